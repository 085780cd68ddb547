"""Loops of a linkage: conditions at the joints that close them, of which some are redundant, and the start."""

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from itertools import pairwise
from typing import Any, TypeAlias

import casadi as ca
import numpy as np

from liaisons.algebra import stack
from liaisons.language import constraint, declare, elements_of
from liaisons.linkages.joints import BodyJoint, roll_pitch_yaw_rotation, unit_vector

CLOSED = 1e-10
"""Residual below which a loop is closed [m, 1]."""

_ROUNDS = 60
_RANK = 1e-6  # singular values, relative to the largest element: below, a row depends on those before
_CONDITIONS = {  # of joints by class: components of the offset, and pairs of axes that stay at right angles
    "Revolute": ("uvw", ("wu", "wv")),
    "Prismatic": ("uv", ("wu", "wv", "uv")),
    "Cylindrical": ("uv", ("wu", "wv")),
    "Universal": ("uvw", ("yx",)),
    "Spherical": ("uvw", ()),
    "Planar": ("z", ("zx", "zy")),
    "Weld": ("uvw", ("wu", "wv", "uv")),
}

Evaluation: TypeAlias = Callable[[np.ndarray], tuple[np.ndarray, ...]]
"""From a configuration: residuals of the conditions, their derivative by the rates v, and K with ẋ = K v."""


def close_loops(linkage: Any, closing: Iterable[BodyJoint]) -> None:
    """Declare the conditions of a linkage's closing joints, move its start values onto them, name the redundant ones.

    Conditions that depend on the others, by the rank of their gradients at a configuration nearby, are redundant; those
    that do so in open loops, too, as out of the plane of a plane one, are left out.

    :param linkage: a class of bodies and joints.
    :raises ComponentError: for a joint that cannot close a loop, or a loop that cannot be closed near the start.
    """
    conditions: dict[str, Callable[[Any], ca.SX]] = {}
    for joint in closing:
        for name, declaration in _conditions(joint):
            declare(linkage, name, declaration)
            conditions[name] = declaration.method
    m = linkage()
    coordinates = m.coordinates
    free, x = m.free, ca.vertcat(m.free.q, m.active.s)
    residuals = stack(condition(m) for condition in conditions.values())
    K = ca.diagcat(free.kinematics, ca.SX.eye(m.active.s.shape[0]))
    values = m.start_values()
    function = ca.Function("loops", [x, m.parameter_column], [residuals, ca.jacobian(residuals, x) @ K, K])
    numbers = [values[name] for parameter in m.parameters for name in parameter.names]
    start = np.array([values[str(symbol)] for symbol in ca.vertsplit(x)])

    def evaluate(configuration: np.ndarray) -> tuple[np.ndarray, ...]:
        return tuple(np.array(result) for result in function(configuration, numbers))

    adjusted = np.arange(K.shape[1]) < len(coordinates)
    closed = _closed_configuration(evaluate, start, adjusted)
    gaps = np.abs(evaluate(closed)[0]).ravel()
    if not gaps.max(initial=0.0) < CLOSED:
        worst = [*conditions][int(np.argmax(gaps))]
        joint = next(j for j in closing if worst.startswith(f"{j.name}_"))
        joint.refuse(
            f"the loop through {joint.parent.name} and {joint.child.name} does not close near the start: {worst} stays "
            f"{gaps.max():.3g}; check at, at_child and the start values"
        )
    for item, value in zip(coordinates, closed, strict=False):
        item.start = float(value)
    opened = closed + evaluate(closed)[2] @ np.random.default_rng(0).uniform(-0.3, 0.3, K.shape[1])
    reclosed = _closed_configuration(evaluate, opened, np.ones(K.shape[1], bool))
    nearby = reclosed if np.abs(evaluate(reclosed)[0]).max(initial=0.0) < CLOSED else closed
    redundant = _dependent_rows(evaluate(nearby)[1])
    linkage.redundant = tuple(name for i, name in enumerate(conditions) if i in redundant)
    # Those that depend on the others while loops are closed alone may be needed where the others lose rank.
    left_out = redundant & _dependent_rows(evaluate(opened)[1])
    for name in (name for i, name in enumerate(conditions) if i in left_out):
        delattr(linkage, name)
    elements_of.cache_clear()  # they had the conditions that are left out


def _conditions(joint: BodyJoint) -> Iterator[tuple[str, constraint]]:
    kind = type(joint).__name__
    if kind not in _CONDITIONS:
        joint.refuse(f"a {kind} joint closes no loop; let another joint of the loop, declared last, close it")
    if joint.prescribed:
        joint.refuse(
            "it closes a loop, so that it has no coordinate to prescribe; declare it before another of the loop"
        )
    offsets, pairs = _CONDITIONS[kind]
    w = unit_vector(joint.axis)
    u = np.cross(w, np.eye(3)[int(np.argmin(np.abs(w)))])
    u /= np.linalg.norm(u)
    axes = {"u": u, "v": np.cross(w, u), "w": w} | dict(zip("xyz", np.eye(3), strict=True))
    columns = {name: ca.SX(ca.sparsify(ca.DM(axis))) for name, axis in axes.items()}
    for i, letter in enumerate(offsets, start=1):
        text = f"{joint.child.name} stays at {joint.parent.name}, along axis {i} of {joint.name}"
        method = partial(_offset, joint=joint, axis=columns[letter])
        yield f"{joint.name}_offset_{i}", constraint("m", text)(method)
    for i, (first, second) in enumerate(pairs, start=1):
        text = f"axes of {joint.child.name} and {joint.parent.name} stay at right angles in {joint.name}"
        method = partial(_cosine, joint=joint, first=columns[first], second=columns[second])
        yield f"{joint.name}_angle_{i}", constraint("1", text)(method)


def _offset(m: Any, *, joint: BodyJoint, axis: ca.SX) -> ca.SX:
    parent, child = m.frame_of(joint.parent), m.frame_of(joint.child)
    distance = child.position(m.parameter_vector(f"{joint.name}_at_child")) - parent.position(
        m.parameter_vector(f"{joint.name}_at")
    )
    return ca.dot(parent.matrix @ roll_pitch_yaw_rotation(joint.rotation) @ axis, distance)


def _cosine(m: Any, *, joint: BodyJoint, first: ca.SX, second: ca.SX) -> ca.SX:
    child = m.frame_of(joint.child).matrix @ roll_pitch_yaw_rotation(joint.rotation_child) @ first
    return ca.dot(child, m.frame_of(joint.parent).matrix @ roll_pitch_yaw_rotation(joint.rotation) @ second)


def _closed_configuration(evaluate: Evaluation, start: np.ndarray, adjusted: np.ndarray) -> np.ndarray:
    """Configuration near the start in which the loops are closed, by the Gauss-Newton method.

    :param adjusted: whether a rate may move, in their order.
    """
    configuration = start
    for _ in range(_ROUNDS):
        residuals, slope, K = evaluate(configuration)
        if np.abs(residuals).max(initial=0.0) < 1e-15:
            break
        step = np.zeros(len(adjusted))
        step[adjusted] = np.linalg.lstsq(slope[:, adjusted], residuals.ravel(), rcond=1e-9)[0]
        longest = np.abs(step).max(initial=0.0)
        configuration = configuration - K @ step * min(1.0, 0.5 / longest if longest else 1.0)
    return configuration


def _dependent_rows(matrix: np.ndarray) -> set[int]:
    """Indices of the rows that are linear combinations of those before."""
    tolerance = _RANK * np.abs(matrix).max(initial=0.0)
    ranks = [np.linalg.matrix_rank(matrix[:count], tolerance) for count in range(len(matrix) + 1)]
    return {i for i, (before, after) in enumerate(pairwise(ranks)) if after == before}
