"""``liaisons_motion.derivatives`` by its name under ``liaisons``."""

from liaisons.base.renamed import rename
from liaisons_motion.derivatives import *

rename(__name__, "liaisons_motion.derivatives")
