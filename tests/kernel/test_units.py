"""Units that follow from others: checked by the exponents of their base units."""

from __future__ import annotations

from collections import Counter

import pytest

from liaisons.base import units


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
    assert exponents(units.multiplier_unit(unit), unit) == exponents("W")


@pytest.mark.parametrize("unit", ["m", "m/s", "rad", "rad/s", "rad/s2", "1", "J", "kg.m2/s", "N/m"])
def test_rate_is_one_over_a_second_of_it(unit) -> None:
    assert exponents(units.rate(unit), "s") == exponents(unit)


@pytest.mark.parametrize("unit", ["rad", "rad/s", "rad/s2", "m", "J", "W"])
def test_display_factors_are_those_of_measurements(unit) -> None:
    """Two tables: by how much a number grows when it is shown, and how many SI units a symbol is."""
    shown = units.parse(unit).display
    assert shown
    for name, factor in shown:
        assert factor * units.size_in_si(name, unit) == pytest.approx(1, rel=1e-15)


def test_angles_are_shown_in_degrees() -> None:
    assert [units.parse(unit).display[0][0] for unit in ("rad", "rad/s", "rad/s2")] == ["deg", "deg/s", "deg/s2"]


@pytest.mark.parametrize(
    ("name", "same_as"),
    [("N.m", "J"), ("kg.m2/s", "J.s"), ("W", "J/s"), ("N", "kg.m/s2"), ("T", "V.s/m2"), ("C", "A.s"), ("Hz", "1/s")],
)
def test_equivalent_units_have_equal_exponents(name, same_as) -> None:
    assert units.parse(name).exponents == units.parse(same_as).exponents


@pytest.mark.parametrize("bad", ["", "lb", "m^2", "kg/", "m/s/s"])
def test_unknown_units_are_refused_with_the_reason(bad) -> None:
    with pytest.raises(ValueError, match="is not understood"):
        units.parse(bad)
