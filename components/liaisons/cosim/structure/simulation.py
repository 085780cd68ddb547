"""Simulations before they run: systems with settings, checked before any FMU is loaded."""

from __future__ import annotations

import math
import sys
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import repeat
from operator import attrgetter, itemgetter
from pathlib import Path
from typing import Any, TypedDict, final

import numpy as np
from numpy.typing import ArrayLike

from liaisons.base.arguments import check_finite, check_positive, checked_stop_and_step, float_array, name_list
from liaisons.base.array_names import array_and_index
from liaisons.base.clocks import communication_points
from liaisons.base.logs import collected_warnings
from liaisons.base.port_names import PortNames
from liaisons.base.unit_definitions import SAME, Conversion
from liaisons.cosim.compiled import library as compiled
from liaisons.cosim.instances import extract_fmus
from liaisons.cosim.structure import checks
from liaisons.cosim.structure.components import Components, Port
from liaisons.cosim.structure.connections import Connection, feeds_of
from liaisons.cosim.structure.document import SystemDocument
from liaisons.cosim.structure.schedule import Coupling, Feeds, VariableReference, component_of
from liaisons.cosim.structure.sources import SIGNALS, Drive, Function, drives
from liaisons.errors import InvalidValueError
from liaisons.fmu_files import Scalar

_DEFAULT_TOLERANCE = 1e-8
"""Tolerance of FMUs of liaisons, where neither the user nor a file gives another."""
_POINTS = 500
"""Number of steps where nothing gives a step size."""
_ALIKE = 4
"""Instants closer than this (in ulps of the largest time) count as one."""
_INTERFACE = 0.01
"""Interface tolerance, relative to the tolerance of the solvers."""
_FINEST_INTERFACE = 1e-13
"""Smallest interface tolerance that rounding allows."""


class Settings(TypedDict, total=False):
    """Settings beside stop time and step size, which :meth:`liaisons.System.simulate` describes."""

    start_time: float | None
    times: ArrayLike | None
    tolerance: float | None
    coupling: Coupling | None
    error_tolerance: float | None
    record: str | Iterable[str] | None
    inputs: Mapping[str, Function] | None


@final
@dataclass(frozen=True, eq=False)
class Simulation:
    """A system with complete settings; made by :func:`checked_simulation`.

    :param document: the system, its components with the start values that the coupling needs, its connections without
        those of impulses.
    :param recorded: name in the result -> variable.
    :param times: communication points [s]; with steps of adapted size the start, the end of the first step, the stop.
    :param tolerance: relative tolerance for the FMUs' solvers; None for their own.
    :param error_tolerance: error of a communication step, relative to the size of signals; None for fixed steps.
    :param strong_components: those of the connection graph, in execution order.
    :param cyclic: components in cycles.
    :param adapts: whether steps between the communication points are as short as the estimate of their error requires.
    :param impulses: connections of sums of impulses, which jump at events only.
    :param warnings: texts of the warnings that were logged when it was checked.
    :ivar title: name of the system; ``parts`` its components by name, ``connections`` those of the document.
    :ivar feeds: reference of each fed input -> reference of the output or function of time that feeds it.
    :ivar iterates: whether the coupling repeats steps.
    :ivar step_tolerance: error that a step between communication points may have, relative to the size of signals.
    """

    document: SystemDocument
    drives: Sequence[Drive]
    recorded: Mapping[str, VariableReference]
    times: Sequence[float]
    tolerance: float | None
    coupling: Coupling
    error_tolerance: float | None
    strong_components: Sequence[Sequence[str]]
    cyclic: Collection[str]
    adapts: bool = False
    impulses: Sequence[Connection] = ()
    warnings: tuple[str, ...] = ()
    title: str = field(init=False)
    parts: Components = field(init=False)
    connections: Sequence[Connection] = field(init=False)
    feeds: Feeds = field(init=False)
    iterates: bool = field(init=False)
    step_tolerance: float = field(init=False)
    _ports: dict[VariableReference, tuple[list[VariableReference], int]] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        document, feeds = self.document, dict[VariableReference, VariableReference]()
        for drive in self.drives:
            feeds.update(zip(drive.inputs, drive.references, strict=True))
        derived = {
            "title": document.name,
            "parts": document.parts,
            "connections": document.connections,
            "feeds": feeds | feeds_of(document.connections),
            "iterates": self.coupling in checks.ITERATING,
            "step_tolerance": self.tolerance or _DEFAULT_TOLERANCE,
        }
        for name, value in derived.items():
            object.__setattr__(self, name, value)

    def with_parts(self, parts: Components) -> Simulation:
        """Copy with other components of these names."""
        return replace(self, document=replace(self.document, parts=parts))

    def extract(self, folder: Path) -> Mapping[Path, Path]:
        """Extract the FMUs for runs in several processes, and compile once what each of these needs.

        :returns: path of an FMU -> its own folder.
        :raises SimulationError: if a file is damaged or too big.
        """
        compiled.step_library()
        if self.iterates:
            compiled.step_library(coupled=True)
        return extract_fmus((part.fmu for part in self.parts.values()), folder)

    @cached_property
    def chosen_reconstructions(self) -> Collection[str]:
        """Components outside of cycles for which the user has chosen that inputs hold or extrapolate."""
        said = {name for name, part in self.parts.items() if part.approximation.is_chosen}
        return said.difference(self.cyclic)

    @cached_property
    def takes_steps_of_any_size(self) -> bool:
        """Whether all FMUs do."""
        return all(map(attrgetter("fmu.variable_step"), self.parts.values()))

    @cached_property
    def conversions(self) -> dict[VariableReference, Conversion]:
        """Reference of an input -> conversion of the output that feeds it, where values are converted."""
        return {c.target.reference: c.conversion for c in self.connections if c.conversion != SAME}

    @cached_property
    def recorded_scalars(self) -> Mapping[str, Scalar]:
        """Name in the result -> variable."""
        return {name: self.parts[owner].fmu.variables[variable] for name, (owner, variable) in self.recorded.items()}

    @property
    def renamed_ports(self) -> dict[str, PortNames]:
        """Name of a value in the result -> names of its port there, if :func:`port_names` does not give them."""
        ports: dict[str, PortNames] = {}
        for recorded, (part, variable) in self.recorded.items():
            renamed = self.parts[part].fmu.terminals.renamed
            if not renamed:
                continue
            for name, value in ((recorded, variable), (array_and_index(recorded)[0], array_and_index(variable)[0])):
                if names := renamed.get(value):
                    prefix = name.removesuffix(value)
                    ports[name] = PortNames(*(f"{prefix}{member}" if member else "" for member in names))
        return ports

    @property
    def interface_tolerance(self) -> float:
        """Largest difference of inputs and outputs at the end of an iteration, relative to their size."""
        return max(_INTERFACE * self.step_tolerance, _FINEST_INTERFACE)

    @cached_property
    def units(self) -> dict[str, str]:
        """Name in the result -> unit of the variable, else of a variable connected with it."""
        near: dict[VariableReference, str] = {}
        for c in self.connections:
            for port, other in ((c.source, c.target), (c.target, c.source)) if c.conversion == SAME else ():
                near[port.reference] = near.get(port.reference) or other.variable.unit
        units: dict[str, str] = {}
        for name, scalar in self.recorded_scalars.items():
            units[name] = scalar.unit or near.get(self.recorded[name], "")
        return units

    def port_and_order(self, source: VariableReference) -> tuple[list[VariableReference], int]:
        """Value, rate and acceleration of the port of an output, and which derivative the output is.

        A function of time that drives a whole port is a port, too.

        :returns: without a port, the output alone and 0.
        """
        if source not in self._ports:
            owner, variable = self._variable(source)
            triple, order = Port(self.parts[owner], variable).motion_and_order()
            ends = [*map(attrgetter("reference"), triple or ())]
            if source[0] == SIGNALS:
                sources = [self.feeds.get(end, ("?", "")) for end in ends]
                ends = sources if {*map(component_of, sources)} == {SIGNALS} else []
            self._ports[source] = (ends, order) if ends else ([source], 0)
        return self._ports[source]

    def units_of(self, references: Iterable[VariableReference]) -> list[str]:
        """Unit of each variable; a variable that is no Real has one of its own."""
        units: list[str] = []
        for name, variable in map(self._variable, references):
            scalar = self.parts[name].fmu.variables[variable]
            units.append(scalar.unit if scalar.type == "Real" else f"{name}.{variable}")
        return units

    def _variable(self, reference: VariableReference) -> VariableReference:
        """The variable itself; of a function of time the input that it drives."""
        if reference[0] != SIGNALS:
            return reference
        return next(target for target, source in self.feeds.items() if source == reference)

    def depends(self, output: VariableReference, input_: VariableReference, *, initially: bool = False) -> bool:
        """Whether an output depends directly on an input of its component, in steps or, ``initially``, before them."""
        return self.parts[output[0]].fmu.depends(output[1], input_[1], initially=initially)


def checked_simulation(
    document: SystemDocument,
    stop_time: float | None = None,
    step_size: float | None = None,
    *,
    also: Iterable[str] = (),
    endless: bool = False,
    start_time: float | None = None,
    times: ArrayLike | None = None,
    tolerance: float | None = None,
    coupling: Coupling | None = None,
    error_tolerance: float | None = None,
    record: str | Iterable[str] | None = None,
    inputs: Mapping[str, Function] | None = None,
) -> Simulation:
    """Simulation of a system, with checked and complete settings, which :meth:`liaisons.System.simulate` describes.

    Of a single FMU the default experiment counts, and of a system that of the document before those of its FMUs.

    :param also: further names that are recorded.
    :param endless: whether a simulation without a stop time has no end, as that of a run step by step.
    :raises SimulationError: for a bad setting.
    """
    parts, single, adaptive = document.filled().parts, document.single, error_tolerance is not None
    recorded = _recorded_variables(document, record, also)
    if times is None:
        span = start_time, stop_time, step_size
        points = _communication_points(document, *span, len(recorded), adaptive=adaptive, endless=endless)
    else:
        points = _checked_times(times, start_time or None, stop_time, step_size, adaptive=adaptive)
    if tolerance is None and single:
        tolerance = next(iter(parts.values())).fmu.experiment.tolerance
    driving = [] if inputs is None else drives(document, inputs, points[0])
    for name, value in (("tolerance", tolerance), ("error_tolerance", error_tolerance)):
        if value is not None:
            check_positive(name, value)
    impulses: list[Connection] = []
    connections: list[Connection] = []
    for connection in document.connections:
        (impulses if connection.is_impulse else connections).append(connection)
    driven: list[VariableReference] = []
    for drive in driving:
        driven += drive.inputs
    graph = checks.ConnectionGraph(parts, connections, driven)
    with collected_warnings() as warned:
        chosen = checks.choose_coupling(graph, coupling)
        checks.check_signals(connections, chosen)
        parts = checks.prepare_components(graph, chosen)
        some = points[:2] if isinstance(points, EndlessTimes) else points
        checks.check_steps(parts, graph, some, chosen, adaptive=adaptive)
        checks.check_input_sources(parts, graph)
    fixed = step_size or document.experiment.step_size or times is not None or adaptive
    adapts = not (fixed or single or endless or impulses) and chosen in checks.ITERATING
    return Simulation(
        replace(document, parts=parts, connections=connections),
        driving,
        recorded,
        points,
        tolerance,
        chosen,
        error_tolerance,
        graph.strong_components,
        graph.cyclic,
        adapts=adapts and all(p.fmu.can_get_and_set_state and p.fmu.variable_step for p in parts.values()),
        impulses=impulses,
        warnings=warned.texts,
    )


def _communication_points(
    document: SystemDocument,
    start: float | None,
    stop: float | None,
    step: float | None,
    signals: int,
    *,
    adaptive: bool,
    endless: bool,
) -> Sequence[float]:
    """Communication points at equal distances [s], from the settings, else from the default experiments.

    With steps of adapted size these are the start, the end of the first step, and the stop.

    :param signals: number of recorded signals.
    """
    first, single, own = next(iter(document.parts.values())).fmu, document.single, document.experiment
    usual = first.experiment if single else document.common_experiment
    endless = endless and stop is None
    if start is None:
        start = (usual.start_time if own.start_time is None else own.start_time) or 0.0
    if stop is None and not endless:
        stop = own.stop_time
    if step is None:
        step = usual.step_size if own.step_size is None else own.step_size
    if step is None and stop is not None and (first.is_model_exchange or not single):
        check_finite("stop_time", stop)
        check_finite("start_time", start)
        step = (stop - start) / _POINTS
    missing = "stop_time" if stop is None and not endless else "step_size" if step is None else ""
    if single and missing:
        raise InvalidValueError(f"{document.name}.fmu has no default {missing}: give one")
    if adaptive:
        stop, step = checked_stop_and_step(start, stop, step)
        return [float(start), float(min(start + step, stop)), float(stop)]
    if not endless:
        return communication_points(start, stop, step, signals=signals)
    if step is None:
        raise InvalidValueError("give step_size, the distance between communication points")
    check_finite("start_time", start)
    check_positive("step_size", step)
    return EndlessTimes(float(start), float(step))


@final
@dataclass(frozen=True)
class EndlessTimes(Sequence[float]):
    """Infinite sequence of instants t_i = start_time + i * step_size [s]; the last one, [-1], is infinite."""

    start_time: float
    step_size: float

    def __len__(self) -> int:
        return sys.maxsize

    def __getitem__(self, index: Any) -> Any:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        return math.inf if index == -1 else self.start_time + index * self.step_size


def _recorded_variables(
    document: SystemDocument, record: str | Iterable[str] | None, also: Iterable[str]
) -> dict[str, VariableReference]:
    """Name in the result -> recorded variable; an array is recorded element by element."""
    parts, single = document.parts, document.single
    references: list[VariableReference] = []
    if record is None:
        for owner, part in list(parts.items())[: 1 if single else None]:
            references += zip(repeat(owner), part.fmu.recorded(part.transferable_types))
    for full in (*(() if record is None else name_list("record", record)), *also):
        owner, name = document.reference("record", full)
        references += [(owner, scalar) for scalar in parts[owner].recordable_names(name)]
    return dict(zip(map(itemgetter(1) if single else ".".join, references), references, strict=True))


def _checked_times(times: ArrayLike, *others: float | None, adaptive: bool) -> Sequence[float]:
    """Communication points that the user gives [s]; those that differ only by rounding count as one.

    :param others: start, stop and step size, which say the same.
    """
    if adaptive:
        raise InvalidValueError("times and error_tolerance both choose the communication points: leave one out")
    if any(one is not None for one in others):
        raise InvalidValueError("times are the communication points; leave out start_time, stop_time and step_size")
    points = float_array("times", times)
    if points.ndim != 1 or points.size < 2 or not np.all(np.isfinite(points)):
        raise InvalidValueError(f"times of shape {points.shape}: give at least two finite numbers")
    late = np.flatnonzero(np.diff(points) <= 0)
    if late.size:
        later, before = float(points[late[0] + 1]), float(points[late[0]])
        raise InvalidValueError(f"times[{late[0] + 1}] = {later!r}: must be greater than {before!r}, the one before")
    apart = np.diff(points) > _ALIKE * np.spacing(np.max(np.abs(points)))
    return points[np.append(apart, True)].tolist()
