"""Random linkages, and their Lagrangian by another road than the recursion."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from liaisons import (
    Body,
    Cylindrical,
    Free,
    Linkage,
    Planar,
    Prismatic,
    Revolute,
    Screw,
    Spherical,
    Universal,
    Weld,
    ground,
)
from liaisons.mechanics import Equations

SIMPLE = (Revolute, Prismatic)
ALL = (Revolute, Revolute, Prismatic, Cylindrical, Screw, Universal, Spherical, Planar, Free, Weld)


def random_tree(
    seed: int, most: int = 12, joints: tuple[type, ...] = ALL, *, prescribed: bool | None = None, **more: Any
) -> type[Linkage]:
    """A tree of up to ``most`` bodies with random joints, a third of them prescribed; or all, or none."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, most + 1))
    bodies = [random_body(rng) for _ in range(count)]
    names: dict[str, Any] = {"__doc__": "A random tree.", "gravity_direction": tuple(rng.normal(size=3))}
    for i, body in enumerate(bodies):
        parent = ground if i == 0 else bodies[int(rng.integers(max(0, i - 3), i))]
        kind = joints[int(rng.integers(len(joints)))]
        kind = Revolute if i == 0 and kind is Weld else kind  # something moves
        options: dict[str, Any] = {"at": tuple(rng.normal(size=3)), "rotation": tuple(rng.uniform(-3, 3, 3))}
        if kind in (Revolute, Prismatic, Cylindrical, Screw):
            options["axis"] = ("x", "y", "z", tuple(rng.normal(size=3)))[int(rng.integers(4))]
        if kind not in (Spherical, Free, Weld):
            third = bool(rng.integers(3) == 0)
            options["prescribed"] = third if prescribed is None else prescribed
        if kind is Screw:
            options["pitch"] = 0.5
        if kind in SIMPLE and rng.integers(2):
            options |= {"stiffness": 2.0, "damping": 0.3}
        names |= {f"body_{i}": body, f"joint_{i}": kind(parent, body, **options)}
    return type("RandomTree", (Linkage,), names | more)


def random_body(rng: np.random.Generator) -> Body:
    """A body whose moments of inertia are those of masses."""
    points = rng.normal(size=(5, 3))
    points -= points.mean(axis=0)
    tensor = np.trace(points.T @ points) * np.eye(3) - points.T @ points
    moments = tuple(tensor[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    return Body(float(rng.uniform(0.5, 3)), moments, tuple(rng.normal(size=3)))


def by_differentiation(tree: type[Linkage]) -> type[Linkage]:
    """The same linkage with T from the rates of points and rotation matrices, so that no recursion derives it."""

    def kinetic_energy(m: Any) -> ca.SX:
        total = ca.SX(0)
        for q in (*m.coordinates, *m.actives):
            total += m.parameter_or_zero(f"{q.name}_armature") * m.dot(m.symbols[q.name]) ** 2 / 2
        for item in vars(tree).values():
            if not isinstance(item, Body):
                continue
            frame = m.frame_of(item)
            centre = frame.position(m.parameter_vector(f"{item.name}_centre"))
            W = frame.matrix.T @ m.dot(frame.matrix)
            omega = ca.vertcat(W[2, 1], W[0, 2], W[1, 0])
            inertia = ca.SX(3, 3)
            for name in ("xx", "yy", "zz", "xy", "xz", "yz"):
                i, j = ("xyz".index(axis) for axis in name)
                inertia[i, j] = inertia[j, i] = m.parameter_or_zero(f"{item.name}_inertia_{name}")
            total += m.parameter_or_zero(f"{item.name}_mass") * ca.sumsqr(m.dot(centre)) / 2
            total += ca.dot(omega, inertia @ omega) / 2
        return total

    return type("ByDifferentiation", (tree,), {"__doc__": tree.__doc__, "kinetic_energy": kinetic_energy})


def random_state(equations: Equations, seed: int) -> dict[str, float]:
    """Values of all symbols but parameters; quaternions have unit length."""
    rng, m = np.random.default_rng(seed), equations.mechanism
    names = [str(x) for x in ca.symvar(ca.vertcat(*equations.symbols.values()))]
    parameters = {p.name for p in m.parameters}
    state = {name: float(rng.normal()) for name in names if name not in parameters}
    for orientation in m.orientations:
        q = rng.normal(size=4)
        state |= dict(zip(orientation.quaternion, q / np.linalg.norm(q), strict=True))
    return state
