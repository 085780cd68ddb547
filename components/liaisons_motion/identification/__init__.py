"""Estimates of parameters from measurements, with covariances and the verdicts that verify them."""

from liaisons_motion.identification.fits import Fit
from liaisons_motion.identification.identifying import identify, identify_from_file

__all__ = ["Fit", "identify", "identify_from_file"]
