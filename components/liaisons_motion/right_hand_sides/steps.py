"""Steps of a fixed size for all cases at once, by compiled code over lanes.

Cases go through all their steps in blocks of as many lanes as keep the stages of a step in the first-level cache.
Within a block every loop is over the lanes and vectorises, see :mod:`liaisons.base.compiled_code`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np

from liaisons.base.arrays import Floats
from liaisons.base.compiled_code import call_c_function, compiled_library
from liaisons_motion.right_hand_sides.methods import Tableau
from liaisons_motion.right_hand_sides.right_hand_side import RightHandSide
from liaisons_motion.right_hand_sides.step_code import StepCode

LANES = 32
"""Cases in a block."""
_AHEAD = 4.0
"""Steps within which constraints may not lose rank: a step that is not much shorter misses what happens there."""

Advance = Callable[[float, float, int, Floats, Floats], None]
"""(start time, step size, steps, values of the lanes, states): advances states in place; arrays (blocks, ..., LANES).

Several threads may call it at once, each for blocks of its own."""

_INTEGRATE = """\
void integrate(long blocks, long steps, double start, double h, const double *shared,
               const double *constants, double *states)
{
    static const double limits[] = {-INFINITY, INFINITY};
    for (long block = 0; block < blocks; ++block)
        for (long n = 0; n < steps; ++n)
            step(start + (double)n * h, h, limits, constants + block * K * D, shared, states + block * N * D);
}
"""


def compiled_advance(equations: RightHandSide, tableau: Tableau, shared: Floats) -> Advance:
    """Compiled function that advances the states of all cases in place by steps of one size.

    States become not-a-number where constraints are out of reach, or may lose rank within some steps.

    :param shared: values that all cases share.
    :raises BuildError: if there is no compiler, or it fails.
    """
    code = compiled_library(ensemble_code(equations, tableau))

    def advance(start: float, size: float, steps: int, lanes: Floats, states: Floats) -> None:
        call_c_function(code, "integrate", len(states), steps, start, size, np.append(shared, size), lanes, states)

    return advance


def ensemble_code(equations: RightHandSide, tableau: Tableau) -> str:
    """C99 code that integrates blocks of lanes; behind the shared values stands the step size."""
    (t, k, s, y), size = equations.symbols, ca.SX.sym("size")
    equations = replace(equations, symbols=(t, k, ca.vertcat(s, size), y))
    if not equations.full_rank.is_constant():
        lasts = equations.full_rank > _AHEAD * size
        equations = replace(equations, rates=equations.rates + ca.if_else(lasts, 0, np.nan))
    return StepCode(equations, tableau, LANES).step() + _INTEGRATE
