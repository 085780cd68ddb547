"""Many members of one component, integrated together."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Literal, final, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.arguments import chosen, finite, listed, named, numbers, whole
from liaisons.ensembles.equations import Equations, Settable, default_record, equations
from liaisons.ensembles.kernel import LANES, Advance, kernel
from liaisons.ensembles.methods import METHODS
from liaisons.errors import SimulationError
from liaisons.expressions import program
from liaisons.language import Variable
from liaisons.library import Target
from liaisons.library import component as find
from liaisons.results import Result

Method = Literal["rk4", "rk8"]
Backend = Literal["auto", "native", "numpy"]
Floats = NDArray[np.float64]

_CHUNK = 16  # blocks that a thread takes at once


def ensemble(
    component: Target,
    values: Mapping[str, ArrayLike],
    *,
    stop_time: float,
    step_size: float,
    samples: int = 1,
    start_time: float = 0.0,
    method: Method = "rk8",
    operators: Mapping[str, Target] | None = None,
    record: str | Iterable[str] | None = None,
    estimate: bool = True,
    threads: int | None = None,
    backend: Backend = "auto",
) -> Result:
    """Integrate many members of a component with steps of one size.

    A million steps of a pendulum take some milliseconds.  Inputs keep their values; a coordinate that moves takes an
    operator, whose parameters are values of the members, too::

        ensemble(Pendulum, {"theta_0": angles, "length.amplitude": 0.1}, operators={"length": Sinusoid}, ...)

    :param component: its name, file or class.
    :param values: parameters and inputs by name: a number for all members, or an array with one for each; what is not
        given has its default.
    :param stop_time: end [s].
    :param step_size: largest step [s]; made smaller so that the recorded times, evenly spaced, are met.
    :param samples: how many times are recorded after the start.
    :param method: ``"rk4"`` (4 evaluations a step, order 4) or ``"rk8"`` (11, order 8).  The order holds where the
        motion is smooth.
    :param operators: active coordinate -> operator that moves it, by its name, file or class.
    :param record: an output or several; coordinates and momenta if None.
    :param estimate: estimate the error from a second run with steps twice as long, which costs half as much again.
    :param threads: how many; one a core if None.
    :param backend: ``"native"``: C, compiled for this machine; ``"numpy"``; ``"auto"``: C where there is a compiler.
    :raises ComponentError: for an unknown name, with the nearest match, or an operator that is no function of time.
    :raises SimulationError: for a bad number, or arrays that differ in length.
    :raises BuildError: if the compiler fails.
    """
    kind = find(component)
    moving = {
        name: find(operator) for name, operator in named("operators", {} if operators is None else operators).items()
    }
    settable = Settable(kind, moving)
    settable.check(named("values", values))
    chosen("method", method, get_args(Method))
    chosen("backend", backend, get_args(Backend))
    if threads is not None:
        whole("threads", threads)
    title = kind.__name__
    given = {name: _array(title, name, value) for name, value in values.items()}
    lanes = {name: array for name, array in given.items() if array.ndim}
    count = _members(title, lanes)
    _check_times(start_time, stop_time, step_size, samples)

    names = tuple(default_record(settable.model) if record is None else listed("record", record))
    shared = {name: array for name, array in given.items() if not array.ndim}
    found = equations(settable, lanes, shared, names)
    once = np.array([float(array) for array in shared.values()])
    prepared = kernel(found, method, once, native=None if backend == "auto" else backend == "native")

    time = np.linspace(start_time, stop_time, samples + 1)
    pairs = math.ceil((stop_time - start_time) / samples / step_size / 2 - 1e-9)
    run = _Run(found, lanes, once, count=count, time=time, threads=threads or os.cpu_count() or 1)
    fine, conditions = run.outputs(prepared.advance, 2 * pairs)
    errors = None
    if estimate:
        coarse, _ = run.outputs(prepared.advance, pairs)
        errors = np.max(np.abs(fine - coarse), axis=1) / (2 ** METHODS[method].order - 1)
    failures = _lost(fine, conditions, found.condition_texts, time)
    failures |= {member: (0, text) for member, text in _outside(settable.variables, given, count).items()}
    for member, (first, _) in failures.items():
        fine[:, first:, member] = np.nan
    units = {variable.name: variable.unit for variable in settable.model.outputs}
    return Result(
        title=title,
        time=time,
        names=names,
        values=fine,
        units={name: units[name] for name in names},
        errors=errors,
        failures={member: text for member, (_, text) in failures.items()},
        compiled=prepared.compiled,
    )


@final
class _Run:
    """Members in blocks of lanes, from the start to the end.

    :param lanes: values by name, (count,) each.
    """

    def __init__(
        self,
        found: Equations,
        lanes: Mapping[str, Floats],
        shared: Floats,
        *,
        count: int,
        time: Floats,
        threads: int,
    ) -> None:
        self._count = count
        self._time = time
        self._threads = threads
        self._shared = shared[:, None]
        self._constants = np.array([*lanes.values()]).reshape(len(lanes), count)
        t, lane_symbols, shared_symbols = found.constants
        symbols = [t, lane_symbols, shared_symbols]
        begin = program(symbols, [found.start, found.memory_start, found.start_conditions])
        at_begin = [np.array([[time[0]]]), self._constants, self._shared]
        self._start, self._memory, self._start_conditions = (
            np.broadcast_to(array, (len(array), count)) for array in begin.evaluate(at_begin)
        )
        self._outputs = program([*symbols, found.y, found.memory], [found.outputs, found.conditions])

    def outputs(self, advance: Advance, steps: int) -> tuple[Floats, Floats]:
        """Outputs and conditions, (rows, times, members) each, with so many steps from one time to the next."""
        records = np.empty((len(self._time), *self._blocks(self._start).shape))
        records[0] = self._blocks(self._start)
        constants = self._blocks(self._constants)

        def advance_chunk(first: int) -> None:
            chunk = slice(first, first + _CHUNK)
            for k, (begin, end) in enumerate(zip(self._time[:-1], self._time[1:], strict=True)):
                state = records[k, chunk].copy()
                advance(begin, (end - begin) / steps, steps, constants[chunk], state)
                records[k + 1, chunk] = state

        firsts = range(0, len(constants), _CHUNK)
        if self._threads == 1 or len(firsts) == 1:
            for first in firsts:
                advance_chunk(first)
        else:
            with ThreadPoolExecutor(self._threads) as pool:
                list(pool.map(advance_chunk, firsts))
        y = records.transpose(2, 0, 1, 3).reshape(len(self._start), len(self._time), -1)[..., : self._count]
        every = [self._time[None, :, None], self._constants[:, None], self._shared[:, None], y, self._memory[:, None]]
        outputs, conditions = self._outputs.evaluate(every)
        padded = np.ones((len(self._start_conditions), *conditions.shape[1:]))
        padded[:, 0] = self._start_conditions
        return outputs, np.concatenate([conditions, padded])

    def _blocks(self, rows: Floats) -> Floats:
        """(rows, members) as (blocks, rows, LANES); the last block is filled up with the last member."""
        blocks = -(-self._count // LANES)
        padded = np.pad(rows, ((0, 0), (0, blocks * LANES - self._count)), mode="edge")
        return np.ascontiguousarray(padded.reshape(len(rows), blocks, LANES).swapaxes(0, 1))


def _array(owner: str, name: str, value: ArrayLike) -> Floats:
    array = numbers(f"{owner}: {name}", value)
    if array.ndim > 1:
        raise SimulationError(f"{owner}: {name} has shape {array.shape}; give one number a member")
    return array


def _members(owner: str, lanes: Mapping[str, Floats]) -> int:
    counts = {name: len(array) for name, array in lanes.items()}
    if not counts:
        raise SimulationError(f"{owner}: no value is an array, so there are no members; give one number a member")
    if len(set(counts.values())) > 1:
        said = ", ".join(f"{name} {count}" for name, count in counts.items())
        raise SimulationError(f"{owner}: arrays of different lengths: {said}; give one number a member")
    count = next(iter(counts.values()))
    if count == 0:
        raise SimulationError(f"{owner}: {next(iter(counts))} is empty, so there are no members")
    return count


def _check_times(start_time: float, stop_time: float, step_size: float, samples: int) -> None:
    for name, value in (("start_time", start_time), ("stop_time", stop_time), ("step_size", step_size)):
        finite(name, value)
    if stop_time <= start_time:
        raise SimulationError(f"stop_time = {stop_time!r}: must be greater than start_time = {start_time!r}")
    if step_size <= 0:
        raise SimulationError(f"step_size = {step_size!r}: must be > 0")
    whole("samples", samples)


def _outside(variables: Mapping[str, Variable], given: Mapping[str, Floats], members: int) -> dict[int, str]:
    """Members with a value outside its domain."""
    found: dict[int, str] = {}
    for name, array in given.items():
        everyone = np.broadcast_to(array, members)
        for member in np.flatnonzero(~_allowed(variables[name], everyone)):
            text = f"{name} = {everyone[member]:g}: must be {variables[name].domain() or 'finite'}"
            found.setdefault(int(member), text)
    return found


def _lost(outputs: Floats, conditions: Floats, texts: tuple[str, ...], time: Floats) -> dict[int, tuple[int, str]]:
    """Member -> from which time on it is not to be used, and why."""
    checks = {f"{text} (t = {{:g}} s)": row > 0 for text, row in zip(texts, conditions, strict=True)}
    checks["no longer finite at t = {:g} s; take smaller steps"] = np.isfinite(outputs).all(axis=0)
    found: dict[int, tuple[int, str]] = {}
    for text, holds in checks.items():
        for member in np.flatnonzero(~holds.all(axis=0)):
            first = int(np.argmin(holds[:, member]))
            if first < found.get(int(member), (len(time), ""))[0]:
                found[int(member)] = (first, text.format(time[first]))
    return found


def _allowed(variable: Variable, values: Floats) -> NDArray[np.bool_]:
    allowed = np.isfinite(values)
    if variable.minimum is not None:
        allowed &= (values > variable.minimum) if variable.strict else (values >= variable.minimum)
    if variable.maximum is not None:
        allowed &= (values < variable.maximum) if variable.strict else (values <= variable.maximum)
    return allowed
