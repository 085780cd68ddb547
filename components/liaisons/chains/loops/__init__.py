"""Programs along a row of links as C, in as few loops as possible.

What is carried is calculated from the neighbours where that is cheap: ``u[i - 1]``, ``u[i + 1]``.  The iterations of a
loop are then independent of each other, and the links at the ends are written out.  Otherwise loops follow each other,
outward and inward, and expensive results that are used again are kept for later ones in work space.

CasADi's ``map`` and ``mapaccum`` of the same functions take 2.4 (n = 100) to 12 times as long (n = 10 000) for the
right-hand side of a PendulumChain, and their derivatives 5 times: each operation, or link, is a pass through memory.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import final

import casadi as ca

from liaisons.chains.loops.writing import loops_code, preamble
from liaisons.chains.row_derivatives import forward, reverse
from liaisons.chains.row_functions import row_function
from liaisons.chains.rows import RowProgram, leading_results
from liaisons.mechanics import SIGNATURES, Code

__all__ = ["ChainLoops", "loops_code", "preamble"]


@final
@dataclass(frozen=True, slots=True, eq=False)
class ChainLoops:
    """Functions of a chain as programs along its links, see :class:`liaisons.mechanics.model.Loops`."""

    programs: tuple[RowProgram, ...]

    @property
    def names(self) -> frozenset[str]:
        own = {program.name for program in self.programs}
        return frozenset(name for name in SIGNATURES if name.removesuffix("_function") in own)

    @property
    def links(self) -> int:
        return max(program.n for program in self.programs)

    def code(self, coupled: int, differentiated: Iterable[str], *, adjoint: bool) -> Mapping[str, Code]:
        by_name = {program.name: program for program in self.programs}
        by_name["calculate"] = replace(by_name.pop("outputs"), name="calculate")
        by_name["motion"] = leading_results("motion", by_name["derivatives"], coupled)
        for name in differentiated:
            for derivative in (forward, reverse) if adjoint else (forward,):
                program = derivative(by_name[SIGNATURES[name].member])
                by_name[program.name] = program
        return {name: loops_code(program) for name, program in by_name.items()}

    def preamble(self, functions: Iterable[Code]) -> str:
        return preamble(functions)

    def functions(self, links: int) -> Mapping[str, ca.Function]:
        name_of = {name.removesuffix("_function"): name for name in SIGNATURES}
        return {name_of[p.name]: row_function(replace(p, n=links)) for p in self.programs}
