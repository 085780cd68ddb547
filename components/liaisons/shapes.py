"""Shapes that the picture of a component is made of."""

from liaisons.language import Ball, Box, Flash, Floor, Rod, Rope, Shapes, Spring, Trail, Wire, circle, turned

__all__ = ["Ball", "Box", "Flash", "Floor", "Rod", "Rope", "Shapes", "Spring", "Trail", "Wire", "circle", "turned"]
