"""Where the mechanisms are that tests of FMUs share with these."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "fmu"))
