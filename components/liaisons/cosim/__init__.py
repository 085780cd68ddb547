"""FMU files in, system, result out: composition and simulation on fmpy; no symbols here."""

from liaisons.cosim.component import Component, End
from liaisons.cosim.simulation import simulate
from liaisons.cosim.system import System
from liaisons.results import IncompleteError, Interrupted, Result

__all__ = ["Component", "End", "IncompleteError", "Interrupted", "Result", "System", "simulate"]
