"""Coupled mechanisms: orders, stability bounds, energy handed over, roll-back, FMUs that can do less."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from making import FmuPaths, Trace, coupling_errors, described, rewritten, wired
from numpy.testing import assert_allclose, assert_array_equal
from scipy.interpolate import BPoly, PPoly

from liaisons import Signal
from liaisons.check import slope
from liaisons.cosim import Connection, Coupling, IncompleteError, Result, System, simulate
from liaisons.cosim.coupling.implicit import _jerk_at_end
from liaisons.cosim.coupling.signals import Curve, polynomial_arrays
from liaisons.cosim.coupling.strong_component import _INTEGRALS, StrongComponent
from liaisons.cosim.structure.schedule import shortest_algebraic_loops
from liaisons.errors import SimulationError

START: dict[str, Any] = {"theta_1_0": 0.3, "theta_2_0": 0.5}


def _double(component: FmuPaths, names: Sequence[str] = ("Pendulum", "Pendulum"), **lower: float) -> System:
    """A pendulum hung on the bob of another."""
    first = component(names[0]), {"theta_0": START["theta_1_0"]}
    second = component(names[1]), {"theta_0": START["theta_2_0"]} | lower
    return wired("first.bob -> second.pivot", first=first, second=second)


def _error(component: FmuPaths, result: Result, **starts: float) -> float:
    """Largest difference from the double pendulum in one FMU."""
    start: dict[str, Any] = START | starts
    single = simulate(component("DoublePendulum"), times=result.time, tolerance=1e-13, **start)
    return max(
        float(np.max(np.abs(result[f"{n}.theta"] - single[f"theta_{k}"]))) for k, n in ((1, "first"), (2, "second"))
    )


def _pumped(component: FmuPaths, operator: str, motion: dict[str, float], **starts: float) -> System:
    """A pendulum whose length an operator prescribes."""
    motor, swing = (component(operator), motion), (component("Pendulum"), starts)
    return wired("motor.y -> swing.length", motor=motor, swing=swing)


SHRINKING = {"offset": 1.0, "rate": -1.0}


# ---- orders --------------------------------------------------------------------------------------------------------


COARSE, FINE = (0.02, 0.01, 0.005), (0.01, 0.005, 0.0025)
TWO, THREE = "Pendulum", "fmi3/Pendulum"


@pytest.mark.variants(core=6)
@pytest.mark.parametrize(
    ("coupling", "names", "sizes", "order"),
    [
        ("jacobi", (TWO, TWO), FINE, 1.0),
        ("gauss-seidel", (TWO, TWO), FINE, 1.0),
        ("waveform", (TWO, TWO), COARSE, 4.0),
        ("implicit", (TWO, TWO), COARSE, 4.0),
        ("jacobi", (THREE, THREE), FINE, 1.0),
        ("waveform", (THREE, THREE), COARSE, 4.0),
        ("implicit", (THREE, THREE), COARSE, 4.0),
        ("implicit", (TWO, THREE), COARSE, 4.0),
        ("implicit", (THREE, TWO), COARSE, 4.0),
    ],
)
def test_order_between_mechanisms(
    component: FmuPaths, coupling: Coupling, names: tuple[str, str], sizes: tuple[float, ...], order: float
) -> None:
    system = _double(component, names)
    errors = [_error(component, system.simulate(1.0, H, tolerance=1e-13, coupling=coupling)) for H in sizes]
    # the next term of the error is smaller by (rate · H)² or rate · H, rates up to 10 /s: some per cent of the slope
    assert slope(sizes, errors) == pytest.approx(order, abs=0.1)


def test_order_along_a_line_of_ports_is_six(component: FmuPaths) -> None:
    """Without a cycle, what a source does over a step is known before its target is stepped: quintic polynomials."""

    def error(H: float) -> float:
        motion = {"offset": 1.0, "amplitude": 0.1, "angular_frequency": 2.0}
        system = _pumped(component, "Sinusoid", motion, theta_0=0.5)
        coarse, fine = (system.simulate(4.0, h, tolerance=1e-13, coupling="implicit") for h in (H, 0.01))
        return abs(float(coarse["swing.theta"][-1] - fine["swing.theta"][-1]))

    sizes = (0.4, 0.2, 0.1)
    # fine: H = 0.01 is better than 0.1 by 1e6; (2 · 0.4)² and higher harmonics leave some tenths of the slope
    assert slope(sizes, [error(H) for H in sizes]) == pytest.approx(6.0, abs=0.5)


@pytest.mark.parametrize("names", [("Pendulum", "python/Pendulum"), ("python/Pendulum", "python/Pendulum")])
def test_fmus_that_take_no_derivatives_of_inputs_interpolate_and_are_of_second_order(
    component: FmuPaths, names: tuple[str, str]
) -> None:
    sizes = (0.04, 0.02, 0.01)
    errors = [
        _error(component, _double(component, names).simulate(0.4, H, tolerance=1e-11, coupling="implicit"))
        for H in sizes
    ]
    assert slope(sizes, errors) == pytest.approx(2.0, abs=0.2)  # loads are straight lines


# ---- signals into inputs, by default -------------------------------------------------------------------------------

OMEGA, PHASE = 3.0, 0.7
STEPS = (0.08, 0.04, 0.02, 0.01)


def _pushed(component: FmuPaths, prefix: str, source: str, **starts: float) -> System:
    """A mass on a spring, pushed by a signal."""
    parts: dict[str, Any] = {"mass": (component(f"{prefix}Oscillator"), {"x_0": 0.3, **starts})}
    if source == "port":
        motor = component(f"{prefix}Sinusoid"), {"angular_frequency": OMEGA, "phase": PHASE}
        return wired("motor.y -> mass.x_force", motor=motor, **parts)
    if source == "output":
        swing = component(f"{prefix}Pendulum"), {"theta_0": 0.7}
        return wired("swing.pivot_x_force -> mass.x_force", swing=swing, **parts)
    return wired(**parts)


def _push(t: float) -> float:
    return math.sin(OMEGA * t + PHASE)


@pytest.mark.parametrize("prefix", ["", "fmi3/"])
@pytest.mark.parametrize(("source", "order"), [("port", 6.0), ("output", 4.0), ("function", 4.0)])
def test_smooth_signal_into_a_force_is_of_fourth_order_at_least(
    component: FmuPaths, prefix: str, source: str, order: float
) -> None:
    """From value, rate and acceleration; from the slope that the FMU gives; from points alone."""
    inputs = {"mass.x_force": _push} if source == "function" else None
    system = _pushed(component, prefix, source)
    steps = STEPS[1:] if source == "output" else STEPS[:3]  # one is too coarse, the other soon as good as the solver
    found = [system.simulate(4.0, H, tolerance=1e-13, inputs=inputs)["mass.x"][-1] for H in (*steps, 0.0025)]
    # the next term of the error is smaller by (rate · H)², rates up to 10 /s: some tenths of the slope
    assert slope(steps, [abs(end - found[-1]) for end in found[:-1]]) == pytest.approx(order, abs=0.3)


@pytest.mark.parametrize("part", [1.0, 0.4])
def test_smooth_output_of_another_make_is_of_fourth_order(fmu: FmuPaths, component: FmuPaths, part: float) -> None:
    """Known by its values alone; the first steps, which have no past, are made in thirds; steps of one size or two."""

    def end(H: float) -> float:
        system = wired("wave.y -> mass.x_force", wave=fmu("Wave"), mass=(component("Oscillator"), {"x_0": 0.3}))
        begins = np.arange(0, 4 + H / 2, H)
        times = np.unique(np.round([*begins, *begins[:-1] + part * H], 12))
        return system.simulate(times=times, tolerance=1e-13)["mass.x"][-1]

    truth = _pushed(component, "", "port").simulate(4.0, 0.01, tolerance=1e-13)["mass.x"][-1]
    assert slope(STEPS, [abs(end(H) - truth) for H in STEPS]) == pytest.approx(4.0, abs=0.3)


@pytest.mark.parametrize("at", [0.95, 1.0])
@pytest.mark.parametrize("prefix", ["", "fmi3/"])
@pytest.mark.parametrize("announced", [False, True])
def test_jump_of_a_function_is_found(component: FmuPaths, prefix: str, at: float, announced: bool) -> None:
    """Within a step, and right after its end; where it is announced, the value at that instant is the one before."""
    push = Signal(lambda t: float(t > at), breaks=[at] if announced else [])
    result = _pushed(component, prefix, "function", x_0=0.0).simulate(
        3.0, 0.1, tolerance=1e-12, inputs={"mass.x_force": push}
    )
    late = np.maximum(result.time - at, 0.0)
    assert_allclose(result["mass.x"], 1 - np.cos(late), rtol=0, atol=1e-10)  # mass 1 kg, stiffness 1 N/m


@pytest.mark.parametrize("start", [1.0, 1.03])
def test_kink_that_is_announced_stays_one(component: FmuPaths, start: float) -> None:
    ramp = component("Ramp"), {"start_time": start}
    system = wired("ramp.y -> mass.x_force", ramp=ramp, mass=(component("Oscillator"), {"x_0": 0.0}))
    result = system.simulate(3.0, 0.1, tolerance=1e-12)
    late = np.maximum(result.time - start, 0.0)
    assert_allclose(result["mass.x"], late - np.sin(late), rtol=0, atol=1e-10)


def test_breaks_within_a_step_are_ends_of_pieces(component: FmuPaths) -> None:
    """The jerk of a pivot is that of its piece, also where the next break comes before the end of the step."""
    upper, lower = ((component("Pendulum"), {"theta_0": theta}) for theta in (0.3, 0.5))
    system = wired("upper.bob -> lower.pivot", upper=upper, lower=lower)

    def shaken(t: float) -> tuple[float, float, float]:
        a, b = max(t - 0.23, 0.0), max(t - 0.27, 0.0)
        return 30 * (a**3 - b**3), 90 * (a**2 - b**2), 180 * (a - b)

    coarse = np.linspace(0.0, 0.5, 6)
    first, second = (
        system.simulate(times=times, inputs={"upper.pivot_x": Signal(shaken, breaks=[0.23, 0.27])}, coupling="implicit")
        for times in (coarse, np.sort([*coarse, 0.23, 0.27]))
    )
    at_coarse = second["lower.theta"][np.isin(second.time, coarse)]
    assert_allclose(first["lower.theta"], at_coarse, rtol=0, atol=1e-12)  # the same pieces: rounding


def test_what_inputs_do_can_be_left_to_the_fmu(component: FmuPaths) -> None:
    options: dict[str, Any] = {"stop_time": 1.0, "step_size": 0.1, "tolerance": 1e-12}
    held = _pushed(component, "", "port", input_reconstruction=1).simulate(**options, coupling="implicit")
    named, exact = (
        _pushed(component, "", "port").simulate(**options, coupling=kind) for kind in ("jacobi", "implicit")
    )
    assert_array_equal(held["mass.x"], named["mass.x"])
    assert np.sum(coupling_errors(held)) > np.max(np.abs(held["mass.x"] - exact["mass.x"])) > 1e-3


# ---- stability and energy -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ratio", [0.5, 2.0])
def test_explicit_coupling_multiplies_the_force_s_error_by_the_ratio_of_effective_masses(
    component: FmuPaths, ratio: float
) -> None:
    """Rods at a right angle: Θ = m_2 along the lower rod meets m_1, so the gain of a sweep is -m_2/m_1."""
    lower = component("Pendulum"), {"theta_0": math.pi / 2, "mass": ratio, "theta_dot_0": 1.0}
    system = wired("first.bob -> second.pivot", first=(component("Pendulum"), {"theta_0": 0.0}), second=lower)
    force = system.simulate(4e-5, 1e-5, coupling="jacobi")["second.pivot_x_force"]
    changes = np.diff(force)
    # the force by itself moves by some 1e-4 a step, the first error is of order 1 and falls or grows with the gain
    assert_allclose(changes[1:] / changes[:-1], -ratio, rtol=0.05)


@pytest.mark.parametrize("mass", [0.01, 1.0, 100.0])
def test_implicit_coupling_is_stable_for_any_ratio_of_masses(component: FmuPaths, mass: float) -> None:
    start = {"theta_2_0": 0.4}
    system = _double(component, mass=mass, theta_0=0.4)
    result = system.simulate(1.0, 0.005, tolerance=1e-12, coupling="implicit")
    # quadrature of the load, H⁴/720 · rate⁴ · load/m_1 · t: rate² = 2 · 9.81 (1 + mass), load 9.81 · mass, all N/kg
    bound = 0.005**4 / 720 * (2 * 9.81 * (1 + mass)) ** 2 * max(1.0, 9.81 * mass) + 1e-11
    assert _error(component, result, mass_2=mass, **start) <= bound
    handed = np.abs(result["first.work"] + result["second.work"])
    assert np.max(handed) <= bound * 9.81 * (1 + mass)  # what one does is done to the other: no energy comes or goes


def test_power_leaves_one_mechanism_as_it_enters_the_other(component: FmuPaths) -> None:
    """Force and acceleration fit, too, from the first point on."""
    for mass, end in ((1.0, 1.0), (30.0, 0.1)):
        result = _double(component, mass=mass).simulate(end, 0.01, tolerance=1e-10, coupling="implicit")
        for axis in "xz":
            upper, lower = f"first.bob_{axis}", f"second.pivot_{axis}"
            load = result[f"{upper}_load"]
            # both ends fit to 1e-12 of their size, 20 N and 1 m/s for a kilogram
            assert_allclose(result[f"{lower}_power"], load * result[f"{upper}_dot"], rtol=0, atol=1e-10 * mass)
            assert_allclose(load, result[f"{lower}_force"], rtol=0, atol=1e-8 * mass)
            assert_allclose(result[f"{upper}_ddot"], result[f"{lower}_ddot"], rtol=0, atol=1e-8 * mass)


def test_repetition_fails_where_newton_does_not(component: FmuPaths) -> None:
    system = _double(component, mass=10.0, theta_0=1.5)
    with pytest.raises(
        SimulationError, match=r"^first, second: .* does not converge at t = 0 s, .*coupling='implicit'"
    ):
        system.simulate(0.1, 0.001, coupling="waveform")
    assert system.simulate(0.01, 0.001, coupling="implicit").time[-1] == 0.01


def test_both_iterations_end_at_the_same_motion(component: FmuPaths) -> None:
    newton, picard = (
        _double(component).simulate(0.5, 0.02, tolerance=1e-12, coupling=c) for c in ("implicit", "waveform")
    )
    # interface tolerance 1e-13 of values up to 20, over 25 steps
    assert_allclose(picard["second.theta"], newton["second.theta"], rtol=0, atol=1e-10)


def test_connections_without_a_solution_are_named(component: FmuPaths) -> None:
    system = wired("swing.bob -> swing.pivot", swing=component("Pendulum"))
    with pytest.raises(SimulationError, match=r"^swing: what they exchange at t = 0 s has no unique solution"):
        system.simulate(0.1, 0.1, coupling="implicit")


def test_step_that_is_too_long_for_the_iteration_says_so(component: FmuPaths) -> None:
    system = _double(component, mass=10.0, theta_0=-0.5)
    with pytest.raises(IncompleteError, match=r"choose a smaller step_size$"):
        system.simulate(2.0, 0.2)


# ---- adapted steps --------------------------------------------------------------------------------------------------


def test_adapted_steps_keep_the_tolerance(component: FmuPaths) -> None:
    errors, points = [], []
    for tolerance in (1e-5, 1e-8):
        result = _double(component).simulate(1.0, 0.01, tolerance=1e-12, error_tolerance=tolerance)
        errors.append(_error(component, result))
        points.append(len(result.time))
        assert result.time[-1] == 1.0
    assert errors[0] <= 1e-5 * points[0]  # a tolerance a step, relative to about 1
    assert errors[1] <= 1e-8 * points[1]
    # fifth order a step: 1000 times less error for 4 times as many points, a factor 2 for the ends of the run
    assert points[1] / points[0] == pytest.approx(1000**0.2, rel=1.0)


def test_adapted_steps_do_not_pass_over_what_answers_later(component: FmuPaths) -> None:
    """A child that crouches and rises between two points at which it stands; no step is longer than it crouches."""
    parts: dict[str, Any] = {
        "swing": (component("Pendulum"), {"theta_0": 0.1, "length": 1.0}),
        "pump": (component("SwingPump"), {"low": 1.0, "high": 1.1, "rate": 400.0}),
    }
    wires = "pump.y -> swing.length", "swing.theta -> pump.theta", "swing.theta_dot -> pump.theta_dot"
    result = wired(*wires, **parts).simulate(6.0, 0.01, tolerance=1e-9, error_tolerance=1e-5)
    fine = wired(*wires, **parts).simulate(6.0, 0.001, tolerance=1e-9)
    # a tolerance a step, which the growth of the swing multiplies by less than 3
    assert abs(result["swing.theta"][-1] - fine["swing.theta"][-1]) < 3 * 1e-5 * len(result.time)
    assert np.diff(result.time).max() < np.pi / 2 / math.sqrt(9.81)  # a quarter of a period of length 1 m


def test_adapted_steps_shorten_where_something_happens(component: FmuPaths) -> None:
    motion = {"start_value": 1.0, "end_value": 0.8, "start_time": 1.0, "duration": 0.1}
    system = _pumped(component, "SmoothStep", motion, theta_0=0.5)
    result = system.simulate(2.0, 0.2, tolerance=1e-10, error_tolerance=1e-6, coupling="gauss-seidel")
    sizes = np.diff(result.time)
    during = sizes[(result.time[:-1] >= 1.0) & (result.time[:-1] < 1.1)]
    assert np.median(during) < 0.5 * np.median(sizes[result.time[:-1] < 0.9])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"error_tolerance": 0.0}, r"error_tolerance = 0\.0: must be > 0"),
        ({"error_tolerance": 1e-3, "coupling": "jacobi"}, r"cannot be kept by 'jacobi'.* -> second\.pivot_x_force -> "),
    ],
)
def test_adapted_steps_that_cannot_be(component: FmuPaths, arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(SimulationError, match=words):
        _double(component).simulate(1.0, 0.1, **arguments)


@pytest.mark.parametrize("status", [2, 3])
def test_refused_steps_are_tried_again_shorter(fmu: FmuPaths, status: int) -> None:
    """After Discard and after Error an FMU may go on from a saved state."""
    result = wired(hasty=(fmu("Hasty"), {"longest": 0.1, "status": status})).simulate(1.0, 0.5, error_tolerance=1e-3)
    assert result.time[-1] == 1.0
    assert np.diff(result.time).max() <= 0.1


_NO_STEP = r"no step from t = 0 s is small enough: "


@pytest.mark.parametrize(
    ("status", "words"),
    [
        (2, _NO_STEP + r"hasty: fmi2DoStep from t = 0 s .* returned Discard: \S+ s are too long"),
        (3, _NO_STEP + r"hasty: fmi2DoStep from t = 0 s .* returned Error: \S+ s are too long"),
        (4, r"hasty: fmi2DoStep from t = 0 s to t = 0\.5 s returned Fatal: 0\.5 s are too long"),
    ],
)
def test_steps_that_are_refused_for_ever_end_with_the_words_of_the_last(
    fmu: FmuPaths, trace: Trace, status: int, words: str
) -> None:
    system = wired(hasty=(fmu("Hasty"), {"longest": 0.0, "status": status}))
    with pytest.raises(IncompleteError) as caught:
        system.simulate(1.0, 0.5, error_tolerance=1e-3)
    assert re.fullmatch(words, str(caught.value))
    assert 1 <= len([line for line in trace() if line.startswith("hasty step")]) <= 20


def test_step_in_which_an_input_leaves_its_domain_is_shortened(component: FmuPaths) -> None:
    """A parabola through l = 1.5 m cos 3t is below 0 after 0.8 s."""
    motion = {"offset": 1.0, "amplitude": 0.5, "angular_frequency": 3.0, "phase": math.pi / 2}
    system = _pumped(component, "Sinusoid", motion, input_reconstruction=1)
    with pytest.raises(
        IncompleteError, match=r"swing: fmi2DoStep from t = 0 s to t = 2 s returned Discard: length = -"
    ):
        system.simulate(4.0, 2.0, coupling="jacobi")
    assert system.simulate(4.0, 2.0, error_tolerance=1e-4).time[-1] == 4.0


def test_input_that_leaves_its_domain_for_good_ends_with_the_words_of_the_fmu(component: FmuPaths) -> None:
    with pytest.raises(IncompleteError) as caught:
        _pumped(component, "Ramp", SHRINKING).simulate(2.0, 0.3, error_tolerance=1e-2)
    assert re.fullmatch(
        r"no step from t = \S+ s is small enough: swing: fmi2DoStep [^;]* returned (Discard|Error): length = [^;]*; "
        "the step from t = [^;]* is taken back",
        str(caught.value),
    )
    assert caught.value.result.time[-1] == pytest.approx(1.0, abs=1e-4)


# ---- FMUs of other makes --------------------------------------------------------------------------------------------


def _ring(fmu: FmuPaths, spring: str) -> System:
    return wired("mass.q -> spring.length", mass=(fmu("Cart"), {"q_0": 1.0}), spring=fmu(spring))


def test_foreign_fmus_that_can_go_back_are_coupled_in_second_order(fmu: FmuPaths) -> None:
    def error(H: float) -> float:
        result = _ring(fmu, "Buffer").simulate(2.0, H)
        return float(np.max(np.abs(result["mass.q"] - np.cos(math.sqrt(2.0) * result.time))))

    sizes = (0.1, 0.05, 0.025)
    # the mean of both ends is held: the trapezoidal rule for the velocity
    assert slope(sizes, [error(H) for H in sizes]) == pytest.approx(2.0, abs=0.1)


def test_saved_states_are_given_back(fmu: FmuPaths, trace: Trace) -> None:
    _ring(fmu, "Buffer").simulate(0.5, 0.1)
    calls = trace()
    for name in ("mass", "spring"):
        assert calls.index(f"{name} forget") < calls.index(f"{name} free")


def test_fmu_that_cannot_go_back_is_named(fmu: FmuPaths, caplog: pytest.LogCaptureFixture) -> None:
    system = _ring(fmu, "Spring")
    with pytest.raises(SimulationError, match=r"'implicit' .* spring \(Spring\.fmu\) .* canGetAndSetFMUstate is false"):
        system.simulate(1.0, 0.1, coupling="implicit")
    with pytest.raises(SimulationError, match=r"error_tolerance .* spring \(Spring\.fmu\) cannot: its canGetAndSetFMU"):
        system.simulate(1.0, 0.1, error_tolerance=1e-3)
    caplog.clear()
    result = system.simulate(1.0, 0.1)  # by default it goes on as it can, and says so
    assert len(result.time) == 11
    assert "spring (Spring.fmu) cannot go back" in caplog.text
    assert [record.getMessage() for record in caplog.records if record.levelname == "WARNING"] == [*result.warnings]


def test_fmu_that_must_not_interpolate_by_itself_is_named(component: FmuPaths) -> None:
    system = _double(component, ("Pendulum", "python/Pendulum"), input_reconstruction=1)
    with pytest.raises(SimulationError, match=r"second: input_reconstruction=1 .* 'implicit'.* or set 2"):
        system.simulate(1.0, 0.1, coupling="implicit")


def test_input_without_source_and_without_start_value_is_named(fmu: FmuPaths) -> None:
    with pytest.raises(SimulationError, match=r"unfed\.u is an input without a start value and nothing feeds it"):
        wired(unfed=fmu("Unfed")).simulate(1.0, 0.1)


def test_half_connected_port_is_reported(component: FmuPaths, caplog: pytest.LogCaptureFixture) -> None:
    motor = component("Sinusoid"), {"offset": 1.0, "amplitude": 0.1}
    system = wired("motor.y_dot -> swing.length_dot", motor=motor, swing=component("Pendulum"))
    system.simulate(0.1, 0.1)
    assert "is fed, but" not in caplog.text  # a rate alone may be meant
    system.join([Connection(system.parts["motor"]["y"], system.parts["swing"]["length"])])
    system.simulate(0.1, 0.1)
    assert "swing.length is fed, but swing.length_ddot is not" in caplog.text


def test_failing_step_in_an_iteration_names_component_and_time(component: FmuPaths) -> None:
    words = r"swing: fmi2DoStep from t = 0\.9 s to t = 1 s returned Discard"
    with pytest.raises(IncompleteError, match=words) as caught:
        _pumped(component, "Ramp", SHRINKING).simulate(2.0, 0.1, coupling="implicit")
    assert caught.value.result.time[-1] == pytest.approx(0.9)


# ---- the parts ------------------------------------------------------------------------------------------------------


def test_polynomials_go_through_values_and_derivatives_at_both_ends() -> None:
    quintic, cubic = np.polynomial.Polynomial([1, 2, -3, 0.5, 0.7, -0.2]), np.polynomial.Polynomial([0.3, 1, 2, -1])
    H = 0.3

    def signals(t: float) -> list[float]:
        return [quintic(t), quintic.deriv()(t), quintic.deriv(2)(t), cubic(t), cubic.deriv()(t), 0.0]

    port = (0, 1, 2)
    curves = [Curve(port, 0, 1), Curve(port, 1, 2), Curve(port, 2, 5), Curve((3, 4), 0, 4)]
    _, table = polynomial_arrays(curves, 5, 5)
    data = np.array(signals(0.0) + signals(H))[table["signals"]] * H ** table["scaling"]
    found = np.sum(table["factors"] * data[table["term"]], axis=1) / H ** table["after"]
    sources = (quintic, quintic.deriv(), quintic.deriv(2), cubic)
    expected = [source.deriv(order)(0.0) for source in sources for order in range(1, 6)]
    assert_allclose(found, expected, rtol=0, atol=1e-15 * 360 * 5 / H**5)  # differences of 5, times 6!/2/H⁵


def test_algebraic_loop_is_found_and_told_in_order() -> None:
    feeds = {("b", "u"): ("a", "y"), ("a", "u"): ("b", "y"), ("c", "u"): ("b", "y")}
    loop = [("a", "y"), ("b", "u"), ("b", "y"), ("a", "u"), ("a", "y")]
    (found,) = shortest_algebraic_loops(feeds, lambda _output, _input: True)
    assert found == loop
    assert shortest_algebraic_loops(feeds, lambda output, _: output[0] == "b") == []


# ---- what inputs do within a step ------------------------------------------------------------------------------------


@pytest.mark.parametrize("discrete", [False, True])
def test_what_jumps_only_is_held_and_what_moves_is_its_mean(fmu: FmuPaths, tmp_path: Path, discrete: bool) -> None:
    """For an FMU that holds its inputs over a step: the mean of both ends, or what it is at the begin."""
    source = fmu("Wave")
    if discrete:
        source = described(source, tmp_path / "Wave.fmu", lambda data: data.replace(b'"continuous"', b'"discrete"'))
    system = wired("wave.y -> probe.u", wave=source, probe=fmu("Probe"))
    result = system.simulate(1.0, 0.25, coupling="implicit")
    begins, ends = result["wave.y"][:-1], result["wave.y"][1:]
    expected = begins if discrete else (begins + ends) / 2
    assert_allclose(result["probe.seen"][1:], expected, rtol=1e-15)
    assert coupling_errors(result).any() != discrete  # a sampled signal is what it is


@pytest.mark.parametrize("degree", range(6))
def test_the_slope_of_an_acceleration_is_that_of_the_quintic(degree: int) -> None:
    power = np.polynomial.Polynomial([0.0] * degree + [1.0])
    here, there = (np.array([power.deriv(k)(t) for k in range(3)]) for t in (1.5, 1.2))
    # Rounding of the values, 8 and less, over 0.3³, by factors up to 60.
    assert _jerk_at_end(here, there, 1.5 - 1.2) == pytest.approx(power.deriv(3)(1.5), abs=1e-10)


@pytest.mark.parametrize("count", _INTEGRALS)
def test_what_data_at_the_end_of_a_step_do_is_that_of_hermite_polynomial_arrays(count: int) -> None:
    """Newton's matrix: ∫ (1 - t) h and ∫ h over the step, of h whose value, or rate, at the end is 1."""
    for power, found in enumerate(_INTEGRALS[count]):
        end = [float(k == power) for k in range(count)]
        h = PPoly.from_bernstein_basis(BPoly.from_derivatives([0, 1], [[0.0] * count, end]))
        once, twice = h.antiderivative(), h.antiderivative(2)
        assert_allclose(found, [twice(1), once(1)], rtol=1e-14)


def test_what_does_not_converge_is_named_by_the_worst_of_it() -> None:
    signals = SimpleNamespace(count=3, references=[("a", "x"), ("b", "y"), ("b", "z")])
    bus = SimpleNamespace(end=SimpleNamespace(value=0.5))
    unknowns = np.array([0, 1, 5])
    cycle = SimpleNamespace(_unknowns=unknowns, _signals=signals, _names="a, b", _implicit=False, _bus=bus, nodes=[])
    for errors, worst in (([9.0, 1.0, 2.0], r"a\.x"), ([1.0, 9.0, 2.0], r"b\.y"), ([1.0, 2.0, 9.0], r"b\.z")):
        cycle._errors = np.array(errors)
        with pytest.raises(SimulationError, match=rf"^a, b: .* at t = 0\.5 s, {worst} least of all"):
            StrongComponent._raise_divergence(cast("StrongComponent", cycle))


@pytest.mark.parametrize("tolerance", [1e-4, 1e-5])
def test_adapted_steps_keep_the_tolerance_in_explicit_coupling(fmu: FmuPaths, tolerance: float) -> None:
    """A mass of 1 kg on a spring of 2 N/m."""
    result = _ring(fmu, "Buffer").simulate(2.0, 0.1, error_tolerance=tolerance, coupling="gauss-seidel")
    error = np.max(np.abs(result["mass.q"] - np.cos(math.sqrt(2.0) * result.time)))
    assert error <= tolerance * len(result.time)  # a tolerance a step


def test_a_foreign_source_without_acceleration(component: FmuPaths, tmp_path: Path) -> None:
    """The FMU derives the acceleration, and books the work along the polynomials that it is given: 0.056 J without."""
    own = {b"input_reconstruction": b"held", b"x_dot": b"v", b"x_ddot": b"a"}

    def foreign(name: str, data: bytes) -> tuple[str, bytes]:
        for old, new in own.items() if name == "modelDescription.xml" else ():
            data = data.replace(b'"%s"' % old, b'"%s"' % new)
        return name.replace("terminalsAndIcons", "unknown"), data

    starts = {"x_0": 0.3, "stiffness": 30.0}
    links = ("cart.x -> pendulum.pivot_x", "cart.v -> pendulum.pivot_x_dot", "pendulum.pivot_x_force -> cart.x_load")
    cart, pendulum = rewritten(component("Oscillator"), tmp_path / "Cart.fmu", foreign), component("Pendulum")
    result = wired(*links, cart=(cart, starts), pendulum=pendulum).simulate(
        stop_time=2, step_size=0.005, coupling="implicit"
    )
    whole = wired("cart.x -> pendulum.pivot_x", cart=(component("Oscillator"), starts), pendulum=pendulum)
    expected = whole.simulate(stop_time=2, step_size=0.005)
    assert any("pivot_x_ddot stays 0 while pivot_x_dot changes" in text for text in result.warnings)
    assert np.abs(result["pendulum.energy_balance"]).max() <= 1e-7  # energies of 10 J, 400 steps of 1e-8 at most
    late = slice(len(result.time) // 10, None)
    force = "pendulum.pivot_x_force"
    # Of the three steps before it is derived 0.15 m/s2 for 15 ms remains, and is coupled back.
    assert_allclose(result[force][late], expected[force][late], rtol=0, atol=0.05)
    assert np.abs(expected[force]).max() > 3
