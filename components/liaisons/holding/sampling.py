"""A mechanism beside a motion, from one communication point to the next, to first order in what it is off.

The linearisation is that of the equations that the FMUs have, along the motion as they perform it: within a step a
correction of σ is the polynomial that the mechanism makes of what it is told.  So the matrices of a step are exact,
sampling and all, up to the tolerance with which they are integrated.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import chain
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import svd

from liaisons.base.hermite import coefficients
from liaisons.errors import PlanError
from liaisons.holding.feedback import Step
from liaisons.language import Orientation
from liaisons.models.regulator import READINGS
from liaisons.planning.goals import Array, Goal, by_name, motion_names, unit_quaternion
from liaisons.planning.symbols import column, goal_symbols

_POWERS = np.arange(6)
_DERIVATIVE = ca.DM(np.diag(_POWERS[1:], 1))
"""Of a row of powers, by multiplication from the right."""
_UNIT = coefficients(3)
"""Value, rate and acceleration at 0 and 1 -> coefficients of the polynomial of degree five."""
_PARTS = 32
"""Into so many parts a step is divided: of fourth order, these leave 1e-10."""


class SampledMechanism:
    """The mechanism of a goal, sampled: its coordinates start, and are moved, as the start of the goal says.

    :param required: names of coordinates that move and are held even if they enter nothing.
    :param time: in what time [s] states change by their sizes where no free motion determines it.
    :param longest: a free motion of which a radian takes longer [s] does not.
    :param extents: the greatest absolute values that coordinates have on the way; else those at the start.
    :ivar states: names: the mechanism's on which moves act, or on which these depend; σ where it is held; σ̇, σ̈.
    :ivar names: those of the mechanism.
    :ivar free: coordinates that are held.
    """

    def __init__(
        self,
        goal: Goal,
        required: Container[str],
        *,
        interpolate: bool,
        time: float,
        longest: float,
        extents: Mapping[str, float] | None = None,
    ) -> None:
        symbols = goal_symbols(goal)
        starts, parameters, start = symbols.start_parameters, dict(symbols.parameters), symbols.start
        for name, axes in symbols.quaternions.items():
            if name in start:
                unit = unit_quaternion(f"{symbols.name}: {name}", start[name])
                parameters |= {starts[axis]: float(x) for axis, x in zip(axes, unit, strict=True)}
        self.symbols = symbols = replace(symbols, parameters=parameters)
        self.interpolate, self.name, self.moves = interpolate, symbols.name, goal.moves
        self.is_constrained = any(v.name.endswith("_residual") for v in symbols.model.outputs)
        self.sigma = np.zeros((len(self.moves), 3))
        self.sigma[:, 0] = symbols.initial_sigma
        self.sigma[:, 1] = [float(start.get(f"{m}_dot", 0.0)) for m in self.moves]
        self._usual_time, self._longest, self._extents = time, longest, {} if extents is None else extents
        first = ca.Function("start", symbols.arguments, [symbols.initial_state])
        self.start = np.array(first(symbols.declared_state, *self.sigma.T)).ravel()
        self.state_indices = self._coupled()
        self.names = [symbols.state_names[i] for i in self.state_indices]
        self.quaternions = {name: axes for name, axes in symbols.quaternions.items() if set(axes) <= set(self.names)}
        rates, sigma = symbols.relative_rates, symbols.motion[0]
        held = [i for i, m in enumerate(self.moves) if m in required or symbols.depends(rates, sigma[i])]
        self.held_moves = [self.moves[i] for i in held]
        n, c = len(self.names), len(self.moves)
        self.rows = [*range(n), *(n + i for i in held), *range(n + c, n + 3 * c)]
        internal = {state.name for state in getattr(symbols.component, "internal_states", ())}
        self.internal = [name for name in self.names if name in internal]
        free = (n for n in self.names if n in starts and n not in {*Orientation.momenta, *internal})
        self.free = (*free, *self.held_moves)
        _, *derivatives = zip(*map(motion_names, self.moves), strict=True)
        self.states = (*self.names, *self.held_moves, *chain.from_iterable(derivatives))
        if len(self.states) > READINGS:
            raise PlanError(
                f"{self.name}: {len(self.states)} states are more than the {READINGS} that a Regulator reads"
            )

    @cached_property
    def frequency(self) -> float:
        """Greatest one [1/s] of the free motion about the start, also of falling and damping; 0: there is none."""
        n = len(self.names)
        A = np.array(self._slopes(self.start[self.state_indices], *self.sigma.T))[:, 1 : 1 + n]
        if self.is_constrained:  # along the constraints
            A = np.array(self._projection(self.start, *self.sigma.T))[:, 1 : 1 + n] @ A
        return float(np.max(np.abs(np.linalg.eigvals(A)), initial=0.0))

    @cached_property
    def moves_freely(self) -> bool:
        """Whether a free motion sets a time."""
        return self.frequency * self._longest > 1

    @cached_property
    def time(self) -> float:
        """In what time [s] states change by their sizes: that of one radian of the free motion, if there is any."""
        return 1 / self.frequency if self.moves_freely else self._usual_time

    @cached_property
    def sizes(self) -> Array:
        """Of the states: all that is compared, weighted and called small is divided by them, whatever the units are.

        Coordinates of one unit have one size, such that the kinetic energy of all is alike: an angle's is 1, a length's
        that at which the mass has the angles' moment of inertia.  Rates, accelerations and momenta follow with
        :attr:`time`.
        """
        coordinates, momenta, _ = self._start_sizes
        of_names = [coordinates.get(name, momenta.get(name, 1.0)) for name in self.names]
        of_moves = np.array([coordinates[m] for m in self.moves])
        return np.concatenate([of_names, *(of_moves / self.time**n for n in range(3))])[self.rows]

    @property
    def energy(self) -> float:
        """Kinetic, of what moves by its size in :attr:`time` [J]."""
        return self._start_sizes[2]

    @property
    def input_sizes(self) -> Array:
        """Sizes of the accelerations that are chosen."""
        return self.sizes[-len(self.moves) :]

    @cached_property
    def start_sizes(self) -> dict[str, float]:
        """Sizes of what has start values: coordinates, rates, σ, σ̇ and σ̈."""
        coordinates, *_ = self._start_sizes
        rates = {name: coordinates[coordinate] / self.time for name, coordinate in self._rates.items()}
        return coordinates | rates | {f"{m}_ddot": coordinates[m] / self.time**2 for m in self.moves}

    @property
    def _rates(self) -> dict[str, str]:
        """Coordinates by their rates that have start values, σ̇ among them; angular velocities by themselves."""
        starts, states = self.symbols.start_parameters, self.symbols.state_names
        coordinates = {name: name.replace("_dot", "", 1) for name in starts if name not in states}
        own = {name: q if q in {*states, *starts} else name for name, q in coordinates.items()}
        return own | {f"{m}_dot": m for m in self.moves}

    @cached_property
    def _start_sizes(self) -> tuple[dict[str, float], dict[str, float], float]:
        """Of the coordinates, σ and turns; of the momenta; and of the energy [J]."""
        symbols, model, rates = self.symbols, self.symbols.model, self._rates
        starts, states = symbols.start_parameters, symbols.state_names
        declared = {v.name: v.unit for v in model.variables}
        units = {q: declared.get(q, "").removesuffix("/s") for q in rates.values()}
        units = {q: "rad" if unit in ("", "1", "deg") else unit for q, unit in units.items()}
        energy = [v.name for v in model.outputs].index("kinetic_energy")
        sigma = by_name(self.moves, self.sigma[:, 0])
        resting = {**symbols.inputs, **sigma} | {name: 0.0 for m in self.moves for name in motion_names(m)[1:]}
        still = {**symbols.parameters, **{starts[name]: 0.0 for name in rates if name in starts}}

        def moving(rate: str) -> tuple[float, Array]:
            """Twice the kinetic energy, and the states, where one rate is 1."""
            values = {**resting, **still, starts.get(rate, rate): 1.0}
            columns = [[values[name] for name in names] for names in (resting, still)]
            y, memory = model.start(0.0, *columns)
            z = model.outputs_function(0.0, y, *columns, memory)
            return 2 * float(z[energy]), np.array(y).ravel()[: len(states)]

        moved = {rate: moving(rate) for rate in rates}
        inertia = {u: np.array([moved[rate][0] for rate, q in rates.items() if units[q] == u]) for u in units.values()}
        mean = {u: float(np.exp(np.mean(np.log(m[m > 0])))) for u, m in inertia.items() if m.max() > 0}
        values = by_name(states, self.start) | sigma | dict(self._extents)
        far = {u: max(abs(values.get(q, 0.0)) for q in units if units[q] == u) or 1.0 for u in inertia} | {"rad": 1.0}
        first = "rad" if "rad" in mean else next(iter(mean), "rad")
        whole = mean.get(first, 1.0) * far[first] ** 2
        by_unit = {u: np.sqrt(whole / mean[u]) if u in mean else x for u, x in far.items()}
        coordinates = {q: float(by_unit[unit]) for q, unit in units.items()}
        coordinates |= {name: abs(values[name]) or symbols.sizes.get(name, 1.0) for name in self.internal}
        changes = np.array([np.abs(y) * coordinates[rates[rate]] / self.time for rate, (_, y) in moved.items()])
        momenta = {
            name: float(size) if size > 0 else whole / self.time
            for name, size in zip(states, changes.max(axis=0), strict=True)
            if name not in coordinates and name not in Orientation.quaternion
        }
        return coordinates, momenta, float(whole / self.time**2)

    @property
    def cyclic(self) -> list[str]:
        """Coordinates that enter nothing, so that a motion goes on alike wherever they are."""
        symbols = self.symbols
        enters = symbols.acts(symbols.relative_rates[self.state_indices], symbols.state[self.state_indices])
        return [name for i, name in enumerate(self.names) if not enters[:, i].any() and name in self.free]

    def _coupled(self) -> list[int]:
        """Indices of the states on which moves act, and of those on which these depend."""
        symbols = self.symbols
        acts = symbols.acts(symbols.relative_rates, ca.vertcat(symbols.state, *symbols.motion[:2]))
        n = len(symbols.state_names)
        among, coupled = acts[:, :n], acts[:, n:].any(axis=1)
        for _ in range(n):
            coupled = coupled | among[:, coupled].any(axis=1)
        for _ in range(n):
            coupled = coupled | among[coupled].any(axis=0)
        return [int(i) for i in np.flatnonzero(coupled)]

    @cached_property
    def _slopes(self) -> ca.Function:
        """(y, σ, σ̇, σ̈) -> rates and their derivatives with respect to each of these, side by side.

        Where there are constraints, those of the state that is put back onto them: off the constraints rates depend on
        how fast these are kept [1/s], which is a matter of integration and would be a stiffness where motions are slow.
        """
        state, sigma = self.symbols.state, self.symbols.motion
        constant = [i for i in range(self.start.size) if i not in self.state_indices]
        rates = self.symbols.rates[self.state_indices]
        rates = ca.substitute(rates, state[constant], ca.DM(self.start[constant]))
        arguments = [state[self.state_indices], *sigma]
        columns = [rates, *(ca.jacobian(rates, symbol) for symbol in arguments)]
        slopes = ca.Function("slopes", arguments, [ca.densify(ca.horzcat(*columns))], {"cse": True})
        if not self.is_constrained:
            return slopes
        n, c = len(self.names), len(self.moves)
        y, *sigma = arguments = [ca.MX.sym("y", n), *(ca.MX.sym(name, c) for name in ("s", "v", "a"))]
        whole = ca.MX(ca.DM(self.start))
        whole[self.state_indices] = y
        projection = self._projection(whole, *sigma)
        rates, of_y, of_motion, of_acceleration = ca.horzsplit(
            slopes(projection[:, 0], *sigma), [0, 1, 1 + n, 1 + n + 2 * c, 1 + n + 3 * c]
        )
        of_projected = of_y @ projection[:, 1:] + ca.horzcat(ca.MX(n, n), of_motion)
        return ca.Function("slopes", arguments, [ca.horzcat(rates, of_projected, of_acceleration)])

    def rates(self, y: Array, sigma: Array) -> Array:
        """Of the mechanism's states, σ and its two rates being (moves, 3)."""
        return np.array(self._slopes(y, *sigma.T))[:, 0]

    def steps(
        self, times: Array, planned: Array, period: float, start: Array | None = None
    ) -> tuple[Array, list[Step]]:
        """What is held and what becomes of being off it.

        :param times: communication points (N + 1).
        :param planned: σ, σ̇, σ̈ there, (moves, 3, N + 1).
        :param period: of the regulators.
        :param start: the mechanism's states at the first of them; as the goal says unless given.
        :returns: the states (states, N + 1), and matrices of the N steps, both sides divided by sizes; what chooses are
            accelerations w, one a move.
        """
        y, states, steps = self.start[self.state_indices] if start is None else start, [], []
        for k, H in enumerate(np.diff(times)):
            states.append(y)
            y, step = self._step(y, planned[:, :, k : k + 2], float(H), period)
            steps.append(step)
        reference = np.vstack([np.transpose([*states, y]), *(planned[:, i] for i in range(3))])
        return reference[self.rows], steps

    @cached_property
    def _integrated(self) -> ca.Function:
        """(z, p, 1) -> z after a step, by Runge and Kutta's method.

        z: states, beside them their derivatives with respect to those at the start of the step and to corrections at
        both ends, below them the part of the step that has passed; p: coefficients of σ and of corrections, and H.
        """
        n, c = len(self.names), len(self.moves)
        z, p = ca.MX.sym("z", n + 1, 1 + n + 6 * c), ca.MX.sym("p", 6, c + 7)
        H, powers = p[0, -1], ca.horzcat(*(z[n, 0] ** k for k in range(6)))
        rates = powers @ _DERIVATIVE / H
        bases = ca.vertcat(powers, rates, rates @ _DERIVATIVE / H)  # (orders, powers)
        slopes = self._slopes(z[:n, 0], *ca.vertsplit(bases @ p[:, :c]))
        forced = slopes[:, 1 + n :] @ ca.kron(bases @ p[:, c:-1], ca.DM.eye(c))
        change = slopes[:, 1 : 1 + n] @ z[:n, 1:] + ca.horzcat(ca.MX(n, n), forced)
        rate = ca.vertcat(H * ca.horzcat(slopes[:, 0], change), ca.horzcat(1, ca.MX(1, n + 6 * c)))
        return ca.simpleRK(ca.Function("rate", [z, p], [ca.densify(rate)]), _PARTS)

    def _step(self, y: Array, planned: Array, H: float, period: float) -> tuple[Array, Step]:
        n, c = len(self.names), len(self.moves)
        scale = np.array([1.0, H, H**2])
        ends = _UNIT * np.tile(scale, 2)
        if not self.interpolate:
            ends = np.hstack([np.diag([1.0, 1.0, 0.5, 0, 0, 0])[:, :3] * scale, np.zeros((6, 3))])
        motion = ends @ np.vstack([*planned.transpose(2, 1, 0)])  # (powers, moves)
        begin = np.zeros((n + 1, 1 + n + 6 * c))
        begin[:n, : n + 1] = np.column_stack([y, np.eye(n)])
        last = self._integrated(begin, np.hstack([motion, ends, np.full((6, 1), H)]), 1.0)
        y, off = np.hsplit(np.array(last)[:n], [1])
        M, N = _followed(H, period, c)
        before, after = off[:, n : n + 3 * c], off[:, n + 3 * c :]
        A = np.block([[off[:, :n], before + after @ M], [np.zeros((3 * c, n)), M]])
        A, B = A[np.ix_(self.rows, self.rows)], np.vstack([after @ N, N])[self.rows]
        return y.ravel(), (A * self.sizes / self.sizes[:, None], B * self.input_sizes / self.sizes[:, None])

    def directions(self, reference: Array, sigma: Array) -> Array:
        """Columns along which the states can differ from (states,): of a quaternion only turns, and along constraints.

        They are divided by sizes.

        :param sigma: σ and its two rates there, (moves, 3).
        """
        if self.is_constrained:
            return self._tangents(reference[: len(self.names)], sigma)
        D = np.eye(len(self.states))
        for axes in self.quaternions.values():
            i, *_ = indices = [self.states.index(axis) for axis in axes]
            w, x, y, z = reference[indices]
            D[np.ix_(indices, indices[1:])] = np.array([[-x, -y, -z], [w, -z, y], [z, w, -x], [-y, x, w]]) / 2
            D = np.delete(D, i, axis=1)
        return D

    def _tangents(self, y: Array, sigma: Array) -> Array:
        """Directions along the constraints, on which the mechanism is put back wherever it is led."""
        n, c = len(self.names), len(self.moves)
        slopes = np.array(self._projection(self.whole(y), *sigma.T))[:, 1:]
        of_moves = np.array([self._start_sizes[0][m] for m in self.moves])
        sizes = np.concatenate([self.sizes[:n], of_moves, of_moves / self.time])
        slopes *= sizes / sizes[:n, None]
        along: Any = svd(slopes[:, :n])
        D = np.zeros((n + 3 * c, n + 3 * c))
        D[:n], D[n:, n:] = np.hstack([along[0], slopes[:, n:], np.zeros((n, c))]), np.eye(3 * c)
        left = [i for i, size in enumerate(along[1]) if size > 0.5]  # a projection's are 1 or more, or 0
        return D[np.ix_(self.rows, [*left, *(row for row in self.rows if row >= n)])]

    @cached_property
    def _projection(self) -> ca.Function:
        """(y, σ, σ̇, σ̈) -> what is put back onto the constraints, and its derivatives by y, σ and σ̇, side by side."""
        symbols, project = self.symbols, self.symbols.model.project
        assert project is not None  # there are constraints
        columns = column({**symbols.inputs, **symbols.moved}), column(symbols.parameters)
        projected = project(0, ca.vertcat(symbols.state, 0, 0), *columns)[self.state_indices]
        slopes = [ca.jacobian(projected, x) for x in (symbols.state[self.state_indices], *symbols.motion[:2])]
        return ca.Function("projection", symbols.arguments, [ca.densify(ca.horzcat(projected, *slopes))])

    def whole(self, y: Array) -> Array:
        """All states of the mechanism, those that are left out as at the start."""
        states = self.start.copy()
        states[self.state_indices] = y
        return states

    def rates_off(self, reference: Array, sigma: Array, directions: Array) -> Array:
        """How the rates of the mechanism's states differ along directions, (names, directions)."""
        n, c = len(self.names), len(self.moves)
        slopes = np.array(self._slopes(reference[:n], *sigma.T))[:, 1:]
        return slopes[:, [row for row in self.rows if row < n + 3 * c]] @ (self.sizes[:, None] * directions)

    def forces(self, y: Array, sigma: Array) -> Array:
        """Forces of what moves, and beside them their effective mass."""
        return np.array(self._forces(self.whole(y), *sigma.T))

    @cached_property
    def _forces(self) -> ca.Function:
        symbols = self.symbols
        return ca.Function("forces", symbols.arguments, [ca.densify(ca.horzcat(symbols.forces, symbols.mass))])


def _followed(H: float, period: float, count: int) -> Step:
    """Corrections, their rates and accelerations after a step: the rate of the latter is (w - x'') / period."""
    e = np.exp(-H / period)
    gone = period * (1 - e)
    delay = period * (H - gone)
    M, N = np.array([[1, H, delay], [0, 1, gone], [0, 0, e]]), np.array([[H**2 / 2 - delay], [H - gone], [1 - e]])
    one = np.eye(count)
    return np.asarray(np.kron(M, one), dtype=float), np.asarray(np.kron(N, one), dtype=float)


def reduced(steps: Sequence[Step], directions: Sequence[Array]) -> list[Step]:
    """Matrices of steps in the directions in which the states can differ, at both ends of each."""
    inverses = [np.linalg.pinv(D) for D in directions[1:]]
    return [(b @ A @ D, b @ B) for (A, B), D, b in zip(steps, directions[:-1], inverses, strict=True)]
