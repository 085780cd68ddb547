"""SI units as metadata: exponents of the base units, display units, and the units that follow from them.

A unit is a product of SI symbols with integer exponents, at most one ``/``, factors joined by ``.``:
``"kg.m2/s"``, ``"N.m"``, ``"1/s"``.  Numbers in this package are always SI; a unit never is part of a name.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import cache

ANY = ""  # a quantity that takes the unit of what it is connected to

BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")

# symbol -> exponents of the base units
_SYMBOLS: dict[str, dict[str, int]] = {
    "1": {},
    "kg": {"kg": 1},
    "m": {"m": 1},
    "s": {"s": 1},
    "A": {"A": 1},
    "K": {"K": 1},
    "mol": {"mol": 1},
    "cd": {"cd": 1},
    "rad": {"rad": 1},
    "Hz": {"s": -1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "C": {"A": 1, "s": 1},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "T": {"kg": 1, "s": -2, "A": -1},
}

# what an importer may show instead, the first by default for angles: (name, factor) with  display = factor * SI
_DISPLAY: dict[str, tuple[tuple[str, float], ...]] = {
    "rad": (("deg", 57.29577951308232),),
    "rad/s": (("deg/s", 57.29577951308232), ("rpm", 9.549296585513721)),
    "rad/s2": (("deg/s2", 57.29577951308232),),
    "m": (("mm", 1e3),),
    "J": (("kJ", 1e-3),),
    "W": (("kW", 1e-3),),
}

_FACTOR = re.compile(r"^([A-Za-z]+|1)(-?\d+)?$")


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit: its name, the non-zero exponents of its base units, and its display units."""

    name: str
    exponents: tuple[tuple[str, int], ...]
    display: tuple[tuple[str, float], ...]


@cache
def parse(name: str) -> Unit:
    """Read a unit.

    :param name: for example ``"kg.m2/s"``.
    :raises ValueError: for an empty or unknown unit, with the list of symbols.
    """
    numerator, slash, denominator = name.partition("/")
    exponents: dict[str, int] = {}
    parts = [(part, 1) for part in numerator.split(".")]
    parts += [(part, -1) for part in denominator.split(".")] if slash else []
    for part, sign in parts:
        match = _FACTOR.match(part)
        if match is None or match[1] not in _SYMBOLS:
            raise ValueError(
                f"unit {name!r} is not understood at {part!r}; write SI symbols joined by '.', "
                f"at most one '/', e.g. 'kg.m2/s' (known symbols: {', '.join(_SYMBOLS)})"
            )
        power = sign * int(match[2] or 1)
        for base, exponent in _SYMBOLS[match[1]].items():
            exponents[base] = exponents.get(base, 0) + power * exponent
    ordered = tuple((base, exponents[base]) for base in BASE if exponents.get(base))
    return Unit(name, ordered, _DISPLAY.get(name, ()))


Powers = tuple[int | Fraction, ...]
"""Exponents of the base units in the order of :data:`BASE`, the radian left out: it is 1."""

NUMBER: Powers = (0,) * (len(BASE) - 1)
_NAMED = ("N", "J", "W", "Pa", "C", "V", "T")


@cache
def powers(name: str) -> Powers:
    """Exponents of a unit.

    :raises ValueError: for an empty or unknown unit.
    """
    exponents = dict(parse(name).exponents)
    return tuple(exponents.get(base, 0) for base in BASE if base != "rad")


def product(factors: Iterable[tuple[Powers, int | Fraction]]) -> Powers:
    """Exponents of a product of powers."""
    columns = [tuple(exponent * power for power in base) for base, exponent in factors]
    return tuple(map(sum, zip(*columns, strict=True)))


def written(exponents: Powers) -> str:
    """A unit as this package writes it: ``"N"``, ``"kg.m"``, ``"1/s"``, ``"m(1/2)"``; ``"1"`` for a pure number."""
    for name in _NAMED:
        if powers(name) == exponents:
            return name

    def factors(sign: int) -> str:
        found = zip(BASE, exponents, strict=False)
        return ".".join(base + _exponent(abs(power)) for base, power in found if power * sign > 0)

    top, bottom = factors(1), factors(-1)
    return f"{top or '1'}/{bottom}" if bottom else top or "1"


def _exponent(power: int | Fraction) -> str:
    if power == 1:
        return ""
    return str(power) if Fraction(power).denominator == 1 else f"({power})"


_RATE = {"1": "1/s", "m": "m/s", "m/s": "m/s2", "rad": "rad/s", "rad/s": "rad/s2", "s": "1", "J": "W", "1/s": "1/s2"}
_FORCE = {"m": "N", "rad": "N.m", "1": "J"}
_MOMENTUM = {"m": "kg.m/s", "rad": "kg.m2/s", "1": "J.s"}
_MULTIPLIER = {"m/s": "N", "rad/s": "N.m", "1/s": "J", "J": "1/s"}


def rate(name: str) -> str:
    """Unit of the time derivative of a quantity with this unit; of one that takes any, any."""
    if name in _RATE or name == ANY:
        return _RATE.get(name, ANY)
    return f"{name}.s" if "/" in name else f"{name}/s"


def force(name: str) -> str:
    """Unit of the generalised force on a coordinate with this unit: force × coordinate is an energy."""
    return _FORCE.get(name) or _over("J", name)


def momentum(name: str) -> str:
    """Unit of the momentum ∂L/∂q̇ of a coordinate with this unit: momentum × rate is an energy."""
    return _MOMENTUM.get(name) or _over("J.s", name)


def multiplier(name: str) -> str:
    """Unit of the multiplier of a constraint on rates that has this unit: their product is a power."""
    return _MULTIPLIER.get(name) or _over("W", name)


def _over(numerator: str, name: str) -> str:
    top, slash, bottom = name.partition("/")
    return f"{numerator}.{bottom}/{top}" if slash else f"{numerator}/{top}"
