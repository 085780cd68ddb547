"""Runs step by step: the same numbers as simulate, branches, resets, what is refused."""

from __future__ import annotations

import gc
import math
import pickle
import time
import tracemalloc
import weakref
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from making import FmuPaths, exchange_only, wired
from numpy.testing import assert_allclose

import liaisons
from liaisons import LiaisonsError, System, simulate, start
from liaisons.cosim import Result, Run
from liaisons.errors import IncompleteError, InvalidValueError, SimulationError
from liaisons.models import Pendulum

Made = tuple[System, Mapping[str, Any]]
Make = Callable[[FmuPaths, FmuPaths], Made]


def _pendulums(upper: str, lower: str) -> Make:
    def make(component: FmuPaths, _: FmuPaths) -> Made:
        parts = {"upper": (component(upper), {"theta_0": 0.4}), "lower": (component(lower), {"theta_0": 0.2})}
        return wired("upper.bob -> lower.pivot", **parts), {}

    return make


def _swing(**settings: Any) -> Make:
    def make(component: FmuPaths, _: FmuPaths) -> Made:
        operator = component("Sinusoid"), {"offset": 1.0, "amplitude": 0.1, "angular_frequency": 5.0}
        return wired("operator.y -> swing.length", operator=operator, swing=component("Pendulum")), settings

    return make


def _driven(component: FmuPaths, fmu: FmuPaths) -> Made:
    jumping = liaisons.Signal(lambda t: float(t > 0.33), breaks=[0.33])
    inputs = {"b.x_force": jumping, "a.theta_force": lambda t: abs(math.sin(9 * t))}
    return wired(a=component("fmi3/Pendulum"), b=component("Oscillator"), c=fmu("wave")), {"inputs": inputs}


SYSTEMS: dict[str, Make] = {
    "one": lambda component, _: (wired(a=(component("Pendulum"), {"theta_0": 1.0})), {}),
    "implicit": _pendulums("Pendulum", "fmi3/Pendulum"),
    "Python": _pendulums("python/Pendulum", "Pendulum"),
    "a source": _swing(),
    "Gauss-Seidel": _swing(coupling="gauss-seidel"),
    "Jacobi": _swing(coupling="jacobi"),
    "waveform": _swing(coupling="waveform"),
    "functions": _driven,
    "contacts": lambda component, _: (wired(ball=component("BouncingBall")), {}),
}


@pytest.fixture(params=SYSTEMS)
def made(request: pytest.FixtureRequest, component: FmuPaths, fmu: FmuPaths) -> Made:
    return SYSTEMS[request.param](component, fmu)


def _assert_same_bits(one: Result, other: Result) -> None:
    assert one.names == other.names
    assert one.time.tobytes() == other.time.tobytes()
    assert one.values.tobytes() == other.values.tobytes()
    assert one.coupling_error is not None
    assert other.coupling_error is not None
    assert one.coupling_error.tobytes() == other.coupling_error.tobytes()


@pytest.mark.parametrize("stop_time", [1.0, None])
def test_steps_are_those_of_simulate(made: Made, stop_time: float | None) -> None:
    system, settings = made
    expected = system.simulate(1.0, 0.05, **settings)
    with system.start(stop_time, 0.05, **settings) as run:
        times = [run.time]
        for _ in range(20):
            run.step()
            times.append(run.time)
    assert times == run.result.time.tolist()
    _assert_same_bits(run.result, expected)


def test_steps_and_the_rest_at_once(made: Made) -> None:
    system, settings = made
    with system.start(1.0, 0.05, **settings) as run:
        for _ in range(7):
            run.step()
        run.finish()
    _assert_same_bits(run.result, system.simulate(1.0, 0.05, **settings))


def _free_run(run: Run, name: str, count: int) -> None:
    """Steps whose input changes in most of them."""
    for k in range(count):
        run.step({name: math.sin(k)} if k % 3 else {})


@pytest.mark.parametrize("name", ["Pendulum", "fmi3/Pendulum", "exchange"])
def test_input_is_held_over_a_step(component: FmuPaths, tmp_path: Path, name: str) -> None:
    """As a function of time that jumps where the input is set, to the solvers' tolerance of 1e-10 over 2 s."""
    path = exchange_only(component("Pendulum"), tmp_path) if name == "exchange" else component(name)
    forces = [0.3, -0.5, 0.5, 0.0, 0.9]

    def held(t: float) -> float:
        return forces[min(int(t / 0.4), 4)]

    jumping = liaisons.Signal(held, breaks=[0.4, 0.8, 1.2, 1.6])
    expected = simulate(path, stop_time=2.0, step_size=0.4, tolerance=1e-10, inputs={"theta_force": jumping})
    with start(path, step_size=0.4, tolerance=1e-10) as run:
        for force in forces:
            run.step(theta_force=force)
    result = run.result
    assert_allclose(result["theta"], expected["theta"], rtol=0, atol=1e-8)
    assert result["theta_force"].tolist() == [*forces, forces[-1]]
    assert_allclose(
        result["theta_ddot"][:-1], expected["theta_ddot"][:-1], rtol=0, atol=1e-7
    )  # at each point the new force acts


def test_input_of_a_coupled_system_is_held_over_a_step(component: FmuPaths) -> None:
    """The interface is solved again where the input is set: implicit coupling keeps its order of four."""
    system, _ = _pendulums("Pendulum", "Pendulum")(component, component)

    def motion(step_size: float) -> np.ndarray:
        with system.start(step_size=step_size, tolerance=1e-12) as run:
            while run.time < 1 - 1e-9:
                run.step({"upper.theta_force": float(run.time > 0.5 - 1e-9)})
        return run.result["lower.theta"][:: round(0.1 / step_size)]

    exact = motion(0.0125)
    errors = [float(np.max(np.abs(motion(H) - exact))) for H in (0.1, 0.05)]
    assert errors[0] > 2**3.5 * errors[1]


def test_input_that_jumps_has_no_past(component: FmuPaths, fmu: FmuPaths) -> None:
    """What hands a held input on is constant in each step: no polynomial goes through points before the jump."""
    system = wired("probe.echo -> mass.x_force", probe=fmu("probe"), mass=(component("Oscillator"), {"x_0": 0.0}))
    with (
        system.start(step_size=0.1, coupling="implicit", tolerance=1e-10) as run,
        start(component("Oscillator"), step_size=0.1, tolerance=1e-10, x_0=0.0) as alone,
    ):
        for k in range(12):
            run.step({"probe.u": math.cos(2 * k)})
            alone.step(x_force=math.cos(2 * k))
    assert_allclose(run.result["mass.x"], alone.result["x"], rtol=0, atol=1e-9)


def test_one_step_alone(made: Made) -> None:
    """It is made in two halves, so that its error is estimated."""
    system, settings = made
    with system.start(0.05, 0.05, **settings) as run:
        run.step()
    _assert_same_bits(run.result, system.simulate(0.05, 0.05, **settings))


@pytest.mark.parametrize("name", ["one", "implicit", "a source", "contacts"])
def test_branches_are_exact(component: FmuPaths, fmu: FmuPaths, name: str) -> None:
    system, settings = SYSTEMS[name](component, fmu)
    part = next(iter(system.parts.values()))
    force = {"one": "a.theta_force", "implicit": "upper.theta_force", "a source": "swing.theta_force"}.get(name)
    force = force or f"{part.name}.height_force"
    with system.start(step_size=0.02, **settings) as run, system.start(step_size=0.02, **settings) as other:
        for one in (run, other):
            _free_run(one, force, 10)
        state = run.save()
        _free_run(run, force, 20)
        first, later = run.result, run.save()
        run.restore(state)
        assert run.time == state.time == pytest.approx(0.2)
        _free_run(run, force, 20)
        _assert_same_bits(run.result, first)
        _free_run(other, force, 20)  # saving has changed nothing
        _assert_same_bits(other.result, first)
        run.restore(state)
        run.restore(later)
        _assert_same_bits(run.result, first)


@pytest.mark.parametrize("name", ["one", "implicit", "Gauss-Seidel"])
def test_a_reset_run_is_a_fresh_one(component: FmuPaths, fmu: FmuPaths, name: str) -> None:
    system, settings = SYSTEMS[name](component, fmu)
    part = "swing" if name == "Gauss-Seidel" else next(iter(system.parts))
    with system.start(step_size=0.02, **settings) as run:
        _free_run(run, f"{part}.theta_force", 15)
        run.reset({f"{part}.theta_0": -0.3})
        assert (run.time, run[f"{part}.theta"]) == (0.0, -0.3)
        _free_run(run, f"{part}.theta_force", 15)
    with system.with_start_values({f"{part}.theta_0": -0.3}).start(step_size=0.02, **settings) as fresh:
        _free_run(fresh, f"{part}.theta_force", 15)
    _assert_same_bits(run.result, fresh.result)


def test_a_refused_reset_changes_nothing(made: Made) -> None:
    system, settings = made
    part = next(name for name, part in system.parts.items() if "mass" in part.fmu.variables)
    with system.start(step_size=0.05, **settings) as run, system.start(step_size=0.05, **settings) as other:
        for k in range(4):
            if k == 2:
                with pytest.raises(SimulationError, match=r"must be > 0|c \(wave.fmu\) cannot go back"):
                    run.reset({f"{part}.mass": -1.0})
            for one in (run, other):
                one.step()
    _assert_same_bits(run.result, other.result)


def test_without_a_state_nothing_is_read(component: FmuPaths, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a reset that was refused, of an FMU that cannot return either."""
    with start(component("Pendulum"), step_size=0.1, theta_0=0.4) as run:
        run.step()
        good = run.save()
        with monkeypatch.context() as patch:
            patch.setattr(Run, "restore", lambda run, _: run._refuse("the FMU is silent"))
            with pytest.raises(SimulationError, match="mass = -1 at t = 0"):
                run.reset(mass=-1.0)
        for use in (lambda: run.time, lambda: run["theta"], lambda: run.result, run.save, run.step, run.linearize):
            with pytest.raises(SimulationError, match=r"^Pendulum: it has no state, .* refused: reset it again$"):
                use()
        run.restore(good)
        assert run.time == 0.1
        run.reset(theta_0=0.2)
        assert (run.time, run["theta"]) == (0.0, 0.2)


def test_a_run_is_freed_as_soon_as_nothing_refers_to_it(made: Made) -> None:
    # Its instances and its folder go with it: a cycle of references would keep them until the garbage is collected.
    system, settings = made
    gc.disable()
    try:
        run = start(system, step_size=0.02, **settings)
        run.step()
        if run.repeats:
            run.restore(run.save())
        left = weakref.ref(run)
        del run
        assert left() is None
    finally:
        gc.enable()


def test_saved_states_share_their_history(component: FmuPaths) -> None:
    """States on random branches have the points that led to them, and take little memory of their own."""
    draws, states = np.random.default_rng(43), []
    with start(component("Pendulum"), step_size=0.01, theta_0=1.0, record=["theta", "theta_force"]) as run:
        states.append((run.save(), run.result))
        for _ in range(60):
            state, past = states[draws.integers(len(states))]
            run.restore(state)
            assert run.result.values.tobytes() == past.values.tobytes()
            assert run.result.time.tobytes() == past.time.tobytes()
            for _ in range(draws.integers(5)):
                run.step(theta_force=draws.choice([0.0, 1.0]))
            states.append((run.save(), run.result))
        run.reset()
        for _ in range(5000):
            run.step()
        run.save()
        tracemalloc.start()
        kept = [run.save() for _ in range(100)]
        used = tracemalloc.get_traced_memory()[0]
        tracemalloc.stop()
    assert len(kept) == 100
    assert used < 10 * run.result.values.nbytes  # copies of the history would take a hundred


def test_what_is_not_recorded_is_read(component: FmuPaths, fmu: FmuPaths) -> None:
    with start(component("Pendulum"), step_size=0.1, record=["theta"], theta_0=0.5, mass=2.0) as run:
        run.step()
        assert run["theta"] == run.result["theta"][-1]
        assert run["mass"] == 2.0
        assert run["p_theta"] == pytest.approx(2.0 * run["theta_dot"], rel=1e-12)
        assert run.result.names == ("theta",)
    with start(component("PendulumChain"), step_size=0.1, record=["energy"]) as run:
        run.step()
        assert run["theta"].shape == (simulate(component("PendulumChain"), stop_time=0.1)["theta"].shape[1],)
    with start(fmu("discrete"), record=["seen"]) as run:
        run.step(level=7, armed=True)
        assert (run["seen"], run["word"], run["lamp"].tolist()) == (17.0, "", [1.0, 0.0])


def test_a_step_as_a_function_of_an_array(component: FmuPaths) -> None:
    with start(component("Pendulum"), step_size=0.1) as run, start(component("Pendulum"), step_size=0.1) as other:
        step = run.stepper(["theta_force", "theta_load"], ["theta", "theta_dot"])
        for k in range(5):
            seen = step(np.array([math.sin(k), 0.1]))
            other.step(theta_force=math.sin(k), theta_load=0.1)
            assert seen.tolist() == [other["theta"], other["theta_dot"]]
        _assert_same_bits(run.result, other.result)
        with pytest.raises(SimulationError, match=r"^Pendulum: mass is not recorded; name it in record"):
            run.stepper([], ["mass"])


def test_an_array_of_inputs_is_its_elements(component: FmuPaths) -> None:
    path = component("PendulumChain")
    with start(path, step_size=0.1, record=["energy"]) as run, start(path, step_size=0.1, record=["energy"]) as other:
        forces = np.sin(np.arange(float(len(run["theta"]))))
        for force in (forces, forces, -forces):
            run.step(theta_force=force)
            other.step({f"theta_force[{k}]": x for k, x in enumerate(force.tolist(), start=1)})
            assert run["theta_force"].tolist() == force.tolist()
        _assert_same_bits(run.result, other.result)
        with pytest.raises(InvalidValueError, match=rf"give numbers of shape \({len(forces)},\)"):
            run.step(theta_force=forces[1:])


REFUSED: dict[str, tuple[Callable[[Run], object], str]] = {
    "unknown": (lambda run: run.step(theta_forse=1.0), "no variable 'theta_forse'; did you mean 'theta_force'"),
    "unknown to read": (lambda run: run["thta"], "no variable 'thta'; did you mean 'theta'"),
    "an output": (lambda run: run.step(theta=1.0), "Pendulum.theta is Real of causality 'output'"),
    "a parameter": (lambda run: run.step(mass=1.0), "Pendulum.mass is Real of causality 'parameter'"),
    "driven": (lambda run: run.step(theta_load=1.0), "Pendulum.theta_load is connected or driven"),
    "not a number": (lambda run: run.step(theta_force=math.nan), "Pendulum.theta_force = nan: must be finite"),
    "infinite": (lambda run: run.step(theta_force=-math.inf), "Pendulum.theta_force = -inf: must be finite"),
    "a word": (lambda run: run.step(theta_force="fast"), "Pendulum.theta_force = 'fast': give numbers"),
    "two": (lambda run: run.step(theta_force=[1.0, 2.0]), r"= \[1.0, 2.0\]: give numbers of shape \(\)"),
    "a state of none": (lambda run: run.reset(thta_0=1.0), "no variable 'thta_0'"),
    "backwards": (lambda run: run.pace(-1.0), "pace = -1.0: must be > 0"),
    "a start": (lambda run: run.reset(mass=-1.0), "mass = -1 at t = 0: it must be > 0"),
    "no state": (lambda run: run.restore(None), "None is not a state of a run; restore what its own save"),  # pyright: ignore[reportArgumentType]
    "too many": (lambda run: run.stepper(["theta_force"], [])([0.1, 0.2]), r"0.1, 0.2\]: give one number for each of"),
    "none": (lambda run: run.stepper(["theta_force"], [])([]), r"inputs = \[\]: give one number for each of"),
    "uneven": (lambda run: run.stepper(["theta_force"], [])([[1.0], []]), r"inputs = \[\[1.0\], \[\]\]: give numbers"),
    "pickled": (pickle.dumps, "Pendulum: a run has FMUs in memory, and cannot be copied or pickled"),
    "a pickled state": (lambda run: pickle.dumps(run.save()), "cannot be copied or pickled; pickle its result"),
    "no inputs": (lambda run: run.step(5), "inputs = 5: give a dictionary"),  # pyright: ignore[reportArgumentType]
    "no name": (lambda run: run[["theta"]], r"a variable is read by its name, not by \['theta'\]"),  # pyright: ignore[reportArgumentType]
}


@pytest.mark.parametrize("case", REFUSED)
def test_misuse_is_refused_in_one_line_and_does_no_harm(component: FmuPaths, case: str) -> None:
    misuse, words = REFUSED[case]
    settings: dict[str, Any] = {"step_size": 0.1, "inputs": {"theta_load": math.sin}}
    with start(component("Pendulum"), **settings) as run, start(component("Pendulum"), **settings) as other:
        for one in (run, other):
            one.step(theta_force=0.1)
        with pytest.raises(LiaisonsError, match=words) as error:
            misuse(run)
        assert "\n" not in str(error.value)
        for one in (run, other):
            one.step(theta_force=0.2)
    _assert_same_bits(run.result, other.result)


def test_whole_numbers_are_asked_for(fmu: FmuPaths) -> None:
    with start(fmu("discrete")) as run:
        with pytest.raises(LiaisonsError, match=r"discrete.level = 0.5: give whole numbers from -2147483648 to"):
            run.step(level=0.5)
        with pytest.raises(LiaisonsError, match=r"discrete.armed = 2: give whole numbers from 0 to 1"):
            run.step(armed=2)


def test_no_step_after_the_end_or_after_close(component: FmuPaths) -> None:
    with start(component("Pendulum"), stop_time=0.2, step_size=0.1) as run:
        run.step()
        run.step()
        state = run.save()
        with pytest.raises(
            SimulationError, match=r"^Pendulum: it has reached its end, t = 0.2 s; give a later stop_time"
        ):
            run.step()
    for use in (run.step, run.save, run.reset, lambda: run["theta"], lambda: run.restore(state)):
        with pytest.raises(SimulationError, match=r"^Pendulum: the run is closed; start another one$"):
            use()
    assert run.result.time.tolist() == [0.0, 0.1, 0.2]


def test_states_are_those_of_their_own_run(component: FmuPaths) -> None:
    with start(component("Pendulum"), step_size=0.1) as run, start(component("Pendulum"), step_size=0.1) as other:
        run.step()
        with pytest.raises(SimulationError, match=r"^Pendulum: <state at t = 0.1 s> is of another run"):
            other.restore(run.save())


def test_an_fmu_that_cannot_go_back(fmu: FmuPaths) -> None:
    with start(fmu("faulty"), step_size=0.1) as run:
        run.step()
        for use in (run.save, run.reset):
            with pytest.raises(
                SimulationError, match=r"^faulty: faulty \(faulty.fmu\) cannot go back: its canGetAndSet"
            ):
                use()


def test_a_refused_step_leaves_the_result_until_then(fmu: FmuPaths) -> None:
    with start(fmu("faulty"), step_size=0.1, time_of_failure=0.25) as run:
        run.step()
        run.step()
        with pytest.raises(IncompleteError, match=r"time 0.3 is beyond") as error:
            run.step()
    assert_allclose(error.value.result.time, [0.0, 0.1, 0.2], rtol=1e-14)


def test_an_fmu_that_ends_the_simulation_ends_the_run(fmu: FmuPaths) -> None:
    with start(fmu("finite"), step_size=0.25) as run:
        for _ in range(3):
            run.step()
        assert run.time == pytest.approx(0.6)
        with pytest.raises(SimulationError, match=r"^finite: finite ends the simulation at t = 0.6 s"):
            run.step()
    assert run.result.warnings == ("finite ends the simulation at t = 0.6 s",)
    assert run.result.time[-1] == pytest.approx(0.6)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({}, "give step_size"),
        ({"step_size": 0.0}, "step_size = 0.0: must be > 0"),
        ({"step_size": 0.1, "verify": True}, r"verify = True: only simulate\(\) takes it"),
        ({"step_size": 0.1, "real_time": 1.0}, r"real_time = 1.0: only simulate\(\) takes it"),
    ],
)
def test_settings_of_no_use(fmu: FmuPaths, settings: dict[str, Any], words: str) -> None:
    system = wired(a=fmu("wave"))
    with pytest.raises(LiaisonsError, match=words):
        system.start(**settings)


def test_errors_cannot_choose_the_steps(component: FmuPaths) -> None:
    with (
        wired(a=component("Pendulum")).start(1.0, 0.1, error_tolerance=1e-6) as run,
        pytest.raises(SimulationError, match=r"^wired: errors choose its steps; give step_size, and leave error_tol"),
    ):
        run.step()


def test_subjects_of_start(component: FmuPaths, tmp_path: Path) -> None:
    """Name, class, FMU, system and archive give one motion."""
    system = wired(Pendulum=(component("Pendulum"), {"theta_0": 0.7}))
    system.write_ssp(tmp_path / "one.ssp")
    seen = []
    for subject, prefix in (
        ("Pendulum", ""),
        (Pendulum, ""),
        (component("Pendulum"), ""),
        (system, "Pendulum."),
        (tmp_path / "one.ssp", "Pendulum."),
    ):
        with start(subject, step_size=0.1, start_values={f"{prefix}theta_0": 0.7}) as run:
            for _ in range(5):
                run.step()
            seen.append(run[f"{prefix}theta"])
    assert_allclose(seen, seen[0], rtol=1e-12)


def test_pace_is_kept_and_lateness_is_said(component: FmuPaths) -> None:
    with start(component("Pendulum"), step_size=0.02) as run:
        begin = time.perf_counter()
        run.pace(2.0)
        for _ in range(10):
            run.step()
        assert time.perf_counter() - begin >= 0.1
        run.pace(1.0)
        time.sleep(0.5)
        run.step()
        assert run.lateness[-1] >= 0.48
        run.pace(0.1)  # a fifth of a second for a step
        run.step()
        assert run.lateness[-1] == 0.0
        assert len(run.lateness) == 12
    late = [one for one in run.lateness if one > 1e-3]
    words = (
        f"{len(late)} of 12 paced steps end late, by up to {max(late):.3g} s: choose a smaller pace, or larger steps"
    )
    assert run.result.warnings[-1] == f"Pendulum: {words}"


def test_simulate_in_real_time(component: FmuPaths) -> None:
    """A function of time is asked for the end of a step when the clock has come to its start, and not before."""
    path, begin, asked = component("Pendulum"), time.perf_counter(), dict[float, float]()

    def force(t: float) -> float:
        asked.setdefault(round(t, 9), time.perf_counter() - begin)
        return 0.0

    settings: dict[str, Any] = {"stop_time": 0.5, "step_size": 0.1, "inputs": {"theta_force": force}}
    result = simulate(path, real_time=1.0, **settings)
    assert all(asked[t] >= t - 0.1 for t in (0.2, 0.3, 0.4, 0.5))
    _assert_same_bits(result, simulate(path, **settings))


COSTS = {"one": 15e-6, "array": 8e-6, "implicit": 40e-6}
"""Issue's bounds of a step [s]; three times as long passes, since other processes run meanwhile."""


@pytest.mark.slow
@pytest.mark.parametrize("kind", COSTS)
def test_cost_of_a_step(component: FmuPaths, record_property: Callable[[str, object], None], kind: str) -> None:
    if kind == "implicit":
        system, _ = _pendulums("Pendulum", "Pendulum")(component, component)
    else:
        system = wired(a=component("Pendulum"))
    with system.start(step_size=0.01, record=[f"{name}.theta" for name in system.parts]) as run:
        step = run.stepper(["a.theta_force"], ["a.theta"]) if kind == "array" else None
        force, best = np.zeros(1), math.inf
        for _ in range(5):
            begin = time.process_time()
            for k in range(1000):
                if step is not None:
                    force[0] = k % 5
                    step(force)
                else:
                    run.step({"a.theta_force": float(k % 5)} if kind == "one" else {})
            best = min(best, (time.process_time() - begin) / 1000)
    record_property("seconds a step", best)
    assert best < 3 * COSTS[kind]
