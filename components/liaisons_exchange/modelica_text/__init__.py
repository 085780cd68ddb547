"""Components and systems as Modelica text, from the formulas of their documentation.

Language specification 3.6, with or without the Modelica Standard Library.
"""

from liaisons_exchange.modelica_text.files import modelica, modelica_library

__all__ = ["modelica", "modelica_library"]
