"""``liaisons_exchange.live`` by its name under ``liaisons``."""

from liaisons.base.renamed import rename
from liaisons_exchange.live import *

rename(__name__, "liaisons_exchange.live")
