"""Ensembles, against closed forms and against FMUs."""

from __future__ import annotations

import gc
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from liaisons import System, ensemble, max_error, simulate
from liaisons.base import compiler
from liaisons.base.compiled_code import compiled_library
from liaisons.check import slope
from liaisons.errors import BuildError, ComponentError, SimulationError
from liaisons.language import Mechanism
from liaisons.mechanics import assemble
from liaisons.models import (
    BouncingBall,
    CartesianPendulum,
    CircularHoop,
    DryOscillator,
    Oscillator,
    Pendulum,
    PendulumChain,
    PolarOscillator,
    Ramp,
    Sinusoid,
)
from liaisons_motion.ensembles import integrating, members
from liaisons_motion.ensembles.integrating import _step_halving_errors
from liaisons_motion.right_hand_sides import METHODS, compiled_advance, continuous_model

ANGLES = np.linspace(0.2, 3.0, 37)  # no multiple of the lanes
RATES = np.linspace(0.0, 9.0, 37)  # librations and rotations

either_method = pytest.mark.parametrize("method", METHODS)


def exact(time: np.ndarray, **values: np.ndarray) -> np.ndarray:
    """Angle of each pendulum, shape (times, cases)."""
    cases = [dict(zip(values, case, strict=True)) for case in zip(*values.values(), strict=True)]
    return np.array([Pendulum.exact(time, **case)["theta"] for case in cases]).T


def test_pendulums_that_swing_and_turn() -> None:
    values = {"theta_0": ANGLES, "theta_dot_0": RATES}
    found = ensemble(Pendulum, values, stop_time=2.0, step_size=0.01, samples=4)
    assert found["theta"].shape == (5, 37)
    # Order 8: (10/s · 0.01 s)^8 is 1e-8 a step in units of the error constant, 1e-6; 200 steps; growth below 1e3.
    assert max_error(found["theta"], exact(found.time, **values)) <= 1e-10


@either_method
def test_order(method) -> None:
    order, values = METHODS[method].order, {"theta_0": ANGLES[:5]}
    steps = np.array([0.2, 0.1, 0.05]) * (1.0 if order == 8 else 0.1)
    errors = []
    for step in steps:
        run: dict[str, Any] = {"stop_time": 2.0, "step_size": step, "estimate": False}
        found = ensemble(Pendulum, values, method=method, **run)
        errors.append(max_error(found["theta"], exact(found.time, **values)))
    # A method of lower order would show one less; the next order makes it steeper at these steps.
    assert slope(steps, errors) >= order - 0.3


def test_coefficients() -> None:
    for tableau in METHODS.values():
        a = np.array([[*row, *[0.0] * (tableau.stages - len(row))] for row in tableau.matrix])
        b, c = np.array(tableau.weights), np.array(tableau.nodes)
        # Some ten roundings of coefficients up to 10.
        np.testing.assert_allclose(a.sum(axis=1), c, rtol=0, atol=1e-14)
        for k in range(1, tableau.order + 1):
            assert b @ c ** (k - 1) == pytest.approx(1 / k, abs=1e-14)  # quadrature: y' = t^(k-1)
            linear = b @ np.linalg.matrix_power(a, k - 1) @ np.ones(len(b))
            assert linear == pytest.approx(1 / math.factorial(k), abs=1e-14)


@either_method
def test_the_estimated_error_is_the_error(method) -> None:
    found = ensemble(Pendulum, {"theta_0": ANGLES}, stop_time=4.0, step_size=0.042, samples=8, method=method)
    error = np.max(np.abs(found["theta"] - exact(found.time, theta_0=ANGLES)), axis=0)
    # The orders after the leading one count at twice the step: it may be too large, but hardly too small.
    assert np.all(found.error("theta") > 0.7 * error)
    assert np.all(found.error("theta") < 5 * error)


def test_chaotic_members_are_named() -> None:
    """Against steps a sixteenth as long: what is estimated holds, and nothing else is off by as much as a radian."""
    values = {"theta_1_0": np.linspace(1.0, 3.0, 40), "theta_2_0": np.linspace(1.0, 3.1, 40)}
    found, fine = (
        ensemble("DoublePendulum", values, stop_time=30.0, step_size=step, record="theta_1") for step in (0.02, 0.00125)
    )
    error, estimate = np.max(np.abs(found["theta_1"] - fine["theta_1"]), axis=0), found.error("theta_1")
    without = np.isin(np.arange(40), found.unconverged)
    assert np.array_equal(np.isinf(estimate), without)
    assert 5 < without.sum() < 35
    assert f"{without.sum()} without convergence" in repr(found)
    assert np.all(error[~without] <= 10 * estimate[~without])


def test_roundings_are_no_divergence() -> None:
    found = ensemble(Pendulum, {"theta_0": [0.1, 1.0]}, stop_time=1.0, step_size=1e-4)
    assert not found.unconverged
    assert np.all(found.error("theta") < 1e-11)  # roundings of 1e4 steps


def test_threads_share_few_members_evenly(monkeypatch: pytest.MonkeyPatch) -> None:
    taken: list[int] = []
    advance = integrating.compiled_advance

    def counting(*arguments: Any) -> Any:
        step = advance(*arguments)
        return lambda *at: (taken.append(len(at[-1])), step(*at))

    monkeypatch.setattr(integrating, "compiled_advance", counting)
    angles = np.linspace(0.1, 3.0, 600)
    ensemble(Pendulum, {"theta_0": angles}, stop_time=0.1, step_size=0.01, threads=2, estimate=False)
    assert sum(taken) == 19  # blocks of 32
    assert max(taken) <= 19 / 4  # none takes most of them


def test_cases_do_not_depend_on_their_neighbours() -> None:
    angles = np.linspace(0.1, 3, 2000)
    many = ensemble(Pendulum, {"theta_0": angles}, stop_time=1.0, step_size=0.01, threads=2)
    few = ensemble(Pendulum, {"theta_0": angles[700:703]}, stop_time=1.0, step_size=0.01, threads=1)
    assert np.array_equal(many["theta"][:, 700:703], few["theta"])


def test_an_operator_moves_the_length_as_an_fmu_does(fmu: Callable[..., Path]) -> None:
    motion = {"offset": 1.0, "angular_frequency": 6.0}
    amplitudes = [0.05, 0.1, 0.2]
    found = ensemble(
        Pendulum,
        {"theta_0": 0.4, "friction": 0.1, "length.amplitude": amplitudes}
        | {f"length.{name}": value for name, value in motion.items()},
        stop_time=5.0,
        step_size=0.01,
        operators={"length": Sinusoid},
        record=["theta", "p_theta", "length_force", "energy_balance"],
    )
    for case, amplitude in enumerate(amplitudes):
        system = System("swing")
        swing = system.add("swing", fmu(Pendulum), theta_0=0.4, friction=0.1, input_reconstruction=2)
        system.connect(
            system.add("motor", fmu(Sinusoid), start_values=motion, amplitude=amplitude)["y"], swing["length"]
        )
        result = system.simulate(5.0, 0.01, tolerance=1e-11)
        for name in ("theta", "p_theta", "length_force"):
            # The solver keeps 1e-11 a step; interpolated inputs 1e-13; forces are ten times as large.
            assert abs(found[name][-1, case] - result[f"swing.{name}"][-1]) <= 1e-8
    assert np.max(np.abs(found["energy_balance"])) <= 1e-10  # energies of 10 J, error of order 8 as estimated below
    assert np.max(found.error("energy_balance")) <= 1e-10


def test_hoops_that_turn_evenly() -> None:
    rates, record = np.linspace(0.5, 3.0, 7), ["xi", "xi_dot", "normal_force", "beta_force"]
    run: dict[str, Any] = {"stop_time": 5.0, "step_size": 0.01, "operators": {"beta": Ramp}}
    found = ensemble(CircularHoop, {"beta.rate": rates}, record=record, **run)
    for case, rate in enumerate(rates):
        expected = CircularHoop.exact(found.time, beta_dot=rate)
        for name in found.names:
            # Order 8 with h times the frequency below 0.03; forces are ten times as large as xi.
            assert max_error(found[name][:, case], expected[name]) <= 1e-11


def test_constraints_hold() -> None:
    run: dict[str, Any] = {"stop_time": 2.0, "step_size": 0.01, "samples": 10, "method": "rk4"}
    found = ensemble(CartesianPendulum, {"gravity": [5.0, 9.81]}, record=["x", "y", "z"], **run)
    length = np.sqrt(found["x"] ** 2 + found["y"] ** 2 + (1 - found["z"]) ** 2)
    # Each step is put back onto the sphere, to the last bits.
    assert np.max(np.abs(length - 1.0)) <= 1e-15 * 10


def test_arrays_have_an_axis_of_their_own() -> None:
    found = ensemble(PendulumChain, {"gravity": [5.0, 9.0]}, stop_time=0.1, step_size=0.05)
    assert (found["theta"].shape, found.error("theta").shape) == ((2, 2, 10), (2, 10))


def test_a_case_that_fails_does_not_harm_the_others() -> None:
    run: dict[str, Any] = {"stop_time": 4.0, "step_size": 0.01, "samples": 40, "estimate": False}
    run |= {"operators": {"length": Sinusoid}}
    values = {"mass": [1.0, 0.0, 1.0], "length.amplitude": [0.1, 0.1, 1.5], "length.offset": 1.0}
    found = ensemble(Pendulum, values, **run)
    assert found.failures == {1: "mass = 0: must be > 0", 2: "length must stay > 0 (t = 3.9 s)"}
    assert np.isfinite(found["theta"][:, 0]).all()
    # 1 + 1.5 sin t falls below 0 at t = π + asin(1/1.5) = 3.871
    assert found.time[np.isnan(found["theta"][:, 2])].min() == pytest.approx(3.9)
    alone = ensemble(Pendulum, {"mass": [1.0], "length.amplitude": 0.1, "length.offset": 1.0}, **run)
    assert np.array_equal(found["theta"][:, :1], alone["theta"])
    with pytest.raises(SimulationError, match="no error estimate; leave estimate=False out"):
        found.error("theta")


def test_a_condition_is_asked_on_the_way() -> None:
    run: dict[str, Any] = {"stop_time": 2.0, "step_size": 0.01, "samples": 20, "estimate": False}
    found = ensemble(PolarOscillator, {"phi_dot_0": [0.0, 1.0]}, **run)  # r = |cos t|, and the circle
    assert found.failures == {0: "r must stay > 0 m (t = 1.6 s)"}


def test_without_a_compiler_there_are_no_ensembles(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("system_compiler", "zig_compiler"):
        monkeypatch.setattr(compiler, name, lambda: None)
    compiled_library.cache_clear()
    with pytest.raises(BuildError, match=r"^no C compiler is found: pip install 'liaisons\[cross\]'$"):
        ensemble(Oscillator, {"x_0": [1.0, 2.0]}, stop_time=1.0, step_size=0.1)


@pytest.mark.parametrize(
    ("component", "values", "record"),
    [
        (BouncingBall, {"height_0": np.linspace(0.5, 2.0, 5)}, ("height", "p_height", "gap_impacts", "gap_closed")),
        (DryOscillator, {"mu_static": np.linspace(0.5, 0.9, 5), "mu_sliding": 0.5, "x_0": 3.0}, ("x", "slip_sticks")),
    ],
)
def test_cases_with_contacts_have_the_numbers_of_their_fmu(
    component: type[Mechanism], values: dict[str, Any], record: tuple[str, ...], fmu: Callable[..., Path]
) -> None:
    found = ensemble(component, values, stop_time=6.0, step_size=0.01, samples=60, record=[*record, "energy_balance"])
    for case in range(5):
        own = {name: float(np.broadcast_to(value, 5)[case]) for name, value in values.items()}
        run = simulate(fmu(component), stop_time=6.0, step_size=0.01, start_values=own)
        assert all(np.array_equal(found[name][:, case], run[name][::10]) for name in found.names)
    assert {*np.unique(found[record[-1]])} == {0.0, 1.0}


@pytest.mark.slow
def test_an_operator_moves_the_table_as_in_a_flattened_system(fmu: Callable[..., Path], tmp_path: Path) -> None:
    amplitudes, motion = np.array([0.02, 0.06, 0.1]), {"table.angular_frequency": 12.0, "bounce": 0.6, "height_0": 0.3}
    found = ensemble(
        BouncingBall,
        motion | {"table.amplitude": amplitudes},
        operators={"table": Sinusoid},
        stop_time=3.0,
        step_size=0.01,
        samples=300,
        record=["height", "gap_impacts", "table_force", "energy_balance"],
    )
    for case, amplitude in enumerate(amplitudes):
        system = System("shaken ball")
        ball = system.add("ball", fmu(BouncingBall), bounce=0.6, height_0=0.3)
        shaker = system.add("shaker", fmu(Sinusoid), amplitude=amplitude, angular_frequency=12.0)
        system.connect(ball["table"], shaker["y"])
        run = simulate(system.flatten(tmp_path), stop_time=3.0, step_size=0.01)
        assert all(np.array_equal(found[name][:, case], run[f"ball.{name}"]) for name in found.names)


def test_a_ball_that_lies_on_a_table_moves_with_it() -> None:
    motion = {"table.amplitude": 0.1, "table.angular_frequency": np.array([3.0, 5.0]), "height_0": 0.0, "bounce": 0.0}
    recorded = {"samples": 4, "record": ["height", "gap_force"], "estimate": False}
    found = ensemble(BouncingBall, motion, operators={"table": Sinusoid}, stop_time=1.0, step_size=0.1, **recorded)
    table = 0.1 * np.sin(np.multiply.outer(found.time, [3.0, 5.0]))
    assert found["height"] == pytest.approx(table, abs=1e-12)
    assert found["gap_force"] == pytest.approx(9.81 - table * [9.0, 25.0], abs=1e-9)


def test_contacts_of_other_cases_change_nothing() -> None:
    heights = np.linspace(0.1, 2.0, 300)
    many, few = (
        ensemble(
            BouncingBall, {"height_0": at}, stop_time=3.0, step_size=0.1, threads=threads, samples=3, estimate=False
        )
        for at, threads in ((heights, 2), (heights[150:153], 1))
    )
    assert np.array_equal(many["height"][:, 150:153], few["height"])


def test_a_case_whose_bodies_overlap_is_named_with_its_values() -> None:
    values = {"height_0": [1.0, -0.5], "bounce": [0.5, 0.7], "table": 0.2}
    found = ensemble(BouncingBall, values, stop_time=1.0, step_size=0.1)
    assert {*found.failures} == {1}
    assert found.failures[1].startswith("height_0 = -0.5, bounce = 0.7: gap = -0.7 at t = 0: bodies overlap")
    assert np.isfinite(found["height"][:, 0]).all()
    assert np.isnan(found["height"][:, 1]).all()
    assert np.isnan(found.error("height")[1])
    assert not found.unconverged


def test_members_are_freed_also_when_memory_runs_out(monkeypatch: pytest.MonkeyPatch) -> None:
    called, call = list[str](), members.call_c_function

    def counted(code: Any, name: str, *arguments: Any) -> int:
        called.append(name)
        result = call(code, name, *arguments)
        assert not name.startswith("free") or (arguments[1]["instance"] != 0).sum() == arguments[0]
        return 0 if name == "create_members" and len(called) > 2 else result

    monkeypatch.setattr(members, "call_c_function", counted)
    members.Members(assemble(BouncingBall), 3)
    gc.collect()
    assert called == ["create_members", "free_members"]
    with pytest.raises(SimulationError, match=r"^BouncingBall: out of memory for 4 members; take fewer$"):
        members.Members(assemble(BouncingBall), 4)
    gc.collect()
    assert called[2:] == ["create_members", "free_members"]
    for count in (10**18, 10**30):
        with pytest.raises(SimulationError, match=rf"^BouncingBall: out of memory for {count} members; take fewer$"):
            members.Members(assemble(BouncingBall), count)


def test_a_case_that_fails_on_the_way_has_its_numbers_until_then() -> None:
    # The position overflows under 1e308 N within 4 s.
    values = {"height_0": [1.0, 1.0], "height_load": [0.0, 1e308]}
    found = ensemble(BouncingBall, values, stop_time=4.0, step_size=0.5, samples=8, estimate=False)
    assert {*found.failures} == {1}
    assert 0 < np.isfinite(found["height"][:, 1]).sum() < 9


def test_the_estimate_of_cases_with_contacts_covers_their_errors() -> None:
    starts = np.linspace(1.0, 4.0, 9)
    found = ensemble(DryOscillator, {"x_0": starts}, stop_time=3.0, step_size=3.0, record="x")
    exact = [DryOscillator.exact(found.time, x_0=x)["x"] for x in starts]
    error = np.max(np.abs(found["x"] - np.transpose(exact)), axis=0)
    assert np.all(error <= 1.1 * found.error("x") + 1e-14)
    assert np.all(found.error("x") <= 10 * error + 1e-14)


@pytest.mark.parametrize("method", METHODS)
def test_cases_with_contacts_take_no_fixed_method(method) -> None:
    words = rf"BouncingBall: method = '{method}' takes no unilateral liaisons and no dry friction \(gap\); leave it out"
    with pytest.raises(ComponentError, match=words):
        ensemble(BouncingBall, {"height_0": [1.0]}, stop_time=1.0, step_size=0.1, method=method)


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"record": []}, ComponentError, r"^record = \[\]: name an output of BouncingBall$"),
        ({"record": ["heigth"]}, ComponentError, "did you mean 'height'"),
        ({"step_size": 1e-9}, SimulationError, "too many steps until stop_time = 1.0; take larger ones"),
        ({"samples": 9 * 10**9}, SimulationError, "samples = 9000000000 of 1 cases are more numbers than memory holds"),
        ({"samples": 10**10}, SimulationError, "samples = 10000000000 of 1 cases are more numbers than memory holds"),
    ],
)
def test_misuse_with_contacts(changes, error, message, monkeypatch: pytest.MonkeyPatch) -> None:
    def linspace(*arguments: Any) -> Any:
        if arguments[2] > 10**9:
            raise MemoryError
        return evenly(*arguments)

    evenly = np.linspace
    monkeypatch.setattr(np, "linspace", linspace)
    usual: dict[str, Any] = {"start_values": {"height_0": [1.0]}, "stop_time": 1.0, "step_size": 0.1}
    with pytest.raises(error, match=message):
        ensemble(BouncingBall, **usual | changes)


def test_integrals_are_left_out_unless_they_are_wanted() -> None:
    for value, output, states in (("theta_0", "theta", 2), ("friction", "dissipated", 3)):
        equations = continuous_model(Pendulum, "", "").right_hand_side(lanes=[value], shared=[], record=[output])
        assert equations.start.numel() == states


@pytest.mark.parametrize("component", [Pendulum, CartesianPendulum])
def test_the_generated_code_is_clean(component, monkeypatch) -> None:
    found = continuous_model(component, "", "").right_hand_side(lanes=["gravity"], shared=[], record=["energy"])
    strict = ("-Wall", "-Wextra", "-pedantic", "-Werror", "-fopenmp-simd")
    monkeypatch.setattr(compiler, "FLAGS", (*compiler.FLAGS, *strict))
    compiled_library.cache_clear()
    assert compiled_advance(found, METHODS["rk4"], np.zeros(0))


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"start_values": {"theta0": [1.0]}}, ComponentError, "did you mean 'theta_0'"),
        ({"start_values": {"theta_0": []}}, SimulationError, "no cases"),
        ({"start_values": {"theta_0": 1.0}}, SimulationError, "no cases"),
        ({"start_values": {"theta_0": [1.0], "mass": [1.0, 2.0]}}, SimulationError, "theta_0 1, mass 2"),
        ({"start_values": {"theta_0": [[1.0]]}}, SimulationError, r"shape \(1, 1\)"),
        ({"start_values": {"theta_0": ["a"]}}, SimulationError, "theta_0"),
        ({"record": ["tehta"]}, ComponentError, "did you mean 'theta'"),
        ({"record": []}, ComponentError, "depends on a state"),
        ({"method": "rk5"}, SimulationError, "'rk4'|'rk8'"),
        ({"step_size": 0.0}, SimulationError, "step_size = 0.0: must be > 0"),
        ({"step_size": 1e-300}, SimulationError, "smaller than the rounding of times"),
        ({"step_size": 1e-13}, SimulationError, "too many steps until stop_time = 1.0"),
        ({"samples": 10**12}, SimulationError, "more numbers than memory holds"),
        ({"stop_time": -1.0}, SimulationError, "greater than start_time"),
        ({"samples": 0}, SimulationError, "samples = 0"),
        ({"operators": {"theta": Ramp}}, ComponentError, "no active coordinate 'theta'"),
        ({"operators": {"length": Pendulum}}, ComponentError, "no Operator"),
        ({"start_values": {"length": [1.0]}, "operators": {"length": Ramp}}, ComponentError, "no value 'length'"),
    ],
)
def test_misuse(changes, error, message) -> None:
    usual: dict[str, Any] = {"start_values": {"theta_0": [1.0]}, "stop_time": 1.0, "step_size": 0.1}
    with pytest.raises(error, match=message):
        ensemble(Pendulum, **usual | changes)


def test_the_estimate_takes_the_order_that_three_runs_show() -> None:
    """Cases of order four; of none; that converge but are far apart; that differ by roundings only."""
    error = 1e-6
    states = [[1 + error, 1.0, 1.0, 1.0], [1 + 16 * error, 1 + 1e-3, 1.2, 1 + 1e-14], [1 + 256 * error, 1.0, 2.0, 1.0]]
    fine, half, quarter = (np.array(row)[None, None] for row in states)
    found = _step_halving_errors((fine, fine), (half, half), (quarter, quarter), order=8)
    np.testing.assert_allclose(found[0], [error, np.inf, np.inf, 1e-14], rtol=0.3)


@pytest.mark.parametrize("instant", [0.5, 0.5007, 0.42, 0.513])
@pytest.mark.parametrize("step_size", [0.01, 0.002])
def test_the_estimate_covers_a_rate_that_jumps_on_or_off_the_steps(instant: float, step_size: float) -> None:
    """By SciPy, up to the instant and from it on: the pivot starts at 0.3 m/s, which takes 0.3 cos θ from θ'."""

    def rates(_: float, y: Any) -> list[float]:
        return [y[1], -9.81 * np.sin(y[0])]

    exactly: Any = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-12}
    theta, rate = solve_ivp(rates, (0, instant), [1.0, 0.0], **exactly).y[:, -1]
    end = solve_ivp(rates, (instant, 1.0), [theta, rate - 0.3 * np.cos(theta)], **exactly).y[0, -1]
    moved = {"theta_0": [1.0], "pivot_x.rate": 0.3, "pivot_x.start_time": instant}
    found = ensemble(
        "Pendulum", moved, stop_time=1.0, step_size=step_size, record="theta", operators={"pivot_x": "Ramp"}
    )
    error = abs(found["theta"][-1, 0] - end)
    # Jumps inside steps cost 0.3 m/s of a step at most; what the estimate adds to the error is of that size.
    assert error <= found.error("theta")[-1] <= error + 0.3 * 2 * step_size


def test_a_state_that_is_right_to_rounding_says_how_fast_the_others_converge() -> None:
    # Two states of one case: the first happens to be as far off with all steps, the second with the coarsest alone.
    fine, half, quarter = (np.array(values).reshape(2, 1, 1) for values in ([1, 1], [1 + 3e-11, 1], [1, 1 + 1e-8]))
    assert np.isfinite(_step_halving_errors((fine, fine), (half, half), (quarter, quarter), order=8)).all()
    chaotic = np.array([1 + 3e-3, 1]).reshape(2, 1, 1)
    assert np.isinf(_step_halving_errors((fine, fine), (chaotic, chaotic), (fine, fine), order=8)).all()
