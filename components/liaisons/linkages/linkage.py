"""A linkage: bodies and joints, from whose declarations coordinates, energies, constraints and picture follow."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from liaisons.algebra import hessian, stack
from liaisons.base.published import registered
from liaisons.errors import ComponentError
from liaisons.language import (
    Ball,
    DeclarationsOf,
    Gravity,
    Mechanism,
    Rod,
    Shape,
    Shapes,
    Spring,
    declarations_of,
    declare,
    is_positive_definite,
    reject_clashes,
)
from liaisons.linkages.joints import (
    MOMENTS,
    Attachment,
    Body,
    BodyFrame,
    BodyJoint,
    BodyPoint,
    Frame,
    SpringDamper,
    column,
    ground,
    skew,
)
from liaisons.linkages.loops import close_loops


class Linkage(Mechanism, abstract=True):
    """Bodies and the joints between them; abstract.

    Coordinates, energies and a picture follow from the declarations; a subclass may add what a mechanism declares.

    :raises ComponentError: when the subclass is defined, for a body or joint that is declared wrongly.
    """

    gravity = Gravity()
    gravity_direction: ClassVar[tuple[float, float, float]] = (0.0, 0.0, -1.0)
    redundant: ClassVar[tuple[str, ...]] = ()  # conditions of loops that follow from the others
    left_out: ClassVar[tuple[str, ...]] = ()  # what a robot's file has, and the linkage has not
    visuals: ClassVar[Mapping[str, Sequence[Callable[[BodyFrame], Shape]]]] = {}  # shapes, by body
    _springs = DeclarationsOf(SpringDamper)
    _tree: ClassVar[tuple[BodyJoint, ...]] = ()  # from ground outwards
    _closing: ClassVar[tuple[BodyJoint, ...]] = ()
    _joints: ClassVar[Mapping[str, BodyJoint]] = {}
    _declared_by: ClassVar[Mapping[str, str]] = {}  # by what a body or joint declares, its name

    def __init_subclass__(cls, *, abstract: bool = False, **kwargs: Any) -> None:
        if not abstract:
            _declare(cls)
            if cls._closing:
                reject_clashes(cls, cls().claimed_names())  # before loops are closed in other coordinates
                close_loops(cls, cls._closing)
        super().__init_subclass__(abstract=abstract, **kwargs)

    def __init__(self) -> None:
        super().__init__()
        names = [*(q.name for q in self.coordinates), *(name for o in self.orientations for name in o.rates)]
        rows = {name: [i] for group in (names, [s.name for s in self.actives]) for i, name in enumerate(group)}
        rows |= {o.name: [names.index(name) for name in o.rates] for o in self.orientations}
        self.frames: list[Frame] = []
        self._body_frames = {-1: _GROUND}
        self._numbers = {ground.name: -1}
        for joint in self._tree:
            for frame in joint.frames(self, self._numbers[joint.parent.name], len(self.frames), rows):
                self._body_frames[len(self.frames)] = self._body_frame(frame)
                self.frames.append(frame)
            self._numbers[joint.child.name] = len(self.frames) - 1

    @classmethod
    def from_urdf(
        cls,
        path: Path | str,
        prescribe: Iterable[str] = (),
        *,
        limits: bool = False,
        balance_inertia: bool = False,
        floating_base: bool = False,
        leave_out: Iterable[str] = (),
    ) -> type[Linkage]:
        """A class of a URDF file's links and joints; its root link is the ground.

        :param prescribe: joints that an operator prescribes.
        :param limits: whether limits of joints become stops; a start value outside moves to the middle.
        :param balance_inertia: whether principal moments of which one exceeds the sum of the others become their mean.
        :param floating_base: whether the root link moves freely, by the joint ``floating_base``.
        :param leave_out: names of elements or attributes that would move the bodies, which a linkage cannot.
        :raises ComponentError: for a file that cannot be read, or a wrong link or joint in it.
        """
        return cls._of_file(
            "urdf",
            path,
            prescribe=prescribe,
            limits=limits,
            balance_inertia=balance_inertia,
            floating_base=floating_base,
            leave_out=leave_out,
        )

    @classmethod
    def from_mjcf(
        cls,
        path: Path | str,
        prescribe: Iterable[str] = (),
        *,
        limits: bool = False,
        balance_inertia: bool = False,
        leave_out: Iterable[str] = (),
    ) -> type[Linkage]:
        """A class of an MJCF file's bodies and joints, with its gravity; arguments are those of from_urdf."""
        return cls._of_file(
            "mjcf", path, prescribe=prescribe, limits=limits, balance_inertia=balance_inertia, leave_out=leave_out
        )

    @classmethod
    def _of_file(cls, kind: str, path: Path | str, **options: Any) -> type[Linkage]:
        (read,) = registered("liaisons.robot_files")
        return read(cls, kind, path, **options)

    # ---- for use in methods --------------------------------------------------------------------------------------

    def frame_of(self, body: Body) -> BodyFrame:
        """Symbols of the frame of a body."""
        return self._body_frames[self._numbers[body.name]]

    def attached(self, point: Attachment, name: str = "") -> ca.SX:
        """Inertial coordinates of a point [m], (3, 1).

        :param name: of the parameters of its position in the body, unless it is a BodyPoint.
        """
        if isinstance(point, BodyPoint):
            return stack(getattr(self, point.name).values())
        body = point[0] if isinstance(point, tuple) else point
        return self.frame_of(body).position(self.parameter_vector(name))

    def elastic_energy(self) -> ca.SX:
        """Potential energy of the springs, at joints and between points."""
        total = ca.SX(0)
        for joint in self._tree:
            stretch = joint.value_in(self) - self.parameter_or_zero(f"{joint.name}_unstressed")
            total += self.parameter_or_zero(f"{joint.name}_stiffness") / 2 * ca.sumsqr(stretch)
        for spring in self._springs:
            length = self.parameter_or_zero(f"{spring.name}_length")
            stretch = getattr(self, spring.name) - length if length.nnz() else spring.vector_between(self)
            total += self.parameter_or_zero(f"{spring.name}_stiffness") / 2 * ca.sumsqr(stretch)
        return total

    def parameter_or_zero(self, name: str) -> ca.SX:
        """Symbol of a parameter; a structural 0 if there is none of this name."""
        return self.symbols.get(name, ca.SX(1, 1))

    def parameter_vector(self, name: str) -> ca.SX:
        """Column of the parameters ``name_x``, ``name_y``, ``name_z`` (3, 1); zeros are structural."""
        return stack(self.parameter_or_zero(f"{name}_{axis}") for axis in "xyz")

    def spatial_inertia(self, body: Body | None) -> ca.SX:
        """Matrix (6, 6) from angular velocity and velocity of a body's frame to angular momentum and momentum."""
        if body is None:
            return ca.SX(6, 6)
        mass, tensor = self.parameter_or_zero(f"{body.name}_mass"), ca.SX(3, 3)
        for moment in MOMENTS:
            if (name := f"{body.name}_inertia_{moment}") in self.symbols:
                i, j = ("xyz".index(axis) for axis in moment)
                tensor[i, j] = tensor[j, i] = self.symbols[name]
        offset = skew(self.parameter_vector(f"{body.name}_centre"))
        first = mass * offset
        return ca.sparsify(ca.blockcat(tensor - first @ offset, first, first.T, mass * ca.SX.eye(3)))

    # ---- a mechanism -----------------------------------------------------------------------------------------

    def kinetic_energy(self) -> ca.SX:
        total = ca.SX(0)
        for i, frame in enumerate(self.frames):
            velocity = ca.vertcat(self._body_frames[i].spin, self._body_frames[i].velocity)
            total += ca.dot(velocity, self.spatial_inertia(frame.body) @ velocity) / 2
            rates = (self.active.s_dot if frame.prescribed else self.free.q_dot)[frame.rows, 0]
            total += ca.dot(rates, frame.armature @ rates) / 2
        return total

    def potential_energy(self) -> ca.SX:
        return self._gravity_potential() + self.elastic_energy()

    def gravity_vector(self) -> ca.SX:
        """Acceleration of gravity [m/s2], (3, 1)."""
        return self.gravity * column(self.gravity_direction)

    def dissipation_function(self) -> ca.SX:
        total = ca.SX(0)
        for joint in self._tree:
            rates = self.dot(joint.value_in(self))
            if joint.motions and joint.motions[-1][1] == "ball":
                rates = ca.vertcat(rates, getattr(self, joint.name).rate)
            total += self.parameter_or_zero(f"{joint.name}_damping") / 2 * ca.sumsqr(rates)
        for spring in self._springs:
            if f"{spring.name}_damping" in self.symbols:
                total += (
                    self.parameter_or_zero(f"{spring.name}_damping") / 2 * self.dot(getattr(self, spring.name)) ** 2
                )
        return total

    def picture(self) -> Shapes:
        def position(point: Attachment, name: str = "") -> dict[str, ca.SX]:
            return dict(zip("xyz", ca.vertsplit(self.attached(point, name)), strict=True))

        arms = [(joint.parent, f"{joint.name}_at") for joint in (*self._tree, *self._closing)]
        arms += [(joint.child, f"{joint.name}_at_child") for joint in self._closing]
        centres = [(frame.body, f"{frame.body.name}_centre") for frame in self.frames if frame.body]
        hidden = self.visuals.keys()
        rods = [
            Rod(position(body), position(body, name))
            for body, name in (*arms, *centres)
            if self.parameter_vector(name).nnz() and body.name not in hidden
        ]
        sprung = {end for spring in self._springs for end, _ in spring.named_ends}
        slides = [
            Rod(position(joint.parent, f"{joint.name}_at"), position(joint.child))
            for joint in self._tree
            if [kind for _, kind, _ in joint.motions].count("shift") == 1 and joint.child not in sprung
        ]
        balls = [Ball(position(*centre)) for centre in centres if centre[0].name not in hidden]
        frames = {body: self._body_frames[self._numbers[body]] for body in hidden}
        drawn = [shape(frames[body]) for body, shapes in self.visuals.items() for shape in shapes]
        springs = [Spring(*(position(end, name) for end, name in s.named_ends)) for s in self._springs]
        return [*rods, *slides, *balls, *drawn, *springs]

    @property
    def has_derived_energies(self) -> bool:
        """Whether the energies are those of the declared bodies and joints; a subclass may override them."""
        names = ("kinetic_energy", "potential_energy", "lagrangian")
        return all(getattr(type(self), name) is getattr(Linkage, name) for name in names)

    # ---- derived ---------------------------------------------------------------------------------------------

    def _check_mass_matrix(self, lagrangian: ca.SX, motion: dict[str, ca.SX]) -> None:
        start, metric = self.start_values(), hessian(lagrangian, self.free.q_dot)
        matrix = np.array(ca.Function("A", [*motion.values()], [metric])(*(start[name] for name in motion)))
        if is_positive_definite(matrix):
            return
        if not np.isfinite(matrix).all():
            raise ComponentError(f"{type(self).__name__}: the kinetic energy is not finite at the start; check places")
        sizes, directions = np.linalg.eigh(matrix)
        shares = np.square(directions[:, np.abs(sizes) <= 1e-14 * np.abs(matrix).max(initial=0.0)]).sum(axis=1)
        still = [i for i, share in enumerate(shares) if share > 0.99] or [int(np.argmax(np.abs(directions[:, 0])))]
        frame = next(frame for frame in self.frames if not frame.prescribed and still[0] in frame.rows)
        rates = ", ".join(str(self.free.q_dot[row]) for row in still)
        frame.joint.refuse(
            f"no mass moves with {rates} at the start, neither of {frame.joint.child.name} nor of "
            "what it carries; give it a mass, or an inertia, or let prescribed=True"
        )

    def _gravity_potential(self) -> ca.SX:
        """Potential energy of the weights."""
        bodies = [frame.body for frame in self.frames if frame.body]
        moments = (
            self.parameter_or_zero(f"{body.name}_mass") * self.attached(body, f"{body.name}_centre") for body in bodies
        )
        return -ca.dot(self.gravity_vector(), sum(moments, ca.SX(3, 1)))

    def _body_frame(self, frame: Frame) -> BodyFrame:
        """Symbols of a frame, from those of its parent."""
        parent = self._body_frames[frame.parent]
        rates = (self.active.s_dot if frame.prescribed else self.free.q_dot)[frame.rows, 0]
        own = frame.axes @ rates
        spin = frame.rotation.T @ parent.spin + own[:3]
        velocity = frame.rotation.T @ (parent.velocity + skew(parent.spin) @ frame.position) + own[3:]
        return BodyFrame(parent.matrix @ frame.rotation, parent.position(frame.position), spin, velocity)


_GROUND = BodyFrame(ca.SX.eye(3), ca.SX(3, 1), ca.SX(3, 1), ca.SX(3, 1))


def _declare(cls: type[Linkage]) -> None:
    """Replace the bodies and joints of a class by what they declare, and order its joints.

    :raises ComponentError: for one that is declared wrongly.
    """
    cls._joints = {**cls._joints, **{joint.name: joint for joint in declarations_of(cls, BodyJoint)}}
    bodies: tuple[Any, ...] = declarations_of(cls, Body)
    joints, attached = [*cls._joints.values()], (*declarations_of(cls, SpringDamper), *declarations_of(cls, BodyPoint))
    names = {id(body) for body in bodies} | {id(ground)}
    for item in (*joints, *attached):
        for body in item.bodies:
            if not isinstance(body, Body) or id(body) not in names:
                label = getattr(body, "name", body)
                item.refuse(f"{label!r} is not a body of {cls.__name__}; declare it above by Body(...), or take ground")
    cls._tree = _joints_outwards(bodies, joints)
    cls._closing = tuple(joint for joint in joints if joint not in cls._tree)
    for item in (*bodies, *joints, *attached):
        if item.name in vars(cls):  # not inherited, with what it declares
            _expand(cls, item)


def _joints_outwards(bodies: Iterable[Any], joints: Iterable[Any]) -> tuple[BodyJoint, ...]:
    """The first joint of each body, in an order from ground outwards."""
    inner: dict[str, BodyJoint] = {}
    for joint in joints:
        if joint.child is ground:
            joint.refuse(f"the second body is ground; let it be {joint.parent.name}, and the first one ground")
        if joint.child is joint.parent:
            joint.refuse(f"both bodies are {joint.child.name}; a joint has two")
        inner.setdefault(joint.child.name, joint)
    for body in bodies:
        if body.name not in inner:
            body.refuse(f"no joint holds this body; a free one has Free(ground, {body.name})")
    order: list[Any] = []
    left: list[Any] = [*inner.values()]
    while left:
        reached = {ground.name, *(joint.child.name for joint in order)}
        ready = [joint for joint in left if joint.parent.name in reached]
        if not ready:
            first = left[0]
            first.refuse(f"{first.child.name} hangs on {first.parent.name}, from which no joint leads to ground")
        order += ready
        left = [joint for joint in left if joint not in ready]
    return tuple(order)


def _expand(cls: type[Linkage], item: Any) -> None:
    """Replace a body, joint, point or spring in its class by what it declares, and by itself if its name stays free."""
    closes = [item in cls._closing] * isinstance(item, BodyJoint)
    delattr(cls, item.name)  # coordinates in the order of the joints
    for name, declaration in (*item.declarations(*closes), (item.name, item)):
        present, owner = vars(cls).get(name), cls._declared_by.get(name, item.name)
        if declaration is item:
            if present is None:
                declare(cls, name, declaration)
        elif owner != item.name or (present is not None and not isinstance(present, type(declaration))):
            other = owner if owner != item.name else type(present).__name__
            item.refuse(f"it declares {name}, as {other} does; rename one of them")
        else:
            cls._declared_by = {**cls._declared_by, name: item.name}
            if present is None:  # else it is declared by hand
                declare(cls, name, declaration)
