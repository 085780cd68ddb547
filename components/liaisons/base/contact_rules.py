"""Numbers of the rules by which FMUs treat contacts: they are declared in C files only, and Python reads them there."""

import re
from pathlib import Path

_RUNTIME = Path(__file__).parents[1] / "fmu" / "runtime"


def _number(file: str, name: str) -> float:
    """A constant of a C file of the runtime."""
    (number,) = re.findall(rf"\b{name} = ([-+.\w]+)", (_RUNTIME / file).read_text(encoding="utf-8"))
    return float(number)


MOST_CONTACTS = int(_number("complementarity.h", "MOST_CONTACTS"))
"""Largest number of contacts of one FMU."""
MOST_IMPACTS = int(_number("contact_rules.h", "MOST_IMPACTS"))
"""Largest number of impacts at one instant."""
STILL = _number("contact_rules.h", "STILL")
"""Velocity that is rounding, relative to the sizes of its terms."""
ENERGY_GAIN = _number("contact_rules.h", "ENERGY_GAIN")
"""Energy that an impact may gain by rounding, relative to what its impulses exchange."""
