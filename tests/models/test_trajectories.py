"""The FMUs of the catalogue against closed forms and high-order references.

Tolerances: an error-controlled solver at relative tolerance ε leaves an error of some ten times ε · κ, where κ is the
largest amplification of a disturbance over the run.  In libration, rotation and forced oscillation κ grows in
proportion to time (a phase error), to some hundreds over 100 s.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from on_paper import EXTRAPOLATE, HOLD, INTERPOLATE, Values, assert_follows, breathing_pendulum, operated, run, wave

from liaisons.check import max_error, slope
from liaisons.cosim import Result, simulate
from liaisons.language import Mechanism
from liaisons.models import (
    CartesianPendulum,
    ChargedParticle,
    CircularHoop,
    DoublePendulum,
    EllipticHoop,
    Flywheel,
    FourierHoop,
    FreeParticle,
    IsokineticOscillator,
    KeplerOrbit,
    LinearMolecule,
    Oscillator,
    Pendulum,
    PlanarCat,
    Ramp,
    Satellite,
    Sinusoid,
    Swing,
)

TIGHT = 1e-13  # a solver tolerance near the rounding level of doubles


REGIMES = {"under-damped": 0.3, "critical": 4.0, "over-damped": 10.0}  # ω_0 = 2

RUNS: dict[str, tuple[type[Mechanism], Values, Values, float]] = {
    # what follows its closed form: start, span, and the error that is allowed, relative to numbers above 1
    **{
        f"oscillator, {name}": (
            Oscillator,
            {"x_0": 1.0, "x_dot_0": -0.5, "stiffness": 4.0, "damping": damping},
            {"stop_time": 30.0},
            1e-8,  # κ = 1, a hundred tolerances
        )
        for name, damping in REGIMES.items()
    },
    "flywheel": (
        Flywheel,
        {"angle_dot_0": 3.0, "friction": 0.2, "inertia": 2.0, "angle_force": 0.7},
        {"stop_time": 30.0},
        2e-10,  # κ = 1, angles of up to 50
    ),
    **{
        f"swing, {name}": (
            Swing,
            {"theta_0": 1.2, "theta_dot_0": rate, "lean": 0.7, "mass_torso": 30.0},
            {"stop_time": 50.0},
            allowed,
        )
        # as the pendulum's; angles of 300 rad
        for name, rate, allowed in (("to and fro", 0.5, 1e-7), ("going round", 6.0, 1e-9))
    },
    **{
        f"throw, friction {friction}": (
            FreeParticle,
            {"x_0": 1.0, "z_0": 10.0, "x_dot_0": 3.0, "y_dot_0": -1.0, "z_dot_0": 5.0, "friction": friction},
            {"stop_time": 10.0},
            2.5e-11 if friction == 0 else 1e-10,  # κ = 1, lengths of 400 m
        )
        for friction in (0.0, 0.3)
    },
    "charge, K Fig. 3": (ChargedParticle, {"x_dot_0": 1.0, "z_dot_0": 0.1}, {"stop_time": 50.0}, 1e-8),  # linear: κ = 1
    "charge, oblique fields": (
        ChargedParticle,
        {"x_dot_0": 1.0, "x_0": 2.0, "B_x": 0.3, "B_y": -0.8, "B_z": 0.5, "E_x": 0.2, "E_y": 0.1, "E_z": -0.4}
        | {"charge": -1.3, "mass": 0.7},
        {"stop_time": 50.0},
        1e-8,
    ),
    "charge, no magnetic field": (ChargedParticle, {"x_dot_0": 1.0, "B_z": 0.0, "E_y": 0.5}, {"stop_time": 50.0}, 1e-8),
    **{
        f"molecule {i}": (
            LinearMolecule,
            {"x_1_0": -0.02, "x_2_0": 0.13, "x_3_0": 0.21, "x_1_dot_0": 0.01, "x_3_dot_0": -0.02} | other,
            {"stop_time": 200.0, "step_size": 1.0},
            1e-8,  # κ = 1 and a drift; hundred periods of 1e-10 each at a size of 0.1 m
        )
        for i, other in enumerate(
            ({}, {"mass_outer": 1.0, "mass_inner": 1.0, "stiffness": 2.0, "spacing": 0.5}),
        )
    },
    "cat with its limbs held": (
        PlanarCat,
        {
            "com_x_0": 1.0,
            "com_x_dot_0": -0.5,
            "com_z_0": 3.0,
            "phi_0": 0.2,
            "phi_dot_0": 1.5,
            "psi_1": 0.7,
            "psi_2": -0.4,
        },
        {"stop_time": 10.0},
        1e-12,  # polynomials: roundings
    ),
}


@pytest.mark.parametrize("name", RUNS)
def test_fmu_follows_its_closed_form(fmu, name: str) -> None:
    component, start, span, allowed = RUNS[name]
    result = run(fmu(component), **({"step_size": 0.5} | span), **start)
    given = {k: v for k, v in start.items() if not k.startswith("psi")}  # where the limbs are does not matter
    exact: Values = component.exact(result.time, **given)  # type: ignore[attr-defined]
    for signal, values in exact.items():
        assert max_error(result[signal], values) <= allowed * max(1.0, float(np.max(np.abs(values)))), signal


ORDERS: dict[type[Mechanism], tuple[Values, Values, Values, tuple[float, float]]] = {
    # start of the FMU, of the closed form, span, and the exponent: nearly in proportion to the tolerance, or better
    CartesianPendulum: (
        {"x_0": np.sin(2.5), "z_0": 1 - np.cos(2.5)},
        {"theta_0": 2.5},
        {"stop_time": 20.0, "step_size": 1.0},
        (0.6, 1.2),
    ),
    KeplerOrbit: (
        (orbit := {"x_0": 0.3, "y_0": -1.1, "x_dot_0": 0.7, "y_dot_0": 0.2, "mu": 1.3}),
        orbit,
        {"stop_time": 50.0, "step_size": 1.0},
        (0.7, 1.3),
    ),
    Satellite: (
        (top := {"omega_x_0": 0.2, "omega_y_0": 0.3, "omega_z_0": 1.0}),
        top,
        {"stop_time": 60.0, "step_size": 20.0},
        (0.6, 2.0),
    ),
    IsokineticOscillator: ({}, {}, {"stop_time": 20.0, "step_size": 1.0}, (0.6, 2.0)),
}


TOLERANCES = np.array([1e-6, 1e-8, 1e-10, 1e-12])


def motion_errors(file: Path, component: Any, start: Values, given: Values, tolerances: Any, **span: Any) -> NDArray:
    """Largest error of the coordinate and its rate, which a closed form of motion gives first, by tolerance."""
    found = []
    for tolerance in tolerances:
        result = simulate(file, tolerance=tolerance, **span, **start)
        exact = component.exact(result.time, **given)
        found.append(max(max_error(result[name], exact[name]) for name in list(exact)[:2]))
    return np.array(found)


@pytest.mark.parametrize("component", ORDERS)
def test_error_falls_with_the_tolerance(component, fmu) -> None:
    start, given, span, (least, most) = ORDERS[component]
    found = motion_errors(fmu(component), component, start, given, TOLERANCES, **span)
    assert component is KeplerOrbit or np.all(found <= 100 * TOLERANCES)  # κ = 100
    assert least <= slope(TOLERANCES, found) <= most


# ---- pendulum ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "start", [{"theta_0": 2.5, "theta_dot_0": 0.0}, {"theta_0": 0.0, "theta_dot_0": 7.5}], ids=["libration", "rotation"]
)
@pytest.mark.parametrize("step_size", [1.0, 0.1, 0.01])
def test_pendulum_is_jacobis_over_100_seconds_in_proportion_to_the_tolerance(fmu, start: Values, step_size) -> None:
    tolerances = [*TOLERANCES, TIGHT]
    found = motion_errors(fmu(Pendulum), Pendulum, start, start, tolerances, stop_time=100, step_size=step_size)
    assert found[2] <= 1e-7
    assert found[4] <= 1e-9
    # κ = 500: the phase error of each second counts for all that follow, times Ω².
    assert np.all(found[:4] <= 1000 * TOLERANCES)
    if step_size == 1.0:  # shorter ones cut the solver's own steps and make it better than it was asked to be
        assert 0.8 <= slope(TOLERANCES, found[:4]) <= 1.2


@pytest.mark.parametrize("excess", [-1e-6, 1e-6])
def test_pendulum_near_the_separatrix_keeps_energy_and_follows_as_far_as_amplification_allows(fmu, excess) -> None:
    """Energy 2 m g l (1 + excess): the bob climbs to within a thousandth of the top, and stays there for seconds."""
    start: Values = {"theta_0": 0.0, "theta_dot_0": 2 * np.sqrt(9.81 * (1 + excess))}
    tolerance = 1e-12
    result = run(fmu(Pendulum), tolerance=tolerance, **start)
    assert max_error(result["energy"], result["energy"][0]) <= 1e-9
    assert max_error(result["energy_balance"], 0.0) <= 1e-9
    exact = Pendulum.exact(result.time, **start)
    # κ(t): what a relative disturbance of the start becomes, from the closed form itself.
    relative = 1e-9
    disturbed = Pendulum.exact(result.time, **(start | {"theta_dot_0": start["theta_dot_0"] * (1 + relative)}))
    amplification = np.maximum.accumulate(np.maximum(1, np.abs(disturbed["theta"] - exact["theta"]) / relative))
    assert amplification[-1] > 1e5  # the case deserves its name
    assert np.all(np.abs(result["theta"] - exact["theta"]) <= tolerance * amplification)


# ---- oscillator, flywheel, swing, hoop ---------------------------------------------------------------------------


@pytest.mark.parametrize("damping", REGIMES.values(), ids=REGIMES)
def test_oscillator_driven_by_a_sinusoid_through_its_support(fmu, damping: float) -> None:
    start: Values = {"x_0": 1.0, "x_dot_0": -0.5, "stiffness": 4.0, "damping": damping, "mass": 1.0}
    drive: Values = {"amplitude": 0.4, "angular_frequency": 1.7, "phase": 0.3}
    system = operated(
        fmu, Oscillator, "support", Sinusoid, start | {"input_reconstruction": INTERPOLATE}, offset=0.2, **drive
    )
    result = system.simulate(stop_time=30.0, step_size=0.1, tolerance=1e-10)
    exact = Oscillator.exact(result.time, support=0.2, **start, **drive)
    # Hermite's quintic is off by (ωH)⁶/46080 · amplitude = 2e-10 inside a step; a hundred tolerances for the rest.
    assert_follows(result, exact, 1e-8, "it.", ("x", "x_dot"))


# ---- energy balance, with moving operators -----------------------------------------------------------------------


MOVING: dict[type[Mechanism], tuple[Values, dict[str, Any]]] = {
    Pendulum: (
        {"theta_0": 1.0, "friction": 0.1, "theta_force": 0.3},
        {"length": wave(1.0, 0.1, 2.0), "pivot_x": wave(0.0, 0.2, 1.3), "pivot_z": wave(0.1, 0.1, 3.0)},
    ),
    Oscillator: ({"x_0": 1.0, "damping": 0.2}, {"support": wave(0.1, 0.3, 1.7)}),
    Flywheel: ({"angle_dot_0": 1.0, "friction": 0.2, "angle_load": 0.1}, {}),
    Swing: ({"theta_0": 0.5}, {"rope": wave(2.0, 0.1, 4.0), "lean": wave(1.5, 0.4, 4.0)}),
    CircularHoop: ({"xi_0": 1.0, "xi_dot_0": 0.5}, {"beta": wave(0.0, 1.0, 1.5)}),
    EllipticHoop: ({"u_0": 1.0, "u_dot_0": 0.5}, {"beta": wave(0.0, 1.0, 1.5)}),
    FourierHoop: (
        {"theta_0": 1.0, "theta_dot_0": 0.5, "cos_1": 0.2, "sin_2": -0.1, "cos_3": 0.05, "cos_4": 0.1, "sin_4": 0.1}
        | {"radius": 1.3},
        {"beta": wave(0.0, 1.0, 1.5)},
    ),
    DoublePendulum: (
        {"theta_1_0": 1.0, "theta_2_0": -0.5, "theta_1_force": 0.3},
        {"pivot_x": wave(0.0, 0.2, 1.3), "pivot_z": wave(0.1, 0.1, 3.0)},
    ),
}


@pytest.mark.parametrize("reconstruction", [HOLD, EXTRAPOLATE, INTERPOLATE], ids=["hold", "extrapolate", "interpolate"])
@pytest.mark.parametrize("component", MOVING)
def test_energy_balance_closes_while_operators_work(fmu, component, reconstruction: int) -> None:
    """Whatever σ does between communication points, jumps included, the work is booked for that σ."""
    start, inputs = MOVING[component]
    if reconstruction == HOLD:  # a σ that is held has no rate: the energy law asks for consistent triples
        inputs = {name: lambda t, motion=motion: (motion(t)[0], 0.0, 0.0) for name, motion in inputs.items()}
    settings: Values = {"inputs": inputs, "input_reconstruction": reconstruction}
    result = run(fmu(component), step_size=0.05, tolerance=1e-9, **settings, **start)
    flow = np.max(np.abs(result["work"])) + np.max(np.abs(result["dissipated"]))
    scale = flow + np.max(np.abs(result["kinetic_energy"])) + np.max(np.abs(result["potential_energy"]))
    assert max_error(result["energy_balance"], 0.0) <= 10 * 1e-9 * scale * 20.0
    if inputs and reconstruction != HOLD:  # a hoop that is only shifted feels nothing
        assert np.ptp(result["energy"]) > 1e-3 * scale  # work was done


# ---- what an operator's motion becomes between communication points ----------------------------------------------


def test_interpolation_is_of_sixth_order(fmu) -> None:
    steps = [0.5, 0.4, 0.25, 0.2, 0.1]
    found = []
    for step_size in steps:
        inputs = {"length": wave(1.0, 0.1, 2.0)}
        # g is exact in binary and decimal
        settings: Values = {"stop_time": 10.0, "step_size": step_size, "inputs": inputs, "gravity": 9.8125}
        result = run(fmu(Pendulum), tolerance=TIGHT, theta_0=1.0, **settings)
        theta, p = breathing_pendulum(result.time)
        found.append(max(max_error(result["theta"], theta), max_error(result["p_theta"], p)))
    assert found[-1] <= 1e-9
    assert slope(steps, found, floor=1e-12) >= 5.5  # floor: TIGHT times an amplification of ten


def jumped(
    fmu, port: str, start: Values, stop_time: float, tolerance: float, **ramp: float
) -> tuple[Result, int, Values]:
    """A Ramp that is switched on at 1 s leaves p_θ as it is; the run, the place of the jump, and the motion before."""
    system = operated(fmu, Pendulum, port, Ramp, start, start_time=1.0, **ramp)
    result = system.simulate(stop_time=stop_time, step_size=0.25, tolerance=tolerance)
    still = simulate(fmu(Pendulum), stop_time=1.0, step_size=0.25, tolerance=tolerance, **start)
    jump = int(np.searchsorted(result.time, 1.0))
    assert result["it.p_theta"][jump] == pytest.approx(still["p_theta"][-1], rel=1e-15)  # one rounding
    return result, jump, {name: float(value) for name, value in Pendulum.exact(1.0, **start).items()}


def test_jump_of_the_pivots_speed_leaves_the_momentum_and_gives_the_right_motion(fmu) -> None:
    """θ' jumps by -v cos θ / l; then a pendulum in a moving frame."""
    v = 0.7
    start: Values = {"theta_0": 1.0, "theta_dot_0": 0.5}
    result, jump, before = jumped(fmu, "pivot_x", start, 20.0, 1e-10, offset=0.0, rate=v)
    assert result["it.pivot_x_dot"][jump - 1 : jump + 1].tolist() == [0.0, v]
    rate = before["theta_dot"] - v * np.cos(before["theta"])
    exact = Pendulum.exact(result.time[jump:] - 1.0, theta_0=before["theta"], theta_dot_0=rate)
    for name in ("theta", "theta_dot"):
        assert max_error(result[f"it.{name}"][jump:], exact[name]) <= 1e-8  # κ of ten, ten tolerances
    assert max_error(result["it.energy_balance"], 0.0) <= 10 * 1e-10 * 20 * 20.0  # 20 J over 20 s


def test_jump_of_the_lengths_rate_leaves_the_momentum_and_gives_bessel_functions(fmu) -> None:
    start: Values = {"theta_0": 1e-4, "theta_dot_0": 2e-4}
    result, jump, before = jumped(fmu, "length", start, 10.0, 1e-12, offset=1.0, rate=0.3)
    exact = Pendulum.lengthening(
        result.time[jump:] - 1.0, theta_0=before["theta"], theta_dot_0=before["theta_dot"], length_dot=0.3
    )
    # sin θ = θ is wrong by θ³/6 = 2e-13, for ten seconds at Ω² = 10 /s²; the absolute tolerance is no larger.
    assert max_error(result["it.theta"][jump:], exact["theta"]) <= 2e-11
