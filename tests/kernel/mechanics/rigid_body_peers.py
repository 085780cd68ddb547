"""Trees of bodies in Pinocchio and MuJoCo: mass matrix, inverse and forward dynamics by the names of coordinates."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol, final

import numpy as np
from scipy.spatial.transform import Rotation

from liaisons import Body, Linkage, ground

State = Mapping[str, float]
"""Coordinates, quaternions and their rates, by their names in an FMU."""


_MOMENTS = ("xx", "yy", "zz", "xy", "xz", "yz")  # as a declaration has them
_COUNTS = (7, 4, 1, 1)  # of coordinates, by the types of MuJoCo's joints: free, ball, slide, hinge


class Peer(Protocol):
    """A multibody library with one model; columns have one row a velocity, in the order of ``names``."""

    names: list[str]

    def mass_matrix(self, state: State) -> np.ndarray:
        """A of all velocities."""
        ...

    def inverse(self, state: State, accelerations: np.ndarray) -> np.ndarray:
        """Generalised forces that the accelerations take."""
        ...

    def forward(self, state: State, forces: np.ndarray) -> np.ndarray:
        """Accelerations under generalised forces."""
        ...


def inertia_of(body: Body) -> np.ndarray:
    """Tensor (3, 3) of a declaration."""
    moments: Any = body.inertia if isinstance(body.inertia, tuple) else [body.inertia] * 3
    tensor = np.zeros((3, 3))
    for name, value in zip(_MOMENTS, moments, strict=False):
        i, j = ("xyz".index(axis) for axis in name)
        tensor[i, j] = tensor[j, i] = value
    return tensor


def unit_vector(axis: Any) -> np.ndarray:
    """Of the name of an axis, or of numbers."""
    numbers = np.eye(3)["xyz".index(axis)] if isinstance(axis, str) else np.array(axis, float)
    return numbers / np.linalg.norm(numbers)


def joints_of(tree: type[Linkage]) -> list[Any]:
    """Joints depth first, as Pinocchio takes them."""
    joints = list(dict.fromkeys(frame.joint for frame in tree().frames))

    def outwards(body: Body) -> list[Any]:
        return [each for joint in joints if joint.parent is body for each in (joint, *outwards(joint.child))]

    return outwards(ground)


def gravity_of(tree: type[Linkage]) -> np.ndarray:
    """Acceleration of gravity (3,)."""
    return tree.gravity.start * np.array(tree.gravity_direction)  # type: ignore[attr-defined]


def columns_of(name: str, count: int) -> tuple[list[str], list[str]]:
    """Names of the coordinates, so many, and of the velocities of a joint; scalar first in a quaternion."""
    shifts = [f"{name}_{x}" for x in "xyz"] if count == 7 else []
    if count == 1:
        return [name], [f"{name}_dot"]
    turning = [f"{name}_omega_{x}" for x in "xyz"]
    return [*shifts, *(f"{name}_q_{x}" for x in "wxyz")], [*(f"{shift}_dot" for shift in shifts), *turning]


@final
class Pinocchio:
    """Peer ``pin`` of PyPI: recursive Newton-Euler, composite and articulated bodies.

    :param subject: a linkage, or the path of a URDF file.
    """

    def __init__(self, pinocchio: Any, subject: type[Linkage] | Path) -> None:
        self._pin = pinocchio
        self._model = self._read(subject) if isinstance(subject, Path) else self._of_linkage(subject)
        self._data = self._model.createData()
        joints = list(zip(self._model.names, self._model.joints, strict=True))[1:]  # the first one is the universe
        self._joints = [(joint.idx_q, *columns_of(name, joint.nq)) for name, joint in joints]
        self.names = [rate for *_, rates in self._joints for rate in rates]

    def _read(self, file: Path) -> Any:
        read = self._pin.buildModelFromMJCF if file.suffix == ".xml" else self._pin.buildModelFromUrdf
        return read(str(file))

    def _of_linkage(self, tree: type[Linkage]) -> Any:
        pin, model = self._pin, self._pin.Model()
        model.gravity = pin.Motion(gravity_of(tree), np.zeros(3))
        frames: dict[str, tuple[int, Any]] = {"ground": (0, pin.SE3.Identity())}
        for joint in joints_of(tree):
            parent, pose = frames[joint.parent.name]
            pose = pose * pin.SE3(Rotation.from_euler("xyz", joint.rotation).as_matrix(), np.array(joint.at, float))
            for ending, kind, axis in joint.motions:
                along = unit_vector(axis or joint.axis)
                if kind == "ball":
                    motion = pin.JointModelSpherical()
                elif pitch := getattr(joint, "pitch", 0.0):
                    motion = pin.JointModelHelicalUnaligned(along, pitch / (2 * np.pi))
                else:
                    motion = (pin.JointModelRevoluteUnaligned if kind == "turn" else pin.JointModelPrismaticUnaligned)(
                        along
                    )
                parent = model.addJoint(parent, motion, pose, f"{joint.name}{ending}")
                pose = pin.SE3.Identity()
            body = joint.child
            model.appendBodyToJoint(parent, pin.Inertia(body.mass, np.array(body.centre), inertia_of(body)), pose)
            frames[body.name] = parent, pose
        return model

    def _columns(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        q = np.zeros(self._model.nq)
        for row, names, _ in self._joints:
            ordered = [*names[1:], names[0]]  # scalar last
            q[row : row + len(names)] = [state[name] for name in ordered]
        return q, np.array([state[name] for name in self.names])

    def mass_matrix(self, state: State) -> np.ndarray:
        q, _ = self._columns(state)
        upper = np.triu(self._pin.crba(self._model, self._data, q))
        return upper + np.triu(upper, 1).T

    def inverse(self, state: State, accelerations: np.ndarray) -> np.ndarray:
        return self._pin.rnea(self._model, self._data, *self._columns(state), accelerations)

    def forward(self, state: State, forces: np.ndarray) -> np.ndarray:
        return self._pin.aba(self._model, self._data, *self._columns(state), forces)


@final
class Mujoco:
    """Peer ``mujoco`` of PyPI, without contacts, limits, and what else its simulations add.

    :param subject: a linkage, or the path of an MJCF or URDF file.
    """

    def __init__(self, mujoco: Any, subject: type[Linkage] | Path) -> None:
        self._mujoco = mujoco
        spec = mujoco.MjSpec.from_file(str(subject)) if isinstance(subject, Path) else self._of_linkage(subject)
        self._model: Any = spec.compile()
        self._model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_ACTUATION
        self._model.dof_damping[:] = 0.0  # of all peers the forces are those of bodies alone
        self._data = mujoco.MjData(self._model)
        joints = [self._model.joint(i) for i in range(self._model.njnt)]
        self._joints = [(joint.qposadr[0], *columns_of(joint.name, _COUNTS[joint.type[0]])) for joint in joints]
        self.names = [rate for *_, rates in self._joints for rate in rates]

    def _of_linkage(self, tree: type[Linkage]) -> Any:
        mujoco, spec = self._mujoco, self._mujoco.MjSpec()
        spec.option.gravity = gravity_of(tree)
        bodies = {"ground": spec.worldbody}
        kinds = {
            "turn": mujoco.mjtJoint.mjJNT_HINGE,
            "shift": mujoco.mjtJoint.mjJNT_SLIDE,
            "ball": mujoco.mjtJoint.mjJNT_BALL,
        }
        for joint in joints_of(tree):
            turn = Rotation.from_euler("xyz", joint.rotation).as_quat(scalar_first=True)
            body = bodies[joint.parent.name].add_body(name=joint.child.name, pos=joint.at, quat=turn)
            bodies[joint.child.name] = body
            for ending, kind, axis in joint.motions:
                body.add_joint(name=f"{joint.name}{ending}", type=kinds[kind], axis=unit_vector(axis or joint.axis))
            moments, axes = np.linalg.eigh(inertia_of(joint.child))
            axes[:, 0] *= np.linalg.det(axes)
            body.mass, body.ipos, body.inertia = joint.child.mass, joint.child.centre, moments
            body.iquat, body.explicitinertial = Rotation.from_matrix(axes).as_quat(scalar_first=True), True
        return spec

    def _set(self, state: State) -> Any:
        for row, names, _ in self._joints:
            self._data.qpos[row : row + len(names)] = [state[name] for name in names]
        self._data.qvel[:] = [state[name] for name in self.names]
        self._mujoco.mj_forward(self._model, self._data)
        return self._data

    def mass_matrix(self, state: State) -> np.ndarray:
        matrix, data = np.zeros((self._model.nv, self._model.nv)), self._set(state)
        self._mujoco.mj_fullM(self._model, data, matrix)
        return matrix

    def inverse(self, state: State, accelerations: np.ndarray) -> np.ndarray:
        data = self._set(state)
        data.qacc[:] = accelerations
        self._mujoco.mj_inverse(self._model, data)
        return data.qfrc_inverse.copy()

    def forward(self, state: State, forces: np.ndarray) -> np.ndarray:
        self._data.qfrc_applied[:] = forces
        accelerations = self._set(state).qacc.copy()
        self._data.qfrc_applied[:] = 0.0
        return accelerations
