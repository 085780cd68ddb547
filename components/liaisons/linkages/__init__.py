"""Linkages: bodies and joints, from whose declarations coordinates, energies, constraints and picture follow.

With this package loaded, :mod:`liaisons.mechanics` derives them by recursion over their bodies.
"""

from liaisons.linkages.dynamics import by_recursion
from liaisons.linkages.joints import (
    Body,
    BodyFrame,
    BodyJoint,
    BodyPoint,
    Cylindrical,
    Free,
    Planar,
    Prismatic,
    Revolute,
    Screw,
    Spherical,
    SpringDamper,
    Universal,
    Weld,
    ground,
)
from liaisons.linkages.linkage import Linkage
from liaisons.linkages.printing import of_large_linkage
from liaisons.mechanics import derive_by

__all__ = [
    "Body",
    "BodyFrame",
    "BodyJoint",
    "BodyPoint",
    "Cylindrical",
    "Free",
    "Linkage",
    "Planar",
    "Prismatic",
    "Revolute",
    "Screw",
    "Spherical",
    "SpringDamper",
    "Universal",
    "Weld",
    "ground",
]

derive_by(Linkage, by_recursion, of_large_linkage)
