"""``liaisons_exchange.ssp`` by its name under ``liaisons``."""

from liaisons.base.renamed import rename
from liaisons_exchange.ssp import *

rename(__name__, "liaisons_exchange.ssp")
