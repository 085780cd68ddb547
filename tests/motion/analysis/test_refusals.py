"""What cannot be meant is refused by name."""

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest

from liaisons.errors import ComponentError
from liaisons.language import Mechanism
from liaisons.models import (
    BouncingBall,
    CartesianPendulum,
    ChargedParticle,
    CircularHoop,
    FreeParticle,
    KeplerOrbit,
    LinearMolecule,
    Oscillator,
    Pendulum,
    PlanarCat,
    Satellite,
)
from liaisons_motion import analysis

T = np.linspace(0.0, 1.0, 5)
PATH = {"x": T, "x_dot": 0 * T + 1}
NAME: Any = "Pendulum"
NUMBERS: Any = [1.0, 2.0]
STRANGE = ca.SX.sym("stranger")


def joined(periods: float) -> Any:
    """The path of an oscillator between ends that are so many half periods apart."""
    t = np.linspace(0, periods * np.pi / 2, 41)
    return analysis.stationary_path(
        Oscillator, t, {"x": 1 - t / t[-1], "x_dot": 0 * t - 1 / t[-1]}, mass=0.5, stiffness=2.0
    )


@pytest.mark.variants(quick=None, core=50)
@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: analysis.equilibrium(CartesianPendulum), "CartesianPendulum: an equilibrium needs independent coord"),
        (lambda: analysis.equilibrium(NAME), r"^'Pendulum' is no mechanism; give its class, or derive\('Pendulum'\)$"),
        (
            lambda: analysis.observable(BouncingBall, lambda m: m.height).time_derivative(),
            "a rate takes no unilateral l",
        ),
        (lambda: analysis.curvature(CircularHoop), "CircularHoop: a curvature needs two active coordinates; it has 1"),
        (
            lambda: analysis.holonomy(PlanarCat, lambda a: {"psi_1": a}),
            r"the loop is open: psi_1 at a = 2π and a = 0 differ by 6\.28",
        ),
        (lambda: analysis.holonomy(PlanarCat, lambda a: {"phi": a}), "a loop moves active coordinates, not 'phi'"),
        (lambda: analysis.action(Oscillator, T, PATH, PATH), "the variation must vanish at both ends"),
        (lambda: analysis.action(Oscillator, T, {"x": T}), "Oscillator: the path lacks x_dot"),
        (lambda: analysis.action(Oscillator, T, PATH | {"y": T}), "no coordinate of a path is 'y'; known: support, x"),
        (lambda: analysis.action(Oscillator, T, PATH | {"x": T[:4]}), r"5 instants for samples of shape \(4,\)"),
        (lambda: analysis.action(Oscillator, T, PATH | {"x": T * np.nan}), "x must be finite at all instants"),
        *((lambda k=k: joined(k), "Oscillator: the ends are conjugate points: no path .*ω T = k π") for k in (1, 2, 3)),
        (
            lambda: analysis.poisson_bracket(analysis.hamiltonian(Oscillator), analysis.hamiltonian(KeplerOrbit)),
            "Oscillator and KeplerOrbit share no phase space",
        ),
        (lambda: analysis.flow(Oscillator, 0), "duration = 0 must be finite and > 0"),
        (lambda: analysis.flow(Oscillator, 1.0, x=lambda t: t), "only an active coordinate can be .* time, not 'x'"),
        (lambda: analysis.observable(Oscillator, lambda m: m.x * STRANGE), "contains the unknown symbol 'stranger'"),
        (lambda: analysis.noether(KeplerOrbit, lambda _: {"z": 1}), "moves free coordinates, not 'z'; known: x, y"),
        (
            lambda: analysis.noether(Satellite, lambda _: {"attitude": 1.0}),
            "gives 1 components for attitude; it must give 3",
        ),
        (lambda: analysis.noether(FreeParticle, lambda _: {"x": 1}, x_load=1.0), "moves against friction, drives or l"),
        (lambda: analysis.noether(KeplerOrbit, lambda _: {}, mass=NUMBERS), "mass must be one number here, not an arr"),
        (lambda: analysis.hamiltonian(Mechanism), "Mechanism: analysis takes mechanisms, .* it is abstract$"),
        (lambda: analysis.stationary_path(Oscillator, T, PATH, support_dot=0.1), r"support_dot = 0\.1 of an active"),
        (lambda: analysis.flow(Pendulum, 1.0, length_dot=0.1), "length_dot = 0.1 of an active coordinate that is held"),
        (lambda: analysis.Similarity(-2.0).mean_energies(0.0), "degree = -2 has no mean energies"),
        (
            lambda: analysis.similarity(LinearMolecule),
            "LinearMolecule: the .*not homogeneous in x_1, x_2, x_3: it has a length of its own",
        ),
        (lambda: analysis.similarity(FreeParticle, gravity=0.0), "potential is zero"),
        (lambda: analysis.similarity(ChargedParticle), "L is not T - V"),
        (lambda: analysis.virial(Oscillator, T[::-1], PATH), r"time of shape \(5,\) must hold increasing instants"),
        (lambda: analysis.hamiltonian(Pendulum).evaluate(thetta=1.0), "Pendulum: unknown symbol .* mean 'theta'"),
        (lambda: analysis.hamiltonian(Pendulum).evaluate(mass=-1.0), "Pendulum: mass = -1 must be > 0"),
        (lambda: analysis.hamiltonian(Pendulum).evaluate(length=T), "Pendulum: length = 0 must be > 0"),
        (lambda: analysis.hamiltonian(Pendulum).evaluate(theta=np.nan), "Pendulum: theta = nan must be finite"),
        (
            lambda: analysis.equilibrium(FreeParticle),
            "FreeParticle: no equilibrium found from the guess x = 0, y = 0, z = 0",
        ),
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
