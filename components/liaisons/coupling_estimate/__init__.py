"""Estimates of coupling errors: what each communication step adds, and contacts that it may have missed."""

from __future__ import annotations

from liaisons.cosim import Kernel
from liaisons.coupling_estimate.estimate import Estimate
from liaisons.coupling_estimate.input_reconstruction import (
    contact_mechanisms,
    input_reconstructions,
    prepare_initial_gains,
)

__all__ = ["Estimate", "coupling_estimate"]


def coupling_estimate(kernel: Kernel) -> Estimate | None:
    """Estimate of the errors of a run's steps, for which the bus grows by derivatives; None if none can be estimated.

    :param kernel: the FMUs of the run, before its steps are prepared.
    """
    calls, columns = prepare_initial_gains(kernel), kernel.bus.index
    units = kernel.simulation.units_of(columns)
    estimate = Estimate(input_reconstructions(kernel), columns, units, contact_mechanisms(kernel), calls)
    return estimate if estimate.can_estimate else None
