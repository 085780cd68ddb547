"""Systems in and out of System Structure and Parameterization archives (SSP 1.0 and 2.0)."""

from liaisons.ssp.assignment import fmu_start_values
from liaisons.ssp.connectors import Form
from liaisons.ssp.embedded_starts import fmu_with_table
from liaisons.ssp.experiment import effective_experiment
from liaisons.ssp.reader import read, read_document
from liaisons.ssp.writer import write

__all__ = [
    "Form",
    "effective_experiment",
    "fmu_start_values",
    "fmu_with_table",
    "read",
    "read_document",
    "write",
]
