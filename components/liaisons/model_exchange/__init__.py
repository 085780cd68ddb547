"""FMUs of Model Exchange: their states are integrated here, by DOP853 or CVODE, from event to event."""

from __future__ import annotations

from pathlib import Path

from liaisons.cosim import Fmu
from liaisons.model_exchange.instances import ModelExchange, ModelExchange2, ModelExchange3

__all__ = ["make_instance"]


def make_instance(name: str, fmu: Fmu, directory: Path) -> ModelExchange:
    """Load and instantiate an FMU for Model Exchange.

    :param directory: folder of the extracted FMU.
    """
    return (ModelExchange2 if fmu.version == 2 else ModelExchange3)(name, fmu, directory)
