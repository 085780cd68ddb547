"""``liaisons_motion.analysis`` by its name under ``liaisons``."""

from liaisons.base.renamed import rename
from liaisons_motion.analysis import *
from liaisons_motion.analysis import __all__ as __all__

rename(__name__, "liaisons_motion.analysis")
