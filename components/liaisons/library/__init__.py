"""Components by their names: their FMUs, built if need be, systems of them as one FMU, and both as Modelica text."""

from __future__ import annotations

from liaisons.library.targets import (
    Backend,
    FmiVersion,
    Platforms,
    Target,
    build,
    catalogue,
    catalogue_names,
    claim,
    component,
    components,
    derive,
    fmu_file,
    fmu_path,
    has_size,
    is_target,
    model,
    sized_folder,
    variables,
)

__all__ = [
    "Backend",
    "FmiVersion",
    "Platforms",
    "Target",
    "build",
    "catalogue",
    "catalogue_names",
    "claim",
    "component",
    "components",
    "derive",
    "fmu_file",
    "fmu_path",
    "has_size",
    "is_target",
    "model",
    "sized_folder",
    "variables",
]
