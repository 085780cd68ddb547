"""Where the mechanisms are that tests of FMUs share with these, and random linkages."""

import sys
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1] / "fmu")]
