"""Components and systems as Modelica text, from the formulas of their documentation.

Language specification 3.6, with or without the Modelica Standard Library.
"""

from liaisons.modelica_text.classes import component_text, library_text, system_text
from liaisons.modelica_text.standard_library import with_standard_library
from liaisons.modelica_text.systems import Composition

__all__ = ["Composition", "component_text", "library_text", "system_text", "with_standard_library"]
