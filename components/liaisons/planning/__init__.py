"""``liaisons_motion.planning`` by its name under ``liaisons``."""

from liaisons.base.renamed import rename
from liaisons_motion.planning import *

rename(__name__, "liaisons_motion.planning")
