"""Results of simulations, sweeps and ensembles: named signals with units; needs no symbols and no FMU."""

from liaisons.base.renamed import rename
from liaisons.errors import IncompleteError, Interrupted
from liaisons.results.pictures import Picture, Scene, combined_pictures
from liaisons.results.result import Result

__all__ = ["IncompleteError", "Interrupted", "Picture", "Result", "Scene", "combined_pictures"]

rename(f"{__name__}.figures", "liaisons_pages.pictures.figures")
