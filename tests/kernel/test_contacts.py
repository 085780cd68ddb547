"""What takes no unilateral liaisons and no dry friction says so, by their names, with what to do instead."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from zipfile import ZipFile

import casadi as ca
import numpy as np
import pytest

from liaisons import (
    ActiveCoordinate,
    Coordinate,
    LiaisonsError,
    Mechanism,
    Parameter,
    build,
    dry_friction,
    ensemble,
    equations,
    linearize,
    sensitivities,
    unilateral,
)
from liaisons.mechanics import Contact, Model, assemble
from liaisons.models import DryOscillator, Pendulum


class Sledge(Mechanism):
    """Body on a belt that moves up and along."""

    mass = Parameter(2.0, "kg", "mass", above=0)
    bounce = Parameter(0.5, "1", "coefficient of restitution", minimum=0, maximum=1)
    grip = Parameter(0.5, "1", "coefficient of friction", minimum=0)
    x = Coordinate("m", "place of the sledge")
    z = Coordinate("m", "height of the sledge", start=1.0)
    belt = ActiveCoordinate("m", "way of the belt")
    floor = ActiveCoordinate("m", "height of the belt")

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared({"x": self.x, "z": self.z})

    @unilateral("m", "distance of sledge and belt", restitution="bounce")
    def gap(self) -> ca.SX:
        return self.z - self.floor

    @dry_friction("m/s", "sliding of the sledge on the belt", static="grip", normal="gap")
    def slip(self) -> ca.SX:
        return self.dot(self.x - self.belt)


@pytest.fixture(scope="module")
def model() -> Model:
    """A model that has a contact."""
    return replace(assemble(Pendulum), contacts=(Contact("gap"), Contact("slip", friction=True)))


def test_all_contacts_are_named() -> None:
    with pytest.raises(LiaisonsError, match=r"^Sledge: method = .* unilateral .* \(gap, slip\); leave it out"):
        ensemble(Sledge, {"mass": [1.0, 2.0]}, stop_time=1, step_size=0.1, method="rk4")


def test_model_is_refused(model: Model, tmp_path: Path) -> None:
    refusal = r"^Pendulum: .* unilateral .* \(gap, slip\); .*"
    with pytest.raises(LiaisonsError, match=refusal + "backend='native'"):
        build(model, tmp_path, backend="python")
    assert not list(tmp_path.iterdir())


def test_equations_are_shown() -> None:
    shown = equations(Sledge)
    assert [part.text() for part in map(shown.__getitem__, ("motion", "unilateral", "impacts", "dry_friction"))] == [
        (
            "Equations of motion (K eq. 65, M eq. 26, 36): ṗₖ = ∂L/∂qₖ + Qₖ\n"
            "   ṗₓ = Qₓ + λ_slip − Fₓ\n  ṗ_z = Q_z + λ_gap − F_z"
        ),
        "Unilateral liaisons: 0 ≤ g ⟂ λ ≥ 0\n  gap = z − floor",
        "Impacts: 0 ≤ Λ ⟂ v⁺ + e v⁻ ≥ 0\n      v_gap = ż − floor˙\n      e_gap = bounce\n  G_gap,gap = 1/m",
        "Dry friction: |Q| ≤ S\n    slip = ẋ − belt˙\n  S_slip = grip · λ_gap",
    ]
    assert r"0  \leq  \Lambda  \perp  v^{+} + e v^{-}  \geq  0" in shown.latex()


def test_page_in_the_fmu(fmu: Callable[..., Path]) -> None:
    with ZipFile(fmu(Sledge)) as archive:
        page, names = archive.read("documentation/index.html").decode(), archive.namelist()
    assert "<mo>⟂</mo>" in page
    assert "<td>output, Boolean</td>" in page
    assert "Moreau</b> J. J. Moreau" in page  # the source of the rule
    assert not [name for name in names if name.endswith("_out.csv")]  # what falls through the belt is no reference
    assert "Reference results" not in page


@pytest.mark.parametrize("bounce", [0.0, 0.5, 1.0])
def test_impacts_are_differentiated_also_at_the_edge_of_a_domain(bounce: float, fmu: Callable[..., Path]) -> None:
    """Runs of an FMU to the side where there are values; z = 2 e (t - 0.5) at 0.9 s."""
    for subject, method, bound in ((Sledge, "steps", 1e-12), (fmu(Sledge), "differences", 1e-8)):
        found = sensitivities(subject, "bounce", stop_time=0.9, step_size=0.3, record="z", bounce=bounce, z_dot_0=-2.0)
        assert found.method == method
        assert found.derivative("z", "bounce")[-1] == pytest.approx(0.8, abs=bound)


def test_linear_in_the_mode_of_the_point(fmu: Callable[..., Path]) -> None:
    """In the air z' = p_z/m; on the belt what leaves gap = 0 or slip = 0 is brought back by the rate 10/s twice."""
    rate = np.diag([0.5, 0.5], k=2)[:, :4]
    opened = linearize(fmu(Sledge), {"z_0": 1.0}, inputs=())
    assert opened.states[:4] == ("x", "z", "p_x", "p_z")
    assert opened.A[:4, :4] == pytest.approx(rate, abs=1e-9)
    closed = linearize(fmu(Sledge), {"z_0": 0.0, "z_force": -1.0}, inputs=(), outputs="gap_force")
    assert closed.A[2:4, :4] == pytest.approx(np.array([[0, 0, -20, 0], [0, -200, 0, -20]]), rel=1e-6)
    assert closed.values["gap_force"] == pytest.approx(1.0)


def test_equations_show_what_dry_friction_is_bounded_by() -> None:
    """Coulomb's cone; where static and sliding friction are one parameter, one threshold."""
    shown = {str(e.lhs): str(e.rhs) for e in equations(Sledge)["dry_friction"].sympy()}
    assert shown == {"slip": "-belt_dot + x_dot", "S_slip": "gap_force*grip"}
    shown = {str(e.lhs): str(e.rhs) for e in equations(DryOscillator)["dry_friction"].sympy()}
    assert shown["S_slip"] == "gravity*mass*mu_static"
    assert shown["K_slip"] == "gravity*mass*mu_sliding"
