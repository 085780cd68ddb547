"""``liaisons_motion.examination`` by its name under ``liaisons``."""

from liaisons.base.renamed import rename
from liaisons_motion.examination import *

rename(__name__, "liaisons_motion.examination")
