"""Units that follow from others: checked by the exponents of their base units."""

from __future__ import annotations

from collections import Counter

import pytest

from liaisons import units


def exponents(*names: str) -> dict[str, int]:
    """Of a product, radians left out: an angle is a number."""
    total: Counter[str] = Counter()
    for name in names:
        total.update(dict(units.parse(name).exponents))
    return {base: exponent for base, exponent in total.items() if exponent and base != "rad"}


@pytest.mark.parametrize("unit", ["m", "rad", "1", "m/s", "J", "kg", "m2"])
def test_force_times_coordinate_is_an_energy_and_momentum_times_rate_too(unit) -> None:
    assert exponents(units.force(unit), unit) == exponents("J")
    assert exponents(units.momentum(unit), units.rate(unit)) == exponents("J")


@pytest.mark.parametrize("unit", ["m/s", "rad/s", "1/s", "J", "m", "kg.m/s"])
def test_multiplier_times_constraint_on_rates_is_a_power(unit) -> None:
    assert exponents(units.multiplier(unit), unit) == exponents("W")


@pytest.mark.parametrize("unit", ["m", "m/s", "rad", "rad/s", "rad/s2", "1", "J", "kg.m2/s", "N/m"])
def test_rate_is_one_over_a_second_of_it(unit) -> None:
    assert exponents(units.rate(unit), "s") == exponents(unit)


def test_angles_are_shown_in_degrees() -> None:
    assert [units.parse(unit).display[0][0] for unit in ("rad", "rad/s", "rad/s2")] == ["deg", "deg/s", "deg/s2"]
