"""Joints of a :class:`liaisons.Linkage` and the bodies between them."""

from liaisons.linkages import (
    Body,
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

__all__ = [
    "Body",
    "BodyPoint",
    "Cylindrical",
    "Free",
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
