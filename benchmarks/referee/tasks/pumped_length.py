"""A pendulum whose length an operator pumps twice a period."""

from sympy import cos

from referee.equations import TIME, Lagrange, coordinates
from referee.task import GRAVITY, sinusoid

theta, length = coordinates("theta length")
TASK = Lagrange(
    (length.diff(TIME) ** 2 + (length * theta.diff(TIME)) ** 2) / 2 + GRAVITY * length * cos(theta),
    {theta: (0.3, 0.0)},
    {length: sinusoid(1.0, 0.15, 6.2642)},
).task("pumped length", 4.0, component="Pendulum")
