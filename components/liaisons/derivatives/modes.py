"""Modes of contacts at one instant, chosen by the code of an FMU (``complementarity.c``)."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from importlib import resources
from typing import final

import numpy as np

from liaisons.ensembles.steps import library

_CHOICE = """
long choose_modes(long gaps, long contacts, const double *G, const double *stick, const double *slide,
                  const long *normal, const double *rate, const double *tolerance, long impulses, long n,
                  const long *contact, long *modes, double *forces, double *rates)
{
    Complementarity p = {.gaps = gaps, .contacts = contacts, .G = G, .stick = stick, .slide = slide};
    Modes chosen = {0};
    p.impulses = impulses;
    p.n = n;
    for (long i = 0; i < contacts; ++i) {
        if (i >= gaps)
            p.normal[i - gaps] = normal[i];
        p.rate[i] = rate[i];
        p.tolerance[i] = tolerance[i];
        chosen[i] = modes[i];
    }
    for (long i = 0; i < n; ++i)
        p.contact[i] = contact[i];
    const Choice choice = complementarity_choose(&p, chosen, forces, rates);
    for (long i = 0; i < contacts; ++i)
        modes[i] = chosen[i];
    return choice;
}
"""
REASONS = (
    "",
    "no force keeps them apart and in their bounds (Painlevé)",
    "they contradict each other, or what pushes leaves no way out",
)
"""Why no modes are chosen, by what C returns."""


def _source() -> str:
    """C99 code of the choice."""
    runtime = resources.files("liaisons.fmu") / "runtime"
    header, code = ((runtime / f"complementarity.{end}").read_text("utf-8") for end in "hc")
    return code.replace('#include "complementarity.h"', header) + _CHOICE


@final
class ModeChoice:
    """Choice of modes of contacts: gaps, then dry friction.

    The arrays are arguments and results: ``modes`` before and after it, forces, and rates with them.
    """

    def __init__(self, gaps: int, normals: Sequence[int]) -> None:
        """Take the number of gaps, and of each contact the gap that bounds its friction, or -1."""
        count = len(normals)
        self.G, self.stick, self.slide = np.zeros(count**2), np.zeros(count), np.zeros(count)
        self.rate, self.tolerance, self.forces, self.rates = (np.zeros(count) for _ in range(4))
        self.modes, self._chosen, self._normal = (np.array(x, dtype=ctypes.c_long) for x in (normals,) * 3)
        self._before = (gaps, count, *self._addresses(self.G, self.stick, self.slide, self._normal))
        self._before = (*self._before, *self._addresses(self.rate, self.tolerance))
        self._after = self._addresses(self._chosen, self.modes, self.forces, self.rates)
        self._function = library(_source(), "-ffp-contract=off").choose_modes
        self._function.restype = ctypes.c_long
        self._function.argtypes = [
            *(ctypes.c_long,) * 2,
            *(ctypes.c_void_p,) * 6,
            *(ctypes.c_long,) * 2,
            *(ctypes.c_void_p,) * 4,
        ]

    @staticmethod
    def _addresses(*arrays: np.ndarray) -> tuple[int, ...]:
        return tuple(array.ctypes.data for array in arrays)

    def choose(self, chosen: Sequence[int], *, impulses: bool) -> str:
        """Choose the modes of some contacts; why there are none, or nothing."""
        self._chosen[: len(chosen)] = chosen
        return REASONS[self._function(*self._before, impulses, len(chosen), *self._after)]
