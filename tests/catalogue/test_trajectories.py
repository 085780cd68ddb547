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
from on_paper import EXTRAPOLATE, HOLD, INTERPOLATE, Values, run, wave

from liaisons.check import max_error, slope
from liaisons.cosim import simulate
from liaisons.language import Mechanism
from liaisons.models import (
    CartesianPendulum,
    CircularHoop,
    DoublePendulum,
    EllipticHoop,
    Flywheel,
    FourierHoop,
    IsokineticOscillator,
    KeplerOrbit,
    Oscillator,
    Pendulum,
    Satellite,
    Swing,
)

ORDERS: dict[type[Mechanism], tuple[Values, Values, Values, tuple[float, float]]] = {
    # start of the FMU, of the closed form, span, and the exponent: nearly in proportion to the tolerance, or better
    CartesianPendulum: (
        {"x_0": np.sin(2.5), "z_0": 1 - np.cos(2.5)},
        {"theta_0": 2.5},
        {"stop_time": 20.0, "step_size": 1.0},
        (0.6, 1.2),
    ),
    Pendulum: (
        (swing := {"theta_0": 2.5}),
        swing,
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
