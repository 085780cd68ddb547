"""The planar cat by bodies and joints."""

from math import pi

from liaisons.language import Experiment
from liaisons.linkages import Body, Linkage, Planar, Revolute, ground


class LinkedCat(Linkage):
    """Falling cat in the plane as a linkage: a trunk that is free, and two limbs whose hinges an operator turns.

    It moves like :class:`PlanarCat`, whose Lagrangian is written by hand in the coordinates of the common centre of
    mass; the coordinates here are those of the trunk.  The angular momentum p_fall_angle is not the one about the
    centre of mass.

    Source: M 8.2.
    """

    trunk = Body(mass=2.0, inertia=(0.01, 0.05, 0.05))
    limb_1 = Body(mass=1.0, inertia=(0.001, 0.02, 0.02), centre=(0.15, 0, 0))
    limb_2 = Body(mass=1.0, inertia=(0.001, 0.02, 0.02), centre=(-0.15, 0, 0))
    fall = Planar(ground, trunk, rotation=(pi / 2, 0, 0), start_rate=(0, 9.81, 1.0))
    psi_1 = Revolute(trunk, limb_1, at=(0.2, 0, 0), prescribed=True)
    psi_2 = Revolute(trunk, limb_2, at=(-0.2, 0, 0), prescribed=True)
    experiment = Experiment(stop_time=2.0)

    from liaisons_catalogue.solutions.linked_cat import exact
