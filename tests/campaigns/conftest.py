"""Where modules of other folders that campaigns share are found."""

import sys
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[1] / name) for name in ("kernel/cosim", "kernel/language")]
