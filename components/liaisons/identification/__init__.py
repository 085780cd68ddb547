"""Estimates of parameters from measurements, with covariances and the verdicts that verify them."""

from liaisons.identification.fits import Fit
from liaisons.identification.identifying import identified, identify

__all__ = ["Fit", "identified", "identify"]
