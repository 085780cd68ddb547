"""The simulation of one FMU or of several: arguments are checked, the run is made, a result comes of it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from liaisons.arguments import as_path, finite, listed, named, numbers, shown
from liaisons.cosim import checks
from liaisons.cosim.connections import Connection
from liaisons.cosim.drives import Drive, Function, evaluate
from liaisons.cosim.execution import Execution, Settings
from liaisons.cosim.memory import check_memory
from liaisons.cosim.parts import Part
from liaisons.cosim.schedule import Coupling, Place
from liaisons.errors import SimulationError
from liaisons.results import IncompleteError, Interrupted, Result

_DEFAULT_TOLERANCE = 1e-8
"""That of our FMUs, where neither the user nor anything else says more."""
_INTERFACE, _FINEST_INTERFACE = 0.01, 1e-13
"""What FMUs hand each other has to fit within this part of the tolerance, but not better than rounding allows."""


def simulate(
    fmu: Path | str,
    /,
    *,
    stop_time: float | None = None,
    step_size: float | None = None,
    start_time: float | None = None,
    times: ArrayLike | None = None,
    tolerance: float | None = None,
    record: str | Iterable[str] | None = None,
    inputs: Mapping[str, Function] | None = None,
    **starts: ArrayLike,
) -> Result:
    """Simulate one FMU; what is not given is taken from its default experiment.

    :param fmu: path of the file; :func:`liaisons.simulate` takes a component by its name, file or class, too.
    :param stop_time: end [s].
    :param step_size: distance of the communication points [s], as in :meth:`System.simulate`.
    :param start_time: begin [s].  (A *parameter* of this name can be set in a :class:`System`.)
    :param times: the communication points themselves [s], increasing, in place of the three above.
    :param tolerance: relative tolerance of the FMU's solver.
    :param record: a name of a real variable or several; all outputs and inputs if None.
    :param inputs: name -> function of time [s] that returns its value.  The function of an active coordinate ``s`` may
        return (s, s_dot, s_ddot).  It is called for the communication points, and what it returns is handed over as
        from a connected source.
    :param starts: values of parameters and inputs at the start, where they differ from the FMU's.
    :returns: signals under their own names, ``result["theta"]``.
    :raises SimulationError: as :meth:`System.add` and :meth:`System.simulate` do; so is :class:`Interrupted`.
    """
    path = as_path("fmu", fmu)
    single = Part.of(path.stem, path, starts)
    experiment = single.fmu.experiment
    if times is None:
        start_time = experiment.start_time if start_time is None else start_time
        stop_time = experiment.stop_time if stop_time is None else stop_time
        step_size = experiment.step_size if step_size is None else step_size
        if stop_time is None or step_size is None:
            missing = "stop_time" if stop_time is None else "step_size"
            raise SimulationError(f"{path.name} has no default {missing}: give simulate() one")
    names = single.fmu.recorded() if record is None else listed("record", record)
    recorded = {element: place for name in names for element, place in reals(single, name).items()}
    points = communication_points(
        0.0 if start_time is None else start_time, stop_time, step_size, times, signals=len(recorded)
    )
    given = named("inputs", {} if inputs is None else inputs)
    driven = {(path.stem, name): function for name, function in given.items()}
    return run(
        path.stem,
        {path.stem: single},
        recorded=recorded,
        times=points,
        signals=signals({path.stem: single}, driven, points[0]),
        tolerance=experiment.tolerance if tolerance is None else tolerance,
    )


def run(
    title: str,
    parts: Mapping[str, Part],
    *,
    recorded: Mapping[str, Place],
    times: Sequence[float],
    connections: Sequence[Connection] = (),
    signals: Sequence[Drive] = (),
    tolerance: float | None = None,
    coupling: Coupling | None = None,
    error_tolerance: float | None = None,
    progress: bool = False,
) -> Result:
    """Simulate what is connected; see :meth:`liaisons.cosim.System.simulate`.

    :param recorded: name in the result -> variable.
    """
    feeds = {connection.target.place: connection.source.place for connection in connections}
    check_positive("tolerance", tolerance)
    check_positive("error_tolerance", error_tolerance)
    chosen = checks.coupling(parts, connections, coupling)
    parts = checks.prepared(parts, feeds, chosen)
    checks.steps(parts, feeds, times, chosen, adaptive=error_tolerance is not None)
    driven = [place for s in signals for place in s.inputs]
    for place in driven:
        if place in feeds:
            raise SimulationError(f"inputs: {'.'.join(place)} is connected with {'.'.join(feeds[place])} already")
    checks.inputs(parts, feeds, driven)
    execution = Execution(
        parts,
        feeds,
        signals,
        list(recorded.values()),
        times=times,
        settings=Settings(
            tolerance=tolerance,
            coupling=chosen,
            interface_tolerance=max(_INTERFACE * (tolerance or _DEFAULT_TOLERANCE), _FINEST_INTERFACE),
            error_tolerance=error_tolerance,
            progress=title if progress else "",
        ),
    )
    units = {name: _unit(parts, connections, place) for name, place in recorded.items()}

    def result() -> Result:
        return Result(title, execution.times, tuple(recorded), execution.values, units)

    try:
        execution.run()
    except (SimulationError, KeyboardInterrupt) as error:
        if not execution.times.size:
            raise
        if isinstance(error, SimulationError):
            raise IncompleteError(str(error), result()) from error
        reached = f"{title}: interrupted at t = {execution.times[-1]:.10g} of {times[-1]:.10g} s"
        raise Interrupted(f"{reached}; .result of this exception has what there is", result()) from None
    return result()


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


def reals(owner: Part, name: str) -> dict[str, Place]:
    """The places of a real variable, or of the elements of an array, by their names.

    :raises SimulationError: if there is none of this name, or it is of another type.
    """
    names = owner.fmu.elements(name) if name in owner.fmu.arrays else [name]
    return {element: real(owner, element) for element in names}


def real(owner: Part, name: str) -> Place:
    """The place of a real variable.

    :raises SimulationError: if there is none of this name, or it is of another type.
    """
    if name not in owner.fmu.variables:
        raise SimulationError(f"{owner.name}: {owner.fmu.unknown(name)}")
    kind = owner.fmu.variables[name].type
    if kind != "Real":
        raise SimulationError(f"{owner.name}.{name} is {kind}; only Real variables can be recorded and driven")
    return owner.name, name


def signals(parts: Mapping[str, Part], inputs: Mapping[Place, Function], start_time: float) -> list[Drive]:
    """The functions of time that drive inputs.

    :raises SimulationError: if there is no such input, it is driven twice, or what drives it is no function.
    """
    found: list[Drive] = []
    for (owner_name, name), function in inputs.items():
        owner = parts[owner_name]
        place = real(owner, name)
        causality = owner.fmu.variables[name].causality
        if causality != "input":
            raise SimulationError(f"inputs: {owner.name}.{name} is of causality {causality!r}, so it cannot be driven")
        if not callable(function):
            raise SimulationError(
                f"inputs: {name} = {shown(function)} is no function of time; give a constant as start value"
            )
        triple = owner[name].triple()
        whole = triple is not None and evaluate(function, name, start_time).ndim > 0
        found.append(Drive(function, tuple(end.place for end in triple) if triple and whole else (place,)))
    driven = [place for source in found for place in source.inputs]
    for place in driven:
        if driven.count(place) > 1:
            raise SimulationError(f"inputs: {'.'.join(place)} is driven twice, by itself and by its port")
    return found


def check_positive(name: str, value: float | None) -> None:
    """Raise a SimulationError for what is given and no finite number > 0."""
    if value is not None:
        finite(name, value)
        if value <= 0:
            raise SimulationError(f"{name} = {value!r}: must be > 0")


def _unit(parts: Mapping[str, Part], connections: Sequence[Connection], place: Place) -> str:
    """Unit of a variable; if it has none, that of what it is connected with."""
    name, variable = place
    own = parts[name].fmu.variables[variable].unit
    near = (end.variable.unit for connection in connections for end in connection.opposite(place) if end.variable.unit)
    return own or next(near, "")
