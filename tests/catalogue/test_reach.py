"""Dead points of the four-bar linkage, from its triangles: up to them all is right, beyond it is refused by name."""

from __future__ import annotations

import re

import numpy as np
import pytest

from liaisons import ensemble, operator, sensitivities, simulate
from liaisons.errors import SimulationError
from liaisons.models import FourBar, SmoothStep

A, B, C, D = 0.5, 1.0, 0.8, 1.5  # crank, coupler, rocker, frame [m]
DEAD = float(np.arccos((D**2 + A**2 - (B + C) ** 2) / (2 * D * A)))  # coupler and rocker in line
SENTENCE = (
    r"pin_offset_\d \(rocker stays at coupler, .*\) cannot be kept: turn = ([\d.]+) at t = ([\d.]+) is out of reach"
)
NEAR = 3e-6  # the Python back end lets an internal step leave the constraints by 1e-6 before it looks


def angles(turn: float) -> dict[str, float]:
    """Angles of elbow and swing, the pin above the line from the crank to the rocker's foot."""
    crank, foot = A * np.exp(1j * turn), D
    r = abs(foot - crank)
    coupler = np.angle(foot - crank) + np.arccos((B**2 + r**2 - C**2) / (2 * B * r))
    return {"elbow": coupler - turn, "swing": float(np.angle(crank + B * np.exp(1j * coupler) - foot))}


STARTS = {"pin_at_x": B, "pin_at_child_x": C, **{f"{name}_0": value for name, value in angles(1.0).items()}}


def driven(end: float) -> dict[str, float]:
    return {"start_value": 1.0, "end_value": end, "duration": 2.0}


@pytest.mark.parametrize("backend", ["native", "python"])
@pytest.mark.parametrize(
    "settings", [{}, {"stiff_solver": 1}, {"symplectic_steps": 5}], ids=["dop853", "radau", "gauss"]
)
def test_beyond_a_dead_point_the_step_is_refused_by_name(fmu, backend: str, settings: dict[str, int]) -> None:
    if backend == "python" and settings:
        return
    for beyond in (1.0, 1e-4):
        turn = operator("SmoothStep", start_values=driven(DEAD + beyond))
        with pytest.raises(SimulationError, match=SENTENCE) as refusal:
            simulate(
                fmu(FourBar, backend), stop_time=2, step_size=0.05, start_values={**STARTS, "turn": turn, **settings}
            )
        told = re.search(SENTENCE, str(refusal.value))
        assert told is not None
        value, t = map(float, told.groups())
        assert value == pytest.approx(DEAD, abs=NEAR, rel=0)
        moved = SmoothStep.exact(t, **driven(DEAD + beyond))["y"]
        assert moved == pytest.approx(value, abs=1e-8, rel=0)  # t has nine digits


@pytest.mark.parametrize("backend", ["native", "python"])
def test_what_can_be_reached_is_right_down_to_a_millionth(fmu, backend: str) -> None:
    end = DEAD - 1e-6
    starts = {**STARTS, "turn": operator("SmoothStep", start_values=driven(end))}
    run = simulate(fmu(FourBar, backend), stop_time=2, step_size=0.05, start_values=starts)
    for name, angle in angles(end).items():  # rounding of σ over the square root of the distance
        assert run[name][-1] == pytest.approx(angle, abs=1e-8, rel=0)
    assert np.max(np.abs(run["energy_balance"])) < 1e-7 * np.max(np.abs(run["energy"]))
    assert not run.warnings


def test_what_is_extrapolated_is_behind_and_not_torn(fmu) -> None:
    """A step of Jacobi coupling ends where σ was extrapolated to; what it missed, 1e-5, the next one makes good."""
    starts = {**STARTS, "turn": operator("SmoothStep", start_values=driven(DEAD - 1e-2))}
    run = simulate(fmu(FourBar), stop_time=2, step_size=0.02, coupling="jacobi", start_values=starts)
    assert run["swing"][-1] == pytest.approx(angles(DEAD - 1e-2)["swing"], abs=1e-3, rel=0)
    starts["turn"] = operator("SmoothStep", start_values=driven(DEAD + 1.0))
    with pytest.raises(SimulationError, match=SENTENCE):
        simulate(fmu(FourBar), stop_time=2, step_size=0.02, coupling="jacobi", start_values=starts)


def test_a_refused_step_leaves_the_last_state_which_can_go_another_way(fmu) -> None:
    from liaisons import System

    system = System("held")
    system.add("it", fmu(FourBar), start_values=STARTS)
    with system.start(stop_time=2.0, step_size=0.1) as run:
        run.step({"it.turn": 1.0, "it.turn_dot": 0.0})
        before = run["it.elbow"]
        with pytest.raises(SimulationError, match="cannot be kept"):
            run.step({"it.turn": DEAD + 0.1})
        assert run["it.elbow"] == before


def test_ensembles_and_derivatives_name_it_too() -> None:
    settings = {f"turn.{name}": value for name, value in driven(DEAD - 1e-2).items()}
    settings |= {**STARTS, "turn.end_value": np.array([DEAD + 1e-4, DEAD - 1e-6])}
    run = ensemble("FourBar", settings, operators={"turn": "SmoothStep"}, stop_time=2, step_size=0.01, samples=20)
    assert {*run.failures} == {0}
    told = re.search(SENTENCE, run.failures[0])
    assert told is not None
    assert float(told[1]) == pytest.approx(DEAD, abs=NEAR, rel=0)
    assert run["swing"][-1, 1] == pytest.approx(angles(DEAD - 1e-6)["swing"], abs=1e-6, rel=0)  # steps of 10 ms
    values = {f"turn.{name}": value for name, value in driven(DEAD + 1.0).items()}
    with pytest.raises(SimulationError, match=SENTENCE):
        sensitivities("FourBar", "crank_mass", times=np.linspace(0, 2, 11), record="turn_force",
                      start_values={**STARTS, **values}, operators={"turn": "SmoothStep"})  # fmt: skip


def test_derivatives_next_to_a_dead_point_are_refused_by_what_is_prescribed_there() -> None:
    """It can be reached, by 1e-7 rad; what steps of derivatives do not come to is told with coordinate and value."""
    values = {f"turn.{name}": value for name, value in driven(DEAD - 1e-7).items()}
    with pytest.raises(SimulationError, match=r"at t = [\d.]+ s, where turn = [\d.]+: .* must be kept") as caught:
        sensitivities("FourBar", "crank_mass", times=np.linspace(0, 2, 11), record="turn_force",
                      start_values={**STARTS, **values}, operators={"turn": "SmoothStep"})  # fmt: skip
    told = re.search(r"turn = ([\d.]+)", str(caught.value))
    assert told is not None
    assert DEAD - 0.1 < float(told[1]) < DEAD


@pytest.mark.parametrize("backend", ["native", "python"])
def test_a_start_beyond_a_dead_point_names_what_is_prescribed(fmu, backend: str) -> None:
    with pytest.raises(
        SimulationError, match=r"pin_offset_\d .* must be kept .*\); prescribed: turn = 3; (reset, )?set another"
    ):
        simulate(fmu(FourBar, backend), stop_time=1, start_values={**STARTS, "turn": 3.0})
