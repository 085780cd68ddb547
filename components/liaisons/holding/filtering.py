"""Kalman filters of sampled mechanisms: prediction by the equations of motion, correction by what is measured.

An estimate x has the mechanism's states, biases of what is measured, and unknown forces, divided by their sizes; what
is measured is divided by its noise.  Redundant states (constraints, quaternions) have a singular covariance, of the
rank of the tangent space onto which each step projects.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil
from typing import Any, final

import casadi as ca
import numpy as np
from scipy.linalg import solve_discrete_are, svd

from liaisons.errors import PlanError
from liaisons.holding.feedback import RANK, named_sum, reachable_subspace
from liaisons.holding.sampling import SampledMechanism
from liaisons.planning.goals import Array, by_name

_PARTS_OF_RADIAN = 8
"""Runge-Kutta steps in a radian of the free motion: of order four, each leaves (1/8)^5/120 = 2.5e-7."""
_DRIFT_RADIANS = 100
"""Radians of the free motion in which biases and unknown forces drift by their standard deviations."""
_START_PART = 0.1
"""Standard deviations of states at the start of a plan, relative to sizes, unless given."""
_CIRCLE = 1e-6
"""Multipliers nearer to the unit circle are on it."""


@final
@dataclass(frozen=True)
class Uncertainty:
    """Standard deviations by names, in units of the variables."""

    noise: Mapping[str, float]  # of one sample of what is measured
    disturbance: Mapping[str, float]  # of the impulse of a random force in a second [· √s]
    bias: Mapping[str, float]  # of the biases of what is measured
    unknown_forces: Mapping[str, float]
    states: Mapping[str, float]  # at the start of a plan


@final
class EstimationModel:
    """Prediction and correction of estimates over one period.

    :param period: [s].
    :ivar states: names of the elements of x.
    :ivar sizes: by which they are divided.
    :ivar start: x at the start.
    :ivar measured: names of what is measured.
    :ivar predict: function (x, begin, end) -> x after a period, its derivatives, and the covariance that is added; σ
        and its two rates at both ends have the shape (moves, 3).
    :ivar measure: function (x, σ and its rates) -> what is measured, and its derivatives.
    :ivar land: function (x, σ and its rates) -> x projected onto constraints and unit quaternions, and its derivatives.
    :ivar correct: function (x, P, σ and its rates, y) -> x and its covariance after a measurement; innovations, which
        are independent, of variance 1; and the gain.
    """

    def __init__(self, sampled: SampledMechanism, uncertainty: Uncertainty, period: float) -> None:
        self.sampled, self.uncertainty, self.period = sampled, uncertainty, period
        self.measured = tuple(uncertainty.noise)
        extra = {f"{name}_bias": size for name, size in uncertainty.bias.items()} | dict(uncertainty.unknown_forces)
        n, more, self.states = len(sampled.names), len(extra), (*sampled.names, *extra)
        self.sizes = np.array([*sampled.sizes[:n], *extra.values()])
        self.noise = np.array([*uncertainty.noise.values()])
        self.drift = np.repeat([0.0, np.sqrt(period / sampled.time / _DRIFT_RADIANS)], [n, more])
        self.start = np.append(sampled.start[sampled.state_indices], np.zeros(more)) / self.sizes
        x, w = ca.SX.sym("x", n + more), ca.SX.sym("w", len(uncertainty.disturbance))
        begin, end = (ca.SX.sym(name, len(sampled.moves), 3) for name in ("begin", "end"))
        X = by_name(self.states, ca.vertsplit(x * self.sizes))
        deviations = np.array([*uncertainty.disturbance.values()]) / np.sqrt(period)  # of a mean over a period
        pushes = by_name(uncertainty.disturbance, ca.vertsplit(w * deviations)) if deviations.size else {}
        pushes |= {name: X[name] + pushes.get(name, 0) for name in uncertainty.unknown_forces}
        own = ca.vertcat(*(X[name] for name in sampled.names))
        rates, projected, readings = sampled.expressions(own, end, pushes, self.measured)
        readings = (readings + ca.vertcat(*(X.get(f"{m}_bias", 0) for m in self.measured))) / self.noise
        if ca.depends_on(readings, w):
            raise PlanError(f"{sampled.name}: a random force is part of what is measured; measure no accelerations")
        slopes = ca.Function("slopes", [x, end, w], [ca.vertcat(rates, ca.SX(more, 1)) / self.sizes])
        landed = ca.vertcat(projected / self.sizes[:n], x[n:])
        self.measure = ca.Function("measure", [x, end], [readings, ca.densify(ca.jacobian(readings, x))])
        self.land = ca.Function("land", [x, end], [landed, ca.densify(ca.jacobian(landed, x))])
        motion, parts = sampled.reconstructed(begin, end, period), ceil(period / sampled.time * _PARTS_OF_RADIAN)
        after = self.land(_integrated(lambda y, part: slopes(y, motion(part), w), x, period, parts), end)[0]
        still = [ca.substitute(y, w, ca.SX.zeros(*w.shape)) for y in (after, *(ca.jacobian(after, y) for y in (x, w)))]
        covariance = still[2] @ still[2].T + ca.diag(ca.DM(self.drift**2))
        self.predict = ca.Function("predict", [x, begin, end], [*map(ca.densify, (*still[:2], covariance))])
        P, y = ca.SX.sym("P", n + more, n + more), ca.SX.sym("y", len(self.noise))
        expected, C = self.measure(x, end)
        root = ca.chol(C @ P @ C.T + ca.SX.eye(len(self.noise))).T
        innovations, gain = ca.solve(root, y - expected), ca.solve(root, C @ P)
        corrected, T = self.land(x + gain.T @ innovations, end)
        results = [corrected, T @ (P - gain.T @ gain) @ T.T, innovations, ca.solve(root.T, gain).T]
        self.correct = ca.Function("correct", [x, P, end, y], results)

    def step(self, steady: Array | None) -> ca.Function:
        """Function (is_first, x, P, begin, end, y) -> x and P after the measurement y, and its innovations.

        P is the lower triangle, column by column.

        :param steady: covariance before each measurement, with which P is empty; None: it is predicted, too.
        """
        n, lower = len(self.states), ca.Sparsity.lower(len(self.states))
        x, is_first, y = ca.SX.sym("x", n), ca.SX.sym("is_first"), ca.SX.sym("y", len(self.noise))
        begin, end = (ca.SX.sym(name, len(self.sampled.moves), 3) for name in ("begin", "end"))
        triangle = ca.SX.sym("P", lower.nnz() if steady is None else 0)
        predicted, F, Q = self.predict(x, begin, end)
        P = ca.SX(ca.DM(steady)) if steady is not None else ca.tril2symm(ca.SX(lower, triangle))
        if steady is None:
            P = ca.if_else(is_first, P, F @ P @ F.T + Q)
        x_1, P, innovations, _ = self.correct(ca.if_else(is_first, x, predicted), P, end, y)
        after = ca.project(P, lower).nz[:] if steady is None else triangle
        return ca.Function("step", [is_first, x, triangle, begin, end, y], [x_1, after, innovations], {"cse": True})

    def tangents(self, x: Array, sigma: Array) -> Array:
        """Orthonormal columns, the directions in which x may deviate."""
        decomposition: Any = svd(np.array(self.land(x, sigma)[1]))
        return decomposition[0][:, decomposition[1] > 0.5]  # a projection's are 1 or more, or 0

    def start_covariance(self) -> Array:
        """Covariance at the start of a plan."""
        usual = dict.fromkeys(self.states, _START_PART) | dict.fromkeys(self.states[len(self.sampled.names) :], 1.0)
        for name, deviation in self.uncertainty.states.items():
            if name not in self.sampled.names:
                raise PlanError(f"{self.sampled.name}: deviations of {name!r}: the states are {', '.join(self.states)}")
            usual[name] = deviation / self.sizes[self.states.index(name)]
        T = np.array(self.land(self.start, self.sampled.sigma)[1]) * [*usual.values()]
        return T @ T.T

    def steady_covariance(self) -> Array:
        """Covariance before a measurement to which that of the filter tends at an equilibrium.

        :raises PlanError: if a state is not observable, or its estimate would not be corrected in the long run.
        """
        x, sigma = self.start, self.sampled.sigma
        D, (_, F, Q), C = self.tangents(x, sigma), self.predict(x, sigma, sigma), self.measure(x, sigma)[1]
        A, Q, C = D.T @ np.array(F) @ D, D.T @ np.array(Q) @ D, np.array(C) @ D
        generator = (A - np.eye(len(A))) * (self.sampled.time / self.period)
        seen, hidden = reachable_subspace(generator.T, C.T / (np.linalg.norm(C) or 1.0))
        if hidden.size and np.max(np.abs(np.linalg.eigvals(hidden.T @ A @ hidden))) > 1 - _CIRCLE:
            self.refuse_unobservable(seen.T @ D.T, D)
        directions, variances, _ = svd(Q)
        _, still = reachable_subspace(generator, directions * np.sqrt(variances / (variances[0] or 1.0)))
        modes = np.linalg.eigvals(still.T @ A @ still)
        if np.any(np.abs(np.abs(modes) - 1) < _CIRCLE):
            texts = ", ".join(named_sum(self.states, D @ u, self.sizes) for u in still.T)
            raise PlanError(
                f"{self.sampled.name}: no disturbance changes {texts}, whose estimate would not be corrected in the "
                f"long run; random forces act on {', '.join(self.sampled.ports) or 'no port'}"
            )
        return D @ solve_discrete_are(A.T, C.T, Q, np.eye(len(C))) @ D.T

    def refuse_unobservable(self, matrix: Array, directions: Array) -> None:
        """Raise an error that names the directions that a matrix maps to 0."""
        _, values, rows = svd(matrix @ directions)
        hidden = rows[np.count_nonzero(values > RANK * np.max(values, initial=0.0)) :]
        if hidden.size:
            texts = "; ".join(named_sum(self.states, directions @ row, 1 / self.sizes) for row in hidden)
            names = ", ".join(self.measured)
            raise PlanError(f"{self.sampled.name} cannot be observed: {names} shows no change along {texts}")


def _integrated(rates: Any, x: ca.SX, period: float, count: int) -> ca.SX:
    """x after a period, in as many steps of the classical Runge-Kutta method, of rates of (x, part of the period)."""
    h = period / count
    for k in range(count):
        first = rates(x, k / count)
        second = rates(x + h / 2 * first, (k + 0.5) / count)
        third = rates(x + h / 2 * second, (k + 0.5) / count)
        x = x + h / 6 * (first + 2 * (second + third) + rates(x + h * third, (k + 1) / count))
    return x


def identifier(name: str) -> str:
    """Name of a variable without brackets: ``theta[1]`` -> ``theta_1``."""
    return re.sub(r"\W", "_", name.removesuffix("]"))
