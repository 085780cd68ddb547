"""The gyroscope in gimbals."""

from liaisons.language import Experiment
from liaisons.linkages import Body, Linkage, Revolute, ground


class Gyroscope(Linkage):
    """Heavy gyroscope in two gimbals: the outer one turns about the vertical, the inner one about a horizontal axis.

    θ is the angle of the rotor's axis from the upward vertical, Ω the rate of precession, ω_3 = spin' + Ω cos θ; I_1
    and I_3 are the rotor's moments of inertia across (about the pivot) and along its axis, B and C those of the inner
    gimbal about its own horizontal and axial directions, and l is the distance from the pivot to the rotor's centre of
    mass.  In steady precession::

        (I_1 + B - C) Ω² cos θ - I_3 ω_3 Ω + m g l = 0

    Source: H. Goldstein, Classical Mechanics, 5.7, with the gimbals' moments.
    """

    outer = Body(mass=0.5, inertia=(2e-3, 2e-3, 3e-3))
    inner = Body(mass=0.3, inertia=(1e-3, 1e-3, 1.5e-3))
    rotor = Body(mass=1.0, inertia=(1e-3, 1e-3, 1.8e-3), centre=(0, 0, 0.05))
    precession = Revolute(ground, outer, axis="z")
    nutation = Revolute(outer, inner, axis="y", start=1.0)
    spin = Revolute(inner, rotor, axis="z", start_rate=300.0)
    experiment = Experiment(stop_time=2.0, step_size=0.005)

    from liaisons_catalogue.solutions.gyroscope import steady_precession
