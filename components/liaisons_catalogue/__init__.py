"""The catalogue: one file, one component; each with its equation, its source and its closed form.

Its components are found by their entry points, as those of any package: ``[project.entry-points]`` in
``pyproject.toml`` lists them.  K and M, by which sources are named, are the texts of Kneller and Marle: see
``liaisons/bibliography.md``.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
