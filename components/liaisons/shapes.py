"""Shapes that the picture of a component is made of."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub("liaisons", __file__)
