"""A bead on a hoop that turns about a point off its centre, ever faster."""

from sympy import cos

from referee.equations import TIME, Lagrange, coordinates

OFFSET, INERTIA = 0.5, 0.1  # [m], [kg.m2]; radius 1 m, mass 1 kg
xi, beta = coordinates("xi beta")
turn = beta.diff(TIME)
spin = turn + xi.diff(TIME)
TASK = Lagrange(
    ((OFFSET**2 + INERTIA) * turn**2 + spin**2 + 2 * OFFSET * turn * spin * cos(xi)) / 2,
    {xi: (1.0, 1.0)},
    {beta: lambda t, *_: (2 * t + t * t / 4, 2 + t / 2, 0.5)},
).task("hoop", 4.0, component="CircularHoop", parameters={"hoop_inertia": INERTIA})
