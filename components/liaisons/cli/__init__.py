"""``liaisons_tools.cli`` by its name under ``liaisons``."""

from liaisons.base.renamed import rename
from liaisons_tools.cli import *

rename(__name__, "liaisons_tools.cli")
