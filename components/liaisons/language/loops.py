"""Loops of a linkage: conditions at the joints that close them, of which some are redundant, and the start."""

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from liaisons.expressions.algebra import stack
from liaisons.language.declarations import constraint
from liaisons.language.joints import BodyJoint, Refusal, direction, named, rotated

CLOSED = 1e-10
"""Residual below which a loop is closed [m, 1]."""

_ROUNDS = 60
_RANK = 1e-6  # of a row, relative to the largest: below, it depends on the rows before
_CONDITIONS = {  # of joints by class: components of the offset, and pairs of axes that stay at right angles
    "Revolute": ("uvw", ("wu", "wv")),
    "Prismatic": ("uv", ("wu", "wv", "uv")),
    "Cylindrical": ("uv", ("wu", "wv")),
    "Universal": ("uvw", ("yx",)),
    "Spherical": ("uvw", ()),
    "Planar": ("z", ("zx", "zy")),
    "Weld": ("uvw", ("wu", "wv", "uv")),
}


def close_loops(component: Any, closing: Iterable[BodyJoint]) -> tuple[str, ...]:
    """Declare the conditions of the joints that close loops, and move the start values onto them.

    Conditions that depend on the others, by the rank of their gradients at a configuration nearby, are redundant; those
    that do so in open loops, too, as out of the plane of a plane one, are left out.

    :returns: names of the redundant conditions.
    :raises ComponentError: for a joint that cannot close a loop, or a loop that cannot be closed near the start.
    """
    conditions: dict[str, Callable[[Any], ca.SX]] = {}
    for joint in closing:
        for declaration in _conditions(component.__name__, joint):
            setattr(component, declaration.name, declaration)
            conditions[declaration.name] = declaration.method
    m = component()
    coordinates = m.coordinates
    free, x = m.free, ca.vertcat(m.free.q, m.active.s)
    residuals = stack(condition(m) for condition in conditions.values())
    K = ca.diagcat(free.kinematics, ca.SX.eye(m.active.s.shape[0]))
    slope = ca.jacobian(residuals, x) @ K
    values = m.start_values()
    function = ca.Function("loops", [x, m.parameter_column], [residuals, slope, K])
    numbers = [values[name] for parameter in m.parameters for name in parameter.names]
    start = np.array([values[str(symbol)] for symbol in ca.vertsplit(x)])

    def at(position: np.ndarray) -> tuple[np.ndarray, ...]:
        return tuple(np.array(result) for result in function(position, numbers))

    adjusted = np.zeros(K.shape[1], bool)
    adjusted[: len(coordinates)] = True
    closed = _closed(at, start, adjusted)
    gaps = np.abs(at(closed)[0]).ravel()
    if not gaps.max(initial=0.0) < CLOSED:
        worst = [*conditions][int(np.argmax(gaps))]
        joint = next(j for j in closing if worst.startswith(f"{j.name}_"))
        Refusal(component.__name__, joint.name)(
            f"the loop through {joint.parent.name} and {joint.child.name} does not close near the start: {worst} stays "
            f"{gaps.max():.3g}; check at, at_child and the start values"
        )
    for item, value in zip(coordinates, closed, strict=False):
        item.start = float(value)
    dependent = _dependent(at(_nearby(at, closed))[1])
    # Those that depend on the others while loops are closed alone may be needed where the others lose rank.
    always = _dependent(at(_moved(at, closed))[1])
    for name in (name for i, name in enumerate(conditions) if i in dependent & always):
        delattr(component, name)
    delattr(component, "_constraints")  # what was collected before
    return tuple(name for i, name in enumerate(conditions) if i in dependent)


def _conditions(owner: str, joint: BodyJoint) -> Iterator[constraint]:
    refuse, kind = Refusal(owner, joint.name), type(joint).__name__
    if kind not in _CONDITIONS:
        refuse(f"a {kind} joint closes no loop; let another joint of the loop, declared last, close it")
    if joint.prescribed:
        refuse("it closes a loop, so that it has no coordinate to prescribe; declare it before another of the loop")
    offsets, pairs = _CONDITIONS[kind]
    w = direction(joint.axis)
    u = np.cross(w, np.eye(3)[int(np.argmin(np.abs(w)))])
    u /= np.linalg.norm(u)
    axes = {"u": u, "v": np.cross(w, u), "w": w} | dict(zip("xyz", np.eye(3), strict=True))
    columns = {name: ca.SX(ca.sparsify(ca.DM(axis))) for name, axis in axes.items()}
    for i, letter in enumerate(offsets, start=1):
        text = f"{joint.child.name} stays at {joint.parent.name}, along axis {i} of {joint.name}"
        method = partial(_offset, joint=joint, axis=columns[letter])
        yield named(constraint("m", text)(method), f"{joint.name}_offset_{i}")
    for i, (first, second) in enumerate(pairs, start=1):
        text = f"axes of {joint.child.name} and {joint.parent.name} stay at right angles in {joint.name}"
        method = partial(_cosine, joint=joint, first=columns[first], second=columns[second])
        yield named(constraint("1", text)(method), f"{joint.name}_angle_{i}")


def _offset(m: Any, *, joint: BodyJoint, axis: ca.SX) -> ca.SX:
    parent, child = m.frame_of(joint.parent), m.frame_of(joint.child)
    distance = child.position(m.vector(f"{joint.name}_at_child")) - parent.position(m.vector(f"{joint.name}_at"))
    return ca.dot(parent.matrix @ rotated(joint.rotation) @ axis, distance)


def _cosine(m: Any, *, joint: BodyJoint, first: ca.SX, second: ca.SX) -> ca.SX:
    child = m.frame_of(joint.child).matrix @ rotated(joint.rotation_child) @ first
    return ca.dot(child, m.frame_of(joint.parent).matrix @ rotated(joint.rotation) @ second)


def _closed(at: Callable[..., tuple[np.ndarray, ...]], start: np.ndarray, adjusted: np.ndarray) -> np.ndarray:
    """Configuration near the start in which the loops are closed, by the Gauss-Newton method."""
    position = start
    for _ in range(_ROUNDS):
        residuals, slope, K = at(position)
        if np.abs(residuals).max(initial=0.0) < 1e-15:
            break
        step = np.zeros(len(adjusted))
        step[adjusted] = np.linalg.lstsq(slope[:, adjusted], residuals.ravel(), rcond=1e-9)[0]
        longest = np.abs(step).max(initial=0.0)
        position = position - K @ step * min(1.0, 0.5 / longest if longest else 1.0)
    return position


def _nearby(at: Callable[..., tuple[np.ndarray, ...]], closed: np.ndarray) -> np.ndarray:
    """Another configuration with closed loops, in general position; the same one where none is met."""
    position = _moved(at, closed)
    moved = _closed(at, position, np.ones(at(closed)[2].shape[1], bool))
    return moved if np.abs(at(moved)[0]).max(initial=0.0) < CLOSED else closed


def _moved(at: Callable[..., tuple[np.ndarray, ...]], closed: np.ndarray) -> np.ndarray:
    """Another configuration, in which the loops are open."""
    K = at(closed)[2]
    return closed + K @ np.random.default_rng(0).uniform(-0.3, 0.3, K.shape[1])


def _dependent(slope: np.ndarray) -> set[int]:
    """Rows that are linear combinations of those before."""
    basis, dependent = np.zeros((0, slope.shape[1])), set[int]()
    largest = np.abs(slope).max(initial=0.0)
    for i, row in enumerate(slope):
        left = row - basis.T @ (basis @ row)
        left -= basis.T @ (basis @ left)
        length = float(np.linalg.norm(left))
        if length < _RANK * largest:
            dependent.add(i)
        else:
            basis = np.vstack([basis, left / length])
    return dependent
