"""Programs along a row of links as C: one loop for all that can be calculated in one passage.

Where all that is carried can be had from the neighbours, it is: ``u[i - 1]``, ``u[i + 1]``.  The turns of a loop are
then independent of each other, and the links at the ends are written out.  Otherwise loops follow each other, outward
and inward, and what costs much and is needed again is kept for later ones in work space.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from liaisons.expressions.row_derivatives import forward, reverse
from liaisons.expressions.rows import RowProgram, leading
from liaisons.fmu.loops.writing import PREAMBLE, Code, loops

__all__ = ["PREAMBLE", "Code", "loop_functions", "loops"]


def loop_functions(programs: Iterable[RowProgram], coupled: int, *, adjoint: bool) -> dict[str, Code]:
    """The functions of a component by the names of core.h.

    :param programs: as in :class:`liaisons.mechanics.model.Model`.
    :param coupled: how many numbers of y act on the motion.
    :param adjoint: whether adjoint derivatives can be asked for.
    """
    found = {program.name: program for program in programs}
    found["calculate"] = replace(found.pop("outputs"), name="calculate")
    found["motion"] = leading("motion", found["derivatives"], coupled)
    for name in ("start", "calculate", "remember"):
        for differentiated in (forward, reverse) if adjoint else (forward,):
            of = differentiated(found[name])
            found[of.name] = of
    return {name: loops(program) for name, program in found.items()}
