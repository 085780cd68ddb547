"""``liaisons_motion.ensembles`` by its name under ``liaisons``."""

from liaisons.base.renamed import rename
from liaisons_motion.ensembles import *

rename(__name__, "liaisons_motion.ensembles")
for _old, _new in {"methods": "methods", "right_hand_sides": "right_hand_side", "steps": "steps"}.items():
    rename(f"{__name__}.{_old}", f"liaisons_motion.right_hand_sides.{_new}")
