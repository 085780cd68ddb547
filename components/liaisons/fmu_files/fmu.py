"""The description of an FMU: variables, terminals, units, dependencies, default experiment, capabilities, binaries."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import IO, Literal, final
from zipfile import ZipFile

import fmpy

from liaisons.base.archive import DESCRIPTION, START_VALUES, Archive, file_identity
from liaisons.base.array_names import Shape, array_and_index
from liaisons.base.port_names import MISMATCH
from liaisons.base.unit_definitions import UnitDefinition
from liaisons.errors import SimulationError, suggestion
from liaisons.fmu_files.model_description import Description, Table, parse
from liaisons.fmu_files.terminals import Terminals, read_terminals
from liaisons.fmu_files.variables import LONGEST, RECORDED, Scalar, Variables, VariableType

_MOST_STEPS = 1e12


@final
@dataclass(frozen=True, slots=True)
class DefaultExperiment:
    """Default experiment of an FMU or an SSP archive [s, s, s, 1]; None for a value that is not specified."""

    start_time: float | None = None
    stop_time: float | None = None
    step_size: float | None = None
    tolerance: float | None = None

    def usable(self) -> DefaultExperiment:
        """The experiment without a stop time or a step size that cannot be simulated."""
        start, stop, step = self.start_time or 0.0, self.stop_time, self.step_size
        if step is not None and not 0 < step < math.inf:
            step = None
        if stop is not None and not start < stop < math.inf:
            stop = None
        if stop is not None and step is not None and not (stop - start) / step <= _MOST_STEPS:
            stop = step = None
        return replace(self, stop_time=stop, step_size=step)


@final
@dataclass(frozen=True, eq=False)
class Fmu:
    """The description of an FMI 2.0 or 3.0 FMU; made by :func:`read`.

    :param version: 2 or 3.
    :param is_model_exchange: whether it is used for Model Exchange, with a solver of ours.
    :param states: number of continuous states.
    :param indicators: number of event indicators (FMI 2.0).
    :param continuous_states: indices of the derivative of each continuous state, or array of them, and of the state.
    :param needs_completed_step: whether Model Exchange has to call completedIntegratorStep.
    :param guid: GUID, or instantiation token.
    :param binary: path of the library for this platform in the archive.
    :param variable_step: whether communication steps may differ in length.
    :param can_get_and_set_state: whether its state can be saved and restored.
    :param provides_directional_derivatives: whether it calculates them.
    :param input_derivatives: whether derivatives of inputs can be set within a step (FMI 2.0 only).
    :param takes_intermediate_inputs: whether inputs can be set in intermediate update mode (FMI 3.0 only).
    :param output_derivative_order: highest order of output derivatives that can be read.
    :param unpacked: size of its files in bytes.
    :param nominals: nominal values by name, where the file says one; else they are 1.
    :param function: Python function that is called instead of a library; None: the FMU has a library.
    """

    path: Path
    model_name: str
    variables: Variables
    terminals: Terminals = field(repr=False)
    version: int = 2
    is_model_exchange: bool = False
    states: int = 0
    continuous_states: tuple[tuple[int, int], ...] = ()
    indicators: int = 0
    needs_completed_step: bool = False
    identifier: str = ""
    guid: str = ""
    binary: str = ""
    variable_step: bool = True
    can_get_and_set_state: bool = True
    provides_directional_derivatives: bool = False
    input_derivatives: bool = False
    takes_intermediate_inputs: bool = False
    output_derivative_order: int = 0
    unpacked: int = 0
    log_categories: tuple[str, ...] = ()
    experiment: DefaultExperiment = DefaultExperiment()
    units: Mapping[str, UnitDefinition] = field(default_factory=dict)
    nominals: Mapping[str, float] = field(default_factory=dict, repr=False)
    _outputs: Table = field(default_factory=dict, repr=False)
    _initial: Table = field(default_factory=dict, repr=False)
    function: object = None
    _recorded: dict[frozenset[VariableType], list[str]] = field(default_factory=dict, init=False, repr=False)

    @cached_property
    def arrays(self) -> Mapping[str, Shape]:
        """Shapes of arrays by name: variables of FMI 3.0, and ``x[1]``, ``x[2]``, ... of FMI 2.0."""
        return self.variables.arrays

    def elements(self, name: str) -> list[str]:
        """Names of the elements of an array; of a scalar, its own.

        :raises KeyError: for an unknown name.
        """
        return list(self.variables.entry(name).names())

    def reals(self, *causalities: str, longest: float = math.inf) -> list[str]:
        """Names of real scalars of some causalities, in the order of the file.

        :param longest: arrays with more elements are left out.
        """
        return self._scalars({"Real"}, causalities, longest)

    def recorded(self, types: frozenset[VariableType] = RECORDED) -> list[str]:
        """Names that are recorded by default: outputs and inputs, without arrays longer than :data:`LONGEST`.

        If there are none, local variables, :data:`LONGEST` of them at most.
        """
        if types not in self._recorded:
            names = self._scalars(types, ("output", "input"), LONGEST)
            self._recorded[types] = names or self._scalars(types, ("local",), LONGEST)[:LONGEST]
        return [*self._recorded[types]]

    @cached_property
    def structural_parameters(self) -> frozenset[str]:
        """Names of the variables that are set in configuration mode."""
        return frozenset(name for name, entry in self.variables.entries.items() if entry.prototype.is_structural)

    @cached_property
    def unset_inputs(self) -> Sequence[str]:
        """Names of real inputs without a start value; of no arrays longer than :data:`LONGEST`."""
        return [name for name in self.reals("input", longest=LONGEST) if self.variables[name].start is None]

    @cached_property
    def has_contacts(self) -> bool:
        """Whether the name of a variable tells of impacts or dry friction."""
        return any(re.search("_impacts|_sticks", name) for name in self.variables.entries)

    def _scalars(self, types: Collection[str], causalities: Collection[str], longest: float) -> list[str]:
        return [
            name
            for entry in self.variables.entries.values()
            if entry.prototype.type in types and entry.prototype.causality in causalities and entry.size <= longest
            for name in entry.names()
        ]

    @property
    def mismatches(self) -> list[str]:
        """Names of the local variables that measure how far value, rate and acceleration of inputs contradict."""
        inputs = {name for port in self.reals("input") for name in (port, array_and_index(port)[0])}
        names: list[str] = []
        for name in self.reals("local"):
            base, _ = array_and_index(name)
            value = f"{base.removesuffix(MISMATCH)}{name[len(base) :]}"
            if base.endswith(MISMATCH) and value in inputs and self.terminals.port(value):
                names.append(name)
        return names

    @cached_property
    def next_event_variable(self) -> Scalar | None:
        """The variable ``next_event_time``, the next instant [s] at which outputs jump; None without such a variable.

        FMUs of liaisons whose outputs jump at such instants have it; its largest value means that there is none.
        """
        event = self.variables.entries.get("next_event_time")
        if not isinstance(event, Scalar):
            return None
        marked = (event.type, event.causality, event.continuous, event.unit) == ("Real", "local", False, "s")
        return event if marked else None

    @cached_property
    def has_sampled_outputs(self) -> bool:
        """Whether all outputs are discrete and their next change is announced, as those of a sampled controller."""
        if self.next_event_variable is None:
            return False
        return not any(self.variables[name].continuous for name in self._scalars(RECORDED, ("output",), math.inf))

    def depends(self, output: str, input_: str, *, initially: bool = False) -> bool:
        """Whether an output depends directly on an input, in step mode or, if ``initially``, in initialization mode."""
        variable = self.variables[output]
        inputs = (self._initial if initially else self._outputs).get(variable.index)
        return inputs is None or self.variables[input_].index in inputs

    def items(self, variable: str) -> Mapping[str, int]:
        """Values of the items of a variable's enumeration type, by name; empty without such a type."""
        description = read_description(self.path)
        return description.items.get(description.attributes.get(variable, {}).get("declaredType", ""), {})

    @property
    def has_table(self) -> bool:
        """Whether the motion of an FMU of liaisons is a table in its resources, not in its parameters."""
        with ZipFile(self.path) as archive:
            return START_VALUES in archive.namelist() and archive.read(START_VALUES).startswith(b"t ")

    def require_file(self, task: str) -> None:
        """Raise an error if the FMU is a Python function, which has no file.

        :param task: the task that needs a file, such as ``"an archive"``.
        """
        if self.function is not None:
            raise SimulationError(f"{self.model_name}: {task} takes no Python function; declare a Sampled component")

    def unknown_variable_message(self, name: str, *suggestions: str) -> str:
        """Message for a variable that does not exist; it may propose variables and further ``suggestions``."""
        base, index = array_and_index(name)
        if base in self.arrays:
            shape = self.arrays[base]
            bounds = f"{base}[{','.join('1' * len(shape))}] to {base}[{','.join(map(str, shape))}]"
            return f"{self.path.name} has no variable {name!r}; the array has {bounds}"
        entries = self.variables.entries
        known = [f"{other}{name[len(base) :]}" if index and other in self.arrays else other for other in entries]
        return f"{self.path.name} has no variable {name!r}{suggestion(name, [*known, *suggestions])}"


def read(
    path: Path | str,
    sizes: Mapping[str, int] | None = None,
    *,
    prefers: Literal["CoSimulation", "ModelExchange"] = "CoSimulation",
) -> Fmu:
    """Description of an FMU, read from its file; cached until the file changes.

    :param sizes: new values of structural parameters, which change the shapes of arrays.
    :param prefers: the interface type to use, where it has both.
    :raises SimulationError: if the file is missing, truncated, too big, no FMU, of another FMI version or kind, has
        no binary for this platform, or a model description that contradicts itself.
    """
    path = Path(path)
    return _read(path, tuple((sizes or {}).items()), prefers, *file_identity(path))


@lru_cache(maxsize=64)
def _read(path: Path, sizes: tuple[tuple[str, int], ...], prefers: str, *_identity: int) -> Fmu:
    with Archive(path) as archive, _open_description(archive) as file:
        return _make_fmu(path, archive, parse(file, dict(sizes)), prefers)


def read_description(path: Path) -> Description:
    """Model description of an FMU alone, with all attributes of its variables.

    :raises SimulationError: as :func:`read`, but other files of the FMU are not checked.
    """
    with Archive(path) as archive, _open_description(archive) as file:
        return parse(file, {}, keeps_attributes=True)


def experiment_problems(path: Path) -> Iterator[str]:
    """Yield what is wrong with the default experiment of an FMU, beyond FMI's schema.

    :raises SimulationError: as :func:`read_description`.
    """
    experiment = read_description(path).experiment
    names = "startTime", "stopTime", "stepSize", "tolerance"
    values = {name: float(experiment[name]) for name in names if name in experiment}
    start = values.pop("startTime", 0.0)
    for name, value in values.items():
        least = start if name == "stopTime" else 0.0
        if not least < value < math.inf:
            yield f"DefaultExperiment: {name} = {value:g}: it must be a number > {least:g}"


@contextmanager
def _open_description(archive: Archive) -> Iterator[IO[bytes]]:
    """Open the model description of an archive, and name its path in errors of reading it."""
    if DESCRIPTION not in archive.names:
        raise SimulationError(f"{archive.path}: has no {DESCRIPTION} inside, so it is no FMU")
    with archive.open(DESCRIPTION) as file:
        try:
            yield file
        except ValueError as error:
            reason = " ".join(str(error).split())
            raise SimulationError(f"{archive.path}: its {DESCRIPTION} cannot be read: {reason}") from error


def _kind_and_token(path: Path, description: Description, prefers: str) -> tuple[str, str]:
    """The kind of simulation that an FMU is used for, and the name of the attribute that has its token.

    :raises SimulationError: if it is made for none, or of another version of FMI.
    :raises ValueError: if its description lacks what it has to say.
    """
    root, kinds = description.root, description.kinds
    version = root["fmiVersion"]
    if version[:2] not in {"2.", "3."}:
        raise SimulationError(f"{path}: FMI {version}; only FMUs of FMI 2.0 and 3.0 can be simulated")
    name = next((name for name in (prefers, "CoSimulation", "ModelExchange") if name in kinds), None)
    if name is None:
        words = "made for scheduled execution only" if kinds else "made for no kind of simulation"
        raise SimulationError(f"{path}: {words}; export it for co-simulation or model exchange")
    token = "guid" if version.startswith("2.") else "instantiationToken"
    for attribute in ("modelName", token):
        if attribute not in root:
            raise ValueError(f"fmiModelDescription has no {attribute!r}")
    if "modelIdentifier" not in kinds[name]:
        raise ValueError(f"{name} has no 'modelIdentifier'")
    return name, token


def _make_fmu(path: Path, archive: Archive, description: Description, prefers: str) -> Fmu:
    root, kinds = description.root, description.kinds
    name, token = _kind_and_token(path, description, prefers)
    kind, is_model_exchange, two = kinds[name], name == "ModelExchange", token == "guid"

    def is_true(*names: str) -> bool:  # FMI 2.0 and 3.0 differ in some names
        return any(kind.get(attribute) in {"true", "1"} for attribute in names)

    initial = description.outputs | description.initial_unknowns
    initial |= dict.fromkeys(description.exact, frozenset[int]())
    return Fmu(
        path=path,
        version=2 if two else 3,
        is_model_exchange=is_model_exchange,
        states=description.states,
        continuous_states=description.continuous_states,
        indicators=int(root.get("numberOfEventIndicators") or 0),
        needs_completed_step=is_true("completedIntegratorStepNotNeeded", "needsCompletedIntegratorStep") != two,
        model_name=root["modelName"],
        identifier=kind["modelIdentifier"],
        guid=root[token],
        binary=_binary_path(path, archive, kind["modelIdentifier"], is_fmi_2=two),
        variable_step=is_model_exchange or is_true("canHandleVariableCommunicationStepSize"),
        can_get_and_set_state=is_true("canGetAndSetFMUstate", "canGetAndSetFMUState"),
        provides_directional_derivatives=is_true("providesDirectionalDerivative", "providesDirectionalDerivatives"),
        input_derivatives=is_model_exchange or is_true("canInterpolateInputs"),
        takes_intermediate_inputs=is_true("providesIntermediateUpdate") and not description.fixed_inputs,
        output_derivative_order=1 if is_model_exchange else int(kind.get("maxOutputDerivativeOrder", 0)),
        unpacked=archive.size,
        log_categories=tuple(description.log_categories),
        experiment=_default_experiment(description.experiment),
        variables=description.variables,
        units=description.units,
        nominals=description.nominals,
        terminals=read_terminals(archive, description.variables),
        _outputs=description.outputs,
        _initial=initial,
    )


def _default_experiment(attributes: Mapping[str, str]) -> DefaultExperiment:
    try:
        texts = (attributes.get(name) for name in ("startTime", "stopTime", "stepSize", "tolerance"))
        experiment = DefaultExperiment(*(None if text is None else float(text) for text in texts))
    except ValueError as error:
        raise ValueError(f"DefaultExperiment: {error}") from None
    start = experiment.start_time if experiment.start_time and math.isfinite(experiment.start_time) else None
    tolerance = experiment.tolerance if experiment.tolerance and 0 < experiment.tolerance < math.inf else None
    return replace(experiment, start_time=start, tolerance=tolerance).usable()


def _binary_path(path: Path, archive: Archive, identifier: str, *, is_fmi_2: bool) -> str:
    """Path of this platform's library inside an archive.

    Folders are called as in FMI 2.0.4 and 3.0, or, for FMI 2.0, by the older names.
    """
    files, library = archive.names, identifier + fmpy.sharedLibraryExtension
    folders = [fmpy.platform_tuple]
    if is_fmi_2 and (
        fmpy.architecture.startswith("x86") or fmpy.system == "darwin"
    ):  # fmpy.platform says linux64 on ARM
        folders.append(fmpy.platform)
    for folder in folders:
        if f"binaries/{folder}/{library}" in files:
            return f"binaries/{folder}/{library}"
    members = sorted({*files, *archive.folders})
    inside = {name.split("/")[1] for name in members if name.startswith("binaries/") and name.count("/") > 1}
    empty = {folder for folder in inside if not any(name.startswith(f"binaries/{folder}/") for name in files)}
    lacking = inside.intersection(folders) - empty
    words = dict.fromkeys(empty, " (empty)") | dict.fromkeys(lacking, f" (without {library})")
    platforms = ", ".join(folder + words.get(folder, "") for folder in sorted(inside)) or "none"
    sources = any(name.startswith("sources/") and name.endswith(".c") for name in files)
    raise SimulationError(
        f"{path}: no binary for this platform (binaries/{folders[-1]}/{library}); inside are: "
        f"{platforms}; {'compile its sources here' if sources else 'export it for this platform'}"
        " (own components: 'liaisons build')"
    )
