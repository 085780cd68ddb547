"""Components by their names, files or classes, the FMUs that are built from them, and systems as one model.

Each is imported at its first use: names are found without loading what derives equations.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
