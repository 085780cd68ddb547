"""Ends that no motion of σ changes, told by the structure of the equations; and starts where only samples say so."""

from __future__ import annotations

import casadi as ca
import numpy as np

from liaisons.algebra import at_zero
from liaisons.base.port_names import port_names
from liaisons.errors import PlanError
from liaisons.expressions import nonzero_states
from liaisons_motion.planning.guesses import arbitrary_motion
from liaisons_motion.planning.problems import Problem

_INTERVALS = 30
"""Intervals on which the integration of a loop, by six Runge-Kutta steps in each, leaves 1e-9."""
_INVARIANT_SPREAD = 1e-9
"""Spread of an end over several motions, in units of its size, below which it seems invariant: the integration's
error."""
_INVARIANT_MISS = 1e-3
"""Miss of an invariant end, in units of its size, above which it is refused."""
_STATES = 40
"""Number of states at which expressions are looked at."""
_SCALES = (-2, 4)
"""Range of the powers of ten of their distances from the start."""


def refuse_invariants(problem: Problem) -> None:
    """Raise an error for a row at the end that the structure of the equations keeps outside of its range.

    Three motions tell which rows to look at.

    :param problem: in relative units.
    :raises PlanError: with its name.
    """
    end, initial_labels = problem.end, set(problem.start.labels)
    started = {state for state in problem.states if state in initial_labels or state in problem.moves}
    if not end.labels or len(started) < len(problem.states):
        return
    ends = (end.function(arbitrary_motion(problem, _INTERVALS, k, 10.0 ** (k % 3)).knots[:, -1]) for k in range(1, 4))
    values = np.hstack([*map(np.array, ends)])
    off = np.maximum(end.low - values.max(axis=1), values.min(axis=1) - end.high)
    unmoved = np.flatnonzero((np.ptp(values, axis=1) < _INVARIANT_SPREAD) & (off > _INVARIANT_MISS))
    for i in unmoved[_never_moved(problem)[unmoved]] if unmoved.size else ():
        size, stays = end.sizes[i], round(float(values[i, 0]), 5) + 0.0
        required = float(np.clip(values[i, 0], end.low[i], end.high[i]) * size)
        how = " and comes back" if problem.is_loop else ""
        raise PlanError(
            f"{problem.name}: end: {end.labels[i]} = {required:.6g} cannot be reached: "
            f"however {', '.join((*problem.moves, *problem.forces))} moves{how}, it ends at {stays * size:.6g}"
        )


def _never_moved(problem: Problem) -> np.ndarray:
    """Whether a row at the end depends on nothing but states that every motion of σ leaves at their start values."""
    X, U = ca.SX.sym("x", len(problem.states)), ca.SX.sym("u", len(problem.controls))
    symbols, rng = ca.vertcat(X, U), np.random.default_rng(0)
    centres = np.concatenate([problem.initial_state, np.zeros(U.numel())])[:, None]
    states = centres + 10 ** rng.uniform(*_SCALES, (len(centres), _STATES)) * rng.uniform(
        -1, 1, (len(centres), _STATES)
    )

    def nonzero(expression: ca.SX) -> np.ndarray:
        return nonzero_states(expression, symbols, states) >= 0

    rates, rows, still = problem.rates(X, U), problem.end.function(X), list(range(X.numel()))
    while still:  # the largest set of states whose rates vanish while they are all at their start values
        at_start = ca.substitute(rates, X[still], ca.SX(ca.DM(problem.initial_state[still])))
        moved = nonzero(at_start[still])
        if not moved.any():
            break
        still = [i for i, moves in zip(still, moved, strict=True) if not moves]
    start = ca.SX(ca.DM(problem.initial_state[still]))
    rates, rows = (ca.substitute(e, X[still], start) if still else e for e in (rates, rows))
    if problem.is_loop and len(problem.controls) == 1:  # what is a function of σ comes back with it
        value, rate, _ = port_names(problem.moves[0])[:3]
        s = X[problem.states.index(value)]
        s_dot = X[problem.states.index(rate)] if rate in problem.states else U[0]
        others = ca.vertcat(*(x for x in ca.vertsplit(symbols) if not ca.is_equal(x, s) and not ca.is_equal(x, s_dot)))
        for i in range(X.numel()):
            rest = ca.vertcat(
                ca.jacobian(rates[i], others).T,
                at_zero(rates[i], s_dot),
                ca.jacobian(ca.jacobian(rates[i], s_dot), s_dot),
            )
            if i not in still and not nonzero(rest).any():
                still.append(i)
    moving = [i for i in range(X.numel()) if i not in still]
    if not moving:
        return np.ones(rows.numel(), dtype=bool)
    slopes = ca.jacobian(rows, X[moving])
    return np.array([not nonzero(slopes[i, :].T).any() for i in range(rows.numel())])
