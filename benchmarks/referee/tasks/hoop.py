"""A bead on a hoop that turns about a point off its centre, ever faster."""

from sympy import cos, sin
from sympy.physics.mechanics import dynamicsymbols

from referee.equations import TIME, lagrange, point

OFFSET, INERTIA = 0.5, 0.1  # [m], [kg.m2]; radius 1 m, mass 1 kg
xi, beta = dynamicsymbols("xi beta")
bead = point(1.0, OFFSET * cos(beta) + cos(beta + xi), OFFSET * sin(beta) + sin(beta + xi), gravity=0.0)
TASK = lagrange(
    "hoop",
    4.0,
    bead + INERTIA * beta.diff(TIME) ** 2 / 2,
    {xi: (1.0, 1.0)},
    {beta: lambda t: (2 * t + t * t / 4, 2 + t / 2, 0.5)},
    component="CircularHoop",
    parameters={"hoop_inertia": INERTIA},
)
