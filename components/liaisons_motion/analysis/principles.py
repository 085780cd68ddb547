"""Variational principles: the action is stationary (K 3.1, M 3), the constraint is least (K 4)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.base.array_names import suffixed_name
from liaisons.errors import ComponentError, suggestion
from liaisons.mechanics import Equations
from liaisons_motion.analysis.numeric import checked_times, with_values
from liaisons_motion.analysis.phase_space import hamiltonian_field
from liaisons_motion.analysis.quantity import (
    Quantity,
    Source,
    Values,
    equations_of,
    require_conservative,
    require_constants_at_rest,
    require_free_coordinates,
    require_independent_coordinates,
    require_no_contacts,
    require_no_orientations,
)

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)  # exact for squares of cubic polynomials
_NODES, _WEIGHTS = (1 + _NODES) / 2, _WEIGHTS / 2


@dataclass(frozen=True)
class Action:
    """S[q + ε δq] = action + ε first + ½ ε² second + ... for one variation δq [J.s]."""

    action: float
    first: float  # δS, 0 on a motion (K eq. 77)
    second: float  # its sign tells a minimum from a saddle (K eq. 76 says "Min")


def action(
    source: Source,
    time: ArrayLike,
    path: Values,
    variation: Values | None = None,
    **values: float,
) -> Action:
    """Action S = ∫ L dt of a sampled path (K eq. 76, M eq. 1), and its variations with the path (K eq. 77, M eq. 9).

    Constraints stand beside L, not in it: a motion under constraints makes S stationary for variations that are
    compatible with them, C δq = 0 and δs = 0, and these alone (Hölder's principle, M eq. 15).

    Between the samples the path is the cubic Hermite polynomial of values and rates, which is integrated by Gauss's
    rule.  As S is stationary on a motion, an interpolation error e of the motion enters S by its square.

    :param time: instants [s], shape (n,), increasing.
    :param path: ``q`` and ``q_dot`` of each free coordinate, also ``s`` and ``s_dot`` of active ones that move; (n,).
    :param variation: δq, δs in the same way, 0 at both ends; coordinates that are not named do not vary.
    :param values: parameters, and active coordinates that do not move.
    :raises ComponentError: for an orientation, contacts, missing or unknown samples, shapes that do not fit, or a
        variation that moves the ends.
    """
    equations = equations_of(source)
    require_no_contacts(equations, "the action")
    require_no_orientations(equations, "the action")
    require_constants_at_rest(equations, values)
    names = _path_coordinates(equations, path)
    if not names:
        raise ComponentError(f"{equations.name}: the path moves no coordinate; give one and its rate")
    t, z = _sampled_path(equations, time, path, names)
    eta = np.zeros_like(z)
    if variation is not None:
        varied = _path_coordinates(equations, variation, names)
        _, samples = _sampled_path(equations, time, variation, varied)
        eta[[names.index(name) for name in varied]] = samples
        if np.max(np.abs(eta[:, 0, [0, -1]])) > 1e-9 * np.max(np.abs(eta[:, 0])):
            raise ComponentError(f"{equations.name}: the variation must vanish at both ends (K 3.1)")
    total, column = np.zeros(3), eta.ravel(order="F")
    for piece, S, slope, curvature, _ in _interval_actions(
        _interval_action_function(equations, names, values), z, np.diff(t)
    ):
        total += np.array([S, slope @ column[piece], column[piece] @ curvature @ column[piece]])
    return Action(*total.tolist())


@dataclass(frozen=True, eq=False)
class StationaryPath:
    """The motion between two configurations in a given time, by the principle of stationary action."""

    path: dict[str, NDArray]  # q and q_dot by name, (n,)
    action: float  # S [J.s]
    index: int  # directions in which S is a maximum, the conjugate points on the way: 0 means a minimum


def stationary_path(source: Source, time: ArrayLike, guess: Values, **values: float) -> StationaryPath:
    """Path with δS = 0 between the ends of a guess, by Newton's method on S; no equation of motion is used.

    The path is a cubic Hermite spline in the given instants: its error is of fourth order in their distance.

    :param time: instants [s], shape (n,), increasing; some tens of them.
    :param guess: ``q`` and ``q_dot`` of each free coordinate, (n,); q at both ends is kept.
    :param values: parameters and active coordinates.
    :raises ComponentError: for constraints, contacts, an orientation, friction, drives and loads, of which S knows
        nothing; if the ends are conjugate points, as for an oscillator with ω T = k π, which no path or
        infinitely many join; or if Newton's method finds none near the guess.
    """
    from scipy.linalg import eigh

    equations = equations_of(source)
    require_independent_coordinates(equations, "the action")
    require_free_coordinates(equations, "a path of stationary action")
    require_constants_at_rest(equations, values)
    require_conservative(equations, "a path of stationary action", values)
    names = [item.name for item in equations.mechanism.coordinates]
    t, z = _sampled_path(equations, time, guess, names)
    h = np.diff(t)
    free = np.ones(z.shape, dtype=bool)
    free[:, 0, [0, -1]] = False
    free = np.flatnonzero(free.ravel(order="F"))
    function = _interval_action_function(equations, names, values)
    for _ in range(50):
        S, gradient, hessian, norm = _total_action(function, z, h)
        curvatures = eigh(hessian[free[:, None], free], norm[free[:, None], free], eigvals_only=True)
        smallest = np.min(np.abs(curvatures)) * (t[-1] - t[0]) ** 2
        if smallest < 1e-6:  # the path answers a shift of its ends by 1/smallest
            raise ComponentError(
                f"{equations.name}: the ends are conjugate points: no path or infinitely many take T = "
                f"{t[-1] - t[0]:g} s (ω T = k π for an oscillator); choose another time"
            )
        step = np.zeros(z.size)
        step[free] = -np.linalg.solve(hessian[free[:, None], free], gradient[free])
        z = z + step.reshape(z.shape, order="F")
        if np.max(np.abs(step)) <= 1e-11 * (1 + np.max(np.abs(z))):
            columns = {
                suffixed_name(name, end): z[k, d] for k, name in enumerate(names) for d, end in enumerate(("", "_dot"))
            }
            return StationaryPath(columns, S, int(np.count_nonzero(curvatures < 0)))
    raise ComponentError(f"{equations.name}: no path of stationary action found; start nearer to one")


def vakonomic_equations(source: Source) -> Quantity:
    """Rates q̇ and ṗ of the paths with δS = 0 among all that keep the constraints (Arnold and Kozlov); (n + f,).

    They are Hamilton's equations for the largest p·q̇ - L over the rates that the constraints allow.  Of geometric
    constraints they are d'Alembert's motion, of non-holonomic ones another: there p is no longer ∂L/∂q̇, and what it has
    across the constraints is free at the start.  Without friction, drives and loads.

    :raises ComponentError: for a constraint that is not linear in the rates.
    """
    equations = equations_of(source)
    require_no_contacts(equations, "vakonomic motion")
    require_free_coordinates(equations, "vakonomic motion")
    m, constraints = equations.mechanism, equations.constraints
    if ca.depends_on(constraints.matrix, m.free.q_dot):
        raise ComponentError(f"{equations.name}: vakonomic equations need constraints that are linear in the rates")
    C, velocities = constraints.matrix, equations.dynamics.velocities
    residuals = ca.substitute(constraints.rate_residuals, m.free.q_dot, velocities)
    zero = ca.SX.zeros(velocities.shape)
    correction, _ = equations.dynamics.inertia.solve_constrained(C, zero, -residuals, constraints.squares)
    H = ca.dot(m.free.frame.T @ m.free.p, m.free.q_dot) - equations.lagrangian
    field = hamiltonian_field(equations, ca.substitute(H, m.free.q_dot, velocities + correction))
    return Quantity(equations, ca.vertcat(*field), conservative=True)


def gauss_function(source: Source) -> Quantity:
    """Gauss's function of the accelerations, ½ (q̈ - A⁻¹f)ᵀ A (q̈ - A⁻¹f) (K eq. 108, the Q of 112) [N2/kg].

    It is least, among the accelerations that the constraints allow, on the motion, where it is ½ Zᵀ A⁻¹ Z with the
    forces Z of the constraints (K eq. 109).  Written in the accelerations: give ``q_ddot`` to ``evaluate``.  In
    Cartesian coordinates it is K's sum; in others it lacks a constant.

    :raises ComponentError: for contacts.
    """
    equations = equations_of(source)
    require_no_contacts(equations, "Gauss's function")
    excess = equations.mechanism.free.q_ddot - equations.dynamics.inertia.solve(equations.forces)
    return Quantity(equations, ca.bilin(equations.mass_matrix, excess, excess) / 2)


def _path_coordinates(equations: Equations, path: Values, allowed: list[str] | None = None) -> list[str]:
    """Names of the coordinates of a path: all free ones, and the active ones with samples.

    :param allowed: coordinates that may have samples, none of which must; None: as above.
    :raises ComponentError: for samples of anything else.
    """
    m = equations.mechanism
    free, active = [item.name for item in m.coordinates], [item.name for item in m.actives]
    movable = allowed or [*free, *active]
    rates = {name: suffixed_name(name, "_dot") for name in movable}
    for name in path:
        if name not in (*rates, *rates.values()):
            raise ComponentError(f"{equations.name}: no coordinate of a path is {name!r}{suggestion(name, movable)}")
    return [name for name in movable if name in path or rates[name] in path or (allowed is None and name in free)]


def _sampled_path(equations: Equations, time: ArrayLike, path: Values, names: list[str]) -> tuple[NDArray, NDArray]:
    """Times of a path, (n,), and values and rates of its coordinates, (coordinates, 2, n)."""
    t = np.asarray(time, dtype=float)
    needed = [suffixed_name(name, end) for name in names for end in ("", "_dot")]
    for name in needed:
        if name not in path:
            raise ComponentError(f"{equations.name}: the path lacks {name}; give coordinates and rates")
        t = checked_times(equations, time, np.shape(path[name]))
        if not np.all(np.isfinite(path[name])):
            raise ComponentError(f"{equations.name}: {name} must be finite at all instants")
    return t, np.array([path[name] for name in needed], dtype=float).reshape(len(names), 2, -1)


def _cubic_hermite(ends: Sequence[Any], h: Any, u: float) -> tuple[Any, Any]:
    """Value and rate of a cubic at the part u of its interval, from value and rate at both ends.

    :param h: duration of the interval.
    """
    q_0, v_0, q_1, v_1 = ends
    q = (1 - u) ** 2 * ((1 + 2 * u) * q_0 + u * h * v_0) + u**2 * ((3 - 2 * u) * q_1 - (1 - u) * h * v_1)
    v = 6 * u * (1 - u) * (q_1 - q_0) / h + (1 - u) * (1 - 3 * u) * v_0 - u * (2 - 3 * u) * v_1
    return q, v


def _interval_action_function(equations: Equations, names: list[str], values: Mapping[str, float]) -> ca.Function:
    """Function of both ends of an interval: its action, with gradient and Hessian, and the norm ∫ δqᵀ A δq dt."""
    count, h = len(names), ca.SX.sym("h")
    ends = ca.SX.sym("ends", 4 * count)
    symbols = ca.vertcat(*(equations.symbols[suffixed_name(name, end)] for end in ("", "_dot") for name in names))
    L = with_values(equations, equations.lagrangian, values, symbols)
    A = with_values(equations, equations.mass_matrix, values, symbols)
    S, norm = ca.SX(0), ca.SX.zeros(4 * count, 4 * count)
    for node, weight in zip(_NODES, _WEIGHTS, strict=True):
        q, v = _cubic_hermite(ca.vertsplit(ends, count), h, node)
        point = ca.vertcat(q, v)
        basis = ca.jacobian(q, ends)[: A.shape[0], :]  # of the free coordinates, which come first
        S += weight * h * ca.substitute(L, symbols, point)
        norm += weight * h * basis.T @ ca.substitute(A, symbols, point) @ basis
    hessian, gradient = ca.hessian(S, ends)
    return ca.Function("piece", [ends, h], [ca.densify(e) for e in (S, gradient, hessian, norm)])


def _interval_actions(
    function: ca.Function, z: NDArray, h: NDArray
) -> Iterator[tuple[slice, float, NDArray, NDArray, NDArray]]:
    """Yield the indices of each interval, and its action, gradient, Hessian and norm.

    :param z: values and rates, (coordinates, 2, n); indices are those of its ravel in the order "F".
    """
    node, column = 2 * z.shape[0], z.ravel(order="F")
    for i, width in enumerate(h):
        piece = slice(i * node, (i + 2) * node)
        S, slope, curvature, weight = (np.asarray(part) for part in function(column[piece], width))
        yield piece, float(S[0, 0]), slope[:, 0], curvature, weight


def _total_action(function: ca.Function, z: NDArray, h: NDArray) -> tuple[float, NDArray, NDArray, NDArray]:
    """Action of the whole path, its gradient and Hessian, and the matrix of the norm of a variation."""
    gradient, hessian, norm = np.zeros(z.size), np.zeros((z.size, z.size)), np.zeros((z.size, z.size))
    total = 0.0
    for piece, S, slope, curvature, weight in _interval_actions(function, z, h):
        total += S
        gradient[piece] += slope
        hessian[piece, piece] += curvature
        norm[piece, piece] += weight
    return total, gradient, hessian, norm
