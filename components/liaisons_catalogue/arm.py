"""The arm with six axes."""

from math import pi

from liaisons.language import Experiment
from liaisons.linkages import Body, BodyPoint, Linkage, Revolute, Spherical, ground

_RIGHT = pi / 2


class Arm(Linkage):
    """Arm whose six axes an operator turns; from its flange a load hangs on a spherical joint.

    The axes follow the convention of Denavit and Hartenberg: each is given in the frame of the one before, and is
    parallel or perpendicular to it.  At rest the torques hold the weights, τ_i = z_i · Σ (o_i - c_k) × m_k g, summed
    over all bodies that axis i carries.

    Source: J. J. Craig, Introduction to Robotics, ch. 3 and 6.
    """

    base = Body(mass=20.0, inertia=(0.3, 0.3, 0.2), centre=(0, 0, 0.2))
    upper = Body(mass=12.0, inertia=(0.05, 0.4, 0.4), centre=(0.3, 0, 0))
    fore = Body(mass=6.0, inertia=(0.05, 0.05, 0.03), centre=(0.05, 0, 0.02))
    wrist_1 = Body(mass=3.0, inertia=(0.03, 0.03, 0.01), centre=(0, 0, 0.2))
    wrist_2 = Body(mass=1.5, inertia=0.003)
    flange = Body(mass=0.5, inertia=0.001, centre=(0, 0, 0.05))
    load = Body(mass=2.0, inertia=(0.02, 0.02, 0.01), centre=(0, 0, -0.25))
    axis_1 = Revolute(ground, base, prescribed=True)
    axis_2 = Revolute(base, upper, at=(0.1, 0, 0.4), rotation=(_RIGHT, 0, 0), prescribed=True, start=0.8)
    axis_3 = Revolute(upper, fore, at=(0.6, 0, 0), prescribed=True, start=-0.5)
    axis_4 = Revolute(fore, wrist_1, at=(0.1, 0, 0), rotation=(0, _RIGHT, 0), prescribed=True)
    axis_5 = Revolute(wrist_1, wrist_2, at=(0, 0, 0.5), rotation=(_RIGHT, 0, 0), prescribed=True, start=0.4)
    axis_6 = Revolute(wrist_2, flange, rotation=(-_RIGHT, 0, 0), prescribed=True)
    grip = Spherical(flange, load, at=(0, 0, 0.1))
    tip = BodyPoint(flange, at=(0, 0, 0.1))
    experiment = Experiment(stop_time=5.0, step_size=0.02)

    from liaisons_catalogue.solutions.arm import static_torques
