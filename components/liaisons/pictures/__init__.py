"""``liaisons_pages.pictures`` by its name under ``liaisons``."""

from liaisons.base.renamed import rename
from liaisons_pages.pictures import *

rename(__name__, "liaisons_pages.pictures")
