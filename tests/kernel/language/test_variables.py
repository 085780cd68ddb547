"""Ports, tables and orientations that components have by their declarations."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from liaisons.errors import ComponentError
from liaisons.language import Dimension, Layout, Operator, ParameterArray
from liaisons.language.declarations import Attitude
from liaisons.models import Constant, PendulumChain, Swing

LINEAR, ANGULAR = ("s", "v", "a", "f"), ("phi", "w", "a", "tau")
ENDS = ("", "_dot", "_ddot", "_force")


def ports(layout: Layout) -> dict[str, dict[str, str]]:
    """Variables by role, of each port by its name."""
    return {port.name: {member.role: member.variable for member in port.members} for port in layout.ports}


def test_ports_name_their_variables() -> None:
    found = ports(Swing().layout())
    for name, roles in (("rope", LINEAR), ("lean", ANGULAR)):
        assert found[name] == {role: name + end for role, end in zip(roles, ENDS, strict=True)}
    assert ports(Constant().layout()) == {"y": {"s": "y", "v": "y_dot", "a": "y_ddot"}}
    assert [v.name for v in Constant().layout().outputs] == ["y", "y_dot", "y_ddot"]


def test_ports_of_arrays_are_those_of_their_elements() -> None:
    arrays = PendulumChain(3).layout()
    flat = arrays.flat()
    sizes = {v.count: v.dimension for v in arrays.variables if v.dimension is not None}
    assert "theta[2]" in ports(flat)
    assert ports(flat)["theta[2]"]["phi"] == "theta[2]"
    assert ports(flat.with_arrays(sizes)) == ports(arrays)  # type: ignore[arg-type]


def test_the_matrix_of_an_orientation_turns_as_rodrigues_says() -> None:
    axis, angle = np.array([2.0, 3.0, 6.0]) / 7, 0.8
    cross = np.cross(axis, np.eye(3)).T  # times a vector: the cross product
    expected = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    q = ca.SX([np.cos(angle / 2), *(np.sin(angle / 2) * axis)])
    turned = Attitude(q, ca.SX(3, 1), ca.SX(3, 1))
    np.testing.assert_allclose(
        ca.DM(turned.matrix).full(), expected, rtol=0, atol=1e-15
    )  # roundings of numbers of size 1
    rate = np.array([0.3, -0.5, 0.7])
    later = q + 1e-6 * turned.kinematics @ rate
    after = ca.DM(Attitude(later, ca.SX(3, 1), ca.SX(3, 1)).matrix).full()
    # dR/dt = R [omega]x; a difference over 1e-6 s is off by 1e-6.
    np.testing.assert_allclose((after - expected) / 1e-6, expected @ np.cross(rate, np.eye(3)).T, rtol=0, atol=1e-5)


ROWS = Dimension("rows", 6, "rows")
INSTANTS = (0.0, 1.0, 3.0, 3.0, 4.0, 2.0)  # the last one is no row: instants no longer ascend


class Table(Operator):
    """A table with a jump."""

    instant = ParameterArray(INSTANTS, "s", "instants", ROWS)
    value = ParameterArray((0.0, 10.0, 20.0, 30.0, 40.0, 50.0), "1", "values", ROWS)

    def signal(self, t: ca.SX) -> ca.SX:
        return 0 * t


@pytest.mark.parametrize(
    ("rests", "t", "expected"),
    [
        (False, -1.0, (0, 10)),
        (False, 0.0, (0, 10)),
        (False, 1.0, (10, 20)),
        (False, 2.9, (10, 20)),
        (False, 3.0, (30, 40)),  # behind the jump
        (False, 9.0, (30, 40)),
        (True, -1.0, (0, 10)),
        (True, 1.5, (10, 20)),
        (True, 3.0, (30, 40)),
        (True, 4.0, (40, 40)),
        (True, 9.0, (40, 40)),
    ],
)
def test_rows_between_whose_instants_a_time_lies(*, rests: bool, t: float, expected: tuple[float, float]) -> None:
    table = Table()
    begin, end = table.interval(table.clock, "value", rests=rests)
    columns = [next(p for p in table.parameters if p.name == name).value_in(table) for name in ("instant", "value")]
    rows = ca.Function("rows", [table.clock, *columns], [begin[0], end[0]])
    assert tuple(map(float, rows(t, INSTANTS, Table.value.leading))) == expected


def test_what_a_chain_is_damped_by_has_a_unit() -> None:
    with pytest.raises(ComponentError, match=r"Odd\.friction_coefficient: .* is N.* where 1/s is expected"):
        type("Odd", (PendulumChain,), {"friction_coefficient": lambda m: m.mass * m.gravity, "__module__": __name__})
