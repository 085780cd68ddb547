"""The catalogue: one file, one component; each with its equation, its source and its closed form."""

from liaisons.mechanics import Component
from liaisons.models.charged_particle import ChargedParticle
from liaisons.models.circular_hoop import CircularHoop
from liaisons.models.double_pendulum import DoublePendulum
from liaisons.models.flywheel import Flywheel
from liaisons.models.free_particle import FreeParticle
from liaisons.models.kepler_orbit import KeplerOrbit
from liaisons.models.linear_molecule import LinearMolecule
from liaisons.models.operators import Constant, Ramp, Sinusoid, SmoothStep
from liaisons.models.oscillator import Oscillator
from liaisons.models.pendulum import Pendulum
from liaisons.models.planar_oscillator import PlanarOscillator
from liaisons.models.polar_oscillator import PolarOscillator
from liaisons.models.swing import Swing
from liaisons.models.swing_pump import SwingPump

CATALOGUE: tuple[type[Component], ...] = (
    Pendulum,
    DoublePendulum,
    Oscillator,
    Flywheel,
    PlanarOscillator,
    PolarOscillator,
    LinearMolecule,
    FreeParticle,
    ChargedParticle,
    KeplerOrbit,
    Swing,
    CircularHoop,
    Constant,
    Ramp,
    Sinusoid,
    SmoothStep,
    SwingPump,
)

__all__ = [
    "CATALOGUE",
    "ChargedParticle",
    "CircularHoop",
    "Constant",
    "DoublePendulum",
    "Flywheel",
    "FreeParticle",
    "KeplerOrbit",
    "LinearMolecule",
    "Oscillator",
    "Pendulum",
    "PlanarOscillator",
    "PolarOscillator",
    "Ramp",
    "Sinusoid",
    "SmoothStep",
    "Swing",
    "SwingPump",
]
