"""Simulations before they run: systems with settings, checked before any FMU is loaded."""

from __future__ import annotations

import math
import sys
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from functools import cached_property
from types import NoneType
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike

from liaisons.base.arguments import (
    check_finite,
    check_positive,
    checked_stop_and_step,
    float_array,
    name_dictionary,
    name_list,
    shown,
)
from liaisons.base.array_names import array_and_index
from liaisons.base.logs import collected_warnings
from liaisons.base.memory import check_memory
from liaisons.base.port_names import PortNames
from liaisons.base.unit_definitions import SAME, Conversion
from liaisons.cosim.description.fmu import DefaultExperiment, Fmu
from liaisons.cosim.description.start_values import start_values as checked_starts
from liaisons.cosim.structure import checks
from liaisons.cosim.structure.components import Components, SystemComponent
from liaisons.cosim.structure.connections import Connection, feeds_of
from liaisons.cosim.structure.scenes import FmuScene, connected_groups
from liaisons.cosim.structure.schedule import Coupling, Feeds, VariableReference
from liaisons.cosim.structure.sources import Drive, Function, drives
from liaisons.errors import InvalidValueError, SimulationError, suggestion

_DEFAULT_TOLERANCE = 1e-8
"""Tolerance of FMUs of liaisons, where neither the user nor a file gives another."""
_POINTS = 500
"""Number of steps of a simulation for which nothing gives a step size."""
_ALIKE = 4
"""Largest difference of two instants that are one, in units in the last place of the largest time."""
_INTERFACE = 0.01
"""Interface tolerance, relative to the tolerance of the solvers."""
_FINEST_INTERFACE = 1e-13
"""Smallest interface tolerance that rounding allows."""


@final
@dataclass(frozen=True)
class SimulationSettings:
    """Settings of a simulation, which :meth:`liaisons.cosim.System.simulate` describes."""

    stop_time: float | None = None
    step_size: float | None = None
    _: KW_ONLY
    start_time: float | None = None
    times: ArrayLike | None = None
    tolerance: float | None = None
    coupling: Coupling | None = None
    error_tolerance: float | None = None
    record: str | Iterable[str] | None = None
    inputs: Mapping[str, Function] | None = None
    verify: bool = False
    progress: bool = False
    real_time: float | None = None

    def run_options(self) -> dict[str, Any]:
        """Settings of how a simulation is run, by name; the others say what is simulated."""
        return {name: getattr(self, name) for name in ("verify", "progress", "real_time")}

    def refuse_run_options(self) -> None:
        """Raise an error if one of :meth:`run_options` is set.

        :raises SimulationError: naming it.
        """
        for name, value in self.run_options().items():
            if not isinstance(value, (int, float, NoneType)) or value:
                raise InvalidValueError(f"{name} = {shown(value)}: is for simulate(); leave it out")


@final
@dataclass(frozen=True, eq=False)
class Simulation:
    """A system with complete settings; made by :func:`checked_simulation`.

    :param parts: components by name, in the order of addition, with the start values that the coupling needs.
    :param recorded: name in the result -> variable.
    :param times: communication points [s]; with steps of adapted size the start, the end of the first step, the stop.
    :param tolerance: relative tolerance for the FMUs' solvers; None for their own.
    :param error_tolerance: error of a communication step, relative to the size of signals; None for fixed steps.
    :param strong_components: those of the connection graph, in execution order.
    :param cyclic: components in cycles.
    :param single: whether variables have no prefix in the result: those of one FMU.
    :param adapts: whether steps between the communication points are as short as the estimate of their error requires.
    :param impulses: connections of sums of impulses, which jump at events only.
    :param warnings: texts of the warnings that were logged when it was checked.
    """

    title: str
    parts: Components
    connections: Sequence[Connection]
    drives: Sequence[Drive]
    recorded: Mapping[str, VariableReference]
    times: Sequence[float]
    tolerance: float | None
    coupling: Coupling
    error_tolerance: float | None
    strong_components: Sequence[Sequence[str]]
    cyclic: Collection[str]
    single: bool = False
    adapts: bool = False
    impulses: Sequence[Connection] = ()
    warnings: tuple[str, ...] = ()

    @cached_property
    def feeds(self) -> Feeds:
        """Reference of each fed input -> reference of the output or function of time that feeds it."""
        driven = {place: source for d in self.drives for place, source in zip(d.inputs, d.references, strict=True)}
        return driven | feeds_of(self.connections)

    @cached_property
    def chosen_reconstructions(self) -> Collection[str]:
        """Components outside of cycles for which the user has chosen that inputs hold or extrapolate."""
        said = {name for name, part in self.parts.items() if part.approximation.is_chosen}
        return said.difference(self.cyclic)

    @cached_property
    def group_number(self) -> dict[str, int]:
        """Index of the strong component of each component."""
        return {name: k for k, group in enumerate(self.strong_components) for name in group}

    @cached_property
    def conversions(self) -> dict[VariableReference, Conversion]:
        """Reference of an input -> conversion of the output that feeds it, where values are converted."""
        return {c.target.reference: c.conversion for c in self.connections if c.conversion != SAME}

    @cached_property
    def discrete_signals(self) -> frozenset[str]:
        """Names in the result of recorded discrete variables."""
        return frozenset(n for n, (p, v) in self.recorded.items() if not self.parts[p].fmu.variables[v].continuous)

    @property
    def renamed_ports(self) -> dict[str, PortNames]:
        """Name of a value in the result -> names of its port there, if :func:`port_names` does not give them."""
        ports: dict[str, PortNames] = {}
        for recorded, (part, variable) in self.recorded.items():
            for name, value in ((recorded, variable), (array_and_index(recorded)[0], array_and_index(variable)[0])):
                if names := self.parts[part].fmu.terminals.renamed.get(value):
                    prefix = name.removesuffix(value)
                    ports[name] = PortNames(*(f"{prefix}{member}" if member else "" for member in names))
        return ports

    @property
    def scene(self) -> FmuScene:
        """Picture of the system."""
        number = {name: i for i, name in enumerate(self.parts)}
        pairs = ((number[c.source.part.name], number[c.target.part.name]) for c in self.connections)
        parts = {"" if self.single and number[name] == 0 else f"{name}.": part for name, part in self.parts.items()}
        return FmuScene(parts, connected_groups(len(parts), pairs))

    @property
    def iterates(self) -> bool:
        """Whether the coupling repeats steps."""
        return self.coupling in checks.ITERATING

    @property
    def step_tolerance(self) -> float:
        """Error that a step between communication points may have, relative to the size of signals."""
        return self.tolerance or _DEFAULT_TOLERANCE

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
        own = {place: self.parts[place[0]].fmu.variables[place[1]].unit for place in self.recorded.values()}
        return {name: own[place] or near.get(place, "") for name, place in self.recorded.items()}

    def depends(self, output: VariableReference, input_: VariableReference, *, initially: bool = False) -> bool:
        """Whether an output depends directly on an input of its component, in steps or, ``initially``, before them."""
        return self.parts[output[0]].fmu.depends(output[1], input_[1], initially=initially)


def checked_simulation(
    title: str,
    parts: Components,
    connections: Sequence[Connection],
    settings: SimulationSettings,
    *,
    single: bool = False,
    also: Iterable[str] = (),
    endless: bool = False,
    usual: DefaultExperiment | None = None,
) -> Simulation:
    """Simulation of a system, with checked and complete settings.

    :param single: whether the simulation is of the first FMU alone, whose variables have no prefix and whose default
        experiment counts; the others are its operators.
    :param also: further names that are recorded.
    :param endless: whether a simulation without a stop time has no end, as that of a run step by step.
    :param usual: experiment of the system, before those of its FMUs.
    :raises SimulationError: for a bad setting.
    """
    recorded = _recorded_variables(title, parts, settings.record, also, single=single)
    fmus = [part.fmu for part in parts.values()][: 1 if single else None]
    last = fmus[0].experiment.stop_time if single else None
    own = usual or DefaultExperiment(stop_time=last)
    usual = _first_given(own, common_experiment(fmus))
    points = _communication_points(title, fmus, settings, len(recorded), usual=usual, single=single, endless=endless)
    tolerance, error_tolerance = settings.tolerance, settings.error_tolerance
    if tolerance is None and single:
        tolerance = next(iter(parts.values())).fmu.experiment.tolerance
    functions = name_dictionary("inputs", {} if settings.inputs is None else settings.inputs)
    driving = drives(
        {
            variable_reference(title, parts, "input", name, single=single): function
            for name, function in functions.items()
        },
        parts,
        points[0],
    )
    for name, value in (("tolerance", tolerance), ("error_tolerance", error_tolerance)):
        if value is not None:
            check_positive(name, value)
    impulses = [connection for connection in connections if connection.is_impulse]
    connections = [connection for connection in connections if not connection.is_impulse]
    graph = checks.ConnectionGraph(parts, connections, [input_ for drive in driving for input_ in drive.inputs])
    with collected_warnings() as warned:
        chosen = checks.choose_coupling(graph, settings.coupling)
        checks.check_signals(connections, chosen)
        parts = checks.prepare_components(graph, chosen)
        some = points[:2] if isinstance(points, EndlessTimes) else points
        checks.check_steps(parts, graph, some, chosen, adaptive=error_tolerance is not None)
        checks.check_input_sources(parts, graph)
    free = all(part.fmu.can_get_and_set_state and part.fmu.variable_step for part in parts.values())
    asked = (settings.step_size, own.step_size, settings.times, error_tolerance)
    chooses = all(one is None for one in asked) and not single and not endless
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
        graph.strong_components,
        graph.cyclic,
        single=single,
        adapts=chooses and free and chosen in checks.ITERATING and not impulses,
        impulses=impulses,
        warnings=warned.texts,
    )


def common_experiment(fmus: Iterable[Fmu]) -> DefaultExperiment:
    """Default experiment of several FMUs: start of all, or 0 if they differ; latest stop; shortest step size."""
    experiments = [fmu.experiment for fmu in fmus]
    starts = {experiment.start_time or 0.0 for experiment in experiments}
    stops = [stop for experiment in experiments if (stop := experiment.stop_time) is not None]
    steps = [step for experiment in experiments if (step := experiment.step_size) is not None]
    start = starts.pop() if len(starts) == 1 else 0.0
    return DefaultExperiment(start, max(stops, default=None), min(steps, default=None))


def _first_given(own: DefaultExperiment, common: DefaultExperiment) -> DefaultExperiment:
    """The experiment of a system, its start and step size from those of its FMUs where it has none."""
    start = common.start_time if own.start_time is None else own.start_time
    return DefaultExperiment(start, own.stop_time, common.step_size if own.step_size is None else own.step_size)


def _communication_points(
    title: str,
    fmus: Sequence[Fmu],
    settings: SimulationSettings,
    signals: int,
    *,
    usual: DefaultExperiment,
    single: bool,
    endless: bool,
) -> Sequence[float]:
    """Communication points [s], from the settings, else from the default experiments.

    With steps of adapted size these are the start, the end of the first step, and the stop.

    :param signals: number of recorded signals.
    """
    adaptive = settings.error_tolerance is not None
    if settings.times is not None:
        if adaptive:
            raise InvalidValueError("times and error_tolerance both choose the communication points: leave one out")
        return _checked_times(settings.times, settings)
    start, stop, step = settings.start_time, settings.stop_time, settings.step_size
    endless = endless and stop is None
    start = (usual.start_time or 0.0) if start is None else start
    stop = usual.stop_time if stop is None and not endless else stop
    step = usual.step_size if step is None else step
    if step is None and stop is not None and (fmus[0].is_model_exchange or not single):
        check_finite("stop_time", stop)
        check_finite("start_time", start)
        step = (stop - start) / _POINTS
    missing = "stop_time" if stop is None and not endless else "step_size" if step is None else ""
    if single and missing:
        raise InvalidValueError(f"{title}.fmu has no default {missing}: give one")
    if adaptive:
        stop, step = checked_stop_and_step(start, stop, step)
        return [float(start), float(min(start + step, stop)), float(stop)]
    if not endless:
        return communication_points(start, stop, step, signals=signals)
    if step is None:
        raise InvalidValueError("give step_size, the distance of the communication points")
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


def variable_reference(title: str, parts: Components, label: str, name: str, *, single: bool) -> VariableReference:
    """Component and variable for a name: ``"variable"`` of a single FMU, ``"component.variable"`` of a system.

    :param label: kind of the name, for messages.
    :raises SimulationError: if there is no such component; the variable is not checked.
    """
    if single:
        return next(iter(parts)), name
    owner, _, variable = name.partition(".")
    if owner not in parts:
        raise SimulationError(f"{label} {name!r}: {title} has no component {owner!r}{suggestion(owner, parts)}")
    return owner, variable


def with_start_values(
    title: str, parts: Components, start_values: Mapping[str, object], *, single: bool = False
) -> dict[str, SystemComponent]:
    """Components with some other start values.

    :param start_values: new start values by name.
    :raises SimulationError: for an unknown name, or a value that it cannot have.
    """
    own: dict[str, dict[str, object]] = {name: dict(part.starts) for name, part in parts.items()}
    for name, value in name_dictionary(f"{title}: start_values", start_values).items():
        owner, variable = variable_reference(title, parts, "start value", name, single=single)
        own[owner][variable] = value
    return {name: replace(part, starts=checked_starts(name, part.fmu, own[name])) for name, part in parts.items()}


def _recorded_variables(
    title: str,
    parts: Components,
    record: str | Iterable[str] | None,
    also: Iterable[str],
    *,
    single: bool,
) -> dict[str, VariableReference]:
    """Name in the result -> recorded variable; an array is recorded element by element."""
    names = [] if record is None else name_list("record", record)
    all_of = () if record is not None else [next(iter(parts))] if single else parts
    variables = [
        (name, variable) for name in all_of for variable in parts[name].fmu.recorded(parts[name].transferable_types)
    ]
    for full in (*names, *also):
        owner, name = variable_reference(title, parts, "record", full, single=single)
        variables += [(owner, scalar) for scalar in parts[owner].recordable_names(name)]
    return {variable[1] if single else ".".join(variable): variable for variable in variables}


def communication_points(
    start_time: float, stop_time: float | None, step_size: float | None, *, signals: int = 1
) -> list[float]:
    """Communication points t_i = start_time + i * step_size, and stop_time [s].

    The last step may be longer than the others by a millionth, as rounding.

    :param signals: number of recorded signals.
    :raises SimulationError: unless all are finite, step_size > 0 and stop_time > start_time; or if the recording is
        larger than the memory.
    """
    stop_time, step_size = checked_stop_and_step(start_time, stop_time, step_size)
    check_memory(start_time, stop_time, step_size, signals)
    steps = max(1, math.ceil((stop_time - start_time) / step_size - 1e-6))
    return [*(start_time + step_size * np.arange(steps)).tolist(), float(stop_time)]


def _checked_times(times: ArrayLike, settings: SimulationSettings) -> list[float]:
    """Communication points that the user gives [s]; those that differ by rounding are one."""
    if settings.start_time or settings.stop_time is not None or settings.step_size is not None:
        raise InvalidValueError("times are the communication points; leave out start_time, stop_time and step_size")
    points = float_array("times", times)
    if points.ndim != 1 or points.size < 2 or not np.all(np.isfinite(points)):
        raise InvalidValueError(f"times of shape {points.shape}: give two finite numbers at least")
    late = np.flatnonzero(np.diff(points) <= 0)
    if late.size:
        later, before = float(points[late[0] + 1]), float(points[late[0]])
        raise InvalidValueError(f"times[{late[0] + 1}] = {later!r}: must be greater than {before!r}, the one before")
    apart = np.diff(points) > _ALIKE * np.spacing(np.max(np.abs(points)))
    return points[np.append(apart, True)].tolist()
