"""FMU files, read: an archive in, the description of its FMU and checked start values out; nothing is run here.

:func:`read` makes an :class:`Fmu`, which has the variables, terminals, units, dependencies and capabilities that a
file declares.  A Python function that is called once per period has such a description, too: :func:`sampled`.
"""

from liaisons.fmu_files.fmu import DefaultExperiment, Fmu, experiment_problems, read, read_description
from liaisons.fmu_files.sampled_function import TIME, SampledFunction, sampled, variable_name
from liaisons.fmu_files.start_values import Starts, checked_starts, integer_range, structural_sizes
from liaisons.fmu_files.terminals import TerminalDescription, Terminals
from liaisons.fmu_files.variables import (
    NUMBERS,
    RECORDED,
    Array,
    Entry,
    Scalar,
    Variables,
    VariableType,
)

__all__ = [
    "NUMBERS",
    "RECORDED",
    "TIME",
    "Array",
    "DefaultExperiment",
    "Entry",
    "Fmu",
    "SampledFunction",
    "Scalar",
    "Starts",
    "TerminalDescription",
    "Terminals",
    "VariableType",
    "Variables",
    "checked_starts",
    "experiment_problems",
    "integer_range",
    "read",
    "read_description",
    "sampled",
    "structural_sizes",
    "variable_name",
]
