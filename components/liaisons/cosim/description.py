"""What an FMU file says about itself: variables, units, dependencies, default experiment, binaries."""

from __future__ import annotations

import io
import math
import numbers
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal
from zipfile import BadZipFile, ZipFile

import fmpy

from liaisons.errors import SimulationError, suggestion

VariableType = Literal["Real", "Integer", "Enumeration", "Boolean", "String"]

_DESCRIPTION = "modelDescription.xml"
_BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


@dataclass(frozen=True, slots=True)
class Variable:
    """One scalar variable; ``unit`` is empty where the FMU gives none."""

    name: str
    reference: int
    type: VariableType
    causality: str
    settable: bool  # before and during initialization
    start: str | None
    unit: str


@dataclass(frozen=True, slots=True)
class Unit:
    """SI value = factor * value + offset; exponents of kg, m, s, A, K, mol, cd, rad."""

    exponents: tuple[int, ...]
    factor: float
    offset: float


@dataclass(frozen=True, slots=True)
class Experiment:
    """The default experiment [s, s, 1]; None where the FMU gives none."""

    stop_time: float | None
    step_size: float | None
    tolerance: float | None


@dataclass(frozen=True, slots=True)
class Fmu:
    """An FMI 2.0 co-simulation FMU, read but not run; made by :func:`read`.

    ``dependencies`` maps an output to the inputs that it depends on directly, ``initial_dependencies`` does so for
    initialization; an output that is missing there depends on all inputs.
    """

    path: Path
    model_name: str
    identifier: str
    guid: str
    binary: str
    variable_step: bool
    log_categories: tuple[str, ...]
    experiment: Experiment
    variables: Mapping[str, Variable]
    units: Mapping[str, Unit]
    dependencies: Mapping[str, frozenset[str]]
    initial_dependencies: Mapping[str, frozenset[str]]

    def reals(self, *causalities: str) -> list[str]:
        """Names of the real variables of these causalities, in the order of the file."""
        return [v.name for v in self.variables.values() if v.type == "Real" and v.causality in causalities]

    def depends(self, output: str, input_: str, *, initially: bool = False) -> bool:
        """Whether an output depends directly on an input, while stepping or in initialization."""
        known = (self.initial_dependencies if initially else self.dependencies).get(output)
        return known is None or input_ in known

    def unknown(self, name: str) -> str:
        """What to say of a variable that does not exist."""
        return f"{self.path.name} has no variable {name!r}{suggestion(name, self.variables)}"


def read(path: Path | str) -> Fmu:
    """Read the description inside an FMU file.

    :raises SimulationError: if the file is missing, truncated, no FMU, of another FMI version or kind, or has no
        binary for this platform.
    """
    path = Path(path)
    if not path.is_file():
        what = "is a directory, not an FMU" if path.is_dir() else "no such file"
        raise SimulationError(f"{path}: {what}; check the path, or build it with 'liaisons build'")
    try:
        with ZipFile(path) as archive:
            files = archive.namelist()
            text = archive.read(_DESCRIPTION) if _DESCRIPTION in files else None
    except BadZipFile:
        raise SimulationError(f"{path}: truncated, or no FMU at all (no zip archive); build or copy it again") from None
    except OSError as error:
        raise SimulationError(f"{path}: cannot be read: {error.strerror}") from None
    if text is None:
        raise SimulationError(f"{path}: has no {_DESCRIPTION} inside, so it is no FMU")
    description = _parsed(path, text)
    if description.fmiVersion != "2.0":
        raise SimulationError(f"{path}: FMI {description.fmiVersion}; only FMI 2.0 co-simulation FMUs can be simulated")
    if description.coSimulation is None:
        raise SimulationError(f"{path}: made for model exchange only; export it for co-simulation")
    return _fmu(path, files, description)


def _parsed(path: Path, text: bytes) -> Any:
    # An archive in memory: given the file, fmpy leaves it open when the XML is broken.
    archive = io.BytesIO()
    with ZipFile(archive, "w") as copy:
        copy.writestr(_DESCRIPTION, text)
    try:
        return fmpy.read_model_description(archive, validate=False)
    except Exception as error:  # fmpy and lxml raise whatever they stumble on
        reason = " ".join(str(error).split())
        raise SimulationError(f"{path}: its {_DESCRIPTION} cannot be read: {reason}") from error


def _fmu(path: Path, files: list[str], description: Any) -> Fmu:
    exact = [v.name for v in description.modelVariables if v.causality == "output" and v.initial == "exact"]
    dependencies = _dependencies(description.outputs)
    initial = dependencies | _dependencies(description.initialUnknowns) | dict.fromkeys(exact, frozenset[str]())
    experiment = (getattr(description.defaultExperiment, name, None) for name in ("stopTime", "stepSize", "tolerance"))
    return Fmu(
        path=path,
        model_name=description.modelName,
        identifier=description.coSimulation.modelIdentifier,
        guid=description.guid,
        binary=_binary(path, files, description.coSimulation.modelIdentifier),
        variable_step=description.coSimulation.canHandleVariableCommunicationStepSize,
        log_categories=tuple(category.name for category in description.logCategories),
        experiment=Experiment(*(None if text is None else float(text) for text in experiment)),
        variables={v.name: _variable(v) for v in description.modelVariables},
        units={unit.name: _unit(unit.baseUnit) for unit in description.unitDefinitions if unit.baseUnit},
        dependencies=dependencies,
        initial_dependencies=initial,
    )


def _variable(variable: Any) -> Variable:
    free = variable.causality in {"parameter", "input"} or variable.initial in {"exact", "approx"}
    return Variable(
        name=variable.name,
        reference=variable.valueReference,
        type=variable.type,
        causality=variable.causality,
        settable=free and variable.variability != "constant",
        start=variable.start,
        unit=variable.unit or (variable.declaredType and variable.declaredType.unit) or "",
    )


def _unit(base: Any) -> Unit:
    return Unit(tuple(getattr(base, name) for name in _BASE_UNITS), base.factor, base.offset)


def _dependencies(unknowns: list[Any]) -> dict[str, frozenset[str]]:
    return {
        unknown.variable.name: frozenset(known.name for known in unknown.dependencies if known.causality == "input")
        for unknown in unknowns
        if unknown.dependencies is not None
    }


def _binary(path: Path, files: list[str], identifier: str) -> str:
    """Where this platform's library lies in the archive: FMI 2.0's folder names, and the tuples of FMI 2.0.4."""
    library = identifier + fmpy.sharedLibraryExtension
    folders = [fmpy.platform_tuple]
    if fmpy.architecture.startswith("x86") or fmpy.system == "darwin":  # fmpy.platform says linux64 on ARM, too
        folders.append(fmpy.platform)
    for folder in folders:
        if f"binaries/{folder}/{library}" in files:
            return f"binaries/{folder}/{library}"
    inside = sorted({name.split("/")[1] for name in files if name.startswith("binaries/") and name.count("/") > 1})
    sources = any(name.startswith("sources/") and name.endswith(".c") for name in files)
    raise SimulationError(
        f"{path}: no binary for this platform (binaries/{folders[-1]}/{library}); inside are: "
        f"{', '.join(inside) or 'none'}; {'compile its sources here' if sources else 'export it for this platform'}"
        " (own components: 'liaisons build')"
    )


def start_value(owner: str, fmu: Fmu, name: str, value: Any) -> float | int | bool | str:
    """A start value as the type that its variable takes.

    :param owner: name of the component, for messages.
    :raises SimulationError: if there is no such variable, it cannot be set, or the value is of the wrong type or
        not finite.
    """
    if name not in fmu.variables:
        raise SimulationError(f"{owner}: {fmu.unknown(name)}")
    variable = fmu.variables[name]
    if not variable.settable:
        settable = [v.name for v in fmu.variables.values() if v.settable]
        raise SimulationError(
            f"{owner}.{name} = {value!r}: causality {variable.causality!r}, so it is calculated and cannot be set"
            f"{suggestion(name, settable)}"
        )
    takes, convert, words = _TAKES[variable.type]
    if not isinstance(value, takes) or (isinstance(value, bool) and takes is not bool):
        raise SimulationError(f"{owner}.{name} = {value!r}: expected {words}, got {type(value).__name__}")
    if variable.type == "Real" and not math.isfinite(value):
        raise SimulationError(f"{owner}.{name} = {value!r}: expected a finite number")
    return convert(value)


_TAKES: dict[VariableType, tuple[type, type, str]] = {
    "Real": (numbers.Real, float, "a number"),
    "Integer": (numbers.Integral, int, "an integer"),
    "Enumeration": (numbers.Integral, int, "an integer"),
    "Boolean": (bool, bool, "True or False"),
    "String": (str, str, "a string"),
}
