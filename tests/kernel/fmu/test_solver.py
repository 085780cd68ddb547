"""The internal solver: its coefficients, its order, and what tolerance and communication step do to the error."""

from __future__ import annotations

import re
from importlib import resources

import numpy as np
import pytest
from driver import DISCARD, ERROR
from handmade import libration, rotation
from numpy.typing import NDArray
from scipy.integrate._ivp import dop853_coefficients as reference

DURATION = 100.0  # [s]
AMPLITUDE = 2.0  # [rad]
RATE = 8.0  # [rad/s]; the separatrix is at 2Ω = 6.26 rad/s


@pytest.fixture(scope="module")
def tableau() -> tuple[NDArray, dict[str, NDArray]]:
    """A (12, 12), b, c, order-3 weights and order-5 differences, read from solver.c."""
    code = (resources.files("liaisons.fmu") / "runtime" / "solver.c").read_text()
    a, vectors = np.zeros((12, 12)), {name: np.zeros(12) for name in ("b", "c", "bhh", "e")}
    for i, j, value in re.findall(r"\ba_(\d+)_(\d+) = ([-+.e\d]+)", code):
        a[int(i) - 1, int(j) - 1] = float(value)
    for name, i, value in re.findall(r"\b(bhh|b|c|e)_(\d+) = ([-+.e\d]+)", code):
        vectors[name][int(i) - 1] = float(value)
    return a, vectors


def test_coefficients_are_the_published_ones(tableau) -> None:
    a, vectors = tableau
    np.testing.assert_array_equal(a, reference.A[:12, :12])
    np.testing.assert_array_equal(vectors["b"], reference.B)
    np.testing.assert_array_equal(vectors["c"], reference.C[:12])
    np.testing.assert_array_equal(vectors["e"], reference.E5[:12])
    np.testing.assert_array_equal(vectors["b"] - vectors["bhh"], reference.E3[:12])


def test_coefficients_of_the_dense_output_are_the_published_ones() -> None:
    code = (resources.files("liaisons.fmu") / "runtime" / "events.c").read_text()
    tables = re.findall(r"static const double \w+(?:\[\w+\])+ = \{(.*?)\};", code, re.DOTALL)
    times, stages, shapes = (np.array(re.findall(r"-?\d+\.?\d*", table), dtype=float) for table in tables)
    np.testing.assert_array_equal(times, reference.C[13:])
    np.testing.assert_array_equal(stages.reshape(3, 15), reference.A[13:, :15])
    np.testing.assert_array_equal(shapes.reshape(4, 16), reference.D)


def motion(library, size: float, tolerance: float, **start: float) -> tuple[NDArray, ...]:
    """Times, theta, theta_dot and energy balance at the communication points."""
    instance = library.start(tolerance=tolerance, **start)
    rows = []
    for i in range(round(DURATION / size)):
        instance.step(i * size, size)
        rows.append(instance.get("theta", "theta_dot", "energy_balance"))
    return (1 + np.arange(len(rows))) * size, *np.array(rows).T


def errors(library, size: float, tolerance: float) -> list[float]:
    """Largest error of angle and rate against elliptic functions, in libration and in rotation."""
    found = []
    for exact, value, start in (
        (libration, AMPLITUDE, {"theta_0": AMPLITUDE}),
        (rotation, RATE, {"theta_0": 0.0, "theta_dot_0": RATE}),
    ):
        t, *angles, _ = motion(library, size, tolerance, **start)
        found.append(float(np.abs(np.array(angles) - exact(t, value)).max()))
    return found


@pytest.mark.parametrize("size", [1.0, 0.1, 0.01])
@pytest.mark.parametrize(("tolerance", "allowed"), [(1e-10, 1e-7), (1e-14, 1e-9)])
def test_accuracy_over_100_s(every_pendulum, size, tolerance, allowed) -> None:
    """The allowed errors are those that the project promises; about 3e3 angular units pass in 100 s of rotation."""
    swing, turn = errors(every_pendulum, size, tolerance)
    assert swing <= allowed
    assert turn <= allowed * (2 if every_pendulum.python else 1)  # its method is of order 5: rounding of more steps


def test_error_falls_in_proportion_to_the_tolerance(every_pendulum) -> None:
    tolerances = np.array([1e-6, 1e-8, 1e-10, 1e-12])
    swing, turn = np.array([errors(every_pendulum, 1.0, tolerance) for tolerance in tolerances]).T
    for error in (swing, turn):
        slope, _ = np.polyfit(np.log10(tolerances), np.log10(error), 1)
        # Step sizes differ by factors of 1.8 a decade of tolerance: which step is the last before a communication
        # point changes from one to the next and scatters the error by a factor of about 3, the slope by 0.15.
        assert slope == pytest.approx(1.0, abs=0.2)


def test_tolerance_of_the_experiment_is_the_default(pendulum_library) -> None:
    def end(tolerance: float | None) -> float:
        instance = pendulum_library.start(tolerance=tolerance, theta_0=AMPLITUDE)
        instance.step(0.0, 5.0)
        return instance["theta"]

    assert end(None) == end(1e-8)  # that of the component's Experiment
    assert end(None) != end(1e-6)


@pytest.mark.parametrize(("given", "used"), [(1e-30, "1e-14"), (0.5, "0.01")])
def test_tolerances_out_of_range_are_clamped_with_a_warning(every_pendulum, given, used) -> None:
    instance = every_pendulum.instantiate(logging=True)
    instance.initialize(tolerance=given)
    assert instance.messages == [f"tolerance = {given:g} is out of range, {used} is used"]


@pytest.mark.parametrize("size", [1e-150, 1e-165, 1e-200, 1e-305])
def test_motion_as_small_as_numbers_can_be(pendulum_library, size) -> None:
    """Squares of the error estimate underflow.  The motion is linear; after a quarter of a period p = -m l² Ω θ_0."""
    instance = pendulum_library.start(theta_0=size)
    omega = np.sqrt(9.81)
    instance.step(0.0, np.pi / 2 / omega)
    # Far below the absolute tolerance steps are as large as they like; polynomials of order 8 stay near the sine.
    assert abs(instance["p_theta"]) <= 10 * omega * size


def test_condition_that_fails_inside_a_step_discards_it(fall_library) -> None:
    """v reaches -1 m/s at x = 2/3, before t = 1 s."""
    instance = fall_library.start(limit=1.0)
    before = instance.get("x", "v")
    instance.step(0.0, 1.0, DISCARD)
    (message,) = instance.messages
    assert message.startswith("v must stay > -limit; at t = 0.")
    assert message.endswith("; the step from t = 0 is taken back")
    np.testing.assert_array_equal(instance.get("x", "v"), before)


def test_condition_that_fails_at_the_start_is_refused(fall_library) -> None:
    message = "v must stay > -limit; at t = 0 it does not (-2); set another value and initialize again"
    fall_library.initializing(limit=-2.0).exit_initialization(ERROR, message)


@pytest.mark.parametrize("symplectic", [0, 2])
@pytest.mark.parametrize(("t_1", "size"), [(1.2345, 6.0), (2.0, 1.0), (1.0, 0.3), (1.0, 0.5)])
def test_steps_stop_at_instants_where_the_component_is_not_smooth(every_kick, symplectic, t_1, size) -> None:
    """Piecewise linear: exact up to rounding if no step goes over the kink, wrong by 1e-9 and more if one does."""
    if every_kick.python and symplectic:
        return
    instance = every_kick.start(t_1=t_1, **({"symplectic_steps": symplectic} if symplectic else {}))
    instance.follow(size, round(6.0 / size))
    assert instance["x"] == pytest.approx(6.0 + 2 * (6.0 - t_1), rel=1e-15)
