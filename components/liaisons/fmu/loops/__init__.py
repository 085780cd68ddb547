"""Programs along a row of links as C, in as few loops as possible.

What is carried is calculated from the neighbours where that is cheap: ``u[i - 1]``, ``u[i + 1]``.  The iterations of a
loop are then independent of each other, and the links at the ends are written out.  Otherwise loops follow each other,
outward and inward, and expensive results that are used again are kept for later ones in work space.

CasADi's ``map`` and ``mapaccum`` of the same functions take 2.4 (n = 100) to 12 times as long (n = 10 000) for the
right-hand side of a PendulumChain, and their derivatives 5 times: each operation, or link, is a pass through memory.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from liaisons.expressions.row_derivatives import forward, reverse
from liaisons.expressions.rows import RowProgram, leading_results
from liaisons.fmu.functions import DIFFERENTIATED
from liaisons.fmu.loops.writing import PREAMBLE, Code, loops_code
from liaisons.mechanics.functions import SIGNATURES

__all__ = ["PREAMBLE", "Code", "loop_functions", "loops_code"]


def loop_functions(programs: Iterable[RowProgram], coupled: int, *, adjoint: bool) -> dict[str, Code]:
    """Return the C code of a chain's functions and of their derivatives, by member of ``Model`` in core.h.

    :param programs: as in :class:`liaisons.mechanics.model.Model`.
    :param coupled: number of coupled states, on which the rates depend.
    :param adjoint: with adjoint derivatives.
    """
    by_name = {program.name: program for program in programs}
    by_name["calculate"] = replace(by_name.pop("outputs"), name="calculate")
    by_name["motion"] = leading_results("motion", by_name["derivatives"], coupled)
    for name in DIFFERENTIATED:
        for differentiated in (forward, reverse) if adjoint else (forward,):
            program = differentiated(by_name[SIGNATURES[name].member])
            by_name[program.name] = program
    return {name: loops_code(program) for name, program in by_name.items()}
