"""What cannot be meant is refused by name."""

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest

from liaisons import analysis
from liaisons.errors import ComponentError
from liaisons.language import ActiveCoordinate, Mechanism, Parameter
from liaisons.models import (
    BouncingBall,
    CartesianPendulum,
    ChargedParticle,
    CircularHoop,
    DryOscillator,
    FreeParticle,
    IsokineticOscillator,
    KeplerOrbit,
    LinearMolecule,
    NoseHooverOscillator,
    Oscillator,
    OscillatorChain,
    Pendulum,
    PlanarCat,
    Regulator,
    Satellite,
    SpatialCat,
    StringPendulum,
)


class Table(Mechanism):
    """A table that is prescribed."""

    mass = Parameter(2.0, "kg", "mass", above=0)
    height = ActiveCoordinate("m", "height")

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.height) ** 2


T = np.linspace(0.0, 1.0, 5)
PATH = {"x": T, "x_dot": 0 * T + 1}
NAME: Any = "Pendulum"
CHAIN: Any = OscillatorChain
OPERATOR: Any = Regulator
NUMBERS: Any = [1.0, 2.0]
STRANGE = ca.SX.sym("stranger")


def joined(periods: float) -> Any:
    """The path of an oscillator between ends that are so many half periods apart."""
    t = np.linspace(0, periods * np.pi / 2, 41)
    return analysis.stationary_path(
        Oscillator, t, {"x": 1 - t / t[-1], "x_dot": 0 * t - 1 / t[-1]}, mass=0.5, stiffness=2.0
    )


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: analysis.equilibrium(NAME), r"^'Pendulum' is no mechanism; give its class, or derive\('Pendulum'\)$"),
        (lambda: analysis.dynamic_field(KeplerOrbit), "KeplerOrbit: it has no active coordinate"),
        (
            lambda: analysis.active_energy(CartesianPendulum),
            "CartesianPendulum: the geometry of active constraints needs independent",
        ),
        (lambda: analysis.curvature(CircularHoop), "CircularHoop: a curvature needs two active coordinates; it has 1"),
        (
            lambda: analysis.holonomy(PlanarCat, lambda a: {"psi_1": a}),
            r"the loop is open: psi_1 at a = 2π and a = 0 differ by 6\.28",
        ),
        (lambda: analysis.holonomy(PlanarCat, lambda a: {"phi": a}), "a loop moves active coordinates, not 'phi'"),
        (
            lambda: analysis.curvature_integral(Satellite, lambda a: {"wheel_1": ca.cos(a)}),
            "Satellite: a curvature that adds up needs coordinates; describe",
        ),
        (lambda: analysis.normal_modes(Satellite), "Satellite: an equilibrium needs coordinates; describe the mech"),
        (lambda: analysis.action(Satellite, T, {}), "Satellite: the action needs coordinates; describe the mechanism"),
        (lambda: analysis.action(Oscillator, T, PATH, PATH), "the variation must vanish at both ends"),
        (lambda: analysis.action(Oscillator, T, {"x": T}), "Oscillator: the path lacks x_dot"),
        (lambda: analysis.action(Oscillator, T, PATH | {"y": T}), "no coordinate of a path is 'y'; known: support, x"),
        (lambda: analysis.action(Oscillator, T, PATH | {"x": T[:4]}), r"5 instants for samples of shape \(4,\)"),
        (lambda: analysis.action(Oscillator, T, PATH | {"x": T * np.nan}), "x must be finite at all instants"),
        *((lambda k=k: joined(k), "Oscillator: the ends are conjugate points: no path .*ω T = k π") for k in (1, 2, 3)),
        (lambda: analysis.hamiltonian(CartesianPendulum), r"CartesianPendulum: a Hamiltonian needs .* plane, rod"),
        (lambda: analysis.flow(CartesianPendulum, 1.0), "CartesianPendulum: phase space needs independent coordinates"),
        (
            lambda: analysis.poisson_bracket(analysis.hamiltonian(Oscillator), analysis.hamiltonian(KeplerOrbit)),
            "Oscillator and KeplerOrbit share no phase space",
        ),
        (lambda: analysis.flow(Oscillator, 0), "duration = 0 must be finite and > 0"),
        (lambda: analysis.flow(Oscillator, 1.0, x=lambda t: t), "only an active coordinate can be .* time, not 'x'"),
        (lambda: analysis.observable(Oscillator, lambda m: m.x * STRANGE), "contains the unknown symbol 'stranger'"),
        (
            lambda: analysis.noether(KeplerOrbit, lambda _: {"x": 1}),
            "KeplerOrbit: the field x: 1 is no symmetry: it changes L by .* of its",
        ),
        (
            lambda: analysis.noether(ChargedParticle, lambda m: {"x": -m.y, "y": m.x}, E_x=1.0),
            "ChargedParticle: .* is no symmetry",
        ),
        (lambda: analysis.noether(KeplerOrbit, lambda _: {"z": 1}), "moves free coordinates, not 'z'; known: x, y"),
        (
            lambda: analysis.noether(Satellite, lambda _: {"attitude": 1.0}),
            "gives 1 components for attitude; it must give 3",
        ),
        (
            lambda: analysis.noether(CartesianPendulum, lambda _: {"x": 1}),
            "the field moves rod, whose forces change",
        ),
        (lambda: analysis.noether(CartesianPendulum, lambda m: {"x": -m.y, "y": m.x}), "the field moves plane, whose"),
        (lambda: analysis.noether(IsokineticOscillator, lambda m: {"x": -m.y, "y": m.x}), "the field moves kinetic"),
        (lambda: analysis.noether(DryOscillator, lambda _: {"x": 1}, stiffness=0.0), "the field moves slip, whose"),
        (lambda: analysis.noether(FreeParticle, lambda _: {"x": 1}, x_load=1.0), "moves against friction, drives or l"),
        (
            lambda: analysis.noether(CHAIN, lambda _: {}),
            "Chain: analysis takes .* it is a chain; write its",
        ),
        (lambda: analysis.noether(KeplerOrbit, lambda _: {}, mass=NUMBERS), "mass must be one number here, not an arr"),
        (lambda: analysis.hamiltonian(Mechanism), "Mechanism: analysis takes mechanisms, .* it is abstract$"),
        (lambda: analysis.hamiltonian(OPERATOR), "Regulator: analysis takes mechanisms, .* it is an operator$"),
        (lambda: analysis.similarity(IsokineticOscillator), "Oscillator: kinetic does not scale with x, y, z alone"),
        (lambda: analysis.similarity(CartesianPendulum), "CartesianPendulum: rod does not scale with x, y, z, rod al"),
        (lambda: analysis.similarity(Oscillator, damping=0.1), "Oscillator: similarity has no friction, drives and lo"),
        (
            lambda: analysis.similarity(Pendulum).mean_energies(1.0),
            "forces that hold length have a virial of",
        ),
        *(
            (lambda name=name: getattr(analysis, name)(StringPendulum), r"takes no unilateral .* \(slack\)")
            for name in ("hamilton_equations", "phase_velocity", "divergence", "gauss_function", "effective_mass")
        ),
        (lambda: analysis.action(BouncingBall, T, {}), r"BouncingBall: the action takes no unilateral .* \(gap\)"),
        (
            lambda: analysis.observable(BouncingBall, lambda m: m.contact_force("gap")),
            r"contains forces .* \(gap\)",
        ),
        *(
            (lambda make=make: make(Pendulum).evaluate(p_theta=1.0, friction=0.3), "Pendulum: friction, drives and l")
            for make in (
                analysis.hamilton_equations,
                analysis.dynamic_field,
                analysis.reduced_multiplier_equations,
                analysis.vakonomic_equations,
            )
        ),
        (
            lambda: analysis.stationary_path(Oscillator, T, PATH, damping=0.1),
            "action has no friction, drives and loads; set",
        ),
        (lambda: analysis.stationary_path(Oscillator, T, PATH, support_dot=0.1), r"support_dot = 0\.1 of an active"),
        (lambda: analysis.flow(Pendulum, 1.0, length_dot=0.1), "length_dot = 0.1 of an active coordinate that is held"),
        (lambda: analysis.virial(NoseHooverOscillator, T, {"q": T, "q_dot": T}), "the motion lacks xi; give"),
        (lambda: analysis.normal_modes(ChargedParticle), r"forces depend on the rates .*take linearize\(\)"),
        (lambda: analysis.equilibrium(NoseHooverOscillator), "an equilibrium is at rest, which leaves out xi, eta; s"),
        (lambda: analysis.equilibrium(CircularHoop, beta_dot=2.0), "an equilibrium is at rest, .* out beta_dot; simul"),
        (lambda: analysis.multiplier_equations(SpatialCat).evaluate(), "SpatialCat: not finite at these values; give"),
        *(
            (
                lambda name=name: getattr(analysis, name)(Table),
                "Table: .* needs a free coordinate; all are prescribed",
            )
            for name in ("hamilton_equations", "divergence", "vakonomic_equations", "kinetic_connection", "equilibrium")
        ),
        (lambda: analysis.action(Table, T, {}), "Table: the path moves no coordinate; give one and its rate"),
        (lambda: analysis.Similarity(-2.0).mean_energies(0.0), "degree = -2 has no mean energies"),
        (
            lambda: analysis.similarity(LinearMolecule),
            "LinearMolecule: the .*not homogeneous in x_1, x_2, x_3: it has a length of its own",
        ),
        (lambda: analysis.similarity(CircularHoop), "Hoop: the kinetic energy is not of degree 2 in the lengths xi"),
        (lambda: analysis.similarity(Satellite), r"the kinetic energy is not of degree 2 in the lengths \(none\)"),
        (lambda: analysis.similarity(FreeParticle, gravity=0.0), "potential is zero"),
        (lambda: analysis.similarity(ChargedParticle), "L is not T - V"),
        (lambda: analysis.virial(Oscillator, T[::-1], PATH), r"time of shape \(5,\) must hold increasing instants"),
        (lambda: analysis.virial(Pendulum, T, {}), r"not of degree 2 in the lengths \(none\)"),
        (lambda: analysis.hamiltonian(Pendulum).evaluate(thetta=1.0), "Pendulum: unknown symbol .* mean 'theta'"),
        (lambda: analysis.hamiltonian(Pendulum).evaluate(mass=-1.0), "Pendulum: mass = -1 must be > 0"),
        (lambda: analysis.hamiltonian(Pendulum).evaluate(length=T), "Pendulum: length = 0 must be > 0"),
        (lambda: analysis.hamiltonian(Pendulum).evaluate(theta=np.nan), "Pendulum: theta = nan must be finite"),
        (
            lambda: analysis.equilibrium(FreeParticle),
            "FreeParticle: no equilibrium found from the guess x = 0, y = 0, z = 0",
        ),
        (lambda: analysis.normal_modes(LinearMolecule, x_1_force=1.0), "LinearMolecule: no equilibrium"),
        (lambda: analysis.normal_modes(CartesianPendulum), "CartesianPendulum: an equilibrium needs independent coord"),
        (lambda: analysis.normal_modes(Pendulum, lenght=1.0), r"unknown symbol 'lenght'; did you mean 'length'\?"),
        (
            lambda: analysis.normal_modes(Pendulum, theta=3.0, length=2.0).frequencies,
            r"is unstable, Ω² = -4\.905; see squares",
        ),
    ],
)
def test_what_cannot_be_meant_is_refused_by_name(call: Callable[[], Any], words: str) -> None:
    with pytest.raises(ComponentError, match=words):
        call()
