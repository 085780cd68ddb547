"""Estimates of coupling errors: what each communication step adds, and contacts that it may have missed."""

from liaisons.coupling_estimate.estimate import Estimate
from liaisons.coupling_estimate.input_reconstruction import coupling_estimate

__all__ = ["Estimate", "coupling_estimate"]
