"""Units: exponents, and what follows from a coordinate's unit."""

import pytest

from liaisons import units


@pytest.mark.parametrize(
    ("name", "same_as"),
    [("N.m", "J"), ("kg.m2/s", "J.s"), ("W", "J/s"), ("N", "kg.m/s2"), ("T", "V.s/m2"), ("C", "A.s"), ("Hz", "1/s")],
)
def test_equivalent_units_have_equal_exponents(name: str, same_as: str) -> None:
    assert units.parse(name).exponents == units.parse(same_as).exponents


@pytest.mark.parametrize("coordinate", ["m", "rad", "1", "m2", "m/s", "kg"])
def test_force_and_momentum_times_coordinate_are_energy_and_action(coordinate: str) -> None:
    def exponents(name: str) -> dict[str, int]:
        return {base: power for base, power in units.parse(name).exponents if base != "rad"}

    def product(left: str, right: str) -> dict[str, int]:
        total = exponents(left)
        for base, power in exponents(right).items():
            total[base] = total.get(base, 0) + power
        return {base: power for base, power in total.items() if power}

    assert product(units.force(coordinate), coordinate) == exponents("J")
    assert product(units.momentum(coordinate), coordinate) == exponents("J.s")
    assert product(units.rate(coordinate), "s") == exponents(coordinate)


@pytest.mark.parametrize("bad", ["", "lb", "m^2", "kg/", "m/s/s"])
def test_unknown_units_are_refused_with_the_reason(bad: str) -> None:
    with pytest.raises(ValueError, match="is not understood"):
        units.parse(bad)
