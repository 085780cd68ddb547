"""Pictures of simulated FMUs; FMUs calculate variables of them that were not recorded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, final

import numpy as np

from liaisons.base.archive import Archive
from liaisons.base.array_names import array_and_index
from liaisons.base.folders import temporary_folder
from liaisons.cosim.compiled.calls import Vector
from liaisons.cosim.instances import extract_fmus, make_instance
from liaisons.cosim.structure.components import Components, SystemComponent
from liaisons.cosim.structure.connections import Connection
from liaisons.errors import SimulationError
from liaisons.results import Picture, Result, combined_pictures

Values = Mapping[str, Vector]


@final
@dataclass(frozen=True)
class FmuScene:
    """Picture of the FMUs of a result.

    :param components: those of the system, by name.
    :param connections: theirs.
    :param single: whether variables of the first have no prefix in the result.
    """

    components: Components
    connections: Sequence[Connection] = ()
    single: bool = False

    @cached_property
    def parts(self) -> Components:
        """Components by the prefix of their variables in the result, ``"swing."``."""
        return {"" if self.single and not k else f"{p.name}.": p for k, p in enumerate(self.components.values())}

    @property
    def groups(self) -> Sequence[Sequence[int]]:
        """Numbers of the components that are connected with each other."""
        group = {name: k for k, name in enumerate(self.components)}
        for connection in self.connections:
            joined, other = group[connection.source.part.name], group[connection.target.part.name]
            group = {name: joined if k == other else k for name, k in group.items()}
        return [[i for i, k in enumerate(group.values()) if k == each] for each in dict.fromkeys(group.values())]

    @property
    def picture(self) -> Picture:
        """Picture of all components; of an FMU without a picture, its points."""
        return combined_pictures(self.pictures, self.groups)

    @cached_property
    def pictures(self) -> Mapping[str, Picture]:
        """Picture of each component, by the prefix of its variables."""
        return {prefix: picture_of(part) for prefix, part in self.parts.items()}

    def values(self, signals: Values) -> Values:
        """Values of all variables of the picture at some frames, by name.

        Variables that were not recorded are calculated by FMUs that are initialized at each frame.

        :param signals: recorded values at the frames, by name.
        :raises SimulationError: if an FMU cannot calculate them.
        """
        values = dict(signals)
        for prefix, part in self.parts.items():
            missing = [name for name in self.pictures[prefix].variables if f"{prefix}{name}" not in values]
            recorded = {name.removeprefix(prefix): signals[name] for name in signals if name.startswith(prefix)}
            if missing:
                values |= {
                    f"{prefix}{name}": rows for name, rows in _recalculated_values(part, missing, recorded).items()
                }
        return values


def read_result(path: Path | str, fmu: Path | str, start_values: Mapping[str, object] | None = None) -> Result:
    """Result of one FMU, read from a CSV file, with the picture of the FMU, so that it can be animated.

    :param start_values: parameters of the simulation that differ from those of the FMU.
    :raises SimulationError: if a file cannot be read.
    """
    result, part = Result.from_csv(path), SystemComponent.read(Path(fmu).stem, fmu, start_values or {})
    return replace(result, scene=FmuScene({part.name: part}, single=True))


def picture_of(part: SystemComponent) -> Picture:
    """Picture from the file of an FMU; if it has none, points of its outputs in metres.

    :raises SimulationError: if it cannot be read, or refers to an unknown variable.
    """
    path, variables = part.fmu.path, part.fmu.variables
    with Archive(path) as archive:
        if Picture.MEMBER not in archive.names:
            return Picture.from_points(name for name in part.fmu.reals("output") if variables[name].unit == "m")
        with archive.open(Picture.MEMBER) as file:
            picture = Picture.from_json(file.read(), str(path))
    for name in picture.variables:
        if name not in variables:
            raise SimulationError(f"{path}: {Picture.MEMBER}: {part.fmu.unknown_variable_message(name)}")
    return picture


def _recalculated_values(part: SystemComponent, names: list[str], recorded: Values) -> Values:
    """Values of variables that an instance calculates in initialization mode from the recorded values."""
    count = max((len(values) for values in recorded.values()), default=1)
    start_values = _start_values_of_frames(part, recorded)
    values = np.empty(len(names))
    results = np.empty((len(names), count))
    with ExitStack() as stack:
        folders = extract_fmus([part.fmu], stack.enter_context(temporary_folder()))
        instance = stack.enter_context(make_instance(part.name, part.fmu, folders[part.fmu.path]))
        instance.initialize(part.starts, None, 0.0, 1.0)
        read = instance.getter([part.fmu.variables[name] for name in names], values)
        for k in range(count):
            for name, frames in start_values.items():
                instance.assign(name, frames[k])
            read.perform(f" in frame {k}")
            results[:, k] = values
    return dict(zip(names, results, strict=True))


def _start_values_of_frames(part: SystemComponent, recorded: Values) -> Mapping[str, Any]:
    """Start values for each frame, by input or parameter ``NAME_0``; arrays are whole."""
    variables, starts, arrays = part.fmu.variables, {}, {}
    for name, values in recorded.items():
        base, index = array_and_index(name)
        if base not in variables.entries:
            continue
        target = base if variables.entries[base].prototype.causality == "input" else f"{base}_0"
        entry = variables.entries.get(target)
        if entry is None or entry.prototype.causality not in {"input", "parameter"}:
            continue
        if index is None:
            starts[target] = values.tolist()
        else:
            arrays.setdefault(target, []).append((index, values))
    for target, columns in arrays.items():
        rows = np.stack([values for _, values in sorted(columns, key=lambda column: column[0])], axis=1)
        starts[target] = [tuple(row) for row in rows.tolist()]
    return starts
