"""``hold``: feedback that keeps a mechanism at an equilibrium, sampled at the communication points.

The regulators read the mechanism's states once a step, H, and are themselves integrators of third order (see
:class:`liaisons.models.Regulator`).  What happens over one step to first order, x(t + H) = A x(t) + B w, is exact: the
mechanism extrapolates σ from (σ, σ̇, σ̈) at t, and at an equilibrium the derivatives of its equations are constant, so
that both parts are matrix exponentials.  The gains solve Riccati's equation of this discrete system on the part that
can be controlled.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, final

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, solve_discrete_are, svd
from scipy.optimize import linear_sum_assignment

from liaisons.arguments import finite, named, shown
from liaisons.check import Verdict, verdict
from liaisons.cosim import Result
from liaisons.errors import LiaisonsError
from liaisons.interface import System
from liaisons.language import Orientation
from liaisons.library import Target, component
from liaisons.models import Regulator
from liaisons.operators.plans import Plan
from liaisons.operators.problems import Goal, PlanError, Reader, move_names

Array = NDArray[np.float64]

_ROOM = sum(name.startswith("reading_") for name in vars(Regulator))
_NEAR = 1e-5
"""Size of the differences by which the FMUs' multipliers are measured."""
_RANK = 1e-8
"""A direction that is reached by less than this, of what is asked for, is out of reach."""
_DRIFT = 1e-4
"""Weight of the rate of what moves without being held, beside 1 for what is."""


@final
@dataclass(frozen=True, eq=False)
class Held:
    """A mechanism and the feedback that holds it, found by :func:`liaisons.hold`: w = -gains (x - at) once a step."""

    name: str  # of the component
    component: Target
    moves: tuple[str, ...]
    step_size: float
    free: tuple[str, ...]  # coordinates that are held
    states: tuple[str, ...]  # what is read: the mechanism's, σ where it is held, σ̇, σ̈
    at: Array  # their values at the equilibrium
    gains: Array  # (moves, states)
    loop: Array  # of one step, in the directions in which the states can differ
    directions: Array  # (states, directions)
    reached: int  # how many of them can be controlled
    conserved: tuple[str, ...]  # states that no move can change
    values: Mapping[str, float]  # of parameters, as they were given
    starts: Mapping[str, float]  # start values of the FMU, σ and σ̇ among them
    shifts: tuple[Mapping[str, float], ...]  # of these, by which the states are made to differ
    bounds: Mapping[str, tuple[float, float]]  # of accelerations

    @property
    def multipliers(self) -> NDArray[np.complex128]:
        """Factors of one step in the closed loop, greatest first; those of what cannot be controlled are 1."""
        return _multipliers(self.loop)

    @property
    def controlled(self) -> NDArray[np.complex128]:
        """The multipliers of what is controlled: inside the unit circle."""
        near_one = np.argsort(np.abs(self.multipliers - 1))
        return np.delete(self.multipliers, near_one[: len(self.loop) - self.reached])

    def system(self, **starts: float) -> System:
        """The mechanism and one regulator FMU a coordinate, wired; communication points are ``step_size`` apart.

        :param starts: start values of the mechanism that differ from the equilibrium's, ``theta_0=3.3``, and of what
            moves, ``pivot_x=0.1``, ``pivot_x_dot=0.2``.
        """
        system, starts = System(f"held {self.name}"), {**self.starts, **starts}
        sources: dict[str, Any] = {}
        regulators = []
        for move, gain in zip(self.moves, self.gains, strict=True):
            low, high = self.bounds.get(f"{move}_ddot", (-1e9, 1e9))
            triple = {move: "value_0", f"{move}_dot": "rate_0", f"{move}_ddot": "acceleration_0"}
            settings: dict[str, Any] = {state: starts.pop(name, 0.0) for name, state in triple.items()}
            settings |= {"gain": _filled(gain), "wanted": _filled(self.at), "lowest": low, "highest": high}
            regulators.append(system.add(f"{self.name}_{move}", "Regulator", period=self.step_size, **settings))
            sources |= {name: regulators[-1][y] for name, y in zip(triple, ("y", "y_dot", "y_ddot"), strict=True)}
        mechanism = system.add(self.name, self.component, **self.values, **starts)
        for move, regulator in zip(self.moves, regulators, strict=True):
            system.connect(regulator["y"], mechanism[move])
            for i, name in enumerate(self.states, start=1):
                source = sources[name] if name in sources else mechanism[name]
                system.connect(source, regulator[f"reading_{i}"])
        return system

    def simulate(self, stop_time: float, *, inputs: Mapping[str, Any] | None = None, **starts: float) -> Result:
        """Run :meth:`system`.

        :param stop_time: end [s].
        :param inputs: input of the mechanism -> function of time: a disturbance.
        :param starts: as of :meth:`system`.
        """
        given = {f"{self.name}.{name}": value for name, value in (inputs or {}).items()}
        return self.system(**starts).simulate(
            stop_time, self.step_size, coupling="jacobi", tolerance=1e-11, inputs=given or None
        )

    def deviation(self, run: Result) -> Array:
        """By how much the states of a run differ from those that are held, (states, times)."""
        names = []
        for name in self.states:
            ends = {move + end: f"{self.name}_{move}.y{end}" for move in self.moves for end in ("", "_dot", "_ddot")}
            names.append(ends.get(name, f"{self.name}.{name}"))
        return np.array([run[name] for name in names]) - self.at[:, None]

    def survives(self, port: str, duration: float, *, stop_time: float, first: float = 0.01) -> float:
        """Greatest of the forces tried at a port, from 0 on, after which what is held came back.

        Doubled until it falls, then halved in between twelve times: nothing is said of other forces.

        :param port: input of the mechanism, ``"theta_force"``.
        :param duration: how long the force acts [s].
        :param stop_time: by then the free coordinates are back to 5 % of where they were most [s].
        :param first: the first force tried.
        """
        places = [self.states.index(name) for name in self.free if name not in self.moves]

        def comes_back(force: float) -> bool:
            try:
                run = self.simulate(stop_time, inputs={port: lambda t: force if t < duration else 0.0})
            except LiaisonsError:
                if force == 0:
                    raise
                return False
            off = np.abs(self.deviation(run)[places])
            return bool(np.all(off[:, -1] <= 0.05 * np.max(off)))

        low, high = 0.0, first
        if not comes_back(low):
            return low
        while comes_back(high) and high < 1e6:
            low, high = high, 2 * high
        for _ in range(12):
            middle = (low + high) / 2
            low, high = (middle, high) if comes_back(middle) else (low, middle)
        return low

    def measured(self) -> Array:
        """The matrix of one step as the FMUs perform it, from runs on both sides of the equilibrium."""
        back = np.linalg.pinv(self.directions)
        begins, ends = [], []
        for direction in self.shifts:
            shifted: list[dict[str, Any]] = [
                {name: self.starts[name] + by * x for name, x in direction.items()} for by in (_NEAR, -_NEAR)
            ]
            runs = [self.simulate(self.step_size, **starts) for starts in shifted]
            change = back @ (self.deviation(runs[0]) - self.deviation(runs[1])) / (2 * _NEAR)
            begins.append(change[:, 0])
            ends.append(change[:, -1])
        return np.linalg.lstsq(np.array(begins), np.array(ends), rcond=None)[0].T

    def verify(self) -> list[Verdict]:
        """Whether one step of the FMUs is what was predicted, and whether what is controlled comes back."""
        measured = self.measured()
        error = float(np.max(np.abs(measured - self.loop)) / np.max(np.abs(self.loop)))
        far = np.abs(self.multipliers[:, None] - _multipliers(measured))
        apart = float(np.max(far[linear_sum_assignment(far)]))
        radius = float(np.max(np.abs(self.controlled)))
        why = "differences of 1e-5, solver tolerance 1e-11"
        return [
            verdict("one step of the FMUs is the matrix predicted", error=error, tolerance=1e-5, reason=why),
            verdict("so are its multipliers", error=apart, tolerance=1e-3, reason="a root of it where they coincide"),
            verdict("what is controlled comes back, |multiplier| < 1", error=radius, tolerance=1 - 1e-9),
        ]

    def __repr__(self) -> str:
        radius = np.max(np.abs(self.controlled))
        rest = f"; conserved: {', '.join(self.conserved)}" if self.conserved else ""
        moves = ", ".join(self.moves)
        return f"<{self.name} held by {moves} every {self.step_size:g} s: |multiplier| <= {radius:.6f}{rest}>"


def hold(
    mechanism: Target,
    /,
    at: Mapping[str, Any] | None = None,
    moves: str | Sequence[str] | None = None,
    *,
    step_size: float | None = None,
    weights: Mapping[str, float] | None = None,
    effort: float = 0.01,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    **values: float,
) -> Held:
    """Find the feedback that keeps a mechanism at an equilibrium.

    ::

        regulator = hold("Pendulum", {"theta": np.pi, "pivot_x": 0}, "pivot_x", step_size=0.02)
        run = regulator.simulate(10, theta_0=np.pi + 0.2)

    Once a step the states are read and the accelerations of what moves are chosen, so that the sum over all steps of
    Σ weight (x - x_0)² + effort w² is least.  Where a moved coordinate enters nothing (the angle of a wheel), it is
    held only if ``at`` names it.

    :param mechanism: name, file or class of a mechanism.
    :param at: values of coordinates at the equilibrium, and of rates of what moves; the others as declared, at rest.
    :param moves: active coordinates that the feedback moves; all unless given.
    :param step_size: distance of the communication points [s], which is the sampling period; else the experiment's.
    :param weights: of states by name; coordinates have 1, momenta 0.
    :param effort: weight of the accelerations.
    :param bounds: (low, high) of accelerations, ``{"pivot_x_ddot": (-5, 5)}``: there the feedback saturates.
    :param values: parameters.
    :raises PlanError: if it is no equilibrium, or if what is to be held cannot be controlled, with what stays.
    """
    if isinstance(mechanism, Plan) or at is None:
        raise PlanError("hold keeps an equilibrium: give a mechanism and at={name: value, ...}, not a plan")
    if step_size is None:
        step_size = component(mechanism).experiment.step_size
    finite("step_size", step_size, PlanError)
    finite("effort", effort, PlanError)
    if step_size <= 0 or effort <= 0:
        raise PlanError(f"step_size = {step_size:g}, effort = {effort:g}: both must be > 0")
    names, bounds = move_names(mechanism, moves), named("bounds", bounds or {}, PlanError)
    known = [f"{name}_ddot" for name in names]
    for name in bounds:
        if name not in known:
            raise PlanError(f"bounds of {name!r}: a regulator bounds accelerations, {', '.join(known)}")
        pair = bounds[name]
        if not (isinstance(pair, (tuple, list)) and len(pair) == 2 and pair[0] < 0 < pair[1]):
            raise PlanError(f"bounds of {name} = {shown(pair)}: give (low, high) with low < 0 < high")
    reader = Reader(Goal(mechanism, names, at, {}, (), (step_size, step_size), "time", {}, values))
    return _Design(reader, dict(at), step_size).held(dict(weights or {}), effort, bounds)


class _Design:
    """The mechanism beside its equilibrium, sampled."""

    def __init__(self, reader: Reader, at: dict[str, Any], step_size: float) -> None:
        self.reader, self.name, self.H = reader, reader.name, step_size
        if any(v.name.startswith("lambda_") for v in reader.model.outputs):
            raise PlanError(f"{self.name} has constraints: hold takes mechanisms in free coordinates")
        moves = reader.goal.moves
        for turn, axes in reader.turns.items():
            if turn in at:
                unit = np.array(at[turn], dtype=float) / np.linalg.norm(at[turn])
                reader.k |= {reader.starts[axis]: float(x) for axis, x in zip(axes, unit, strict=True)}
        y = np.array([reader.k[reader.starts[n]] if n in reader.starts else 0.0 for n in reader.x_names])
        point = [y, reader.s_start, np.array([float(at.get(f"{m}_dot", 0.0)) for m in moves]), np.zeros(len(moves))]
        symbols = [reader.y, reader.s, reader.v, reader.a]
        point[0] = np.array(ca.Function("start", symbols, [reader.start_state])(*point)).ravel()
        slopes = [ca.jacobian(reader.rates, symbol) for symbol in symbols[:3]]
        rates, *slopes = map(np.array, ca.Function("rates", symbols, [reader.rates, *slopes])(*point))
        self.point = point
        self.places = self._coupled()
        self.x_names = [reader.x_names[i] for i in self.places]
        self.point[0] = point[0][self.places]
        self.slopes = [slopes[0][np.ix_(self.places, self.places)], *(slope[self.places] for slope in slopes[1:])]
        self.turns = {turn: axes for turn, axes in reader.turns.items() if set(axes) <= set(self.x_names)}
        self.keeps = [m in at or reader.depends(reader.rates, reader.s[i]) for i, m in enumerate(moves)]
        still = dict(zip(self.x_names, rates.ravel()[self.places], strict=True))
        still |= {m: point[2][i] for i, m in enumerate(moves) if self.keeps[i]}
        worst = max(still, key=lambda name: abs(still[name]))
        if not abs(still[worst]) <= 1e-9:
            raise PlanError(f"{self.name}: this is no equilibrium: the rate of {worst} is {still[worst]:.3g}")

    def _coupled(self) -> list[int]:
        """Places of the states that what moves acts on, and of those on which they depend."""
        reader = self.reader
        acts = reader.acts(reader.rates, ca.vertcat(reader.y, reader.s, reader.v))
        n = len(reader.x_names)
        among, found = acts[:, :n], acts[:, n:].any(axis=1)
        for _ in range(n):
            found = found | among[:, found].any(axis=1)
        for _ in range(n):
            found = found | among[found].any(axis=0)
        return [int(i) for i in np.flatnonzero(found)]

    def held(self, weights: dict[str, float], effort: float, bounds: Mapping[str, tuple[float, float]]) -> Held:
        """The feedback of least cost."""
        reader, moves = self.reader, self.reader.goal.moves
        kept = [m for m, keeps in zip(moves, self.keeps, strict=True) if keeps]
        rates = [f"{m}_dot" for m in moves]
        states = (*self.x_names, *kept, *rates, *(f"{m}_ddot" for m in moves))
        if len(states) > _ROOM:
            raise PlanError(f"{self.name}: {len(states)} states are more than the {_ROOM} that a Regulator reads")
        free = (*(name for name in self.x_names if name in reader.starts and name not in Orientation.momenta), *kept)
        cost = {name: float(name in free) for name in states}
        cost |= {f"{m}_dot": _DRIFT for m in moves if m not in kept}
        for name in weights:
            if name not in cost:
                raise PlanError(f"{self.name}: weights of {name!r}: the states are {', '.join(states)}")
        D = self._directions(len(states))
        back = np.linalg.pinv(D)
        rows = np.array([*range(len(self.x_names) + len(moves) * 3)])
        dropped = [len(self.x_names) + i for i, keeps in enumerate(self.keeps) if not keeps]
        rows = np.delete(rows, dropped)
        A, B = self._sampled()
        A, B = back @ A[np.ix_(rows, rows)] @ D, back @ B[rows]
        Q = D.T @ np.diag([(cost | weights)[name] for name in states]) @ D
        still = [i for i in range(len(A)) if np.allclose(A[i], np.eye(len(A))[i]) and not np.any(np.abs(B[i]) > 0)]
        V, U = reachable((A - np.eye(len(A))) / self.H, B / self.H)
        K = riccati(V.T @ A @ V, V.T @ B, V.T @ Q @ V, effort * np.eye(len(moves))) @ V.T
        if U.size:
            fixed = np.eye(len(A))[:, still]
            others = svd(U - fixed @ (fixed.T @ U))[0][:, : U.shape[1] - len(still)]
            U = np.hstack([fixed, others])
            stays = bool(np.max(np.abs(np.linalg.eigvals(U.T @ A @ U))) < 1 + 1e-6)
            target, missed = steady(A, D[[states.index(name) for name in free]], V, U)
            for j in range(U.shape[1]):
                if not stays or (j >= len(still) and missed[j] > _RANK):
                    self._refuse(back.T @ U[:, j], states)
            K -= K @ V @ target @ U.T
        values = np.concatenate(self.point)[rows]
        starts = {parameter: reader.k[parameter] for parameter in reader.starts.values()}
        starts |= dict(zip([*moves, *rates], np.concatenate(self.point[1:3]), strict=True))
        starts |= {f"{m}_ddot": 0.0 for m in moves}
        turned = [axis for axes in self.turns.values() for axis in axes]
        singles = [name for name in starts if name not in {reader.starts[axis] for axis in turned}]
        turns = [
            {reader.starts[states[i]]: float(column[i]) for i in np.flatnonzero(column)}
            for column in D.T
            if any(states[i] in turned for i in np.flatnonzero(column))
        ]
        conserved = [name for name, row in zip(states, D, strict=True) if set(np.flatnonzero(row)) & set(still)]
        return Held(
            name=self.name,
            component=reader.goal.component,
            moves=moves,
            step_size=self.H,
            free=free,
            states=states,
            at=values,
            gains=K @ back,
            loop=A - B @ K,
            directions=D,
            reached=V.shape[1],
            conserved=tuple(conserved),
            values=reader.goal.values,
            starts={name: float(value) for name, value in starts.items()},
            shifts=(*turns, *({name: 1.0} for name in singles)),
            bounds=bounds,
        )

    def _directions(self, count: int) -> Array:
        """Columns along which the states can differ: of a quaternion only turns."""
        D = np.eye(count)
        for axes in self.turns.values():
            i, *_ = places = [self.x_names.index(axis) for axis in axes]
            w, x, y, z = self.point[0][places]
            D[np.ix_(places, places[1:])] = np.array([[-x, -y, -z], [w, -z, y], [z, w, -x], [-y, x, w]]) / 2
            D = np.delete(D, i, axis=1)
        return D

    def _sampled(self) -> tuple[Array, Array]:
        """One step: the mechanism sees σ as it is extrapolated, the regulators follow what they chose."""
        n, c, H = len(self.x_names), len(self.reader.goal.moves), self.H
        zero, one = np.zeros((c, c)), np.eye(c)
        seen, own = np.zeros((n + 3 * c, n + 3 * c)), np.zeros((4 * c, 4 * c))
        seen[:n] = np.hstack([*self.slopes, np.zeros((n, c))])
        seen[n : n + 2 * c, n:] = np.block([[zero, one, zero], [zero, zero, one]])
        own[: 3 * c] = np.block([[zero, one, zero, zero], [zero, zero, one, zero], [zero, zero, -one / H, one / H]])
        moved, felt = (np.asarray(expm(matrix * H), dtype=float) for matrix in (own, seen))
        A = np.vstack([felt[:n], np.hstack([np.zeros((3 * c, n)), moved[: 3 * c, : 3 * c]])])
        return A, np.vstack([np.zeros((n, c)), moved[: 3 * c, 3 * c :]])

    def _refuse(self, vector: Array, states: Sequence[str]) -> None:
        places = [i for i in range(len(states)) if abs(vector[i]) > 1e-3 * np.max(np.abs(vector))]  # not what H adds
        terms = [f"{vector[i] / vector[places[0]]:+.3g}" for i in places]
        text = " ".join(f"{term[0]} {term[1:]} {states[i]}" for term, i in zip(terms, places, strict=True))
        text = text.removeprefix("+ ").removeprefix("1 ")
        moves = ", ".join(self.reader.goal.moves)
        raise PlanError(f"{self.name} cannot be held there: to first order {moves} cannot change {text}")


def reachable(A: Array, B: Array) -> tuple[Array, Array]:
    """Orthonormal bases of what x' = A x + B u can reach, and of what is perpendicular to it: the staircase."""
    n, new = len(A), B
    V: Array = np.zeros((n, 0))
    while new.size and V.shape[1] < n:
        new = new - V @ (V.T @ new)
        new = new - V @ (V.T @ new)
        found: Any = svd(new, full_matrices=False)
        directions, sizes, _ = found
        new = np.asarray(directions[:, sizes > _RANK * max(1.0, float(np.linalg.norm(A)))], dtype=float)
        V = np.asarray(np.hstack([V, new]), dtype=float)
        new = A @ new
    whole: Any = svd(V)[0] if V.size else np.eye(n)
    return V, whole[:, V.shape[1] :]


def steady(A: Array, C: Array, V: Array, U: Array) -> tuple[Array, Array]:
    """Where V has to rest so that C x = 0 remains while each direction of U stays, and what that misses."""
    left = np.vstack([V.T @ (np.eye(len(A)) - A) @ V, C @ V])
    right = np.vstack([V.T @ A @ U, -C @ U])
    found: Any = np.linalg.lstsq(left, right, rcond=1e-12)[0]
    return found, np.asarray(np.linalg.norm(left @ found - right, axis=0))


def riccati(A: Array, B: Array, Q: Array, R: Array) -> Array:
    """Gains K of u = -K x for which Σ xᵀQx + uᵀRu is least, x' = A x + B u step by step."""
    P = solve_discrete_are(A, B, Q, R)
    return np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)


def _multipliers(matrix: Array) -> NDArray[np.complex128]:
    found = np.linalg.eigvals(matrix).astype(complex)
    return found[np.argsort(-np.abs(found), kind="stable")]


def _filled(values: Array) -> Array:
    return np.pad(values, (0, _ROOM - values.size))
