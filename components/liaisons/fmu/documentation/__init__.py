"""The page inside an FMU that shows what the component is, with its equations from the symbols."""

from liaisons.fmu.documentation.page import index_page

__all__ = ["index_page"]
