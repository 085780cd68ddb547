"""First-order deviations of a mechanism from a motion, from one communication point to the next.

The equations of the FMUs are linearised along the motion that they perform: within a step a correction of σ is the
polynomial that the mechanism reconstructs from its inputs; a force is constant, or beside a plan's σ, between which the
mechanism interpolates, a straight line from sample to sample.  What a regulator computes at a sample is the force at
the next one.  The matrices of a step therefore include the sampling, and are exact up to the error of their
integration.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import expm

from liaisons.algebra import closure, stack
from liaisons.base.array_names import by_name
from liaisons.base.arrays import Floats
from liaisons.base.hermite import coefficient_matrix
from liaisons.base.port_names import port_names
from liaisons.errors import PlanError, suggestion
from liaisons.language import Orientation
from liaisons_catalogue.regulator import READINGS
from liaisons_motion.goals import Goal, GoalSymbols, goal_symbols, runge_kutta
from liaisons_motion.holding.feedback import Step, image_basis, spectral_radius

_DERIVATIVE = ca.DM(np.diag(np.arange(1, 6), 1))
"""Derivative of a polynomial: a row of powers times this matrix."""
_HERMITE = coefficient_matrix(3)
"""Quintic Hermite interpolation: value, rate and acceleration at 0 and 1 -> coefficients."""


class SampledMechanism:
    """The mechanism of a goal with sampled inputs, at the start of the goal.

    :param required: names of moved coordinates that are held even if no equation depends on them.
    :param time: time [s] in which states change by their sizes, if no free motion determines it.
    :param longest: longest radian [s] of a free motion that determines it.
    :param extents: greatest absolute values of coordinates on the motion; unless given those at the start.
    :ivar interpolates_forces: whether forces are straight lines between samples, for the mechanism interpolates inputs.
    :ivar states: names of all states: ``names``, σ if it is held, forces, σ̇, σ̈.
    :ivar names: states of the mechanism that moves act on, or on which these depend.
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
        self.symbols = symbols = goal_symbols(goal)
        self.interpolate = interpolate
        self.name, self.moves, self.controls, self.driven = symbols.name, goal.moves, goal.controls, goal.driven
        self.interpolates_forces = interpolate and bool(goal.moves and goal.controls)
        starts, start = symbols.start_parameters, symbols.start
        self.is_constrained = any(v.name.endswith("_residual") for v in symbols.model.outputs)
        self.sigma = np.zeros((len(self.driven), 3))
        self.sigma[:, 0] = symbols.initial_sigma
        self.sigma[: len(self.moves), 1] = [float(start.get(f"{m}_dot", 0.0)) for m in self.moves]
        self._default_time, self._longest_radian = time, longest
        self._extents = extents or {}
        self.start = symbols.first_state
        self.state_indices = self._moved_states()
        self.names = [symbols.state_names[i] for i in self.state_indices]
        rates, sigma = symbols.relative_rates, symbols.motion[0]
        is_held = [m in required or symbols.depends(rates, sigma[i]) for i, m in enumerate(self.moves)]
        held = np.flatnonzero(is_held).tolist()
        self.held_moves = [self.moves[i] for i in held]
        n, c, m = len(self.names), len(self.moves), len(self.driven)
        rates_of_moves = (n + order * m + i for order in (1, 2) for i in range(c))
        self.rows = [*range(n), *(n + i for i in (*held, *range(c, m))), *rates_of_moves]
        internal = {state.name for state in getattr(symbols.component, "internal_states", ())}
        self.internal_states = [name for name in self.names if name in internal]
        coordinates = (name for name in self.names if name in starts and not name.endswith(Orientation.momenta))
        self.free = (*(name for name in coordinates if name not in internal), *self.held_moves)
        derivatives = (port_names(move)[order] for order in (1, 2) for move in self.moves)
        self.states = (*self.names, *self.held_moves, *self.controls, *derivatives)
        if len(self.states) > READINGS:
            raise PlanError(
                f"{self.name}: {len(self.states)} states are more than the {READINGS} that a Regulator reads"
            )

    @cached_property
    def frequency(self) -> float:
        """Largest absolute eigenvalue [1/s] of the free motion about the start; 0 if there is none."""
        of_states = slice(1, 1 + len(self.names))
        return spectral_radius(
            np.array(self._rates_and_slopes(self.start[self.state_indices], *self.sigma.T))[:, of_states]
        )

    @cached_property
    def has_free_motion(self) -> bool:
        """Whether :attr:`time` is that of a free motion, which is fast enough."""
        return self.frequency * self._longest_radian > 1

    @cached_property
    def time(self) -> float:
        """Time [s] in which states change by their sizes: one radian of a free motion, else the default."""
        return 1 / self.frequency if self.has_free_motion else self._default_time

    @cached_property
    def sizes(self) -> Floats:
        """Typical magnitudes of the states, by which they are divided in weights, comparisons and tolerances.

        Coordinates of one unit have one size, at which all units have the same kinetic energy: 1 for angles, for
        lengths that at which the mass has the angles' moment of inertia.  Rates, accelerations and momenta follow with
        :attr:`time`.
        """
        coordinates, momenta, _ = self._magnitudes
        of_names = [coordinates.get(name, momenta.get(name, 1.0)) for name in self.names]
        return np.concatenate([of_names, *(self._driven_sizes / self.time**n for n in range(3))])[self.rows]

    @property
    def _driven_sizes(self) -> Floats:
        """Sizes of moved coordinates, and of forces, whose work along the size of a coordinate is a typical energy.

        A force that belongs to no coordinate acts along its unit's: an angle, or a length.
        """
        coordinates, _, energy = self._magnitudes
        units = {v.name: v.unit for v in self.symbols.model.variables}
        lengths = [size for name, size in coordinates.items() if units.get(name) == "m"]

        def size(name: str) -> float:
            if name in coordinates:
                return coordinates[name]
            own = coordinates.get(name.removesuffix("_force").removesuffix("_load"))
            is_linear = units[name] == "N" and own is None
            return energy / (own or (max(lengths, default=1.0) if is_linear else 1.0))

        return np.array([size(name) for name in self.driven])

    @property
    def energy(self) -> float:
        """Kinetic energy [J] of a motion that changes a coordinate by its size in :attr:`time`."""
        return self._magnitudes[2]

    @property
    def input_sizes(self) -> Floats:
        """Sizes of the inputs w, the accelerations of σ, then the forces."""
        return self.sizes[self.input_rows]

    @property
    def input_rows(self) -> list[int]:
        """Indices of the states that inputs w approach, or become: σ̈, then the forces."""
        names = (*(port_names(move)[2] for move in self.moves), *self.controls)
        return [self.states.index(name) for name in names]

    @property
    def _rate_coordinates(self) -> dict[str, str]:
        """Rate with a start value -> its coordinate, also of active ones; an angular velocity maps to itself."""
        starts, states = self.symbols.start_parameters, self.symbols.state_names
        coordinates = {name: name.replace("_dot", "", 1) for name in starts if name not in states}
        own = {name: q if q in {*states, *starts} else name for name, q in coordinates.items()}
        return own | {f"{m}_dot": m for m in self.moves}

    @cached_property
    def _magnitudes(self) -> tuple[dict[str, float], dict[str, float], float]:
        """Typical magnitudes of coordinates, of momenta, and of the energy [J], by which numbers are scaled."""
        symbols, model, rates = self.symbols, self.symbols.model, self._rate_coordinates
        starts, states = symbols.start_parameters, symbols.state_names
        declared = {v.name: v.unit for v in model.variables}
        units = {q: declared.get(q, "").removesuffix("/s") for q in rates.values()}
        units = {q: "rad" if unit in ("", "1", "deg") else unit for q, unit in units.items()}
        energy = [v.name for v in model.outputs].index("kinetic_energy")
        sigma = by_name(self.driven, self.sigma[:, 0])
        resting = symbols.inputs | dict.fromkeys(self.motion_names, 0.0) | sigma
        still = symbols.parameters | {starts[name]: 0.0 for name in rates if name in starts}

        def inertia_and_states(rate: str) -> tuple[float, Floats]:
            """Twice the kinetic energy, and the states, where this rate is 1 and all others are 0."""
            values = {**resting, **still, starts.get(rate, rate): 1.0}
            columns = [[values[name] for name in names] for names in (resting, still)]
            y, memory = model.start(0.0, *columns)
            z = model.outputs_function(0.0, y, *columns, memory)
            return 2 * float(z[energy]), np.array(y).ravel()[: len(states)]

        moved = {rate: inertia_and_states(rate) for rate in rates}
        values = by_name(states, self.start) | sigma | dict(self._extents)
        mean, extents = dict[str, float](), {"rad": 1.0}
        for unit in dict.fromkeys(units.values()):
            extents.setdefault(unit, max(abs(values.get(q, 0.0)) for q in units if units[q] == unit) or 1.0)
            inertia = np.array([moved[rate][0] for rate, q in rates.items() if units[q] == unit])
            if inertia.max() > 0:
                mean[unit] = float(np.exp(np.mean(np.log(inertia[inertia > 0]))))
        first = "rad" if "rad" in mean else next(iter(mean), "rad")
        inertia_size = mean.get(first, 1.0) * extents[first] ** 2
        by_unit = extents | {unit: np.sqrt(inertia_size / inertia) for unit, inertia in mean.items()}
        coordinates = {q: float(by_unit[unit]) for q, unit in units.items()}
        coordinates |= {name: abs(values[name]) or symbols.sizes.get(name, 1.0) for name in self.internal_states}
        changes = [np.abs(y) * coordinates[rates[rate]] / self.time for rate, (_, y) in moved.items()]
        momenta = {
            name: float(size) if size > 0 else inertia_size / self.time
            for name, size in zip(states, np.max(changes, axis=0), strict=True)
            if name not in coordinates and not name.endswith(Orientation.quaternion)
        }
        return coordinates, momenta, float(inertia_size / self.time**2)

    @property
    def cyclic_coordinates(self) -> list[str]:
        """Names of the coordinates on which no rate depends."""
        symbols, rows = self.symbols, self.state_indices
        uses = symbols.dependencies(symbols.relative_rates[rows], symbols.state[rows])
        return [name for i, name in enumerate(self.names) if name in self.free and not uses[:, i].any()]

    def _moved_states(self) -> list[int]:
        """Indices of the states that σ changes, and of those on which these depend."""
        symbols = self.symbols
        dependencies = symbols.dependencies(symbols.relative_rates, ca.vertcat(symbols.state, *symbols.motion[:2]))
        n = len(symbols.state_names)
        uses, is_moved = dependencies[:, :n], dependencies[:, n:].any(axis=1)
        return closure(uses, np.isin(np.arange(n), closure(uses.T, is_moved)))

    @cached_property
    def _rates_and_slopes(self) -> ca.Function:
        """Function (y, σ, σ̇, σ̈) -> rates of y, and their derivatives by each argument, side by side.

        Under constraints the state is projected first: off the constraints the rates contain the stabilisation [1/s],
        which belongs to the integration, and would be stiff beside a slow motion.
        """
        arguments = [ca.SX.sym("y", len(self.names)), *(ca.SX.sym(name, len(self.driven)) for name in ("s", "v", "a"))]
        y, *sigma = arguments
        rates, projected, _ = self.rates_states_and_signals(y, ca.horzcat(*sigma), {}, [])
        if self.is_constrained:
            rates = ca.substitute(rates, y, projected)
        columns = ca.horzcat(rates, *(ca.jacobian(rates, symbol) for symbol in arguments))
        return ca.Function("slopes", arguments, [ca.densify(columns)], {"cse": True})

    def rates(self, y: Floats, sigma: Floats) -> Floats:
        """Rates of the mechanism's states y.

        :param sigma: σ and its two rates, (driven, 3).
        """
        return np.array(self._rates_and_slopes(y, *sigma.T))[:, 0]

    def balanced(self, y: Floats, sigma: Floats, names: Sequence[str]) -> Floats:
        """σ and forces (driven, 3), with values of these forces at which the states y rest, as nearly as they can.

        Rates are linear in forces.
        """
        sigma, n = sigma.copy(), len(self.names)
        chosen = [self.driven.index(name) for name in names]
        columns = np.array(self._rates_and_slopes(y, *sigma.T)) / self.sizes[:n, None]
        slopes = columns[:, [1 + n + i for i in chosen]]
        sigma[chosen, 0] -= np.linalg.lstsq(slopes, columns[:, 0], rcond=1e-12)[0]
        return sigma

    def steps(
        self, times: Floats, planned: Floats, period: float, start: Floats | None = None
    ) -> tuple[Floats, list[Step]]:
        """States at communication points, integrated, and the linearised steps between them.

        :param times: communication points (N + 1).
        :param planned: σ, σ̇, σ̈ there, (driven, 3, N + 1).
        :param period: sampling period of the regulators [s].
        :param start: the mechanism's states at the first point; those of the goal unless given.
        :returns: the states (states, N + 1), and A and B of the N steps, for states and inputs w divided by sizes.
        """
        y = self.start[self.state_indices] if start is None else start
        states, steps = [], []
        for k, step_size in enumerate(np.diff(times)):
            states.append(y)
            y, step = self._linearized_step(y, planned[:, :, k : k + 2], float(step_size), period)
            steps.append(step)
        states.append(y)
        reference = np.vstack([np.transpose(states), *planned.transpose(1, 0, 2)])
        return reference[self.rows], steps

    @cached_property
    def _step_integrator(self) -> ca.Function:
        """Function (z, p, 1) -> z at the end of a step, by the Runge-Kutta method.

        z has the states and, beside them, their derivatives by the states at the start of the step, by the corrections
        of σ at both ends and by forces at its start and its end; its last row is the elapsed part of the step.  p has
        the coefficients of σ, of forces and of corrections, and the size of the step.
        """
        n, c, m = len(self.names), len(self.moves), len(self.driven)
        columns = 1 + n + 6 * c + 2 * (m - c)
        z, p = ca.MX.sym("z", n + 1, columns), ca.MX.sym("p", 6, m + 7)
        step_size = p[0, -1]
        bases = _powers_and_derivatives(z[n, 0], step_size)
        slopes = self._rates_and_slopes(z[:n, 0], *ca.vertsplit(bases @ p[:, :m]))
        of_motion = slopes[:, [1 + n + order * m + i for order in range(3) for i in range(c)]]
        moved = of_motion @ ca.kron(bases @ p[:, m:-1], ca.DM.eye(c)) if c else ca.MX(n, 0)
        of_forces, late = slopes[:, [1 + n + i for i in range(c, m)]], z[n, 0] * self.interpolates_forces
        forced = ca.horzcat(moved, of_forces * (1 - late), of_forces * late)
        change = slopes[:, 1 : 1 + n] @ z[:n, 1:] + ca.horzcat(ca.MX(n, n), forced)
        clock = ca.horzcat(1, ca.MX(1, columns - 1))
        return runge_kutta(z, p, ca.vertcat(step_size * ca.horzcat(slopes[:, 0], change), clock))

    def _linearized_step(self, y: Floats, planned: Floats, step_size: float, period: float) -> tuple[Floats, Step]:
        """The mechanism's states at the end of a step, and its matrices A and B."""
        n, c, m = len(self.names), len(self.moves), len(self.driven)
        ends = self._reconstruction_matrix(step_size)
        motion = self._coefficients(np.vstack([*planned.transpose(2, 1, 0)]), step_size)  # (powers, driven)
        begin = np.zeros((n + 1, 1 + n + 6 * c + 2 * (m - c)))
        begin[:n, 0], begin[:n, 1 : n + 1] = y, np.eye(n)
        parameters = np.hstack([motion, ends, np.full((6, 1), step_size)])
        last = np.array(self._step_integrator(begin, parameters, 1.0))[:n]
        y, of_states, before, after, early, late = np.split(last, np.cumsum([1, n, 3 * c, 3 * c, m - c]), axis=1)
        M, N = _correction_step_matrices(step_size, period, c)
        moved = [n + order * m + i for order in range(3) for i in range(c)]
        forces = [n + i for i in range(c, m)]
        A, B = np.zeros((n + 3 * m, n + 3 * m)), np.zeros((n + 3 * m, m))
        A[:n, :n], A[:n, moved], A[:n, forces] = of_states, before + after @ M, early
        A[np.ix_(moved, moved)], B[:n, :c], B[moved, :c], B[:n, c:] = M, after @ N, N, late
        B[forces, c:] = np.eye(m - c)
        sizes, rows = self.sizes[:, None], self.rows
        return y.ravel(), (A[np.ix_(rows, rows)] * self.sizes / sizes, B[rows] * self.input_sizes / sizes)

    def _coefficients(self, ends: Any, step_size: float) -> Any:
        """Coefficients (6, driven) of σ and of forces by the fraction of a step.

        :param ends: σ and its two rates, or forces and 0, at the start of the step, then at its end: (6, driven).
        """
        c, of_moves, of_forces = len(self.moves), self._reconstruction_matrix(step_size), np.zeros((6, 6))
        of_forces[0, 0] = 1.0
        of_forces[1, [0, 3]] = [-1.0 * self.interpolates_forces, 1.0 * self.interpolates_forces]
        if isinstance(ends, ca.SX):
            return ca.horzcat(ca.DM(of_moves) @ ends[:, :c], ca.sparsify(ca.DM(of_forces)) @ ends[:, c:])
        return np.hstack([of_moves @ ends[:, :c], of_forces @ ends[:, c:]])

    def _reconstruction_matrix(self, step_size: float) -> Floats:
        """Matrix (6, 6) from σ and its two rates at both ends of a step to coefficients of σ, by the fraction of it."""
        scale = np.array([1.0, step_size, step_size**2])
        if self.interpolate:
            return _HERMITE * np.tile(scale, 2)
        extrapolation = np.zeros((6, 6))
        extrapolation[:3, :3] = np.diag(scale / [1, 1, 2])
        return extrapolation

    def reconstructed_motion(self, begin: ca.SX, end: ca.SX, step_size: float, fraction: ca.SX) -> ca.SX:
        """σ and its two rates, (driven, 3), after a fraction of a step.

        :param begin: the same at the start of the step; ``end``: at its end.
        """
        coefficients = self._coefficients(ca.vertcat(begin.T, end.T), step_size)
        return (_powers_and_derivatives(fraction, step_size) @ coefficients).T

    def rates_states_and_signals(
        self, y: ca.SX, motion: ca.SX, forces: Mapping[str, ca.SX], signals: Sequence[str]
    ) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Rates of the mechanism's states y, y projected onto the constraints, and the signals, as expressions.

        :param motion: σ and its two rates (driven, 3).
        :param forces: by inputs; they add to those of the goal.
        :param signals: names.
        :raises PlanError: for an unknown name, or a signal that depends on a state that σ does not change.
        """
        inputs = dict(self.symbols.inputs)
        for name, force in forces.items():
            if name not in self.free_inputs:
                raise PlanError(f"{self.name}: no input {name!r} is free{suggestion(name, self.free_inputs)}")
            inputs[name] += force
        symbols, rows = replace(self.symbols, inputs=inputs), self.state_indices
        state = ca.SX(ca.DM(self.start))
        state[rows] = y
        readings = stack(symbols.signals[name] for name in signals)
        for i, x in enumerate(ca.vertsplit(symbols.state)):
            if i not in rows and ca.depends_on(readings, x):
                moves = ", ".join(self.driven)
                raise PlanError(f"{self.name}: {', '.join(signals)} depends on {x.name()}, which {moves} cannot move")
        results = [symbols.rates[rows], _projected_states(symbols)[rows], readings]
        rates, projected, readings = ca.substitute(results, symbols.arguments, [state, *ca.horzsplit(motion)])
        return rates, projected, readings

    @property
    def start_values(self) -> dict[str, float]:
        """Start values of the mechanism by its parameters."""
        return {name: float(self.symbols.parameters[name]) for name in self.symbols.start_parameters.values()}

    @property
    def motion_names(self) -> list[str]:
        """Names of σ, σ̇ and σ̈ of each moved coordinate, then those of forces."""
        return [*(name for move in self.moves for name in port_names(move)[:3]), *self.controls]

    def motion_of_values(self, values: ca.SX) -> ca.SX:
        """σ and its two rates, and forces, (driven, 3), from a column of values in the order of ``motion_names``."""
        moved = 3 * len(self.moves)
        forces = ca.horzcat(values[moved:], ca.SX(len(self.controls), 2))
        return ca.vertcat(ca.reshape(values[:moved], 3, -1).T, forces)

    @property
    def free_inputs(self) -> list[str]:
        """Names of the inputs that nothing feeds: forces."""
        return [name for name in self.symbols.inputs if name not in self.symbols.motion_symbols]

    def directions(self, reference: Floats, sigma: Floats) -> Floats:
        """Columns that span the deviations of the states, divided by sizes.

        Deviations of quaternions are rotations; under constraints they are tangential.

        :param reference: the states (states,).
        :param sigma: σ and its two rates there, (driven, 3).
        """
        if self.is_constrained:
            return self._tangents(reference[: len(self.names)], sigma)
        D = np.eye(len(self.states))
        for axes in self.symbols.quaternions.values():
            if not set(axes) <= set(self.names):
                continue
            i, *_ = indices = [self.states.index(axis) for axis in axes]
            w, x, y, z = reference[indices] / 2
            D[np.ix_(indices, indices[1:])] = [
                [-x, -y, -z],
                [w, -z, y],
                [z, w, -x],
                [-y, x, w],
            ]
            D = np.delete(D, i, axis=1)
        return D

    def _tangents(self, y: Floats, sigma: Floats) -> Floats:
        """Columns that span the deviations tangential to the constraints, divided by sizes."""
        n, c = len(self.names), len(self.driven)
        slopes = np.array(self._projection(self.full_state(y), *sigma.T))[:, 1:]
        sizes = np.concatenate([self.sizes[:n], *(self._driven_sizes / self.time**order for order in range(2))])
        slopes *= sizes / sizes[:n, None]
        of_states = image_basis(slopes[:, :n])
        rank = of_states.shape[1]
        D = np.block(
            [
                [of_states, slopes[:, n:], np.zeros((n, c))],
                [np.zeros((3 * c, rank)), np.eye(3 * c)],
            ]
        )
        columns = [*range(rank), *(row - n + rank for row in self.rows if row >= n)]
        return D[np.ix_(self.rows, columns)]

    @cached_property
    def _projection(self) -> ca.Function:
        """Function (y, σ, σ̇, σ̈) -> y projected onto the constraints, and derivatives by y, σ and σ̇, side by side."""
        symbols, rows = self.symbols, self.state_indices
        projected = _projected_states(symbols)[rows]
        causes = symbols.state[rows], *symbols.motion[:2]
        columns = ca.horzcat(projected, *(ca.jacobian(projected, x) for x in causes))
        return ca.Function("projection", symbols.arguments, [ca.densify(columns)])

    def full_state(self, y: Floats) -> Floats:
        """All states of the mechanism: y, and the others as at the start."""
        states = self.start.copy()
        states[self.state_indices] = y
        return states

    def rate_changes(self, reference: Floats, sigma: Floats, directions: Floats) -> dict[str, Floats]:
        """Derivatives along directions of the rates that have start values, by name.

        :param reference: the states (states,), about which deviations are; ``sigma``: σ and its two rates, (driven, 3).
        """
        symbols = self.symbols
        names = [name for name in symbols.start_parameters if name not in symbols.state_names]
        causes = ca.vertcat(symbols.state[self.state_indices], *symbols.motion)
        slopes = ca.jacobian(stack(symbols.signals[name] for name in names), causes)
        values = ca.Function("rates", symbols.arguments, [slopes])(
            self.full_state(reference[: len(self.names)]), *sigma.T
        )
        return by_name(names, np.array(values)[:, self.rows] @ (self.sizes[:, None] * directions))

    @cached_property
    def forces_and_mass(self) -> ca.Function:
        """Function (state, σ, σ̇, σ̈) -> operator forces λ and, beside them, the effective mass Θ: (moves, 1 + moves)."""
        columns = ca.horzcat(self.symbols.forces, self.symbols.mass)
        return ca.Function("forces", self.symbols.arguments, [ca.densify(columns)])


def _projected_states(symbols: GoalSymbols) -> ca.SX:
    """Expressions of all states, projected onto the constraints."""
    project = symbols.model.project
    return symbols.state if project is None else project(*symbols.model_arguments[:4])


def _powers_and_derivatives(fraction: Any, step_size: ca.MX | float) -> Any:
    """Powers of the elapsed fraction of a step, and their first two derivatives by time, (3, powers)."""
    values = ca.horzcat(*(fraction**k for k in range(6)))
    rates = values @ _DERIVATIVE / step_size
    return ca.vertcat(values, rates, rates @ _DERIVATIVE / step_size)


def _correction_step_matrices(step_size: float, period: float, count: int) -> Step:
    """Matrices M, N of a step of the filter dx''/dt = (w - x'') / period: (x, x', x'') -> M (x, x', x'') + N w."""
    flow = np.diag([1.0, 1.0, 1 / period], 1)  # of x, x', x'' and w
    flow[2, 2] = -1 / period
    step: Any = np.kron(expm(step_size * flow)[:3], np.eye(count))
    return step[:, : 3 * count], step[:, 3 * count :]


def in_directions(steps: Sequence[Step], directions: Sequence[Floats]) -> list[Step]:
    """The steps in coordinates of the directions at both ends of each."""
    transformed: list[Step] = []
    for (A, B), (before, after) in zip(steps, pairwise(directions), strict=True):
        inverse = np.linalg.pinv(after)
        transformed.append((inverse @ A @ before, inverse @ B))
    return transformed
