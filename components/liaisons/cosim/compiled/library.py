"""The compiled library of communication steps."""

from __future__ import annotations

from ctypes import CDLL
from pathlib import Path

from liaisons.cosim.compiled.cached import cached_library

STEPS = tuple(Path(__file__).with_name(name) for name in ("loop.c", "coupling.c", "calls.h"))
"""Sources of communication steps; Python, too, can make those of explicit coupling, to the same bits."""


def step_library() -> CDLL | None:
    """Compiled library of communication steps; None if it cannot be compiled or loaded."""
    return cached_library(STEPS, "communication steps are made by Python")
