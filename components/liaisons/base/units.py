"""SI units as metadata: exponents of base units, display units, and units derived from them.

A unit is a product of SI symbols with integer exponents, at most one ``/``, factors joined by ``.``:
``"kg.m2/s"``, ``"N.m"``, ``"1/s"``.  Numbers in this package are always SI; a unit never is part of a name.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import cache

ANY = ""  # of a quantity that takes the unit of the variable it is connected to

BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")

_DERIVED = {
    "Hz": "1/s",
    "N": "kg.m/s2",
    "J": "kg.m2/s2",
    "W": "kg.m2/s3",
    "Pa": "kg/m.s2",
    "C": "A.s",
    "V": "kg.m2/s3.A",
    "T": "kg/s2.A",
}
_SYMBOLS = ("1", *BASE, *_DERIVED)

# display units, the first by default for angles: (name, factor) with  display = factor * SI
_DISPLAY: dict[str, tuple[tuple[str, float], ...]] = {
    "rad": (("deg", 57.29577951308232),),
    "rad/s": (("deg/s", 57.29577951308232), ("rpm", 9.549296585513721)),
    "rad/s2": (("deg/s2", 57.29577951308232),),
    "m": (("mm", 1e3),),
    "J": (("kJ", 1e-3),),
    "W": (("kW", 1e-3),),
}

_PREFIXES = {"": 1.0, "k": 1e3, "c": 1e-2, "m": 1e-3, "µ": 1e-6, "u": 1e-6, "n": 1e-9}
_MEASURED = {prefix + name: (name, size) for prefix, size in _PREFIXES.items() for name in (*BASE, *_DERIVED)} | {
    **{f"{prefix}g": ("kg", 1e-3 * size) for prefix, size in _PREFIXES.items()},
    "deg": ("rad", math.pi / 180),
    "°": ("rad", math.pi / 180),
    "rev": ("rad", 2 * math.pi),
    "min": ("s", 60.0),
    "h": ("s", 3600.0),
}
"""Symbols in units of measurements: the SI unit, and how many of it they are."""

_FACTOR = re.compile(r"^([A-Za-z]+|1)(-?\d+)?$")


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit: the non-zero exponents of its base units, and its display units."""

    exponents: tuple[tuple[str, int], ...]
    display: tuple[tuple[str, float], ...]


@cache
def parse(name: str) -> Unit:
    """Unit of a name: exponents of its base units, and display units.

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
        symbol = match[1]
        factors = parse(_DERIVED[symbol]).exponents if symbol in _DERIVED else ((symbol, 1),)
        for base, exponent in factors:
            exponents[base] = exponents.get(base, 0) + power * exponent
    ordered = tuple((base, exponents[base]) for base in BASE if exponents.get(base))
    return Unit(ordered, _DISPLAY.get(name, ()))


def size_in_si(measured: str, unit: str) -> float:
    """Factor from a unit of measurements to a declared unit: π/180 from ``"deg/s"`` to ``"rad/s"``, 0.01 from cm to m.

    :param measured: empty: the declared unit.
    :param unit: of SI as a rule; empty: that of SI for what was measured.
    :raises ValueError: for an unknown unit, or one of another quantity.
    """
    if measured in {"", "-", unit}:
        return 1.0
    if unit == ANY:
        return _size_and_base(measured)[0] if is_unit(measured) else 1.0
    (size, base), (declared, other) = _size_and_base(measured), _size_and_base(unit)
    if parse(base).exponents != parse(other).exponents:
        raise ValueError(f"unit {measured!r} cannot be converted to {unit!r}")
    return size / declared


def is_unit(text: str) -> bool:
    """Whether a text is a unit of measurements."""
    try:
        parse(_size_and_base(text)[1])
    except ValueError:
        return False
    return True


def _size_and_base(measured: str) -> tuple[float, str]:
    """How many of an SI unit a unit of measurements is, and that unit, which may be none."""
    written = measured.translate({ord("^"): None, ord("²"): "2", ord("·"): ".", ord("*"): ".", ord("μ"): "µ"})
    written = written.replace("rpm", "rev/min")
    top, _, _ = written.partition("/")
    size = 1.0
    for match in re.finditer(r"([^\W\d_]+|°)(-?\d*)", written):
        power = int(match[2] or 1) * (1 if match.start() < len(top) else -1)
        size *= _MEASURED.get(match[1], ("", 1.0))[1] ** power
    return size, re.sub(r"[^\W\d_]+|°", lambda match: _MEASURED.get(match[0], match)[0], written)


Powers = tuple[int | Fraction, ...]
"""Exponents of the base units in the order of :data:`BASE`, the radian left out: it is 1."""

NUMBER: Powers = (0,) * (len(BASE) - 1)
_NAMED = ("N", "J", "W", "Pa", "C", "V", "T")


@cache
def powers(name: str) -> Powers:
    """Exponents of base units in a unit.

    :raises ValueError: for an empty or unknown unit.
    """
    exponents = dict(parse(name).exponents)
    return tuple(exponents.get(base, 0) for base in BASE if base != "rad")


def product(factors: Iterable[tuple[Powers, int | Fraction]]) -> Powers:
    """Exponents of base units in a product of units, each raised to a power."""
    columns = [tuple(exponent * power for power in base) for base, exponent in factors]
    return tuple(map(sum, zip(*columns, strict=True)))


def unit_name(exponents: Powers) -> str:
    """Name of the unit with these exponents: ``"N"``, ``"kg.m"``, ``"m(1/2)"``; ``"1"`` for a pure number."""
    for name in _NAMED:
        if powers(name) == exponents:
            return name

    def factors(sign: int) -> str:
        """Names of the base units with exponents of one sign, joined."""
        pairs = zip(BASE, exponents, strict=False)
        return ".".join(base + _exponent_text(abs(power)) for base, power in pairs if power * sign > 0)

    top, bottom = factors(1), factors(-1)
    return f"{top or '1'}/{bottom}" if bottom else top or "1"


def quotient(numerator: str, denominator: str) -> str:
    """Unit of the quotient of two quantities, without the radian; ANY if one of both units is ANY."""
    if ANY in (numerator, denominator):
        return ANY
    return unit_name(product([(powers(numerator), 1), (powers(denominator), -1)]))


def _exponent_text(power: int | Fraction) -> str:
    """Text of an exponent behind a symbol; empty for 1."""
    if power == 1:
        return ""
    return str(power) if Fraction(power).denominator == 1 else f"({power})"


_RATE = {ANY: ANY, "m/s": "m/s2", "rad/s": "rad/s2", "s": "1", "J": "W", "1/s": "1/s2"}
_QUOTIENTS = {
    "J": {"m": "N", "rad": "N.m", "1": "J"},
    "J.s": {"m": "kg.m/s", "rad": "kg.m2/s", "1": "J.s"},
    "W": {"m/s": "N", "rad/s": "N.m", "1/s": "J", "J": "1/s"},
}
"""Usual names of quotients, by numerator and denominator."""


def rate(unit: str) -> str:
    """Unit of the time derivative of a quantity with this unit; ANY for ANY."""
    return _RATE.get(unit, f"{unit}.s" if "/" in unit else f"{unit}/s")


def force(unit: str) -> str:
    """Unit of the generalised force on a coordinate with this unit: force × coordinate is an energy."""
    return _conjugate_unit("J", unit)


def momentum(unit: str) -> str:
    """Unit of the momentum ∂L/∂q̇ of a coordinate with this unit: momentum × rate is an energy."""
    return _conjugate_unit("J.s", unit)


def multiplier_unit(unit: str) -> str:
    """Unit of the Lagrange multiplier of a constraint on rates in this unit: their product is a power."""
    return _conjugate_unit("W", unit)


def _conjugate_unit(product: str, unit: str) -> str:
    """Unit whose product with ``unit`` is ``product``: the usual name, else a quotient."""
    top, slash, bottom = unit.partition("/")
    return _QUOTIENTS[product].get(unit) or f"{product}{slash and '.'}{bottom}/{top}"
