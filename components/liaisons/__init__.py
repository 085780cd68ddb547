"""From one Lagrangian with active constraints to verified FMUs.

The public names are in ``__init__.pyi``, where type checkers read them, too; each is imported at its first use, so that
simulating FMUs never loads the symbolic layers.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
