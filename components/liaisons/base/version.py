"""The version of this package."""

__version__ = "1.0.0"
__date__ = "2026-11-26"
"""Date of this version, written into FMUs of the catalogue so that rebuilt files are identical."""
