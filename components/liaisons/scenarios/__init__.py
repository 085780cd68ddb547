"""``liaisons_tools.scenarios`` by its name under ``liaisons``."""

from liaisons.base.renamed import rename
from liaisons_tools.scenarios import *

rename(__name__, "liaisons_tools.scenarios")
