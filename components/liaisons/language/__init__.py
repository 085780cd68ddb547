"""Declaration of components: parameters, coordinates, energies, points, constraints and closed forms.

:mod:`liaisons.mechanics` derives equations from them, :mod:`liaisons.fmu` builds FMUs.
"""

import warnings
from typing import TYPE_CHECKING

from liaisons.language.chain import Chain
from liaisons.language.closed_forms import Values, closed_form
from liaisons.language.component import Component
from liaisons.language.declarations import (
    ActiveCoordinate,
    Coordinate,
    Friction,
    Gravity,
    Input,
    InternalState,
    Joint,
    Orientation,
    Parameter,
    ParameterArray,
    Size,
    assertion,
    calculated,
    constraint,
    dry_friction,
    non_holonomic,
    output,
    point,
    rheonomic_constraint,
    unchecked,
    unilateral,
)
from liaisons.language.mechanism import Mechanism
from liaisons.language.operator import Operator
from liaisons.language.shapes import (
    Ball,
    Box,
    Flash,
    Floor,
    Rod,
    Rope,
    Shape,
    Shapes,
    Spring,
    Trail,
    Wire,
    circle,
    turned,
)
from liaisons.language.variables import Dimension, Experiment, Terminal, Variable

__all__ = [
    "ActiveCoordinate",
    "Ball",
    "Box",
    "Chain",
    "Component",
    "Coordinate",
    "Dimension",
    "Experiment",
    "Flash",
    "Floor",
    "Friction",
    "Gravity",
    "Input",
    "InternalState",
    "Joint",
    "Mechanism",
    "Operator",
    "Orientation",
    "Parameter",
    "ParameterArray",
    "Rod",
    "Rope",
    "Shape",
    "Shapes",
    "Size",
    "Spring",
    "Terminal",
    "Trail",
    "Values",
    "Variable",
    "Wire",
    "assertion",
    "calculated",
    "circle",
    "closed_form",
    "constraint",
    "dry_friction",
    "non_holonomic",
    "output",
    "point",
    "rheonomic_constraint",
    "turned",
    "unchecked",
    "unilateral",
]

if not TYPE_CHECKING:
    _RENAMED = {"condition": assertion, "submersion": rheonomic_constraint}

    def __getattr__(name: str) -> type:
        """Declaration of an old name, for one version."""
        if name not in _RENAMED:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        new = _RENAMED[name]
        warnings.warn(f"{__name__}.{name} is now {__name__}.{new.__name__}", DeprecationWarning, stacklevel=2)
        return new
