"""From one Lagrangian with active constraints to verified FMUs.

The public names are in ``__init__.pyi``, where type checkers read them, too; each is imported at its first use, so that
simulating FMUs never loads the symbolic layers.  ``dir(liaisons)`` has what one begins with, and groups of the others:
``declarations``, ``joints``, ``shapes``, ``signals``, and the modules that functions come from.
"""

import lazy_loader

__getattr__, _every_name, __all__ = lazy_loader.attach_stub(__name__, __file__)

_MODULES = "analysis check declarations errors joints pictures shapes signals ssp sweeps"
_CLASSES = "Chain Linkage Mechanism Operator Result Sampled System"
_FUNCTIONS = (
    "assemble build derive ensemble equations flatten fmu_path gradient hold identify linearize modelica observe "
    "operator plan read_result sensitivities show simulate start sweep verdict"
)


def __dir__() -> list[str]:
    return ["__version__", *_CLASSES.split(), *sorted(f"{_MODULES} {_FUNCTIONS}".split())]
