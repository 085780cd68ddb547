"""FMUs in Python, a back end: pythonfmu with CasADi functions at run time.

It is registered as an entry point of the group ``liaisons.fmu_back_ends``: model without arrays, guid -> members.
"""

from liaisons.python_fmu.python_backend import python_members

__all__ = ["python_members"]
