"""Files of robots in MuJoCo and Pinocchio: mass matrix and forces at random states, beside those of a linkage.

``python tests/kernel/language/robot_peers.py FILE...`` prints a table: read and equal, or refused by line.
"""

from __future__ import annotations

import re
import sys
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from liaisons import Linkage, derive
from liaisons.errors import ComponentError

STATES = 20
DIGITS = 1e-9
"""Difference from a peer, relative to the largest number of each kind; both are right to rounding."""


class Joint(NamedTuple):
    """Rows of a joint in a peer's configuration and velocity, and their counts."""

    name: str
    q: int
    v: int
    counts: tuple[int, int]
    axes: Rotation = Rotation.identity()  # of a free joint, before it moves
    place: tuple[float, ...] = (0.0, 0.0, 0.0)


def identifier(name: str) -> str:
    word = re.sub(r"\W", "_", name, flags=re.ASCII).strip("_")
    return f"n{word}" if word[:1].isdigit() else word


def _peer(name: str) -> Any:
    return import_module(name)


class MujocoFile:
    """An MJCF file in MuJoCo, without contacts, limits and actuators."""

    def __init__(self, file: Path) -> None:
        self.mujoco = mujoco = _peer("mujoco")
        self.model: Any = mujoco.MjModel.from_xml_path(str(file))
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_ACTUATION
        self.data = mujoco.MjData(self.model)
        names: dict[str, int] = {}
        self.joints: list[Joint] = []
        for i in range(self.model.njnt):
            joint, body = self.model.joint(i), self.model.body(self.model.jnt_bodyid[i])
            owner = body.name or f"body_{body.id}"
            names[owner] = names.get(owner, 0) + 1
            label = joint.name or f"{owner}_joint{f'_{names[owner]}' if names[owner] > 1 else ''}"
            count, q = [(7, 6), (4, 3), (1, 1), (1, 1)][joint.type[0]], joint.qposadr[0]
            start = self.model.qpos0[q : q + 7]
            found = Joint(identifier(label), q, joint.dofadr[0], count)
            if count == (7, 6):
                found = found._replace(axes=Rotation.from_quat(np.roll(start[3:], -1)), place=tuple(start[:3]))
            self.joints.append(found)
        self.size = self.model.nq, self.model.nv

    def configuration(self, joint: Joint, values: np.ndarray, turn: Rotation) -> np.ndarray:
        """qpos of a joint, of shifts along its axes and a turn."""
        if joint.counts == (1, 1):
            return values
        quaternion = np.roll((joint.axes * turn).as_quat(), 1)
        return np.array([*(joint.place + joint.axes.apply(values)), *quaternion] if len(values) else quaternion)

    def shift_axes(self, joint: Joint, _turn: Rotation) -> np.ndarray:
        """Matrix from rates of shifts to velocities."""
        return joint.axes.as_matrix()

    def turning(self, _spin: np.ndarray, _velocity: np.ndarray) -> np.ndarray:
        """Rate of a velocity beyond that along its axes, as they stand still."""
        return np.zeros(3)

    def numbers(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mass matrix and forces A q̈."""
        self.data.qpos[:], self.data.qvel[:] = q, v
        self.mujoco.mj_forward(self.model, self.data)
        matrix = np.zeros((self.model.nv, self.model.nv))
        self.mujoco.mj_fullM(self.model, self.data, matrix)
        return matrix, self.data.qfrc_passive - self.data.qfrc_bias


class PinocchioFile:
    """A URDF file in Pinocchio, where every joint moves, also one that mimics another."""

    def __init__(self, file: Path, tree: type[Linkage]) -> None:
        self.pin = pinocchio = _peer("pinocchio")
        text, floats = balanced(file, tree), "floating_base_x" in [c.name for c in tree.coordinates]
        base = [pinocchio.JointModelFreeFlyer()] * floats
        self.model: Any = pinocchio.buildModelFromXML(text, *base)
        self.data = self.model.createData()
        named = list(zip(self.model.names, self.model.joints, strict=True))[1:]
        self.joints = [
            Joint("floating_base" if j.nq == 7 and i == 0 and floats else identifier(n), j.idx_q, j.idx_v, (j.nq, j.nv))
            for i, (n, j) in enumerate(named)
        ]
        self.size = self.model.nq, self.model.nv

    def configuration(self, joint: Joint, values: np.ndarray, turn: Rotation) -> np.ndarray:
        """Configuration of a joint, of shifts along its axes and a turn; of a continuous one cosine and sine."""
        if joint.counts == (2, 1):
            return np.array([np.cos(values[0]), np.sin(values[0])])
        return values if joint.counts == (1, 1) else np.array([*values, *turn.as_quat()])

    def shift_axes(self, _joint: Joint, turn: Rotation) -> np.ndarray:
        """Matrix from rates of shifts to velocities, along the axes of the body."""
        return turn.inv().as_matrix()

    def turning(self, spin: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Rate of a velocity beyond that along its axes, which turn."""
        return -np.cross(spin, velocity)

    def numbers(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mass matrix and forces A q̈."""
        matrix = np.triu(self.pin.crba(self.model, self.data, q))
        forces = -self.pin.nle(self.model, self.data, q, v) - self.model.damping * v
        return matrix + np.triu(matrix, 1).T, forces


def balanced(file: Path, tree: type[Linkage]) -> str:
    """Text of a URDF file, with the class's inertia of the links that left_out says are balanced."""
    document = ElementTree.parse(file).getroot()
    starts = {p.name: p.start for p in tree.parameters}
    for link in document.findall("link"):
        name = link.get("name", "")
        if not any(line.startswith(f"inertia of link {name!r} as printed") for line in tree.left_out):
            continue
        label = next(n for n in (identifier(name), f"{identifier(name)}_link") if f"{n}_mass" in starts)
        inertial: Any = link.find("inertial")
        origin, tensor = inertial.find("origin"), np.zeros((3, 3))
        angles = "0 0 0" if origin is None else origin.get("rpy", "0 0 0")
        R = Rotation.from_euler("xyz", [float(word) for word in angles.split()]).as_matrix()
        for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)):
            tensor[i, j] = tensor[j, i] = starts.get(f"{label}_inertia_{'xyz'[i]}{'xyz'[j]}", 0.0)
        tensor = R.T @ tensor @ R
        for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"):
            inertial.find("inertia").set(key, repr(float(tensor["xyz".index(key[1]), "xyz".index(key[2])])))
    return ElementTree.tostring(document, encoding="unicode")


def distances(tree: type[Linkage], peer: MujocoFile | PinocchioFile) -> tuple[float, float]:
    """Largest differences of mass matrix and forces at random states, relative to the largest number of each."""
    equations, rng = derive(tree), np.random.default_rng(47)
    function = ca.Function("f", [ca.vertcat(*equations.symbols.values())], [equations.mass_matrix, equations.forces])
    coordinates = [c.name for c in tree.coordinates]
    rates = [*(f"{name}_dot" for name in coordinates), *(name for o in tree.orientations for name in o.rates)]
    worst = np.zeros(2)
    for _ in range(STATES):
        (q, v), T, state = map(np.zeros, peer.size), np.zeros((len(rates), len(rates))), dict[str, float]()
        for joint in peer.joints:
            shifts = [f"{joint.name}_{axis}" for axis in "xyz"] if joint.counts[1] == 6 else [joint.name]
            shifts *= joint.counts[1] != 3
            values, turn = rng.uniform(-1, 1, len(shifts)), Rotation.from_quat(rng.normal(size=4))
            own = [f"{name}_dot" for name in shifts]
            state |= dict(zip(shifts, values.tolist(), strict=True))
            q[joint.q : joint.q + joint.counts[0]] = peer.configuration(joint, values, turn)
            block = np.eye(joint.counts[1])
            if joint.counts[1] == 6:
                block[:3, :3] = peer.shift_axes(joint, turn)
            if joint.counts[1] > 1:
                x, y, z, w = turn.as_quat().tolist()
                state |= {f"{joint.name}_q_{axis}": c for axis, c in zip("wxyz", (w, x, y, z), strict=True)}
                own += [f"{joint.name}_omega_{axis}" for axis in "xyz"]
            T[joint.v : joint.v + joint.counts[1], [rates.index(name) for name in own]] = block
        speeds = rng.uniform(-1, 1, len(rates))
        numbers = equations.numbers(state | dict(zip(rates, speeds.tolist(), strict=True)))
        v = T @ speeds
        matrix, forces = peer.numbers(q, v)
        for joint in (joint for joint in peer.joints if joint.counts[1] == 6):
            first, middle, last = joint.v, joint.v + 3, joint.v + 6
            forces = forces - matrix[:, first:middle] @ peer.turning(v[middle:last], v[first:middle])
        got = [np.array(result) for result in function([*numbers.values()])]
        for i, (ours, theirs) in enumerate(zip(got, (T.T @ matrix @ T, T.T @ forces), strict=True)):
            size = max(np.abs(theirs).max(), np.abs(matrix).max())  # forces of an acceleration of 1 at least
            worst[i] = max(worst[i], np.abs(ours.reshape(theirs.shape) - theirs).max() / size)
    return worst[0], worst[1]


def read(file: Path) -> tuple[type[Linkage] | None, str]:
    """Class of a file and the options that it takes beside none; None and the refusal of one that has no such."""
    options: dict[str, Any] = {}
    while True:
        try:
            make = Linkage.from_urdf if file.suffix == ".urdf" else Linkage.from_mjcf
            return make(file, **options), ", ".join(options)
        except ComponentError as error:
            asked = next((key for key in ("balance_inertia", "floating_base") if f"{key}=True" in str(error)), None)
            if asked is None or asked in options:
                return None, str(error).partition(": ")[2]
            options[asked] = True


def peer_of(file: Path, tree: type[Linkage]) -> MujocoFile | PinocchioFile:
    return PinocchioFile(file, tree) if file.suffix == ".urdf" else MujocoFile(file)


def row(file: Path) -> str:
    """Row of a table: file, how far mass matrix and forces are from those of its peer, options or refusal."""
    tree, words = read(file)
    if tree is None:
        return f"| {file.name} | refused | {words} |"
    errors = distances(tree, peer_of(file, tree))
    verdict = "equal" if max(errors) <= DIGITS else "UNEQUAL"
    return f"| {file.name} | {verdict}: {errors[0]:.0e}, {errors[1]:.0e} | {words} |"


if __name__ == "__main__":
    for name in sys.argv[1:]:
        sys.stdout.write(f"{row(Path(name))}\n")
        sys.stdout.flush()
