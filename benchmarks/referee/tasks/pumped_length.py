"""A pendulum whose length an operator pumps twice a period."""

from sympy import cos
from sympy.physics.mechanics import dynamicsymbols

from referee.equations import lagrange
from referee.task import GRAVITY, sinusoid

theta, length = dynamicsymbols("theta length")
theta_dot, length_dot = dynamicsymbols("theta length", 1)
TASK = lagrange(
    "pumped length",
    4.0,
    (length_dot**2 + (length * theta_dot) ** 2) / 2 + GRAVITY * length * cos(theta),
    {theta: (0.3, 0.0)},
    {length: sinusoid(1.0, 0.15, 6.2642)},
    component="Pendulum",
)
