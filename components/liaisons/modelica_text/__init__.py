"""``liaisons_exchange.modelica_text`` by its name under ``liaisons``."""

from liaisons.base.renamed import rename
from liaisons_exchange.modelica_text import *

rename(__name__, "liaisons_exchange.modelica_text")
