"""Joints of a :class:`liaisons.Linkage` and the bodies between them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub("liaisons", __file__)
