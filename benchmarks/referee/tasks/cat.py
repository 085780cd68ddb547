"""A cat of three bodies that falls and turns by its limbs."""

from math import pi

from sympy import Matrix, cos, sin

from referee.equations import TIME, Lagrange, coordinates
from referee.task import sinusoid

MASSES, INERTIAS, HINGE, ARM = (2.0, 1.0, 1.0), (0.05, 0.02, 0.02), 0.2, 0.15
phi, one, two = coordinates("phi psi_1 psi_2")


def arm(angle):
    return Matrix([cos(angle), sin(angle)])


# Of the centres of mass, seen from the trunk; what moves all of them alike takes no part.
CENTRES = (0 * arm(phi), HINGE * arm(phi) + ARM * arm(phi + one), -HINGE * arm(phi) - ARM * arm(phi + two))
velocities = [centre.diff(TIME) for centre in CENTRES]
momentum = sum((m * v for m, v in zip(MASSES, velocities, strict=True)), 0 * arm(phi))
spins = [angle.diff(TIME) for angle in (phi, phi + one, phi + two)]
kinetic = sum(m * v.dot(v) + i * w**2 for m, v, i, w in zip(MASSES, velocities, INERTIAS, spins, strict=True))
TASK = Lagrange(
    (kinetic - momentum.dot(momentum) / sum(MASSES)) / 2,
    {phi: (0.0, 0.5)},
    {one: sinusoid(0.5, 0.8, 4.0, -pi / 2), two: sinusoid(0.0, 0.9, 4.0)},
).task("cat", 3.2, component="PlanarCat")
