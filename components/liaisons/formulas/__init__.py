"""``liaisons_pages.formulas`` by its name under ``liaisons``."""

from liaisons.base.renamed import rename
from liaisons_pages.formulas import *

rename(__name__, "liaisons_pages.formulas")
