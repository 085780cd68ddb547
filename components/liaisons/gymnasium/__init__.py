"""``liaisons_motion.gymnasium`` by its name under ``liaisons``."""

from liaisons.base.renamed import rename
from liaisons_motion.gymnasium import *

rename(__name__, "liaisons_motion.gymnasium")
