"""The car axis of the IVP Test Set."""

from liaisons.language import Experiment, Parameter
from liaisons.linkages import Body, BodyPoint, Linkage, Prismatic, Revolute, SpringDamper, ground


class CarAxis(Linkage):
    """Axle of a car: two masses on springs, with a rod between them; an operator lifts the right end of its road.

    The road is a bar of length L that turns by β(t), sin β = y_b/L.  The left mass moves perpendicular to it, which is
    the constraint x_l x_b + y_l y_b = 0 of the source; the right mass keeps the distance L from the left one.  Springs
    of stiffness 1/ε² stand on both ends of the road.

    Source: W. M. Mazzia, C. Magherini, Test Set for Initial Value Problem Solvers (2008), II-12, with y for z.
    """

    gravity = Parameter(1.0, "m/s2", "gravitational acceleration", symbol="g")
    road = Body()
    left = Body(mass=5.0)
    axle = Body(mass=5.0, centre=(1, 0, 0))
    lift = Revolute(ground, road, axis="-y", prescribed=True)
    bounce = Prismatic(road, left, axis="z", start=0.5)
    roll = Revolute(left, axle, axis="-y", start_rate=-1.0)
    wheel_l = BodyPoint(left)
    wheel_r = BodyPoint(axle, at=(1, 0, 0))
    spring_l = SpringDamper(ground, left, stiffness=1e4, length=0.5)
    spring_r = SpringDamper((road, (1, 0, 0)), wheel_r, stiffness=1e4, length=0.5)
    experiment = Experiment(stop_time=3.0, step_size=0.01)
