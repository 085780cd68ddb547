"""Where on_paper.py, hand_derivations.py and making.py are found, which are no tests, but theirs."""

import sys
from pathlib import Path

_HERE = Path(__file__).parent
sys.path[:0] = [str(_HERE), str(_HERE.parent / "kernel/cosim")]
