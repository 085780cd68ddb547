"""Numbers of contacts, from the C file by which FMUs have them."""

import re
from pathlib import Path

HEADER = Path(__file__).with_suffix(".h")
"""File of the runtime of FMUs that declares them."""

_NUMBERS = dict(re.findall(r"\b([A-Z_]+) = ([-+.\w]+)", HEADER.read_text(encoding="utf-8")))

MOST_CONTACTS = int(_NUMBERS["MOST_CONTACTS"])
"""Largest number of contacts of one FMU."""
MOST_IMPACTS = int(_NUMBERS["MOST_IMPACTS"])
"""Largest number of impacts at one instant."""
STILL = float(_NUMBERS["STILL"])
"""Velocity that is rounding, relative to the sizes of its terms."""
ENERGY_GAIN = float(_NUMBERS["ENERGY_GAIN"])
"""Energy that an impact may gain by rounding, relative to what its impulses exchange."""
