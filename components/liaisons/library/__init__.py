"""Components by their names, files or classes, and the FMUs that are built from them.

Each is imported at its first use: names are found without loading what derives equations.
"""

import lazy_loader

from liaisons.base.renamed import rename

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

rename(f"{__name__}.flattening", "liaisons.composition.systems")
