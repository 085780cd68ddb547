"""A pendulum whose pivot moves to and fro."""

from sympy import cos
from sympy.physics.mechanics import dynamicsymbols

from referee.equations import lagrange
from referee.task import GRAVITY, sinusoid

theta, x = dynamicsymbols("theta pivot_x")
theta_dot, x_dot = dynamicsymbols("theta pivot_x", 1)
TASK = lagrange(
    "moving pivot",
    9.6,
    (x_dot**2 + 2 * x_dot * theta_dot * cos(theta) + theta_dot**2) / 2 + GRAVITY * cos(theta),
    {theta: (0.3, 0.0)},
    {x: sinusoid(0.0, 0.1, 3.0)},
    component="Pendulum",
    carrier=1.0,
)
