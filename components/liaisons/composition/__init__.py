"""Connected models, and systems of our own FMUs, as one model: the equations of motion of the whole.

Each is imported at its first use: models are composed without loading what runs systems.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
