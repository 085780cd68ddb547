"""Where the modules of these tests are found, and those of other folders that they share."""

import sys
from pathlib import Path

_TESTS = Path(__file__).parents[1]
sys.path[:0] = [str(_TESTS / name) for name in ("crossings", "kernel/cosim", "kernel/fmu", "pages/pictures", "../docs")]
