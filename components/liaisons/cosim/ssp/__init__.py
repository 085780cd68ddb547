"""Systems in and out of System Structure and Parameterization archives (SSP 1.0 and 2.0)."""

from liaisons.cosim.ssp.connectors import Form
from liaisons.cosim.ssp.experiment import Experiment, chosen
from liaisons.cosim.ssp.reader import Archive, read
from liaisons.cosim.ssp.writer import write

__all__ = ["Archive", "Experiment", "Form", "chosen", "read", "write"]
