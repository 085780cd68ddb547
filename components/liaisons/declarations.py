"""Declarations in the class of a component: variables, constraints, contacts, outputs and closed forms."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub("liaisons", __file__)
