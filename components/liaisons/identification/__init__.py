"""Parameters from measurements, with their covariance and what makes it believed."""

from liaisons.identification.fit_files import identified
from liaisons.identification.fits import Fit
from liaisons.identification.identifying import identify

__all__ = ["Fit", "identified", "identify"]
