"""Signals that move inputs and active coordinates: operators, tables, formulas and functions of time."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub("liaisons", __file__)
