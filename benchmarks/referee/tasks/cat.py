"""A cat of three bodies that falls and turns by its limbs."""

from math import pi

from sympy.physics.mechanics import ReferenceFrame, dynamicsymbols

from referee.equations import lagrange
from referee.task import sinusoid

MASSES, INERTIAS, HINGE, ARM = (2.0, 1.0, 1.0), (0.05, 0.02, 0.02), 0.2, 0.15
phi, one, two = dynamicsymbols("phi psi_1 psi_2")
space = ReferenceFrame("space")
trunk = space.orientnew("trunk", "Axis", (phi, space.z))
fore, hind = (trunk.orientnew(f"limb {angle}", "Axis", (angle, space.z)) for angle in (one, two))

# Of the centres of mass, seen from the trunk; what moves all of them alike takes no part.
CENTRES = (0 * trunk.x, HINGE * trunk.x + ARM * fore.x, -HINGE * trunk.x - ARM * hind.x)
velocities = [centre.dt(space) for centre in CENTRES]
momentum = sum(m * v for m, v in zip(MASSES, velocities, strict=True))
spins = [body.ang_vel_in(space) for body in (trunk, fore, hind)]
kinetic = sum(m * v.dot(v) + i * w.dot(w) for m, v, i, w in zip(MASSES, velocities, INERTIAS, spins, strict=True))
TASK = lagrange(
    "cat",
    3.2,
    (kinetic - momentum.dot(momentum) / sum(MASSES)) / 2,
    {phi: (0.0, 0.5)},
    {one: sinusoid(0.5, 0.8, 4.0, -pi / 2), two: sinusoid(0.0, 0.9, 4.0)},
    component="PlanarCat",
)
