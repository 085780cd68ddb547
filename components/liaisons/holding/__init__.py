"""``liaisons_motion.holding`` by its name under ``liaisons``."""

from liaisons.base.renamed import rename
from liaisons_motion.holding import *

rename(__name__, "liaisons_motion.holding")
