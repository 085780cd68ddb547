"""Pictures of simulated FMUs, and the variables for them that were not recorded: FMUs calculate these again."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, final

import numpy as np

from liaisons.base.archive import Archive
from liaisons.base.array_names import array_and_index
from liaisons.base.folders import temporary_folder
from liaisons.cosim.arrays import Vector
from liaisons.cosim.instances import extract_fmus, make_instance
from liaisons.cosim.structure.components import Components, SystemComponent
from liaisons.errors import SimulationError
from liaisons.pictures import Picture, combined_pictures
from liaisons.pictures.declared import MEMBER
from liaisons.results import Result

Values = Mapping[str, Vector]


@final
@dataclass(frozen=True)
class FmuScene:
    """The picture of one FMU or of several.

    :param parts: by the prefix of their variables in the result.
    :param groups: as in :func:`liaisons.pictures.combined_pictures`.
    """

    parts: Components
    groups: Sequence[Sequence[int]] = ()

    @property
    def picture(self) -> Picture:
        """The picture of all; of an FMU without a picture, its points."""
        return combined_pictures(self._pictures, self.groups)

    @cached_property
    def _pictures(self) -> Mapping[str, Picture]:
        return {prefix: picture_of(part) for prefix, part in self.parts.items()}

    def values(self, signals: Values) -> Values:
        """All variables of the picture at some frames; those not recorded come from FMUs initialized at each frame.

        :param signals: at the frames, by name.
        :raises SimulationError: if an FMU cannot calculate them.
        """
        values = dict(signals)
        for prefix, part in self.parts.items():
            missing = [name for name in self._pictures[prefix].variables if f"{prefix}{name}" not in values]
            recorded = {name.removeprefix(prefix): signals[name] for name in signals if name.startswith(prefix)}
            if missing:
                values |= {f"{prefix}{name}": rows for name, rows in _calculated(part, missing, recorded).items()}
        return values


def of_file(result: Path, fmu: Path, starts: Mapping[str, object]) -> Result:
    """A result read from a CSV file, with the picture of its FMU.

    :param starts: parameters of the simulation that differ from those of the FMU.
    :raises SimulationError: if a file cannot be read.
    """
    return replace(Result.from_csv(result), scene=FmuScene({"": SystemComponent.read(fmu.stem, fmu, starts)}))


def connected_groups(count: int, pairs: Iterable[tuple[int, int]]) -> list[list[int]]:
    """Numbers of components that are connected; each group is drawn beside the others."""
    group = list(range(count))
    for a, b in pairs:
        group = [group[a] if g == group[b] else g for g in group]
    return [[i for i in range(count) if group[i] == g] for g in dict.fromkeys(group)]


def picture_of(part: SystemComponent) -> Picture:
    """The picture that an FMU has inside; without one, points from its outputs in metres.

    :raises SimulationError: if it cannot be read, or refers to an unknown variable.
    """
    path, variables = part.fmu.path, part.fmu.variables
    with Archive(path) as archive:
        if MEMBER not in archive.names:
            return Picture.from_points(name for name in part.fmu.reals("output") if variables[name].unit == "m")
        with archive.open(MEMBER) as file:
            picture = Picture.from_json(file.read(), str(path))
    for name in picture.variables:
        if name not in variables:
            raise SimulationError(f"{path}: {MEMBER}: {part.fmu.unknown_variable_message(name)}")
    return picture


def _calculated(part: SystemComponent, names: list[str], recorded: Values) -> Values:
    """Values of variables of an instance that is initialized at the configurations."""
    count = max((len(values) for values in recorded.values()), default=1)
    configurations = _configuration(part, recorded)
    values = np.empty(len(names))
    results = np.empty((len(names), count))
    with ExitStack() as stack:
        folders = extract_fmus([part.fmu], stack.enter_context(temporary_folder()))
        instance = stack.enter_context(make_instance(part.name, part.fmu, folders[part.fmu.path]))
        instance.initialize(part.starts, None, 0.0, 1.0)
        read = instance.getter([part.fmu.variables[name] for name in names], values)
        for k in range(count):
            for name, frames in configurations.items():
                instance.assign(name, frames[k])
            read.perform(f" in frame {k}")
            results[:, k] = values
    return dict(zip(names, results, strict=True))


def _configuration(part: SystemComponent, recorded: Values) -> Mapping[str, Any]:
    """Values of the frames by inputs and initial coordinates that take them; arrays are whole."""
    variables, configuration, arrays = part.fmu.variables, {}, {}
    for name, values in recorded.items():
        base, index = array_and_index(name)
        if base not in variables.entries:
            continue
        target = base if variables.entries[base].prototype.causality == "input" else f"{base}_0"
        entry = variables.entries.get(target)
        if entry is None or entry.prototype.causality not in {"input", "parameter"}:
            continue
        if index is None:
            configuration[target] = values.tolist()
        else:
            arrays.setdefault(target, []).append((index, values))
    for target, columns in arrays.items():
        rows = np.stack([values for _, values in sorted(columns, key=lambda column: column[0])], axis=1)
        configuration[target] = [tuple(row) for row in rows.tolist()]
    return configuration
