"""Kapitza's pendulum: upright on a pivot that shakes up and down."""

from math import pi

from sympy import cos, sin

from referee.equations import TIME, Lagrange, coordinates
from referee.task import GRAVITY, sinusoid

theta, z = coordinates("theta pivot_z")
z_dot, theta_dot = z.diff(TIME), theta.diff(TIME)
TASK = Lagrange(
    (z_dot**2 + 2 * z_dot * theta_dot * sin(theta) + theta_dot**2) / 2 - GRAVITY * (z - cos(theta)),
    {theta: (pi - 0.1, 0.0)},
    {z: sinusoid(0.0, 0.1, 50.0)},
).task("Kapitza", 1.6, component="Pendulum", carrier=1.0, weight=GRAVITY)
