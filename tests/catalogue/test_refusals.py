"""What components refuse: values outside of their domains, singular starts, and what no closed form covers."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from on_paper import BACKENDS

from liaisons.cosim import simulate
from liaisons.errors import ComponentError, SimulationError, ValidityError
from liaisons.language import Component
from liaisons.mechanics import assemble
from liaisons.models import (
    CATALOGUE,
    CartesianPendulum,
    ChargedParticle,
    CircularHoop,
    Constant,
    DoublePendulum,
    DrivenChain,
    EllipticHoop,
    FourierHoop,
    FourierSeries,
    IsokineticOscillator,
    KeplerOrbit,
    LinearMolecule,
    Oscillator,
    OscillatorChain,
    Pendulum,
    PendulumChain,
    PlannedMotion,
    PolarOscillator,
    Ramp,
    Satellite,
    Sinusoid,
    SpatialCat,
    Swing,
    four_bars,
)

UNBOUNDED = (Constant, FourierSeries, PlannedMotion, Ramp, Sinusoid)


def outside(component: type[Component]) -> dict[str, tuple[float, str]]:
    """By name of a settable variable with a domain: a value outside of it, and what is said of it."""
    model = assemble(component)
    bounded = [v for v in (*model.parameters, *model.inputs) if v.minimum is not None and v.dimension is None]
    found = {
        v.name: (v.minimum if v.strict else v.minimum - 0.1, re.escape(f"must be {v.domain()}"))
        for v in bounded
        if v.minimum is not None
    }
    assert bool(found) == (component not in UNBOUNDED)
    assert {v.minimum for v in bounded} <= {0}  # masses, lengths, rates of loss
    return found


@pytest.mark.parametrize(
    ("component", "backend"),
    # Contacts and samples are native only.
    [(c, b) for c in CATALOGUE for b in BACKENDS if b == "native" or not (c.contact_names() or c.is_sampled())],
)
@pytest.mark.variants(core="Pendulum-native")
def test_fmu_names_what_lies_outside_of_its_domain(component, fmu, backend: str) -> None:
    for name, (value, words) in outside(component).items():
        with pytest.raises(SimulationError, match=f"{name} = {value:g} at t = 0: it {words}"):
            simulate(fmu(component, backend), stop_time=0.1, **{name: value})  # type: ignore[arg-type]


FORMS = [  # a closed form of each component, called with what it cannot do without
    *((c, "exact", {}) for c in CATALOGUE if hasattr(c, "exact") and c is not SpatialCat),
    (SpatialCat, "exact", {"azimuth": 0.0}),
    *((c, "small_angles", {}) for c in (DoublePendulum, PendulumChain)),
]


@pytest.mark.parametrize(("component", "form", "more"), FORMS)
def test_closed_form_names_what_lies_outside_of_its_domain(component, form: str, more: dict[str, float]) -> None:
    for name, (value, words) in outside(component).items():
        with pytest.raises(ValidityError, match=f"{component.__name__}.*{name} = {value} {words}"):
            getattr(component, form)(1.0, **more, **{name: value})


SINGULAR: dict[type[Component], list[tuple[dict[str, float], str]]] = {
    CartesianPendulum: [
        ({"rod": 1.5}, r"rod \(distance from the pivot to the bob\) must be kept to 1e-06 m; .* \(-0\.5\)"),
        ({"y_0": 0.1}, r"plane \(distance from the plane of the motion\) must be kept to 1e-06 m; .* \(-0\.1\)"),
        ({"y_dot_0": 0.2}, r"the rate of plane .* must be kept to 1e-06 m/s; .* \(-0\.2\)"),
        (  # sin 0.1 - 0.5 cos 0.1
            {"x_dot_0": 1.0, "z_dot_0": 0.5},
            r"the rate of rod .* must be kept .* \(-0\.398\); given are x_dot_0 = 1, z_dot_0 = 0\.5",
        ),
    ],
    EllipticHoop: [({"centre_x": 1.5, "centre_y": 0.8}, "O must lie inside the hoop")],
    FourierHoop: [
        ({"cos_1": 1.0}, "r must be > 0"),
        ({"cos_2": 0.6, "sin_3": -0.6}, "r must be > 0"),
        ({"sin_4": 1.01}, "r must be > 0"),
    ],
    KeplerOrbit: [
        ({"x_0": 0.0}, "r must stay > 0"),
        ({"y_dot_0": 0.0}, "r must stay > 0.* at t = 1.1107"),  # a fall from 1 m: π/√8 seconds
    ],
    PolarOscillator: [({"phi_dot_0": 0.0}, r"r must stay > 0 m; at t = 1\.5[78]")],  # a quarter period, π/2
    Satellite: [
        ({"J_xy": 12.0}, "J must be positive definite; at t = 0"),
        ({"J_wheel": 9.0, "J_zz": 8.5}, "J must be positive definite without the wheels: J - J_wheel; at t = 0"),
        ({"J_zz": 23.0}, r"each principal moment of J .* \(triangle inequality\); at t = 0"),
        ({"q_w_0": 0.9}, "q_w, q_x, q_y, q_z must be a unit quaternion, to 1e-06; at t = 0"),
        ({"q_w_0": 0.0}, "q_w, q_x, q_y, q_z must be a unit quaternion"),
    ],
    SpatialCat: [({"q_x_0": 0.1}, "q_w, q_x, q_y, q_z must be a unit quaternion, to 1e-06")],
    IsokineticOscillator: [
        ({"x_dot_0": 1.1}, r"kinetic \(kinetic energy less .*\) must be kept to 1e-06 J; .* \(-0\.105\)"),
        ({"thermal_energy": 2.0}, r"kinetic .* must be kept to 1e-06 J; .* \(-1\.5\)"),
    ],
}


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("component", SINGULAR)
def test_fmu_names_the_start_that_contradicts_itself_or_is_singular(component, fmu, backend: str) -> None:
    for start, words in SINGULAR[component]:
        with pytest.raises(SimulationError, match=words):
            simulate(fmu(component, backend), stop_time=2.0, step_size=0.01, **start)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: Pendulum.exact(1.0, friction=0.1), "friction = 0.1 must be == 0; it is the motion with fixed pivot"),
        (lambda: Pendulum.exact(1.0, mass=np.nan), "mass = nan must be > 0"),
        (lambda: Pendulum.period(gravity=-9.81), "gravity = -9.81 must be > 0"),
        (lambda: Pendulum.small_angle(1.0, friction=-0.1), "friction = -0.1 must be >= 0"),
        (lambda: Pendulum.lengthening([0.0, 10.0], length_dot=-0.1), "the length falls to 0.0 m"),
        (lambda: Pendulum.lengthening(1.0, length_dot=0.0), "length_dot = 0.0 must be != 0"),
        (lambda: Pendulum.crouch_growth(length_low=1.0, length_high=0.0), "length_high = 0.0 must be > 0"),
        (lambda: Oscillator.exact([1.0, -1.0]), "t = -1.0 must be >= 0"),
        (lambda: Oscillator.exact(1.0, driven="x"), "driven = 'x'; use 'support' or 'x_force'"),
        (lambda: Oscillator.response(1.0), "no stationary motion at the undamped resonance"),
        (lambda: Oscillator.resonance(damping=1.5), "damping = 1.5 must be < 1.41421"),
        (lambda: Swing.exact(1.0, rope=1.0, torso_length=2.0, lean=np.pi), "centre of mass lies on the pivot"),
        (lambda: CircularHoop.exact(1.0, offset=1.0), "offset = 1.0 must be < radius"),
        (lambda: OscillatorChain.exact(-1.0, u_0=[1.0, 0.0]), "t = -1"),
        (lambda: DrivenChain.exact(1.0, n=1), "DrivenChain: n = 1"),
        (lambda: PendulumChain.small_angles(1.0, theta_0=[0.1, 0.1], gravity=0.0), "gravity = 0"),
        (lambda: DoublePendulum.normal_modes(mass_2=0.0), "mass_2 = 0.0 must be > 0"),
        (lambda: DoublePendulum.small_angles(1.0, gravity=-1.0), "gravity = -1.0 must be > 0"),
        (lambda: DoublePendulum.small_angles(-1.0), "t = -1.0 must be >= 0"),
        (lambda: EllipticHoop.exact([1.0, -1.0]), "t = -1.0 must be >= 0"),
        (lambda: FourierHoop.exact(1.0, cos_1=1.5), "the least r = .* must be > 0"),
        (lambda: FourierHoop.exact(1.0, cos_1=0.3, beta_dot=2.0, theta_dot_0=0.1), "the bead turns back"),
        (lambda: FourierHoop.exact(-1.0), "t = -1.0 must be >= 0"),
        (lambda: LinearMolecule.exact(-1.0), "t = -1.0 must be >= 0"),
        (lambda: LinearMolecule.modes(mass_outer=-1.0), "mass_outer = -1.0 must be > 0"),
        (lambda: ChargedParticle.drift(B_z=0.0, E_x=1.0), "without a magnetic field nothing drifts"),
        (lambda: KeplerOrbit.exact(1.0, y_dot_0=0.0), "angular momentum 0"),
        (lambda: KeplerOrbit.period(x_0=0.0), "r_0 = 0.0 must be > 0"),
        (lambda: PolarOscillator.exact(1.0, phi_dot_0=0.0), "phi_dot_0 = 0.0 must be != 0; it is .* not through r = 0"),
        (lambda: Satellite.exact(1.0, J_xy=12.0), "Satellite.exact: J = .* must be positive definite"),
        (lambda: Satellite.exact(1.0, J_x=12.0), "Satellite.exact: nothing is called 'J_x'; did you mean"),
        (lambda: Satellite.exact(1.0, omega_x_0=1.0, omega_y_0=1e-9), "about the middle axis"),
        (lambda: Satellite.slew(1.0, J_wheel=0.0), "J_wheel = 0.0 must be > 0"),
        (lambda: SpatialCat.turn(0.3, inertia_axial=0.0), "inertia_axial = 0.0 must be > 0"),
        (lambda: IsokineticOscillator.exact(1.0, x_dot_0=2.0), r"the start velocity 2.44948974 m/s must be 1.73205081"),
        (lambda: IsokineticOscillator.exact(1.0, x_0=3**0.5, x_dot_0=0, y_dot_0=2**0.5), "circle of radius 1.73205 m"),
        (lambda: IsokineticOscillator.exact(1.0, x_0=1e-3), "r falls to 0.000"),
        (lambda: IsokineticOscillator.turning_points(position=[1, 1, 1], velocity=[1, 1, 1]), "does not turn"),
        (lambda: four_bars(2).exact(1.0, length=0.0), r"length = 0\.0 must be > 0"),
    ],
)
def test_closed_form_names_what_it_does_not_cover(call: Callable[[], Any], words: str) -> None:
    with pytest.raises(ValidityError, match=words):
        call()


def test_a_row_of_no_windows_is_refused() -> None:
    with pytest.raises(ComponentError, match=r"windows = 0: it must be >= 1"):
        four_bars(0)
