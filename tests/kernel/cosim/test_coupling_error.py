"""What a run says of its coupling error: against flattened steps from the same states, and in words."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from making import FmuPaths, coupling_errors, exchange_only, wired
from numpy.testing import assert_allclose, assert_array_equal

from liaisons import Signal, System, flatten
from liaisons.cosim import Coupling, Result, SystemComponent, interpolation_to_end, simulate
from liaisons.coupling_estimate.estimate import Worst, _cubic_integrals
from liaisons.errors import LiaisonsError

SEEN = ("upper.bob_x", "upper.bob_z", "upper.bob_x_dot", "upper.bob_z_dot")
ALSO = ("upper.theta", "upper.theta_dot", "lower.theta", "lower.theta_dot")


@pytest.fixture(scope="module")
def whole(component: FmuPaths, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return flatten(_pair(component, 1.0, 0.0, 0.0), tmp_path_factory.mktemp("flat"))


def _pair(component: FmuPaths, mass: float, upper: float, lower: float) -> System:
    first = component("Pendulum"), {"theta_0": upper}
    second = component("Pendulum"), {"theta_0": lower, "mass": mass}
    return wired("upper.bob -> lower.pivot", upper=first, lower=second)


def _true(result: Result, whole: Path, k: int, mass: float, seen: tuple[str, ...]) -> float:
    """Error of the step that ends at point k, relative to what is largest of the unit in the run."""
    H = result.time[k] - result.time[k - 1]
    state: dict[str, Any] = {
        f"{name}.theta{rate}_0": result[f"{name}.theta{rate}"][k - 1]
        for name in ("upper", "lower")
        for rate in ("", "_dot")
    }
    state["lower.mass"] = mass
    end = simulate(whole, stop_time=H, step_size=H, tolerance=1e-13, **state)
    errors = []
    for name in seen:
        alike = [other for other in result.names if result.units[other] == result.units[name]]
        size = max(float(np.max(np.abs(result[other]))) for other in alike)
        errors.append(abs(end[name][-1] - result[name][k]) / size)
    return max(errors)


def test_model_exchange_follows_the_quintic_of_a_port(component: FmuPaths, tmp_path: Path) -> None:
    """The sum of the errors is some true error, not that of a cubic, which is 5e4 times as large."""
    swing = exchange_only(component("Pendulum"), tmp_path), {"theta_0": 0.5}
    system = wired(
        "motor.y -> swing.length", motor=(component("Sinusoid"), {"offset": 1.0, "amplitude": 0.1}), swing=swing
    )
    coarse, fine = (system.simulate(stop_time=1.0, step_size=H, tolerance=1e-11) for H in (0.1, 0.1 / 4))
    true = np.max(np.abs(coarse["swing.theta"] - fine["swing.theta"][::4]))
    assert coarse.coupling_error is not None
    assert true / 10 < np.sum(coarse.coupling_error) < 100 * true


def test_an_fmu_interpolates_ports_alone_by_quintics(component: FmuPaths) -> None:
    """A force follows a line from end to end, also that of a port, since no rate of it is set."""
    oscillator = SystemComponent.read("it", component("Oscillator"), {})
    for name, fed, polynomial in (("support", True, "port"), ("support", False, "line"), ("x_force", True, "line")):
        assert interpolation_to_end(oscillator[name], is_fed_by_port=fed) == polynomial


@pytest.mark.parametrize(
    ("coupling", "masses", "seen"),
    [
        ("implicit", (0.1, 1.0, 10.0), SEEN),
        ("waveform", (0.1, 0.4), SEEN),
        ("gauss-seidel", (0.1, 0.4), SEEN + ALSO),
        ("jacobi", (0.1, 0.4), SEEN + ALSO),
    ],
)
@pytest.mark.variants(core=0)
def test_estimate_is_that_of_a_flattened_step_from_the_same_state(
    component: FmuPaths, whole: Path, coupling: Coupling, masses: tuple[float, ...], seen: tuple[str, ...]
) -> None:
    ratios = []
    for mass in masses:
        for upper, lower in ((1.2, -0.6), (0.5, 0.3), (-1.0, 2.0)):
            for H in (0.02, 0.01, 0.005):
                result = _pair(component, mass, upper, lower).simulate(10 * H, H, tolerance=1e-11, coupling=coupling)
                errors = coupling_errors(result)
                ratios += [errors[k] / _true(result, whole, k, mass, seen) for k in (3, 6, 10)]
    good = [1 / 10 < ratio < 10 for ratio in ratios]
    assert np.mean(good) >= 0.95, np.quantile(ratios, (0.0, 0.05, 0.5, 0.95, 1.0))


def test_whip_is_warned_of_and_a_step_that_would_do_is_named(
    component: FmuPaths, whole: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Balances of energy below 1e-8 say nothing of it: the lower angle is 1.7 rad off at H = 0.02."""
    system = _pair(component, 9.2, 1.2, -0.6)
    coarse = system.simulate(4.0, 0.02)
    (record,) = caplog.records
    assert "lower.pivot_x_force -> upper.bob_x_load" in record.message
    assert "a step_size of" in record.message
    truth = simulate(whole, times=coarse.time, tolerance=1e-12, **_starts(9.2, 1.2, -0.6))
    assert np.max(np.abs(coarse["lower.theta"] - truth["lower.theta"])) > 0.1
    assert np.max(coupling_errors(coarse)) > 1e-3
    caplog.clear()
    enough = float(record.message.split("a step_size of ")[1].split(" s ")[0])
    fine = system.simulate(4.0, enough)
    assert np.max(coupling_errors(fine)) < 1e-4
    assert caplog.records == []


def _starts(mass: float, upper: float, lower: float) -> dict[str, Any]:
    return {"lower.mass": mass, "upper.theta_0": upper, "lower.theta_0": lower}


@pytest.mark.parametrize(("prefix", "unit"), [("", 1.0), ("fmi3/", 1.0), ("", 0.01)])
def test_estimate_of_a_signal_into_a_force(component: FmuPaths, prefix: str, unit: float) -> None:
    """A cubic through the thirds is off by H⁴ f⁽⁴⁾/6480 in the mean; its integral over a step is what x' is off."""
    H, omega, force = 0.02 * unit, 3.0 / unit, unit**-2  # whatever the unit of time is
    mass = component(f"{prefix}Oscillator"), {"x_0": 1.0, "stiffness": force}
    result = wired(mass=mass).simulate(4 * unit, H, inputs={"mass.x_force": lambda t: force * math.sin(omega * t)})
    size = np.max(np.abs(result["mass.x_dot"]))
    expected = H**5 * omega**4 * force * np.abs(np.sin(omega * (result.time[1:] - H / 2))) / 6480 / size
    errors = coupling_errors(result)[1:]
    # what has both signs inside a step is added up: 1.1 times as much, by four points 1.75 times
    assert np.all((errors >= 0.9 * expected - 1e-12) & (errors <= 2.0 * expected + 1e-12))


def test_the_first_step_follows_a_signal_through_its_thirds(component: FmuPaths, fmu: FmuPaths) -> None:
    """x'' = sin(3 t + 0.7) - x from rest; a cubic through four points is off by H⁴ 3⁴/6480 = 1e-6 in the mean."""
    mass = component("Oscillator"), {"x_0": 0.0, "damping": 0.0, "stiffness": 1.0}
    system = wired("wave.y -> mass.x_force", wave=fmu("Wave"), mass=mass)
    run = system.simulate(0.1, 0.1, coupling="implicit", tolerance=1e-12)
    assert run["wave.y"].tolist() == [math.sin(0.7), math.sin(3 * 0.1 + 0.7)]
    x, x_dot = (  # (sin(0.7) cos t + 3 cos(0.7) sin t - sin(3 t + 0.7))/8 and its rate
        (math.sin(0.7) * c + 3 * math.cos(0.7) * s - wave) / 8
        for c, s, wave in (
            (math.cos(0.1), math.sin(0.1), math.sin(1.0)),
            (-math.sin(0.1), math.cos(0.1), 3 * math.cos(1.0)),
        )
    )
    assert run["mass.x_dot"][-1] == pytest.approx(x_dot, abs=2e-7)  # H times that
    assert run["mass.x"][-1] == pytest.approx(x, abs=2e-8)


def test_remainders_of_cubics_through_points_at_any_distances() -> None:
    """Of t⁴, whose fourth divided difference is 1: ∫ (t - t₀)(t - t₁)(t - t₂)(t - t₃) over the last step."""
    times = np.array([0.0, 1.0, 2.5, 3.0, 5.0, 5.5, 7.5])
    found = _cubic_integrals(times[None] ** 4, np.diff(times), np.zeros(6, bool))[0]
    for k in range(3, 6):
        primitive = np.polyint(np.poly(times[k - 2 : k + 2]))
        expected = np.polyval(primitive, times[k + 1]) - np.polyval(primitive, times[k])
        assert found[k] == pytest.approx(expected, rel=1e-12)


def test_jumps_are_no_error(component: FmuPaths, caplog: pytest.LogCaptureFixture) -> None:
    result = wired(mass=component("Oscillator")).simulate(2.0, 0.1, inputs={"mass.x_force": lambda t: float(t > 0.95)})
    assert np.max(coupling_errors(result)) < 1e-12
    assert caplog.records == []


@pytest.mark.parametrize("coupling", ["implicit", "gauss-seidel", "jacobi"])
def test_a_jump_that_a_foreign_fmu_does_not_announce_is_seen(
    component: FmuPaths, fmu: FmuPaths, caplog: pytest.LogCaptureFixture, coupling: Coupling
) -> None:
    """x'' = 5 - x from rest since 0.505 s."""
    mass = component("Oscillator"), {"x_0": 0.0, "damping": 0.0}
    result = wired("force.y -> mass.x_force", force=fmu("Jump"), mass=mass).simulate(1.0, 0.1, coupling=coupling)
    error = np.abs(result["mass.x"] - 5 * (1 - np.cos(np.maximum(result.time - 0.505, 0))))
    said = np.cumsum(coupling_errors(result)) * np.max(np.abs(result["mass.x"]))
    assert np.max(error) > 0.05  # it matters
    assert np.all(error <= 10 * said + 1e-7)
    assert "force.y -> mass.x_force is handed over too rarely" in caplog.text


def test_an_acceleration_that_is_held_counts(component: FmuPaths) -> None:
    """Jacobi coupling holds it over a step; a pivot acts by nothing else."""
    motor = component("Sinusoid"), {"amplitude": 0.1, "angular_frequency": 3.0}
    system = wired("motor.y -> swing.pivot_x", motor=motor, swing=component("Pendulum"))
    held, exact = (system.simulate(1.0, 0.02, coupling=kind, tolerance=1e-12) for kind in ("jacobi", "gauss-seidel"))
    error = np.max(np.abs(held["swing.theta"] - exact["swing.theta"])) / np.max(np.abs(exact["swing.theta"]))
    assert error < np.sum(coupling_errors(held)) < 10 * error


@pytest.mark.parametrize("H", [0.02, 0.002])
def test_what_begins_at_0_is_measured_by_what_it_reaches(component: FmuPaths, H: float) -> None:
    """A pendulum at rest, whose pivot begins to move: against its size so far, every first step would be all wrong."""

    def run(coupling: Coupling, **settings: Any) -> Result:
        step = component("SmoothStep"), {"end_value": 1.5, "duration": 4.0}
        system = wired("step.y -> swing.pivot_x", step=step, swing=(component("Pendulum"), {"theta_0": 0.0}))
        return system.simulate(2.0, coupling=coupling, **settings)

    held, exact = run("jacobi", step_size=H), run("gauss-seidel", step_size=H, tolerance=1e-12)
    theta = exact["swing.theta"]
    error = np.max(np.abs(held["swing.theta"] - theta))
    assert error / 3 < np.max(np.abs(theta)) * np.sum(coupling_errors(held)) < 3 * error
    assert held.warnings == ()  # 0.05 mrad


def test_one_fmu_alone_has_none(component: FmuPaths) -> None:
    assert not coupling_errors(simulate(component("Pendulum"), stop_time=1.0, step_size=0.1)).any()


def test_what_foreign_fmus_hand_each_other_is_estimated_by_what_they_do(fmu: FmuPaths) -> None:
    def worst(H: float) -> float:
        system = wired("mass.q -> spring.length", mass=(fmu("Cart"), {"q_0": 1.0}), spring=fmu("Buffer"))
        return float(np.max(coupling_errors(system.simulate(2.0, H))))

    assert worst(0.1) / worst(0.05) == pytest.approx(8.0, rel=0.3)  # of a step, where the whole is of second order


def test_incomplete_run_has_one_too(component: FmuPaths) -> None:
    system = _pair(component, 10.0, 0.3, -0.5)
    with pytest.raises(LiaisonsError) as caught:
        system.simulate(2.0, 0.2)
    error = caught.value.result.coupling_error  # type: ignore[attr-defined] - an IncompleteError
    assert error.shape == caught.value.result.time.shape  # type: ignore[attr-defined] - likewise


def test_verified_run_has_the_differences_from_half_the_step(component: FmuPaths) -> None:
    system = _pair(component, 1.0, 0.5, -0.2)
    result, fine = system.simulate(1.0, 0.02, verify=True), system.simulate(1.0, 0.01)
    for name in ("upper.theta", "lower.theta"):
        expected = np.abs(result[name] - fine[name][::2])
        assert_allclose(result.error(name), expected, rtol=0, atol=1e-10)  # instants differ by rounding
    assert 0 < np.max(result.error("lower.theta")) < 1e-4
    with pytest.raises(LiaisonsError, match=r"simulate\(verify=True\)"):
        fine.error("lower.theta")
    assert "half the step" in result.summary()[0]


def test_steps_that_nobody_gives_are_as_short_as_they_have_to_be(
    component: FmuPaths, whole: Path, caplog: pytest.LogCaptureFixture
) -> None:
    system = _pair(component, 9.2, 1.2, -0.6)
    result, again = (system.simulate(2.0, tolerance=1e-9) for _ in range(2))
    assert_array_equal(result.values, again.values)
    assert_allclose(np.diff(result.time), 0.01, rtol=1e-9)  # the pendulum's own step is the grid
    assert 0 < np.max(coupling_errors(result)) <= 1e-9
    truth = simulate(whole, times=result.time, tolerance=1e-12, **_starts(9.2, 1.2, -0.6))
    # 1e-9 a step, amplified by two whips of 30 each
    assert np.max(np.abs(result["lower.theta"] - truth["lower.theta"])) < 1e-5
    assert caplog.records == []


@pytest.mark.parametrize("prefix", ["", "fmi3/"])
@pytest.mark.variants(core=0)
def test_steps_follow_a_signal_and_shorten_where_it_moves_fast(component: FmuPaths, prefix: str) -> None:
    mass = component(f"{prefix}Oscillator"), {"x_0": 0.0}
    system = wired(mass=mass)
    instants: list[float] = []

    def push(t: float) -> float:
        instants.append(t)
        return math.exp(-(((t - 1.0) / 0.05) ** 2))

    system.simulate(2.0, inputs={"mass.x_force": push}, tolerance=1e-10)
    steps = np.diff(np.unique(instants))
    assert np.min(steps) < 0.5 * np.max(steps)


def test_errors_have_a_point_where_a_signal_breaks_at_0(component: FmuPaths) -> None:
    system = System("breaks at 0")
    system.add("swing", component("Pendulum"), theta_0=0.3)
    length = Signal(lambda t: (1 + 0.1 * abs(t), 0.1 * float(np.sign(t)), 0.0), breaks=[0.0])
    result = system.simulate(0.5, start_time=-0.5, inputs={"swing.length": length}, coupling="implicit")
    assert 0.0 in result.time
    errors = coupling_errors(result)
    assert errors.shape == result.time.shape
    assert np.max(errors) < 1e-10


def test_steps_without_coupling_are_those_of_the_fmus(component: FmuPaths) -> None:
    result = wired(swing=component("Pendulum")).simulate(0.1)
    assert_allclose(result.time, np.arange(11) * 0.01, rtol=1e-12)


def test_a_step_after_a_very_short_one_has_no_error_made_of_rounding(
    component: FmuPaths, caplog: pytest.LogCaptureFixture
) -> None:
    knots = np.pad(np.transpose([(0, 1, 0, 0), (1, 1.1, 0, 0)]), ((0, 0), (0, 98)))
    plan: Any = dict(zip(("instant", "value", "rate", "acceleration"), knots, strict=True))
    system = wired("plan.y -> swing.length", plan=(component("PlannedMotion"), plan), swing=component("Pendulum"))
    result = system.simulate(times=np.sort([*np.linspace(0, 1, 21), 0.35 - 4e-9]), tolerance=1e-10)
    assert np.max(coupling_errors(result)) < 1e-9  # it follows the very polynomial; rounding over (1/50)³
    assert caplog.records == []


def test_of_one_step_alone_nothing_is_said_rather_than_0(fmu: FmuPaths) -> None:
    """It has no neighbour to be compared with, and an FMU that takes no other step cannot halve it."""
    system = wired("wave.y -> faulty.u", wave=fmu("Wave"), faulty=fmu("Faulty"))
    one, two = (coupling_errors(system.simulate(end, 0.25, coupling="implicit"))[-1] for end in (0.25, 0.5))
    assert one != 0.0  # not a number is none either
    assert two > 0.0


def test_errors_that_add_up_are_warned_of(caplog: pytest.LogCaptureFixture) -> None:
    worst = Worst(8.6e-5, 1.5, "swing.theta", "a function of time -> swing.length", 0.1, 7)
    worst.warn(9e-5)
    assert not caplog.records
    worst.warn(800 * 8.6e-5)
    assert "coupling errors add up to 0.069, the largest is: coupling error 8.6e-05 of swing.theta" in caplog.text


@pytest.mark.variants(core=0)
def test_attempts_that_were_taken_back_are_not_warned_of(component: FmuPaths) -> None:
    """A push of 8 ms within the 10 ms between two points: the first steps there are off by more than is allowed."""
    system = wired(mass=(component("Oscillator"), {"x_0": 0.0}))
    pushes = {"mass.x_force": lambda t: 100 * math.exp(-(((t - 1.004) / 0.002) ** 2))}
    assert system.simulate(1.2, 0.01, inputs=pushes, coupling="implicit").warnings
    assert not system.simulate(1.2, inputs=pushes, tolerance=1e-8).warnings
