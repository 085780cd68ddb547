"""A cat of three bodies that falls and turns by its limbs."""

from itertools import combinations
from math import pi

from sympy import Matrix, cos, sin
from sympy.physics.mechanics import dynamicsymbols

from referee.equations import TIME, lagrange, point
from referee.task import sinusoid

MASSES, INERTIAS, HINGE, ARM = (2.0, 1.0, 1.0), (0.05, 0.02, 0.02), 0.2, 0.15
phi, one, two = dynamicsymbols("phi psi_1 psi_2")
angles = (phi, phi + one, phi + two)
trunk, fore, hind = (Matrix([cos(angle), sin(angle)]) for angle in angles)
bodies = zip(MASSES, (0 * trunk, HINGE * trunk + ARM * fore, -HINGE * trunk - ARM * hind), strict=True)
# About the common centre of mass, which falls: the energy of each pair with its reduced mass.
pairs = (point(m * n / sum(MASSES), *(c - d), gravity=0.0) for (m, c), (n, d) in combinations(bodies, 2))
TASK = lagrange(
    "cat",
    3.2,
    sum(pairs) + sum(i * angle.diff(TIME) ** 2 / 2 for i, angle in zip(INERTIAS, angles, strict=True)),
    {phi: (0.0, 0.5)},
    {one: sinusoid(0.5, 0.8, 4.0, -pi / 2), two: sinusoid(0.0, 0.9, 4.0)},
    component="PlanarCat",
)
