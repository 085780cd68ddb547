"""What people see of an FMU: its page, with the equations from the symbols, and its icon.

``pyproject.toml`` registers :func:`extras` as an entry point, by which whatever writes an FMU finds it.
"""

from liaisons_pages.fmu_pages.members import extras

__all__ = ["extras"]
