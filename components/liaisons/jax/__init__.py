"""``liaisons_motion.jax`` by its name under ``liaisons``."""

from liaisons.base.renamed import rename
from liaisons_motion.jax import *

rename(__name__, "liaisons_motion.jax")
