"""``liaisons_tools.sweeps`` by its name under ``liaisons``."""

from liaisons.base.renamed import rename
from liaisons_tools.sweeps import *

rename(__name__, "liaisons_tools.sweeps")
