"""A simulation before it is run: what is simulated, when and how, checked before any FMU is touched."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from liaisons.arguments import finite, listed, named, numbers
from liaisons.array_names import split
from liaisons.cosim.description.fmu import Fmu
from liaisons.cosim.description.model_description import SAME, Conversion
from liaisons.cosim.structure import checks
from liaisons.cosim.structure.components import SystemComponent
from liaisons.cosim.structure.connections import Connection
from liaisons.cosim.structure.memory import check_memory
from liaisons.cosim.structure.scenes import FmuScene
from liaisons.cosim.structure.schedule import Coupling, Feeds, VariableReference
from liaisons.cosim.structure.sources import Drive, Function, drives
from liaisons.errors import SimulationError, suggestion
from liaisons.logs import collected_warnings
from liaisons.port_names import PortNames

_DEFAULT_TOLERANCE = 1e-8
"""That of our FMUs, where neither the user nor anything else says more."""
_POINTS = 500
"""So often an FMU of Model Exchange is looked at if neither it nor the user says how often."""
_INTERFACE, _FINEST_INTERFACE = 0.01, 1e-13
"""What FMUs hand each other has to fit within this part of the tolerance, but not better than rounding allows."""


@final
@dataclass(frozen=True, eq=False)
class Simulation:
    """What is simulated, and how; made by :func:`checked`.

    :param parts: by name, in the order of addition, with the start values that the coupling needs.
    :param recorded: name in the result -> variable.
    :param times: communication points [s]; with steps of adapted size the begin, the end of the first step, the end.
    :param tolerance: relative tolerance for the FMUs' solvers; None for their own.
    :param error_tolerance: error of a communication step, relative to the size of signals; None for fixed steps.
    :param adapts: whether steps between the communication points are as short as the estimate of their error asks for.
    :param warnings: what was warned of when it was checked.
    """

    title: str
    parts: Mapping[str, SystemComponent]
    connections: Sequence[Connection]
    drives: Sequence[Drive]
    recorded: Mapping[str, VariableReference]
    times: Sequence[float]
    tolerance: float | None
    coupling: Coupling
    error_tolerance: float | None
    adapts: bool = False
    warnings: tuple[str, ...] = ()

    @cached_property
    def feeds(self) -> Feeds:
        """Input -> the output, or function of time, that feeds it."""
        driven = {place: source for d in self.drives for place, source in zip(d.inputs, d.places, strict=True)}
        return driven | _feeds(self.connections)

    @cached_property
    def conversions(self) -> dict[VariableReference, Conversion]:
        """Input -> how it follows from the output that feeds it, where it is not the same."""
        return {c.target.place: c.conversion for c in self.connections if c.conversion != SAME}

    @cached_property
    def jumping(self) -> frozenset[str]:
        """Names in the result of what changes in jumps only."""
        return frozenset(n for n, (p, v) in self.recorded.items() if not self.parts[p].fmu.variables[v].continuous)

    @property
    def ports(self) -> dict[str, PortNames]:
        """Value in the result -> names of its port there, where these are not as in :func:`port_names`."""
        found: dict[str, PortNames] = {}
        for recorded, (part, variable) in self.recorded.items():
            for name, value in ((recorded, variable), (split(recorded)[0], split(variable)[0])):
                if names := self.parts[part].fmu.terminals.renamed.get(value):
                    prefix = name.removesuffix(value)
                    found[name] = PortNames(*(f"{prefix}{member}" if member else "" for member in names))
        return found

    @property
    def scene(self) -> FmuScene:
        """What it looks like."""
        prefix = {part: name.removesuffix(variable) for name, (part, variable) in self.recorded.items()}
        return FmuScene({prefix.get(name, f"{name}."): part for name, part in self.parts.items()})

    @property
    def iterates(self) -> bool:
        """Whether steps are repeated."""
        return self.coupling in checks.ITERATING

    @property
    def step_tolerance(self) -> float:
        """Error that a step between communication points may add, relative to the size of signals."""
        return self.tolerance or _DEFAULT_TOLERANCE

    @property
    def interface_tolerance(self) -> float:
        """How well what FMUs hand each other has to fit, relative to its size."""
        return max(_INTERFACE * (self.tolerance or _DEFAULT_TOLERANCE), _FINEST_INTERFACE)

    @cached_property
    def units(self) -> dict[str, str]:
        """Name in the result -> unit; if the variable has none, that of what it is connected with."""
        near: dict[VariableReference, str] = {}
        for c in self.connections:
            for port, other in ((c.source, c.target), (c.target, c.source)) if c.conversion == SAME else ():
                near[port.place] = near.get(port.place) or other.variable.unit
        own = {place: self.parts[place[0]].fmu.variables[place[1]].unit for place in self.recorded.values()}
        return {name: own[place] or near.get(place, "") for name, place in self.recorded.items()}

    def depends(self, output: VariableReference, input_: VariableReference, *, initially: bool = False) -> bool:
        """Whether an output depends directly on an input of the same part, while stepping or in initialization."""
        return self.parts[output[0]].fmu.depends(output[1], input_[1], initially=initially)


def checked(
    title: str,
    parts: Mapping[str, SystemComponent],
    connections: Sequence[Connection] = (),
    *,
    single: bool = False,
    start_time: float | None = None,
    stop_time: float | None = None,
    step_size: float | None = None,
    times: ArrayLike | None = None,
    tolerance: float | None = None,
    coupling: Coupling | None = None,
    error_tolerance: float | None = None,
    record: str | Iterable[str] | None = None,
    also: Iterable[str] = (),
    inputs: Mapping[str, Function] | None = None,
) -> Simulation:
    """Whatever is asked of a simulation, checked; see :meth:`liaisons.cosim.System.simulate` for what it means.

    :param single: it is of one FMU, the first, whose variables go by their own names, and which says what is not
        given; the others are its operators.
    :param also: is recorded besides.
    :raises SimulationError: for a bad argument.
    """
    if single:
        fmu = next(iter(parts.values())).fmu
        own = fmu.experiment
        tolerance = own.tolerance if tolerance is None else tolerance
        if times is None:
            start_time = own.start_time if start_time is None else start_time
            stop_time = own.stop_time if stop_time is None else stop_time
            step_size = _own_step(fmu, start_time or 0.0, stop_time) if step_size is None else step_size
            if stop_time is None or step_size is None:
                missing = "stop_time" if stop_time is None else "step_size"
                raise SimulationError(f"{title}.fmu has no default {missing}: give one")
    recorded = _recorded(title, parts, record, also, single=single)
    if start_time is None:
        start_time = _common_start(parts) if times is None else 0.0
    chooses = step_size is None and times is None
    step_size = _shortest(parts, start_time, stop_time) if chooses else step_size
    if error_tolerance is None:
        points = communication_points(start_time, stop_time, step_size, times, signals=len(recorded))
    elif times is None:
        points = first_points(start_time, stop_time, step_size)
    else:
        raise SimulationError("times and error_tolerance both choose the communication points: leave one out")
    functions = named("inputs", {} if inputs is None else inputs)
    driving = drives(
        {owned(title, parts, "input", name, single=single): function for name, function in functions.items()},
        parts,
        points[0],
    )
    for name, value in (("tolerance", tolerance), ("error_tolerance", error_tolerance)):
        if value is not None:
            finite(name, value)
            if value <= 0:
                raise SimulationError(f"{name} = {value!r}: must be > 0")
    feeds = _feeds(connections)
    driven = [place for drive in driving for place in drive.inputs]
    with collected_warnings() as warned:
        chosen = checks.coupling(parts, connections, driven, coupling)
        checks.signals(connections, chosen)
        parts = checks.prepared(parts, connections, driven, chosen)
        checks.steps(parts, feeds, points, chosen, adaptive=error_tolerance is not None)
        checks.inputs(parts, feeds, driven)
    free = all(part.fmu.can_get_and_set_state and part.fmu.variable_step for part in parts.values())
    adapts = chooses and not single and free and error_tolerance is None and chosen in checks.ITERATING
    return Simulation(
        title,
        parts,
        connections,
        driving,
        recorded,
        points,
        tolerance,
        chosen,
        error_tolerance,
        adapts,
        warnings=warned.texts,
    )


def _own_step(fmu: Fmu, start_time: float, stop_time: float | None) -> float | None:
    """The communication step of an FMU [s]; in Model Exchange, where it says nothing, a part of the whole."""
    if fmu.experiment.step_size is None and fmu.is_model_exchange and stop_time is not None:
        return (stop_time - start_time) / _POINTS
    return fmu.experiment.step_size


def _shortest(parts: Mapping[str, SystemComponent], start_time: float, stop_time: float | None) -> float | None:
    """The shortest step that an FMU says [s], else a part of the whole."""
    steps = [step for part in parts.values() if (step := part.fmu.experiment.step_size) is not None]
    if stop_time is not None:
        finite("stop_time", stop_time)
    return min(steps, default=None if stop_time is None else (stop_time - start_time) / _POINTS)


def _common_start(parts: Mapping[str, SystemComponent]) -> float:
    """The begin [s] that all FMUs say of themselves, else 0."""
    starts = {part.fmu.experiment.start_time or 0.0 for part in parts.values()}
    return starts.pop() if len(starts) == 1 else 0.0


def owned(title: str, parts: Mapping[str, SystemComponent], what: str, name: str, *, single: bool) -> VariableReference:
    """The variable that a name stands for: ``"variable"`` of a single FMU, ``"component.variable"`` of a system.

    :param what: what it is named for.
    :raises SimulationError: if there is no such part; whether there is such a variable is not looked at.
    """
    if single:
        return next(iter(parts)), name
    owner, _, variable = name.partition(".")
    if owner not in parts:
        raise SimulationError(f"{what} {name!r}: {title} has no component {owner!r}{suggestion(owner, parts)}")
    return owner, variable


def _recorded(
    title: str,
    parts: Mapping[str, SystemComponent],
    record: str | Iterable[str] | None,
    also: Iterable[str],
    *,
    single: bool,
) -> dict[str, VariableReference]:
    """Name in the result -> what is recorded under it; of an array, all its elements."""
    names = [] if record is None else listed("record", record)
    all_of = () if record is not None else [next(iter(parts))] if single else parts
    places = [(name, variable) for name in all_of for variable in parts[name].fmu.recorded(parts[name].carried)]
    for full in (*names, *also):
        owner, name = owned(title, parts, "record", full, single=single)
        places += [(owner, scalar) for scalar in parts[owner].recordable(name)]
    return {place[1] if single else ".".join(place): place for place in places}


def _feeds(connections: Iterable[Connection]) -> dict[VariableReference, VariableReference]:
    return {connection.target.place: connection.source.place for connection in connections}


def communication_points(
    start_time: float,
    stop_time: float | None,
    step_size: float | None,
    times: ArrayLike | None = None,
    *,
    signals: int = 1,
) -> list[float]:
    """t_i = start_time + i * step_size, and stop_time [s]; or the given times, where these are not evenly spaced.

    A rest of less than a millionth of a step is taken for rounding and makes no step of its own.

    :param signals: how many are recorded at each.
    :raises SimulationError: unless all are finite, step_size > 0 and stop_time > start_time; or if ``times`` do not
        increase, or come together with the others; or if the recording is larger than the memory.
    """
    if times is not None:
        return _given(times, start_time, stop_time, step_size)
    stop_time, step_size = _span(start_time, stop_time, step_size)
    check_memory(start_time, stop_time, step_size, signals)
    steps = max(1, math.ceil((stop_time - start_time) / step_size - 1e-6))
    return [*(start_time + step_size * np.arange(steps)).tolist(), float(stop_time)]


def first_points(start_time: float, stop_time: float | None, step_size: float | None) -> list[float]:
    """The begin, the end of the first step, and the end of all [s], where steps choose their sizes.

    :raises SimulationError: unless all are finite, step_size > 0 and stop_time > start_time.
    """
    stop_time, step_size = _span(start_time, stop_time, step_size)
    return [float(start_time), float(min(start_time + step_size, stop_time)), float(stop_time)]


def _span(start_time: float, stop_time: float | None, step_size: float | None) -> tuple[float, float]:
    if stop_time is None or step_size is None:
        raise SimulationError("give stop_time and step_size, or the communication points themselves as times")
    for name, value in (("start_time", start_time), ("stop_time", stop_time), ("step_size", step_size)):
        finite(name, value)
    if step_size <= 0:
        raise SimulationError(f"step_size = {step_size!r}: must be > 0")
    if stop_time <= start_time:
        raise SimulationError(f"stop_time = {stop_time!r}: must be greater than start_time = {start_time!r}")
    if stop_time - step_size == stop_time or start_time + step_size == start_time:
        raise SimulationError(f"step_size = {step_size!r}: smaller than the rounding of times up to {stop_time!r} s")
    return stop_time, step_size


def _given(times: ArrayLike, start_time: float, stop_time: float | None, step_size: float | None) -> list[float]:
    if (stop_time, step_size) != (None, None) or start_time != 0.0:
        raise SimulationError("times are the communication points; leave out start_time, stop_time and step_size")
    points = numbers("times", times)
    if points.ndim != 1 or points.size < 2 or not np.all(np.isfinite(points)):
        raise SimulationError(f"times of shape {points.shape}: give two finite numbers at least")
    late = np.flatnonzero(np.diff(points) <= 0)
    if late.size:
        here, before = float(points[late[0] + 1]), float(points[late[0]])
        raise SimulationError(f"times[{late[0] + 1}] = {here!r}: must be greater than {before!r}, the one before")
    return points.tolist()
