"""Estimates of parameters from measurements, with covariances and the verdicts that verify them."""

from liaisons.identification.fit_files import identified
from liaisons.identification.fits import Fit
from liaisons.identification.identifying import identify

__all__ = ["Fit", "identified", "identify"]
