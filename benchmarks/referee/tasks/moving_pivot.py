"""A pendulum whose pivot moves to and fro."""

from sympy import cos

from referee.equations import TIME, Lagrange, coordinates
from referee.task import GRAVITY, sinusoid

theta, x = coordinates("theta pivot_x")
x_dot, theta_dot = x.diff(TIME), theta.diff(TIME)
TASK = Lagrange(
    (x_dot**2 + 2 * x_dot * theta_dot * cos(theta) + theta_dot**2) / 2 + GRAVITY * cos(theta),
    {theta: (0.3, 0.0)},
    {x: sinusoid(0.0, 0.1, 3.0)},
).task("moving pivot", 9.6, component="Pendulum", carrier=1.0)
