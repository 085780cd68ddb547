"""Systems in and out of System Structure and Parameterization archives (SSP 1.0 and 2.0)."""

from liaisons.ssp.connectors import Form
from liaisons.ssp.embedded_starts import has_table, with_table
from liaisons.ssp.experiment import chosen
from liaisons.ssp.reader import read
from liaisons.ssp.writer import write

__all__ = ["Form", "chosen", "has_table", "read", "with_table", "write"]
