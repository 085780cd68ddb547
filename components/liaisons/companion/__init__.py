"""``liaisons_pages.companion`` by its name under ``liaisons``."""

from liaisons.base.renamed import rename
from liaisons_pages.companion import *

rename(__name__, "liaisons_pages.companion")
