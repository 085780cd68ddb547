"""From one Lagrangian with active constraints to verified FMUs.

The names below are what scenarios and users need; each is imported when it is first asked for, so that simulating
FMUs never loads the symbolic layers.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from liaisons.check import Verdict, max_error, slope, table, verdict
    from liaisons.cosim import Result, System, simulate
    from liaisons.errors import LiaisonsError
    from liaisons.fmu import build
    from liaisons.library import fmu_path
    from liaisons.mechanics import (
        ActiveCoordinate,
        Coordinate,
        Experiment,
        Input,
        InternalState,
        Mechanism,
        Operator,
        Orientation,
        Parameter,
        analysis,
        calculated,
        condition,
        constraint,
        derive,
        non_holonomic,
        output,
        point,
        submersion,
    )
    from liaisons.scenario import run_scenario

__version__ = "0.1.0"

__all__ = [
    "ActiveCoordinate",
    "Coordinate",
    "Experiment",
    "Input",
    "InternalState",
    "LiaisonsError",
    "Mechanism",
    "Operator",
    "Orientation",
    "Parameter",
    "Result",
    "System",
    "Verdict",
    "analysis",
    "build",
    "calculated",
    "condition",
    "constraint",
    "derive",
    "fmu_path",
    "max_error",
    "non_holonomic",
    "output",
    "point",
    "run_scenario",
    "simulate",
    "slope",
    "submersion",
    "table",
    "verdict",
]

_HOME = {
    "LiaisonsError": "errors",
    "build": "fmu",
    "fmu_path": "library",
    "run_scenario": "scenario",
    **dict.fromkeys(("Result", "System", "simulate"), "cosim"),
    **dict.fromkeys(("Verdict", "max_error", "slope", "table", "verdict"), "check"),
}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'liaisons' has no attribute {name!r}")
    return getattr(import_module(f"liaisons.{_HOME.get(name, 'mechanics')}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
