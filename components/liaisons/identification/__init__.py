"""``liaisons_motion.identification`` by its name under ``liaisons``."""

from liaisons.base.renamed import rename
from liaisons_motion.identification import *

rename(__name__, "liaisons_motion.identification")
