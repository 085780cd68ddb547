"""Systems in and out of System Structure and Parameterization archives (SSP 1.0 and 2.0)."""

from liaisons_exchange.ssp.assignment import fmu_start_values
from liaisons_exchange.ssp.connectors import Form
from liaisons_exchange.ssp.embedded_starts import fmu_with_table
from liaisons_exchange.ssp.experiment import effective_experiment
from liaisons_exchange.ssp.reader import read, read_document
from liaisons_exchange.ssp.writer import write

__all__ = [
    "Form",
    "effective_experiment",
    "fmu_start_values",
    "fmu_with_table",
    "read",
    "read_document",
    "write",
]
