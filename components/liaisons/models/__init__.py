"""The catalogue: one file, one component; each with its equation, its source and its closed form."""

from liaisons.mechanics import Component
from liaisons.models.circular_hoop import CircularHoop
from liaisons.models.flywheel import Flywheel
from liaisons.models.operators import Constant, Ramp, Sinusoid, SmoothStep
from liaisons.models.oscillator import Oscillator
from liaisons.models.pendulum import Pendulum
from liaisons.models.swing import Swing

CATALOGUE: tuple[type[Component], ...] = (
    Pendulum,
    Oscillator,
    Flywheel,
    Swing,
    CircularHoop,
    Constant,
    Ramp,
    Sinusoid,
    SmoothStep,
)

__all__ = [
    "CATALOGUE",
    "CircularHoop",
    "Constant",
    "Flywheel",
    "Oscillator",
    "Pendulum",
    "Ramp",
    "Sinusoid",
    "SmoothStep",
    "Swing",
]
