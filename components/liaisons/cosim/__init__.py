"""FMU files in, system, result out: composition and simulation on fmpy; no symbols here."""

from liaisons.cosim.drives import Signal
from liaisons.cosim.parts import Part, Port
from liaisons.cosim.system import OperatorFmu, System, simulate
from liaisons.results import IncompleteError, Interrupted, Result

__all__ = ["IncompleteError", "Interrupted", "OperatorFmu", "Part", "Port", "Result", "Signal", "System", "simulate"]
