"""From one Lagrangian with active constraints to verified FMUs.

The names below are what scenarios and users need; each is imported when it is first asked for, so that simulating
FMUs never loads the symbolic layers.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from liaisons.version import __date__ as __date__
from liaisons.version import __version__ as __version__

if TYPE_CHECKING:
    from liaisons import analysis
    from liaisons.check import Verdict, compare, max_error, slope, table, verdict
    from liaisons.cosim import Result
    from liaisons.ensembles import ensemble
    from liaisons.errors import LiaisonsError
    from liaisons.flattening import flatten
    from liaisons.interface import System, simulate, sweep
    from liaisons.language import (
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
        calculated,
        closed_form,
        condition,
        constraint,
        non_holonomic,
        output,
        point,
        submersion,
        unchecked,
    )
    from liaisons.library import build, fmu_path
    from liaisons.mechanics import assemble, derive
    from liaisons.scenario import run_scenario
    from liaisons.sweeps import grid, sample

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
    "assemble",
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
    **dict.fromkeys(("assemble", "derive"), "mechanics"),
    "run_scenario": "scenario",
    **dict.fromkeys(("System", "simulate", "sweep"), "interface"),
    **dict.fromkeys(("build", "fmu_path"), "library"),
    **dict.fromkeys(("grid", "sample"), "sweeps"),
    **dict.fromkeys(("Verdict", "compare", "max_error", "slope", "table", "verdict"), "check"),
}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module 'liaisons' has no attribute {name!r}")
    if name == "analysis":
        return import_module("liaisons.analysis")
    return getattr(import_module(f"liaisons.{_HOME.get(name, 'language')}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
