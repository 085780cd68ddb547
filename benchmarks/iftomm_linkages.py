"""The IFToMM benchmarks A01 to A05 as bodies and joints; all numbers are those of the specifications."""

from __future__ import annotations

from math import pi
from types import new_class
from typing import Any

from _measure import HERE

from liaisons.base.project import load_module
from liaisons.linkages import Body, BodyPoint, Linkage, Prismatic, Revolute, SpringDamper, ground

Squeezer = load_module(HERE.parent / "scenarios" / "andrews_squeezer.py").Squeezer
"""A03."""


class JointedPendulum(Linkage):
    """A01: a point mass at the end of a massless bar, let go horizontally."""

    bar = Body(mass=1.0, centre=(1, 0, 0))
    pivot = Revolute(ground, bar, axis="-y")
    bob = BodyPoint(bar, at=(1, 0, 0))


def jointed_four_bars(windows: int) -> type[Linkage]:
    """A02: rods of 1 kg and 1 m, upright at the start, that lying ones join at their tops; they fall at 1 rad/s."""
    members: dict[str, Any] = {}
    for i in range(windows + 1):
        members[f"standing_{i}"] = _rod()
        members[f"pivot_{i}"] = Revolute(
            ground, members[f"standing_{i}"], axis="-y", at=(i, 0, 0), start=pi / 2, start_rate=-1.0
        )
    for i in range(windows):
        left, right = members[f"standing_{i}"], members[f"standing_{i + 1}"]
        members[f"lying_{i}"] = lying = _rod()
        members[f"left_{i}"] = Revolute(left, lying, axis="-y", at=(1, 0, 0), start=-pi / 2, start_rate=1.0)
        members[f"right_{i}"] = Revolute(right, lying, axis="-y", at=(1, 0, 0), at_child=(1, 0, 0))
    members["top"] = BodyPoint(members["standing_0"], at=(1, 0, 0))
    return new_class(f"JointedFourBars{windows}", (Linkage,), exec_body=lambda names: names.update(members))


def _rod(axis: str = "x", sign: int = 1, width: float = 0.0, mass: float = 1.0) -> Body:
    """A prism of the length 1 m along an axis from the origin of its frame."""
    across, along = mass * (1 + width**2) / 12, mass * width**2 / 6
    moments = tuple(along if name == axis else across for name in "xyz")
    return Body(mass=mass, inertia=moments, centre=tuple(0.5 * sign * (name == axis) for name in "xyz"))


class BricardMechanism(Linkage):
    """A04: five rods of 1 kg along edges of a cube, of a square cross section of 0.1 m; y points up."""

    gravity_direction = (0.0, -1.0, 0.0)
    rod_1, rod_2, rod_3 = _rod("x", 1, 0.1), _rod("y", -1, 0.1), _rod("z", 1, 0.1)
    rod_4, rod_5 = _rod("x", -1, 0.1), _rod("y", 1, 0.1)
    hinge_1 = Revolute(ground, rod_1, axis="y")
    hinge_2 = Revolute(rod_1, rod_2, axis="z", at=(1, 0, 0))
    hinge_3 = Revolute(rod_2, rod_3, axis="x", at=(0, -1, 0))
    hinge_4 = Revolute(rod_3, rod_4, axis="y", at=(0, 0, 1))
    hinge_5 = Revolute(rod_4, rod_5, axis="z", at=(-1, 0, 0))
    hinge_6 = Revolute(ground, rod_5, axis="x", at=(0, 0, 1), at_child=(0, 1, 0))
    P_3 = BodyPoint(rod_3)


def _arm() -> Body:
    """A rod of the governor with its ball at the end."""
    rod, ball = 0.3, 5.0
    across = rod * 1.0001 / 12 + rod * ball / (rod + ball) * 0.25
    return Body(
        mass=rod + ball, inertia=(rod * 0.0002 / 12, across, across), centre=((0.5 * rod + ball) / (rod + ball), 0, 0)
    )


class FlyballGovernor(Linkage):
    """A05: shaft, slider and two arms with balls; springs and dampers stand for the couplers."""

    shaft = _rod("z", 1, 0.01, 0.3)
    slider = Body(mass=3.0, inertia=0.005)
    arm_1, arm_2 = _arm(), _arm()
    spin = Revolute(ground, shaft, axis="z", start_rate=2 * pi)
    s = Prismatic(shaft, slider, axis="z", start=0.5)
    hinge_1 = Revolute(shaft, arm_1, axis="y", at=(0.05, 0, 1), start=pi / 6)
    hinge_2 = Revolute(shaft, arm_2, axis="y", at=(-0.05, 0, 1), start=5 * pi / 6)
    coupler_1 = SpringDamper((slider, (0.05, 0, 0)), (arm_1, (0.5, 0, 0)), stiffness=8e5, damping=4e4, length=0.5)
    coupler_2 = SpringDamper((slider, (-0.05, 0, 0)), (arm_2, (0.5, 0, 0)), stiffness=8e5, damping=4e4, length=0.5)


def joints_of(component: type[Linkage]) -> list[Any]:
    """Joints as declared, in their order."""
    return [*component._joints.values()]  # noqa: SLF001 - a class has coordinates and conditions in their stead
