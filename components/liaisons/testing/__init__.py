"""``liaisons_motion.testing`` by its name under ``liaisons``."""

from liaisons.base.renamed import rename
from liaisons_motion.testing import *

rename(__name__, "liaisons_motion.testing")
