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
from typing import final

import casadi as ca
import numpy as np
from scipy.linalg import solve_discrete_are

from liaisons.base.array_names import by_name
from liaisons.base.arrays import Floats
from liaisons.errors import PlanError
from liaisons_motion.holding.feedback import RANK, image_basis, named_sum, reachable_subspace, spectral_radius
from liaisons_motion.holding.sampling import SampledMechanism

_PARTS_OF_RADIAN = 8
"""Runge-Kutta steps in a radian of the free motion: of order four, each leaves (1/8)^5/120 = 2.5e-7."""
_DRIFT_RADIANS = 100
"""Radians of the free motion in which biases and unknown forces drift by their standard deviations."""
_START_PART = 0.1
"""Standard deviations of states at the start of a plan, relative to sizes, unless given."""
_OFF = 1e-6
"""What Riccati's equation may be off by, relative to the covariance that a period adds."""
_ROUNDING = 1e-11
"""The same, relative to the solution."""
_LARGEST = 1e100
"""Numbers below it have squares."""
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
    :ivar project: function (x, σ and its rates) -> x on constraints and with unit quaternions, and its derivatives.
    :ivar correct: function (x, P, σ and its rates, y) -> x and its covariance after a measurement; innovations, which
        are independent, of variance 1; and the gain.
    """

    def __init__(self, sampled: SampledMechanism, uncertainty: Uncertainty, period: float) -> None:
        self.sampled, self.uncertainty, self.period = sampled, uncertainty, period
        self.measured = tuple(uncertainty.noise)
        biases = {f"{name}_bias": size for name, size in uncertainty.bias.items()}
        drifting = biases | dict(uncertainty.unknown_forces)
        n, more = len(sampled.names), len(drifting)
        self.states = (*sampled.names, *drifting)
        self.sizes = np.array([*sampled.sizes[:n], *drifting.values()])
        self.noise = np.array([*uncertainty.noise.values()])
        drift = np.sqrt(period / sampled.time / _DRIFT_RADIANS)
        self.drift = np.repeat([0.0, drift], [n, more])
        start = sampled.start[sampled.state_indices]
        self.start = np.append(start, np.zeros(more)) / self.sizes
        x = ca.SX.sym("x", n + more)
        w = ca.SX.sym("w", len(uncertainty.disturbance))
        begin, end = (ca.SX.sym(name, len(sampled.driven), 3) for name in ("begin", "end"))
        rates, projected, readings = self._rates_and_readings(x, w, end)
        landed = ca.vertcat(projected / self.sizes[:n], x[n:])
        self.measure, self.project = (
            ca.Function(name, [x, end], [results, ca.densify(ca.jacobian(results, x))])
            for name, results in (("measure", readings), ("project", landed))
        )
        self.predict = self._prediction(x, w, rates, begin, end)
        self.correct = self._correction(x, end)

    def _prediction(self, x: ca.SX, w: ca.SX, rates: ca.SX, begin: ca.SX, end: ca.SX) -> ca.Function:
        """Function ``predict``: x after a period by steps of Runge and Kutta, F = ∂x'/∂x, and G Gᵀ with G = ∂x'/∂w."""
        sampled, period = self.sampled, self.period
        part, inputs = ca.SX.sym("part"), ca.vertcat(w, ca.vec(begin), ca.vec(end))
        motion = sampled.reconstructed_motion(begin, end, period, part)
        slopes = ca.vertcat(ca.substitute(rates, end, motion), 1 / period)
        flow = ca.Function("slopes", [ca.vertcat(x, part), inputs], [slopes])
        advance = ca.simpleRK(flow, ceil(period / sampled.time * _PARTS_OF_RADIAN))
        after, _ = self.project(advance(ca.vertcat(x, 0), inputs, period)[:-1], end)
        derivatives = after, ca.jacobian(after, x), ca.jacobian(after, w)
        predicted, F, G = (ca.substitute(y, w, ca.SX.zeros(*w.shape)) for y in derivatives)
        covariance = G @ G.T + ca.diag(ca.DM(self.drift**2))
        return ca.Function("predict", [x, begin, end], [*map(ca.densify, (predicted, F, covariance))])

    def _correction(self, x: ca.SX, end: ca.SX) -> ca.Function:
        """Function ``correct``: x and P after a measurement, with the gain Kᵀ = S⁻¹ C P of S = C P Cᵀ + 1."""
        P = ca.SX.sym("P", x.numel(), x.numel())
        expected, C = self.measure(x, end)
        y = ca.SX.sym("y", expected.numel())
        root = ca.chol(C @ P @ C.T + ca.SX.eye(y.numel())).T
        innovations, gain = ca.solve(root, y - expected), ca.solve(root, C @ P)
        corrected, T = self.project(x + gain.T @ innovations, end)
        remaining = T @ (P - gain.T @ gain) @ T.T
        results = [corrected, remaining, innovations, ca.solve(root.T, gain).T]
        return ca.Function("correct", [x, P, end, y], results)

    def _rates_and_readings(self, x: ca.SX, w: ca.SX, sigma: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Rates of x, projected states of the mechanism, and readings divided by their noise.

        :param w: random forces, of variance 1.
        :param sigma: σ and its two rates.
        :raises PlanError: if random forces are part of the readings.
        """
        sampled, uncertainty = self.sampled, self.uncertainty
        values = by_name(self.states, ca.vertsplit(x * self.sizes))
        deviations = np.array([*uncertainty.disturbance.values()]) / np.sqrt(self.period)  # of a mean over a period
        forces = by_name(uncertainty.disturbance, ca.vertsplit(w * deviations)) if deviations.size else {}
        forces |= {name: values[name] + forces.get(name, 0) for name in uncertainty.unknown_forces}
        own = ca.vertcat(*(values[name] for name in sampled.names))
        rates, projected, readings = sampled.rates_states_and_signals(own, sigma, forces, self.measured)
        readings += ca.vertcat(*(values.get(f"{name}_bias", 0) for name in self.measured))
        if ca.depends_on(readings, w):
            raise PlanError(f"{sampled.name}: a random force is part of what is measured; measure no accelerations")
        constant = ca.SX(len(self.drift) - rates.numel(), 1)
        return ca.vertcat(rates, constant) / self.sizes, projected, readings / self.noise

    def start_matrices(self) -> tuple[Floats, Floats, Floats]:
        """Matrices F, Q and C at the start: a period is x' = F x + w, Q the covariance of w, C x what is measured."""
        x, sigma = self.start, self.sampled.sigma
        _, F, Q = self.predict(x, sigma, sigma)
        return np.array(F), np.array(Q), np.array(self.measure(x, sigma)[1])

    def filter_step(self, steady_covariance: Floats | None) -> ca.Function:
        """Function (is_first, x, P, begin, end, y) -> x and P after the measurement y, and its innovations.

        P is the lower triangle of the covariance, column by column.

        :param steady_covariance: that before each measurement, with which P is empty; None: it is predicted, too.
        """
        n, lower = len(self.states), ca.Sparsity.lower(len(self.states))
        x, is_first = ca.SX.sym("x", n), ca.SX.sym("is_first")
        y = ca.SX.sym("y", len(self.noise))
        begin, end = (ca.SX.sym(name, len(self.sampled.driven), 3) for name in ("begin", "end"))
        triangle = ca.SX.sym("P", lower.nnz() if steady_covariance is None else 0)
        predicted, F, Q = self.predict(x, begin, end)
        if steady_covariance is None:
            P = ca.tril2symm(ca.SX(lower, triangle))
            P = ca.if_else(is_first, P, F @ P @ F.T + Q)
        else:
            P = ca.SX(ca.DM(steady_covariance))
        x_1, P, innovations, _ = self.correct(ca.if_else(is_first, x, predicted), P, end, y)
        after = ca.project(P, lower).nz[:] if steady_covariance is None else triangle
        arguments = [is_first, x, triangle, begin, end, y]
        return ca.Function("step", arguments, [x_1, after, innovations], {"cse": True})

    def tangents(self, x: Floats, sigma: Floats) -> Floats:
        """Orthonormal columns that span the deviations of x which constraints and unit quaternions allow."""
        return image_basis(np.array(self.project(x, sigma)[1]))

    def start_covariance(self) -> Floats:
        """Covariance of x at the start of a plan."""
        sampled = self.sampled
        deviations = dict.fromkeys(self.states, 1.0) | dict.fromkeys(sampled.names, _START_PART)
        for name, deviation in self.uncertainty.states.items():
            if name not in sampled.names:
                raise PlanError(f"{sampled.name}: deviations of {name!r}: the states are {', '.join(self.states)}")
            deviations[name] = deviation / self.sizes[self.states.index(name)]
        projection = np.array(self.project(self.start, sampled.sigma)[1])
        root = projection * [*deviations.values()]
        return root @ root.T

    def steady_covariance(self) -> Floats:
        """Covariance of x before each measurement of the steady filter at an equilibrium.

        :raises PlanError: if a state is not observable, or its estimate would not be corrected in the long run.
        """
        (F, Q, C), D = self.start_matrices(), self.tangents(self.start, self.sampled.sigma)
        if not all(np.all(np.abs(matrix) < _LARGEST) for matrix in (F, Q, C)):
            raise self._imprecise_error()
        A, Q, C = D.T @ F @ D, D.T @ Q @ D, C @ D
        generator = (A - np.eye(len(A))) * (self.sampled.time / self.period)
        seen, hidden = reachable_subspace(generator.T, C.T / (np.linalg.norm(C) or 1.0))
        if hidden.size and spectral_radius(hidden.T @ A @ hidden) > 1 - _CIRCLE:
            self.refuse_unobservable(seen.T @ D.T, D)
        directions, variances, _ = np.linalg.svd(Q)
        root = directions * np.sqrt(variances / (variances[0] or 1.0))
        _, still = reachable_subspace(generator, root)
        multipliers = np.abs(np.linalg.eigvals(still.T @ A @ still))
        if np.any(np.abs(multipliers - 1) < _CIRCLE):
            texts = ", ".join(named_sum(self.states, D @ u, self.sizes) for u in still.T)
            raise PlanError(
                f"{self.sampled.name}: no disturbance changes {texts}, whose estimate would not be corrected in the "
                f"long run; random forces act on {', '.join(self.sampled.free_inputs) or 'no port'}"
            )
        try:
            P = solve_discrete_are(A.T, C.T, Q, np.eye(len(C)))
            gain = np.linalg.solve(np.eye(len(C)) + C @ P @ C.T, C @ P)
        except np.linalg.LinAlgError:
            raise self._imprecise_error() from None
        off = A @ (P - gain.T @ (C @ P)) @ A.T + Q - P
        if not np.linalg.norm(off) <= _OFF * np.linalg.norm(Q) + _ROUNDING * np.linalg.norm(P):
            raise self._imprecise_error()
        return D @ P @ D.T

    def _imprecise_error(self) -> PlanError:
        """Error of deviations that are too far apart for a filter in double precision."""
        chosen = {"noise": self.uncertainty.noise, "disturbance": self.uncertainty.disturbance}
        values = ", ".join(f"{kind} of {name} = {x:g}" for kind, group in chosen.items() for name, x in group.items())
        words = f"{values} every {self.period:g} s: Riccati's equation has no solution in 16 digits"
        return PlanError(f"{self.sampled.name}: {words}; give standard deviations that are less far apart")

    def refuse_unobservable(self, matrix: Floats, directions: Floats) -> None:
        """Raise an error if a matrix maps some of the directions to 0; it names them.

        :param matrix: from x to all that is measured.
        """
        _, values, rows = np.linalg.svd(matrix @ directions)
        hidden = rows[np.count_nonzero(values > RANK * np.max(values, initial=0.0)) :]
        if hidden.size:
            texts = "; ".join(named_sum(self.states, directions @ row, 1 / self.sizes) for row in hidden)
            names = ", ".join(self.measured)
            raise PlanError(f"{self.sampled.name} cannot be observed: {names} shows no change along {texts}")


def identifier(name: str) -> str:
    """Name of a variable without brackets: ``theta[1]`` -> ``theta_1``."""
    return re.sub(r"\W", "_", name.removesuffix("]"))
