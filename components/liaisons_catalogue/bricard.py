"""Bricard's mechanism."""

from math import pi

from liaisons.language import Experiment
from liaisons.linkages import Body, BodyPoint, Linkage, Revolute, ground

_QUARTER = pi / 2


def _rod() -> Body:
    return Body(mass=1.0, inertia=(0, 1 / 12, 1 / 12), centre=(0.5, 0, 0))


class Bricard(Linkage):
    """Loop of six rods along the edges of a cube, each hinge perpendicular to its two rods; gravity moves it.

    Grübler's formula gives 6 (6 - 1) - 5 · 6 = 0 degrees of freedom.  The loop has one, because one of the constraints
    follows from the others.  By symmetry, hinges 1, 3, 5 turn together, and so do 2, 4, 6.

    Source: R. Bricard, J. math. pures appl. 3 (1897); IFToMM benchmark A04, with thin rods and in another pose.
    """

    rod_1, rod_2, rod_3, rod_4, rod_5 = _rod(), _rod(), _rod(), _rod(), _rod()
    hinge_1 = Revolute(ground, rod_1, axis="z", at=(1, 0, 0), start=_QUARTER)
    hinge_2 = Revolute(rod_1, rod_2, axis="y", at=(1, 0, 0), start=-_QUARTER)
    hinge_3 = Revolute(rod_2, rod_3, axis="z", at=(1, 0, 0), start=_QUARTER)
    hinge_4 = Revolute(rod_3, rod_4, axis="y", at=(1, 0, 0), start=-_QUARTER)
    hinge_5 = Revolute(rod_4, rod_5, axis="z", at=(1, 0, 0), start=_QUARTER)
    hinge_6 = Revolute(ground, rod_5, axis="y", at_child=(1, 0, 0))
    corner = BodyPoint(rod_3)
    experiment = Experiment(stop_time=2.0, step_size=0.01)
