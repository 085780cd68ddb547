"""From one Lagrangian with active constraints to verified FMUs.

The names below are what scenarios and users need; each is imported when it is first asked for, so that simulating
FMUs never loads the symbolic layers.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from liaisons.check import Verdict, compare, max_error, slope, table, verdict
    from liaisons.cosim import Result
    from liaisons.ensembles import ensemble
    from liaisons.errors import LiaisonsError
    from liaisons.flattening import flatten
    from liaisons.interface import System, simulate, sweep
    from liaisons.library import build, fmu_path
    from liaisons.mechanics import (
        ActiveCoordinate,
        Chain,
        Coordinate,
        Experiment,
        Friction,
        Gravity,
        Input,
        InternalState,
        Joint,
        Mechanism,
        Operator,
        Orientation,
        Parameter,
        Size,
        Values,
        analysis,
        calculated,
        closed_form,
        condition,
        constraint,
        derive,
        non_holonomic,
        output,
        point,
        submersion,
        unchecked,
    )
    from liaisons.scenario import run_scenario
    from liaisons.sweeps import grid, sample

__version__ = "0.1.0"
__date__ = "2026-11-22"  # of this version

__all__ = [
    "ActiveCoordinate",
    "Chain",
    "Coordinate",
    "Experiment",
    "Friction",
    "Gravity",
    "Input",
    "InternalState",
    "Joint",
    "LiaisonsError",
    "Mechanism",
    "Operator",
    "Orientation",
    "Parameter",
    "Result",
    "Size",
    "System",
    "Values",
    "Verdict",
    "analysis",
    "build",
    "calculated",
    "closed_form",
    "compare",
    "condition",
    "constraint",
    "derive",
    "ensemble",
    "flatten",
    "fmu_path",
    "grid",
    "max_error",
    "non_holonomic",
    "output",
    "point",
    "run_scenario",
    "sample",
    "simulate",
    "slope",
    "submersion",
    "sweep",
    "table",
    "unchecked",
    "verdict",
]

_HOME = {
    "LiaisonsError": "errors",
    "ensemble": "ensembles",
    "flatten": "flattening",
    "Result": "cosim",
    "run_scenario": "scenario",
    **dict.fromkeys(("System", "simulate", "sweep"), "interface"),
    **dict.fromkeys(("build", "fmu_path"), "library"),
    **dict.fromkeys(("grid", "sample"), "sweeps"),
    **dict.fromkeys(("Verdict", "compare", "max_error", "slope", "table", "verdict"), "check"),
}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'liaisons' has no attribute {name!r}")
    return getattr(import_module(f"liaisons.{_HOME.get(name, 'mechanics')}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
