"""Kapitza's pendulum: upright on a pivot that shakes up and down."""

from math import pi

from sympy import cos, sin
from sympy.physics.mechanics import dynamicsymbols

from referee.equations import lagrange
from referee.task import GRAVITY, sinusoid

theta, z = dynamicsymbols("theta pivot_z")
theta_dot, z_dot = dynamicsymbols("theta pivot_z", 1)
TASK = lagrange(
    "Kapitza",
    1.6,
    (z_dot**2 + 2 * z_dot * theta_dot * sin(theta) + theta_dot**2) / 2 - GRAVITY * (z - cos(theta)),
    {theta: (pi - 0.1, 0.0)},
    {z: sinusoid(0.0, 0.1, 50.0)},
    component="Pendulum",
    carrier=1.0,
    weight=GRAVITY,
)
