"""Where on_paper.py and hand_derivations.py are found, which are no tests, but theirs."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
