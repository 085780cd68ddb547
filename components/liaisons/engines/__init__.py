"""``liaisons_exchange.engines`` by its name under ``liaisons``."""

from liaisons.base.renamed import rename
from liaisons_exchange.engines import *

rename(__name__, "liaisons_exchange.engines")
