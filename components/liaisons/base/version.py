"""Which version this is."""

__version__ = "0.1.0"
__date__ = "2026-11-22"
"""Of this version; it stands in the FMUs of the catalogue, which are the same whenever they are built."""
