from liaisons.language import Component

from .ball_row import BallRow as BallRow
from .bead_on_sphere import BeadOnSphere as BeadOnSphere
from .bouncing_ball import BouncingBall as BouncingBall
from .cartesian_pendulum import CartesianPendulum as CartesianPendulum
from .charged_particle import ChargedParticle as ChargedParticle
from .circular_hoop import CircularHoop as CircularHoop
from .constant import Constant as Constant
from .double_pendulum import DoublePendulum as DoublePendulum
from .driven_chain import DrivenChain as DrivenChain
from .dry_oscillator import DryOscillator as DryOscillator
from .elliptic_hoop import EllipticHoop as EllipticHoop
from .flywheel import Flywheel as Flywheel
from .fourier_hoop import FourierHoop as FourierHoop
from .fourier_series import FourierSeries as FourierSeries
from .free_particle import FreeParticle as FreeParticle
from .general_swing import GeneralSwing as GeneralSwing
from .hoop import Hoop as Hoop
from .isokinetic_oscillator import IsokineticOscillator as IsokineticOscillator
from .junction import Junction as Junction
from .kepler_orbit import KeplerOrbit as KeplerOrbit
from .linear_molecule import LinearMolecule as LinearMolecule
from .nose_hoover_oscillator import NoseHooverOscillator as NoseHooverOscillator
from .oscillator import Oscillator as Oscillator
from .oscillator_chain import OscillatorChain as OscillatorChain
from .parallelograms import FourBars as FourBars
from .parallelograms import four_bars as four_bars
from .parametrised_hoop import ParametrisedHoop as ParametrisedHoop
from .pendulum import Pendulum as Pendulum
from .pendulum_chain import PendulumChain as PendulumChain
from .planar_cat import PlanarCat as PlanarCat
from .planar_oscillator import PlanarOscillator as PlanarOscillator
from .planned_motion import PlannedMotion as PlannedMotion
from .polar_oscillator import PolarOscillator as PolarOscillator
from .ramp import Ramp as Ramp
from .regulator import Regulator as Regulator
from .satellite import Satellite as Satellite
from .shaped_swing import marle_swing as marle_swing
from .sinusoid import Sinusoid as Sinusoid
from .smooth_step import SmoothStep as SmoothStep
from .spatial_cat import SpatialCat as SpatialCat
from .string_pendulum import StringPendulum as StringPendulum
from .swing import Swing as Swing
from .swing_pump import SwingPump as SwingPump

CATALOGUE: tuple[type[Component], ...]
