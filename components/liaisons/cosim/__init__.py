"""FMU files in, system, result out: composition and simulation on fmpy; no symbols here."""

from liaisons.cosim.description.fmu import experiment_problems
from liaisons.cosim.description.sampled_function import SampledFunction, sampled
from liaisons.cosim.running.roll_back import roll_back_difference
from liaisons.cosim.running.run import Run
from liaisons.cosim.structure.components import Port, SystemComponent
from liaisons.cosim.structure.scenes import read_result
from liaisons.cosim.structure.sources import Signal
from liaisons.cosim.system import OperatorFmu, System, simulate, start
from liaisons.results import IncompleteError, Interrupted, Result

__all__ = [
    "IncompleteError",
    "Interrupted",
    "OperatorFmu",
    "Port",
    "Result",
    "Run",
    "SampledFunction",
    "Signal",
    "System",
    "SystemComponent",
    "experiment_problems",
    "read_result",
    "roll_back_difference",
    "sampled",
    "simulate",
    "start",
]
