"""Arrays in mechanisms: the same as declarations that are written out, one by one."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import casadi as ca
import fmpy
import numpy as np
import pytest

from liaisons import (
    Chain,
    Coordinate,
    Mechanism,
    Parameter,
    Size,
    assemble,
    build,
    derive,
    equations,
    simulate,
    unilateral,
)
from liaisons.errors import ComponentError
from liaisons.models import BallRow, Pendulum


class Row(Mechanism):
    """Beads on a line, each bound by a spring to the next and to its place."""

    n = Size(3, "number of beads")
    mass = Parameter((1.0, 2.0, 3.0), "kg", "masses", above=0, size="n")
    stiffness = Parameter(5.0, "N/m", "of the springs between", minimum=0, size="n - 1")
    hold = Parameter(2.0, "N/m", "of the springs to the places", minimum=0)
    x = Coordinate("m", "displacements", start=(0.3,), start_rate=(0.0, 0.1), size="n")

    def kinetic_energy(self) -> ca.SX:
        return ca.dot(self.mass, self.dot(self.x) ** 2) / 2

    def potential_energy(self) -> ca.SX:
        return (ca.dot(self.stiffness, ca.diff(self.x) ** 2) + self.hold * ca.sumsqr(self.x)) / 2


SETTINGS: dict[str, Any] = {"stop_time": 3.0, "step_size": 0.05, "tolerance": 1e-11}


def test_variables_are_arrays_in_fmi_3_and_elements_in_fmi_2(tmp_path: Path) -> None:
    described = fmpy.read_model_description(str(build(Row, tmp_path, fmi="3")))
    shape = {
        v.name: [d.start or getattr(d.variable, "name", "") for d in v.dimensions] for v in described.modelVariables
    }
    assert (shape["mass"], shape["x_force"], shape["p_x_dot"], shape["hold"]) == (["n"], ["n"], ["n"], [])
    assert shape["stiffness"] == [2]
    assert not [v.name for v in described.modelVariables if "[" in (v.description or "")]
    names = {v.name for v in fmpy.read_model_description(str(build(Row, tmp_path))).modelVariables}
    assert {"mass[3]", "x_0[1]", "x_dot_0[2]", "x_dot[2]", "p_x[3]", "p_x_dot[3]", "x_load[1]"} <= names
    assert "stiffness[3]" not in names


def test_size_is_chosen_when_it_is_built(tmp_path: Path) -> None:
    path, start = build(assemble(Row, 5), tmp_path), [0.1, 0.2, 0.3, 0.4, 0.5]
    run = simulate(path, mass=np.ones(5), stiffness=np.zeros(4), x_0=start, x_dot_0=np.zeros(5), **SETTINGS)
    np.testing.assert_allclose(run["x"], np.outer(np.cos(np.sqrt(2.0) * run.time), start), rtol=0, atol=1e-13)
    assert assemble(Row, 3) is assemble(Row)
    with pytest.raises(ComponentError, match=r"Row: n = 1: give a whole number, at least 2"):
        assemble(Row, 1)
    with pytest.raises(ComponentError, match=r"Pendulum: n = 4: only what declares n = Size\(...\) has a size"):
        assemble(Pendulum, 4)


def test_accelerations_and_text_are_by_elements() -> None:
    values = {"x[1]": 0.3, "x[2]": -0.2, "x[3]": 0.1, "mass[2]": 2.0, "stiffness[1]": 4.0}
    found = derive(Row).evaluate("accelerations", **values)
    assert np.ravel(found) == pytest.approx([-2.0 - 0.6, (2.0 + 1.5 + 0.4) / 2, (-1.5 - 0.2) / 3], rel=1e-14)
    assert "½ m₂ ẋ₂²" in str(equations(Row))


@pytest.mark.parametrize("n", [2, 4, 9])
@pytest.mark.parametrize("fmi", ["2", "3"])
def test_rows_of_any_number_of_balls(tmp_path: Path, n: int, fmi: Any) -> None:
    """All that touch are struck at once, up to eight gaps."""
    start: dict[str, Any] = {"mass": 1.0 + np.arange(n), "bounce": 0.7}
    run = simulate(build(assemble(BallRow, n), tmp_path, fmi=fmi), stop_time=2.0, step_size=0.1, **start)
    np.testing.assert_allclose(run["x"], BallRow.exact(run.time, **start)["x"], rtol=0, atol=1e-12)
    assert run["gap_impacts"][-1].tolist() == [1] + [0] * (n - 2)
    assert abs(run["energy_balance"][-1]) < 1e-12


# ---- misuse ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", ["m", "n + 1", "n - x", "hold"])
def test_unknown_sizes_are_refused(size: str) -> None:
    text = rf"Wrong.x: size = '{re.escape(size)}': name a Size of the mechanism, as 'n' or 'n - 1'"
    with pytest.raises(ComponentError, match=text):

        class Wrong(Row):
            x = Coordinate("m", "displacements", size=size)


def test_no_array_is_empty() -> None:
    with pytest.raises(ComponentError, match=r"Wrong.hold: size = 'n - 3' is 0 with n = 3"):

        class Wrong(Row):
            hold = Parameter(1.0, "N/m", "of the springs to the places", size="n - 3")


def test_tuples_need_a_size() -> None:
    with pytest.raises(ComponentError, match=r"Wrong.hold: starts with \(1.0, 2.0\): only an array does; say size='n'"):

        class Wrong(Row):
            hold = Parameter((1.0, 2.0), "N/m", "of the springs to the places", minimum=0)


def test_gaps_are_a_column_of_their_size() -> None:
    with pytest.raises(ComponentError, match=r"Wrong.gap: returns .*: it must be a column of n - 1 = 2 elements"):

        class Wrong(Row):
            @unilateral("m", "distances", size="n - 1")
            def gap(self) -> ca.SX:
                return self.x


def test_a_chain_has_arrays_already() -> None:
    with pytest.raises(
        ComponentError, match=r"Wrong.u: size = 'n': a Chain describes one link; what each has is an array"
    ):

        class Wrong(Chain):
            u = Coordinate("m", "displacement", size="n")

            def tip(self) -> dict[str, ca.SX]:
                return {"x": self.u}

            def kinetic_energy(self) -> ca.SX:
                return self.dot(self.u) ** 2 / 2
