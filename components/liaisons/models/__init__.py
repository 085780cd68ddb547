"""The catalogue: one file, one component; each with its equation, its source and its closed form.

K and M, by which sources are named, are the texts of Kneller and Marle: see ``liaisons/bibliography.md``.
"""

from liaisons.mechanics import Component
from liaisons.models.cartesian_pendulum import CartesianPendulum
from liaisons.models.charged_particle import ChargedParticle
from liaisons.models.circular_hoop import CircularHoop
from liaisons.models.double_pendulum import DoublePendulum
from liaisons.models.driven_chain import DrivenChain
from liaisons.models.elliptic_hoop import EllipticHoop
from liaisons.models.flywheel import Flywheel
from liaisons.models.four_bars import FourBars, four_bars
from liaisons.models.fourier_hoop import FourierHoop
from liaisons.models.fourier_series import FourierSeries
from liaisons.models.free_particle import FreeParticle
from liaisons.models.isokinetic_oscillator import IsokineticOscillator
from liaisons.models.kepler_orbit import KeplerOrbit
from liaisons.models.linear_molecule import LinearMolecule
from liaisons.models.marle_swing import marle_swing
from liaisons.models.nose_hoover_oscillator import NoseHooverOscillator
from liaisons.models.operators import Constant, Ramp, Sinusoid, SmoothStep
from liaisons.models.oscillator import Oscillator
from liaisons.models.oscillator_chain import OscillatorChain
from liaisons.models.pendulum import Pendulum
from liaisons.models.pendulum_chain import PendulumChain
from liaisons.models.planar_cat import PlanarCat
from liaisons.models.planar_oscillator import PlanarOscillator
from liaisons.models.polar_oscillator import PolarOscillator
from liaisons.models.satellite import Satellite
from liaisons.models.spatial_cat import SpatialCat
from liaisons.models.swing import Swing
from liaisons.models.swing_pump import SwingPump

CATALOGUE: tuple[type[Component], ...] = (
    Pendulum,
    CartesianPendulum,
    DoublePendulum,
    PendulumChain,
    Oscillator,
    Flywheel,
    PlanarOscillator,
    PolarOscillator,
    IsokineticOscillator,
    NoseHooverOscillator,
    LinearMolecule,
    OscillatorChain,
    DrivenChain,
    FreeParticle,
    ChargedParticle,
    KeplerOrbit,
    Swing,
    PlanarCat,
    SpatialCat,
    Satellite,
    CircularHoop,
    EllipticHoop,
    FourierHoop,
    Constant,
    Ramp,
    Sinusoid,
    SmoothStep,
    FourierSeries,
    SwingPump,
)

__all__ = [
    "CATALOGUE",
    "CartesianPendulum",
    "ChargedParticle",
    "CircularHoop",
    "Constant",
    "DoublePendulum",
    "DrivenChain",
    "EllipticHoop",
    "Flywheel",
    "FourBars",
    "FourierHoop",
    "FourierSeries",
    "FreeParticle",
    "IsokineticOscillator",
    "KeplerOrbit",
    "LinearMolecule",
    "NoseHooverOscillator",
    "Oscillator",
    "OscillatorChain",
    "Pendulum",
    "PendulumChain",
    "PlanarCat",
    "PlanarOscillator",
    "PolarOscillator",
    "Ramp",
    "Satellite",
    "Sinusoid",
    "SmoothStep",
    "SpatialCat",
    "Swing",
    "SwingPump",
    "four_bars",
    "marle_swing",
]
