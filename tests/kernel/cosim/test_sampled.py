"""Sampled components in systems: against a loop by hand, in every coupling, at any step."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from threading import Lock
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from liaisons import System, sampled
from liaisons.errors import IncompleteError, LiaisonsError
from liaisons.models import Pid

T = 0.02
GAINS = {"gain": 30.0, "integral_time": 1.2, "derivative_time": 0.15, "filter": 4.0, "anti_windup": 0.7}
STIFFNESS, SETPOINT, START = 9.0, 0.3, 0.5


class ByHand:
    """The same controller, written down once more; its state is (integral, filtered)."""

    def __init__(self, bound: float = 1e30) -> None:
        self.bound = bound

    def __call__(self, state: tuple[float, float], setpoint: float, reading: float) -> tuple[float, Any]:
        K, Ti, Td, N, Ni = GAINS.values()
        integral, slow = state
        slow = (Td * slow - N * T * reading) / (Td + N * T)
        wish = K * (setpoint - reading) + integral + K * N * (-reading - slow)
        force = float(np.clip(wish, -self.bound, self.bound))
        return force, (integral + T / Ti * (K * (setpoint - reading) + (force - wish) / Ni), slow)


@cache
def by_hand(steps: int, delay: float, bound: float = 1e30) -> NDArray:
    """Positions of x'' = u - ω² x at the samples, by matrix exponentials."""
    controller = ByHand(bound)
    matrix = np.array([[0.0, 1, 0], [-STIFFNESS, 0, 1], [0, 0, 0]])
    x, state, force = np.array([START, 0.0]), (0.0, 0.0), 0.0
    positions = [START]
    for _ in range(steps):
        new, state = controller(state, SETPOINT, float(x[0]))
        for u, span in ((force, delay), (new, T - delay)):
            x = (expm(matrix * span) @ [*x, u])[:2]
        force = new
        positions.append(float(x[0]))
    return np.array(positions)


def oscillator(system: System) -> Any:
    return system.add("plant", "Oscillator", mass=1.0, stiffness=STIFFNESS, x_0=START)


def with_fmu(delay: float = 0.0, bound: float = 1e30) -> System:
    system = System("loop of FMUs")
    plant = oscillator(system)
    values = {"period": T, "setpoint": SETPOINT, "delay": delay, "lowest": -bound, "highest": bound, **GAINS}
    controller = system.add("controller", "Pid", start_values=values)
    system.connect(plant["x"], controller["reading"])
    system.connect(controller["output"], plant["x_force"])
    return system


def with_function(delay: float = 0.0, bound: float = 1e30) -> System:
    system = System("loop with a function")
    oscillator(system)
    function = sampled(
        lambda state, reading: ByHand(bound)(state, SETPOINT, reading),
        period=T, delay=delay, state=(0.0, 0.0), reads=["plant.x"], writes=["plant.x_force"],
    )  # fmt: skip
    system.add("controller", function)
    return system


SLOW = pytest.mark.slow
EITHER = pytest.mark.parametrize("make", [with_fmu, with_function])


def at_samples(time: NDArray, values: NDArray) -> NDArray:
    return values[np.abs(time / T - np.round(time / T)) < 1e-6]


@EITHER
@pytest.mark.parametrize("coupling", [None, "implicit", *(pytest.param(c, marks=SLOW) for c in ("jacobi", "waveform"))])
@pytest.mark.parametrize("delay", [0.0, T / 4, T])
def test_nothing_is_approximated(make: Callable[..., System], coupling: Any, delay: float) -> None:
    """Errors are those of the plant's solver at any step, and none is estimated."""
    for size in (T, T / 2, T / 5, 1.5 * T, 0.37 * T):
        times = np.unique(np.concatenate([np.arange(0, 1, size), np.arange(51) * T]))
        result = make(delay).simulate(times=times, coupling=coupling, tolerance=1e-11)
        expected = by_hand(50, delay)
        # A break in coupled steps is crossed by a step of 1e-9 of a communication step.
        np.testing.assert_allclose(at_samples(result.time, result["plant.x"]), expected, rtol=0, atol=5e-10)
        assert result.coupling_error is not None
        assert not result.coupling_error.any()
        assert not result.warnings


@EITHER
def test_samples_are_communication_points_of_their_own(make: Callable[..., System]) -> None:
    """Steps of 1.5 periods, of which the result has its points alone."""
    result = make().simulate(0.6, 1.5 * T, tolerance=1e-11)
    assert len(result.time) == 21
    np.testing.assert_allclose(at_samples(result.time, result["plant.x"]), by_hand(30, 0.0)[::3], rtol=0, atol=1e-13)


@EITHER
def test_a_bound_does_not_wind_up(make: Callable[..., System]) -> None:
    result = make(0.0, 3.0).simulate(4.0, T, tolerance=1e-11)
    force = result["plant.x_force"]
    assert np.sum(np.abs(force) == 3.0) > 5
    np.testing.assert_allclose(result["plant.x"], by_hand(200, 0.0, 3.0), rtol=0, atol=1e-13)


@EITHER
def test_step_by_step(make: Callable[..., System]) -> None:
    """As simulated, to the bit; back to a saved state, and to the start."""
    expected = make(T / 4).simulate(40 * T / 2, T / 2)["plant.x"]
    with make(T / 4).start(step_size=T / 2) as run:
        for turn in range(2):
            seen, state = [run["plant.x"]], run.save()
            for i in range(40):
                if i == 13:
                    state = run.save()
                run.step()
                seen.append(run["plant.x"])
            assert seen == expected.tolist()
            if turn == 0:
                run.restore(state)
                for x in expected[14:20]:
                    run.step()
                    assert run["plant.x"] == x
                run.reset()
        assert run.result["plant.x"].tolist() == expected.tolist()


def test_beside_mechanisms_that_are_coupled_implicitly() -> None:
    """A pendulum hangs on a pendulum; the error that is left is that of their coupling, of fourth order."""

    def end(size: float) -> float:
        system = System("two pendulums")
        upper, lower = system.add("upper", "Pendulum", theta_0=0.4), system.add("lower", "Pendulum", theta_0=-0.2)
        system.connect(upper["bob"], lower["pivot"])
        controller = system.add("controller", "Pid", period=0.1, setpoint=0.1, gain=4.0, derivative_time=0.2)
        system.connect(upper["theta"], controller["reading"])
        system.connect(controller["output"], upper["theta_force"])
        return float(system.simulate(1.0, size, tolerance=1e-11)["lower.theta"][-1])

    ends = [end(size) for size in (0.05, 0.025, 0.0125)]
    assert abs(ends[1] - ends[2]) < abs(ends[0] - ends[1]) / 8
    assert abs(ends[1] - ends[2]) < 1e-6


def test_a_function_of_time_alone() -> None:
    system = System("clock")
    oscillator(system)
    system.add("source", sampled(lambda t: (t, -t), period=0.1, reads=["time"], writes=["u", "v"]))
    system.connect(system.parts["source"]["u"], system.parts["plant"]["x_force"])
    result = system.simulate(1.0, 0.05)
    np.testing.assert_allclose(result["source.u"], np.floor(result.time / 0.1 + 1e-6) * 0.1, rtol=1e-14)
    assert (result["source.v"] == -result["source.u"]).all()


def test_a_function_is_called_once_a_sample() -> None:
    """In explicit coupling, where nothing is repeated."""
    calls: list[float] = []
    system = System("count")
    oscillator(system)

    def count(t: float, x: float) -> float:
        calls.append(t)
        return -x

    system.add("controller", sampled(count, period=T, reads=["time", "plant.x"], writes=["plant.x_force"]))
    system.simulate(10 * T, T / 2)
    np.testing.assert_allclose(calls, np.arange(11) * T, rtol=1e-14)


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda x: 1 / (x - x), "controller: <lambda> fails at t = 0 s: ZeroDivisionError('float division by zero')"),
        (lambda x: (x, x), "controller: <lambda> returns [0.5, 0.5] at t = 0 s, expected 1 finite number"),
        (lambda x: np.nan * x, "controller: <lambda> returns [nan] at t = 0 s, expected 1 finite number"),
    ],
)
def test_what_a_function_does_wrong_has_its_name(function: Any, message: str) -> None:
    system = System("wrong")
    oscillator(system)
    system.add("controller", sampled(function, period=T, reads=["plant.x"], writes=["plant.x_force"]))
    with pytest.raises(LiaisonsError) as caught:
        system.simulate(1.0, T)
    assert str(caught.value) == message


def test_a_state_that_cannot_be_copied_is_refused() -> None:
    with pytest.raises(LiaisonsError, match=r"<lambda>: state = <unlocked .* cannot be copied \(.*\), so that no run"):
        sampled(lambda state, x: (x, state), period=T, reads=["x"], writes=["y"], state=Lock())


def test_an_error_later_has_the_result_so_far() -> None:
    system = System("late")
    oscillator(system)
    late = sampled(
        lambda t, x: -x if t < 0.5 else {}["x"], period=T, reads=["time", "plant.x"], writes=["plant.x_force"]
    )
    system.add("controller", late)
    with pytest.raises(IncompleteError, match=r"controller: <lambda> fails at t = 0.5 s: KeyError") as caught:
        system.simulate(1.0, T)
    assert caught.value.result.time[-1] == pytest.approx(0.5, abs=1.5 * T)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"period": 0}, "sampled: <lambda>: period = 0: must be > 0"),
        ({"delay": 2 * T}, "sampled: <lambda>: delay = 0.04 s: must be from 0 to the period, 0.02 s"),
        ({"reads": "plant.x"}, "reads = 'plant.x': give a list of names"),
        ({"writes": []}, "writes = []: name what it returns"),
        ({"reads": ["plant.x", "other.x"]}, "two variables would be called 'x': name them, and connect them"),
        ({"reads": ["plnt.x"]}, "controller: plnt.x: refused has no component 'plnt'; did you mean 'plant'"),
        ({"reads": ["plant.y"]}, "plant: Oscillator.fmu has no variable 'y'"),
    ],
)
def test_refusals(changed: dict[str, Any], message: str) -> None:
    system = System("refused")
    oscillator(system)
    with pytest.raises(LiaisonsError) as caught:
        system.add(
            "controller",
            sampled(lambda x: x, **{"period": T, "reads": ["plant.x"], "writes": ["plant.x_force"], **changed}),
        )
    assert message in str(caught.value)
    assert [*system.parts] == ["plant"]
    assert not system.connections


@pytest.mark.parametrize("task", ["an archive", "a sweep with a journal, or on a cluster,", "a live page"])
def test_what_takes_no_function_says_so(task: str, tmp_path: Any) -> None:
    from liaisons import show, sweep

    system, cases = with_function(), {"plant.x_0": [0.1, 0.2]}
    tasks: dict[str, Callable[[], Any]] = {
        "archive": lambda: system.write_ssp(tmp_path / "loop.ssp"),
        "sweep": lambda: sweep(system, cases, keep="plant.x", stop_time=1.0, step_size=T, journal=tmp_path / "journal"),
        "live": lambda: show(system, path=tmp_path / "loop.html"),
    }
    with pytest.raises(LiaisonsError) as caught:
        tasks[task.split()[1]]()
    assert f": {task} takes no Python function; declare a Sampled component" in str(caught.value)


def test_the_closed_form_of_the_controller() -> None:
    """With constant inputs; what is read at a sample before inputs are set there is the limit from the left."""
    values: dict[str, Any] = {
        "setpoint": 1.0,
        "reading": 0.3,
        "derivative_weight": 0.5,
        "integral_0": 0.2,
        "filtered_0": -0.4,
        **GAINS,
    }
    del values["anti_windup"]
    from liaisons import simulate

    result = simulate("Pid", stop_time=2.0, step_size=0.05, record=["output", "integral", "filtered"], **values)
    exact = Pid.exact(result.time - 1e-3, **values)
    for name, column in exact.items():
        np.testing.assert_allclose(result[name][1:], column[1:], rtol=1e-12)
