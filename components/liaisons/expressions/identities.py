"""Which expressions vanish identically: numbers that neither a kink nor a length of its own can deceive.

An expression that is 0 near a start need not vanish: a wall stands 2 m away, a well is narrow, friction begins at
3 m/s.  Numbers decide in three ways:

- Every operation is rounded at random, in several lanes.  Where terms cancel, lanes differ; where they agree, the
  expression is not 0, however small it is beside anything else.
- States have all sizes, not those near the start alone.
- Of ``fmax``, ``if_else`` and their like every branch counts: a condition is also tried as if it came out otherwise.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons.expressions.calls import with_opaque_calls
from liaisons.expressions.operations import NUMPY, interpret, is_smooth_function

_LANES, _TRIALS = 8, 8  # of rounding; of conditions
_AGREE = 0.1  # relative spread of lanes below which they agree; of cancelled terms 1e-10 do by chance
_ALIKE = 1e-6  # relative difference of two numbers that are one, calculated in two ways
_LEAST = 1e-250  # in place of a number that underflows, which is not 0
_UNDERFLOWS = {ca.OP_EXP, ca.OP_MUL, ca.OP_DIV, ca.OP_SQ, ca.OP_POW, ca.OP_CONSTPOW, ca.OP_INV}


def nonzero_states(expression: ca.SX, symbols: ca.SX, states: NDArray, noise: float = 1e-12) -> NDArray[np.intp]:
    """For each entry of a column the first state at which it is not 0; -1 where it vanishes identically.

    :param symbols: all that occur, a column.
    :param states: their values, shape (symbols, n).
    :param noise: relative error of numbers in the expression, above that of doubles.
    :returns: (entries,); n where it is not 0 if conditions come out otherwise, or where it cannot be evaluated.
    """
    count = states.shape[1]
    column, calls = with_opaque_calls(ca.densify(ca.vec(expression)))
    results = np.random.default_rng(0).normal(size=(len(calls), count))  # of tables anything is assumed
    function = ca.Function("identity", [ca.vertcat(symbols, *calls)], [column])
    states = np.vstack([states, results])
    found = np.full(column.numel(), -1)
    for trial in range(1 if is_smooth_function(function) else _TRIALS):
        values, underflow = _noisy_values(function, states, noise, trial)
        size, finite = np.max(np.abs(values), axis=1), np.all(np.isfinite(values), axis=1)
        with np.errstate(invalid="ignore"):
            agree = finite & (np.ptp(values, axis=1) <= _AGREE * size) & (size > 0)
        sound = finite & ~underflow
        # What underflows is evidence only where there is no other.
        nonzero = np.where(sound.any(axis=1, keepdims=True), agree & sound, agree)
        first = np.where(nonzero.any(axis=1), nonzero.argmax(axis=1) if trial == 0 else count, -1)
        if trial == 0:
            first[~finite.any(axis=1)] = count
        found = np.where(found < 0, first, found)
    return found


def _noisy_values(
    function: ca.Function, states: NDArray, noise: float, trial: int
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Values (entries, lanes, states) with every operation rounded at random, and the states that underflow.

    :param trial: 0: conditions as they are; else each comes out otherwise at some states.
    """
    rng, shape = np.random.default_rng(trial), (_LANES, states.shape[1])
    bank = 1 + noise * rng.uniform(-1, 1, (101, *shape))
    underflow, used = np.zeros(shape[1], dtype=bool), 0

    def side(difference: Any) -> Any:
        """Sign of a difference; one of equal size has it everywhere in a trial."""
        signs = np.sign(difference)
        if trial == 0:
            return signs
        size = np.round(np.log(np.mean(np.abs(difference), axis=0)) / _ALIKE)
        return np.where(np.sin(size * (1 + trial / np.pi)) > 0, -signs, signs)

    conditional: dict[int, Callable[..., Any]] = {
        ca.OP_FABS: lambda x: side(x) * x,
        ca.OP_SIGN: side,
        ca.OP_COPYSIGN: lambda x, y: side(x) * x * side(y),
        ca.OP_FMAX: lambda x, y: np.where(side(x - y) > 0, x, y),
        ca.OP_FMIN: lambda x, y: np.where(side(x - y) > 0, y, x),
        ca.OP_LT: lambda x, y: side(x - y) < 0,
        ca.OP_LE: lambda x, y: side(x - y) <= 0,
    }

    def operation(code: int, operands: list[Any]) -> Any:
        nonlocal underflow, used
        used += 1
        result = np.asarray((conditional.get(code) or NUMPY[code])(*operands), dtype=float)
        if code in _UNDERFLOWS:
            lost = (result == 0) & (True if code == ca.OP_EXP else np.all([x != 0 for x in operands], axis=0))
            if lost.any():
                result, underflow = np.where(lost, _LEAST, result), underflow | lost.any(axis=0)
        return result * bank[used % len(bank)]

    with np.errstate(all="ignore"):  # what is not finite is not evidence
        (rows,) = interpret(
            function,
            entry=lambda _, i: np.broadcast_to(states[i], shape),
            constant=lambda number: np.full(shape, number),
            operation=operation,
        )
    return np.array(rows, dtype=float).reshape(len(rows), *shape), underflow
