"""A bead on a hoop that turns about a point off its centre, ever faster."""

from sympy import cos
from sympy.physics.mechanics import dynamicsymbols

from referee.equations import lagrange

OFFSET, INERTIA = 0.5, 0.1  # [m], [kg.m2]; radius 1 m, mass 1 kg
xi, beta = dynamicsymbols("xi beta")
slide, turn = dynamicsymbols("xi beta", 1)
spin = turn + slide
TASK = lagrange(
    "hoop",
    4.0,
    ((OFFSET**2 + INERTIA) * turn**2 + spin**2 + 2 * OFFSET * turn * spin * cos(xi)) / 2,
    {xi: (1.0, 1.0)},
    {beta: lambda t: (2 * t + t * t / 4, 2 + t / 2, 0.5)},
    component="CircularHoop",
    parameters={"hoop_inertia": INERTIA},
)
