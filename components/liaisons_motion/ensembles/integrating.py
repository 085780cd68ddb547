"""Many cases of one component, integrated together."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from liaisons import Result
from liaisons.base.arguments import (
    check_choice,
    check_integer,
    checked_stop_and_step,
    float_array,
    name_dictionary,
    name_list,
)
from liaisons.base.arrays import Floats, lane_blocks, rows_of_blocks
from liaisons.errors import ComponentError, SimulationError, suggestion
from liaisons.expressions import Program
from liaisons.library import Target
from liaisons.library import component as found_component
from liaisons_motion.ensembles.members import Members, model_with_operators
from liaisons_motion.right_hand_sides import (
    LANES,
    METHODS,
    Advance,
    ContinuousModel,
    Tableau,
    compiled_advance,
    continuous_model,
)

_CHUNK = 16
"""Most blocks in one task of a thread."""
_MEMBERS = 256
"""Most members with contacts in one."""
_TASKS = 4
"""Least number of tasks for each thread, so that none waits long for the last one."""
_MOST_STEPS, _MOST_EVENT_STEPS, _MOST_NUMBERS = 10**12, 10**8, 10**10
_MOST_THREADS = 256
_LEAST_RATIO = 2.0
"""Least ratio of the differences before and after halving the steps: that of a method of first order."""
_LARGEST_DIFFERENCE = 0.1
"""Largest relative difference of two runs from which an error is estimated."""
_TIGHTER = 100.0
"""Ratio of the tolerances of two runs from which an error is estimated."""
_EXACT = 1e-8
"""Tolerance of cases whose constraints come near to losing rank, which fixed steps pass over."""
_ROUNDING = 1e-12
"""Largest relative difference that is rounding, which does not shrink with the step."""


def ensemble(
    component: Target,
    start_values: Mapping[str, ArrayLike],
    *,
    stop_time: float,
    step_size: float,
    samples: int = 1,
    start_time: float = 0.0,
    method: Literal["rk4", "rk8"] | None = None,
    operators: Mapping[str, Target] | None = None,
    record: str | Iterable[str] | None = None,
    estimate: bool = True,
    threads: int | None = None,
) -> Result:
    """Results of many cases of a component, integrated together in compiled code.

    All steps have the same size.  If the component has unilateral liaisons or dry friction, each case takes the steps
    of the FMU, of its own sizes, up to its own events, with the same results.  So do cases that come near to states in
    which constraints lose rank or cannot be satisfied; the error of a case that fails there names the prescribed
    coordinate.

    A million steps of a pendulum take some milliseconds.  Inputs keep their values; a coordinate that moves takes an
    operator, whose parameters are values of the cases, too::

        ensemble(Pendulum, {"theta_0": angles, "length.amplitude": 0.1}, operators={"length": Sinusoid}, ...)

    :param component: its name, file or class.
    :param start_values: parameters and inputs by name: a number for all cases, or an array with one for each; the
        others have their defaults.
    :param stop_time: end [s].
    :param step_size: largest step [s], with contacts communication step; made smaller so that the recorded times,
        evenly spaced, are met.
    :param samples: how many times are recorded after the start.
    :param method: ``"rk4"`` (4 evaluations a step, order 4) or ``"rk8"`` (11, order 8).  The order holds where the
        motion is smooth.  ``"rk8"`` if None; with contacts it is that of the FMU, and neither can be taken.
    :param operators: active coordinate -> operator that moves it, by its name, file or class.
    :param record: an output or several; coordinates and momenta if None.
    :param estimate: estimate the error from runs with steps twice and four times as long, which cost three quarters as
        much again: by the order that the three show, rounded up, the method's at most; the first where an operator
        announces instants at which it is not smooth.  Where halving the step does not
        even halve a difference the case's errors are infinite, see :attr:`liaisons.Result.unconverged`: its motion is
        chaotic for that long, or the steps are too large.  With contacts: what a hundredth of the tolerance
        changes, in twice the time; infinite where it is more than a tenth.
    :param threads: how many, 256 at most; one a core if None.
    :returns: signals of shape (times, cases), :meth:`liaisons.Result.error` of each if it is estimated, and
        ``failures``: cases with a value outside its domain, or that left it on the way.
    :raises ComponentError: for an unknown name, with the nearest match, or an operator that is no function of time.
    :raises SimulationError: for a bad number, or arrays that differ in length.
    :raises BuildError: if there is no compiler, or it fails.
    """
    moved = continuous_model(
        found_component(component), "an ensemble", "take sweep(), which runs its FMU", allow_contacts=True
    ).moved_by(operators)
    model, variables = moved.model, moved.variables
    _check_names(model.name, variables, start_values)
    if method is not None:
        check_choice("method", method, tuple(METHODS))
        model.refuse_contacts(f"method = {method!r}", "leave it out: members take the steps of its FMU")
    check_integer("samples", samples)
    _check_steps(start_time, stop_time, step_size, _MOST_EVENT_STEPS if model.contacts else _MOST_STEPS)
    arrays = {name: _checked_values(f"{model.name}: {name}", value) for name, value in start_values.items()}
    count = _case_count(model.name, {name: array for name, array in arrays.items() if array.ndim})
    names = tuple(moved.coordinates_and_momenta if record is None else name_list("record", record))
    try:
        if samples * count > _MOST_NUMBERS:
            raise MemoryError
        time = np.linspace(start_time, stop_time, samples + 1)
        cases = _Cases(moved, arrays, count, names, time, step_size, _thread_count(threads))
        if model.contacts:
            fine, failures, errors = _integrate_by_fmu(cases, estimate=estimate)
        else:
            tableau = METHODS[method or "rk8"]
            fine, failures, errors = _integrate_with_fixed_steps(cases, tableau, estimate=estimate)
    except MemoryError:
        reason = f"samples = {samples} of {count} cases are more numbers than memory holds; record less"
        raise SimulationError(reason) from None
    failures |= {case: (0, text) for case, text in _domain_failures(moved, arrays, count).items()}
    for case, (first, _) in failures.items():
        fine[:, first:, case] = np.nan
    units = {variable.name: variable.unit for variable in model.outputs}
    return Result(
        model.name,
        time,
        names,
        fine,
        {name: units[name] for name in names},
        failures={case: text for case, (_, text) in failures.items()},
        errors=errors,
        compiled=True,
    )


@dataclass(frozen=True, eq=False)
class _Cases:
    """Cases of an ensemble, and what is recorded of them.

    :param arrays: values by name: a number, or one a case.
    :param names: outputs that are recorded, at ``time``.
    """

    moved: ContinuousModel
    arrays: Mapping[str, Floats]
    count: int
    names: Sequence[str]
    time: Floats
    step_size: float
    threads: int

    def steps_per_record(self, divisor: int = 1) -> int:
        """Number of steps from one recorded time to the next, a multiple of ``divisor``."""
        interval = (self.time[-1] - self.time[0]) / (len(self.time) - 1)
        return divisor * math.ceil(interval / self.step_size / divisor - 1e-9)

    def call_in_threads(self, function: Callable[[slice], None], rows: int, max_rows: int) -> None:
        """Call a function in several threads, each time for a slice of at most ``max_rows`` of the rows."""
        size = min(max_rows, -(-rows // (_TASKS * self.threads)))
        chunks = [slice(begin, begin + size) for begin in range(0, rows, size)]
        with ThreadPoolExecutor(min(self.threads, len(chunks))) as pool:
            list(pool.map(function, chunks))


Failures = dict[int, tuple[int, str]]
"""Case -> index of the first recorded time at which it is invalid, and the reason."""


def _integrate_with_fixed_steps(
    cases: _Cases, tableau: Tableau, *, estimate: bool
) -> tuple[Floats, Failures, Floats | None]:
    """Outputs (signals, times, cases), failures, and errors of cases without contacts, by steps of one size."""
    moved, time = cases.moved, cases.time
    lanes = {name: array for name, array in cases.arrays.items() if array.ndim}
    shared = {name: array for name, array in cases.arrays.items() if not array.ndim}
    equations = moved.right_hand_side(lanes=lanes, shared=shared, record=cases.names, start_time=float(time[0]))
    each, once = np.array([*lanes.values()]), np.array([float(array) for array in shared.values()])
    advance = compiled_advance(equations, tableau, once)

    t, *constants, y = equations.symbols
    (start,) = Program.of(constants, [equations.start]).evaluate([each, once[:, None]])
    seen = Program.of([t, *constants, y], [equations.outputs, equations.conditions])

    def recorded(steps: int) -> list[Floats]:
        """Outputs, conditions and states, (rows, times, cases) each, by a number of steps between recorded times."""
        states = _integrated_states(cases, advance, each, start, steps)
        return [*seen.evaluate([time[None, :, None], each[:, None], once[:, None, None], states]), states]

    steps = cases.steps_per_record(4 if estimate else 1)  # with estimate, steps four times as long have to fit
    fine, conditions, states = recorded(steps)
    errors, runs = None, [states]
    if estimate:
        half, quarter = (recorded(part)[::2] for part in (steps // 2, steps // 4))
        smooth = not any(part.events.numel_out(0) for part in (moved.model, *moved.moving.values()))
        errors = _step_halving_errors((fine, states), half, quarter, order=tableau.order if smooth else 1)
        runs += [half[1], quarter[1]]
    failures = _run_failures(fine, conditions, equations.condition_texts, time)
    lost = np.flatnonzero(~np.all([np.isfinite(run[:, -1]).all(axis=0) for run in runs], axis=0))
    if moved.model.reaches and lost.size:
        chosen = {name: array[lost] if array.ndim else array for name, array in cases.arrays.items()}
        few = replace(cases, arrays=chosen, count=lost.size)
        fine[..., lost], refused, corrected = _integrate_by_fmu(few, _EXACT, estimate=estimate)
        failures = {case: text for case, text in failures.items() if case not in lost}
        failures |= {int(lost[case]): text for case, text in refused.items()}
        if errors is not None:
            errors[:, lost] = corrected
    return fine, failures, errors


def _integrate_by_fmu(
    cases: _Cases, tolerance: float | None = None, *, estimate: bool
) -> tuple[Floats, Failures, Floats | None]:
    """Outputs (signals, times, cases), failures, and errors of cases, by the steps of their FMU.

    :param tolerance: that of the model if None.
    """
    cases.moved.check_outputs(cases.names)
    if not cases.names:
        raise ComponentError(f"record = []: name an output of {cases.moved.model.name}")
    model, count = model_with_operators(cases.moved), cases.count
    names = [*cases.arrays]
    values = np.stack([np.broadcast_to(array, count) for array in cases.arrays.values()], axis=-1)
    rows, steps = [*cases.names, *(state.name for state in cases.moved.model.states)], cases.steps_per_record()
    points = np.linspace(cases.time[0], cases.time[-1], (len(cases.time) - 1) * steps + 1)

    tolerance = model.experiment.tolerance if tolerance is None else tolerance
    tolerances = [tolerance / _TIGHTER] * estimate + [tolerance]
    records, reasons = np.empty((len(tolerances), len(cases.time), count, len(rows))), dict[int, str]()

    def run_chunk(chunk: slice) -> None:
        """Record a slice of the cases with each tolerance, and why members fail with the last, that of the model."""
        members = Members(model, len(values[chunk]))
        for record, tolerance in zip(records, tolerances, strict=True):
            members.start(names, values[chunk], time=points[0], tolerance=tolerance)
            record[0, chunk] = members.read(rows)
            for k in range(1, len(record)):
                members.step(points[(k - 1) * steps : k * steps + 1])
                record[k, chunk] = members.read(rows)
        reasons.update((chunk.start + i, reason) for i, reason in members.failures().items())

    cases.call_in_threads(run_chunk, count, _MEMBERS)
    (*tighter, fine), recorded = records.transpose(0, 3, 1, 2), len(cases.names)
    varied = [i for i, array in enumerate(cases.arrays.values()) if array.ndim]
    failures: Failures = {}
    for case, reason in reasons.items():
        own = ", ".join(f"{names[i]} = {values[case, i]:g}" for i in varied)
        failures[case] = int(np.argmax(np.isnan(fine[0, :, case]))), f"{own}: {reason}"
    errors = None
    for exact in tighter:
        changes = np.max(np.where(np.isnan(exact) & ~np.isnan(fine), np.inf, np.abs(fine - exact)), axis=1)
        diverges = changes[recorded:] > _LARGEST_DIFFERENCE * np.max(np.abs(fine[recorded:]), axis=1)
        errors = np.where(diverges.any(axis=0), np.inf, changes[:recorded])
    return fine[:recorded].copy(), failures, errors


def _integrated_states(cases: _Cases, advance: Advance, lanes: Floats, start: Floats, steps: int) -> Floats:
    """States at all recorded times, (states, times, cases), integrated in blocks of lanes.

    :param lanes: values that differ between the cases, (values, cases).
    :param steps: number between recorded times.
    """
    values, first = lane_blocks(lanes, LANES), lane_blocks(start, LANES)
    records = np.empty((len(cases.time), *first.shape))
    records[0] = first

    def advance_chunk(chunk: slice) -> None:
        """Integrate a slice of the blocks from the first recorded time to the last."""
        for k, (begin_time, end_time) in enumerate(pairwise(cases.time)):
            states = records[k, chunk].copy()
            advance(begin_time, (end_time - begin_time) / steps, steps, values[chunk], states)
            records[k + 1, chunk] = states

    cases.call_in_threads(advance_chunk, len(values), _CHUNK)
    return rows_of_blocks(records, start.shape[1]).swapaxes(0, 1)


Run = Sequence[Floats]
"""Outputs and states, (rows, times, cases)."""


def _step_halving_errors(fine: Run, half: Run, quarter: Run, *, order: int) -> Floats:
    """Largest errors of the finest of three runs, (signals, cases); infinite for cases that do not converge.

    Convergence is that of the states: a single signal may agree by chance.

    :param half: with steps twice as long; ``quarter``: four times.
    :param order: of the method, the largest that errors may show.
    """
    (near, far), changes = (
        [np.max(np.abs(a[row] - b[row]), axis=1) for a, b in ((fine, half), (half, quarter))] for row in (0, 1)
    )
    size = np.max(np.abs(fine[1]), axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        last, previous = (np.max(np.where(x <= _ROUNDING * size, 0, x / size), axis=0) for x in changes)
        ratio = previous / last
        shown = np.where(last > 0, np.clip(np.ceil(np.log2(ratio)), 1, order), 1)
        if order == 1:  # rates jump inside steps, in each run elsewhere: what halving the steps changes is not regular
            return np.where(last > _LARGEST_DIFFERENCE, np.inf, np.maximum(near, far / 2))
        diverges = (last > 0) & ((ratio <= _LEAST_RATIO) | (last > _LARGEST_DIFFERENCE))
    return np.where(diverges, np.inf, near / (2**shown - 1))


def _checked_values(label: str, value: ArrayLike) -> Floats:
    """Array of a value, either a number or one number a case."""
    array = float_array(label, value)
    if array.ndim > 1:
        raise SimulationError(f"{label} has shape {array.shape}; give one number a case")
    return array


def _case_count(owner: str, arrays: Mapping[str, Floats]) -> int:
    """Common length of the arrays, each with one number a case."""
    counts = {name: len(array) for name, array in arrays.items()}
    if len(set(counts.values())) > 1:
        lengths = ", ".join(f"{name} {count}" for name, count in counts.items())
        raise SimulationError(f"{owner}: arrays of different lengths: {lengths}; give one number a case")
    if not any(counts.values()):
        reason = f"{next(iter(counts))} is empty" if counts else "no value is an array"
        raise SimulationError(f"{owner}: {reason}, so there are no cases; give one number a case")
    return next(iter(counts.values()))


def _domain_failures(moved: ContinuousModel, arrays: Mapping[str, Floats], count: int) -> dict[int, str]:
    """Reasons of the cases that have a value outside its domain."""
    texts: dict[int, str] = {}
    for name, array in arrays.items():
        variable, values = moved.variables[name], np.broadcast_to(array, count)
        allowed = np.all([np.isfinite(values), *(gap > 0 for gap in moved.domain_gaps(name, values))], axis=0)
        for case in np.flatnonzero(~allowed).tolist():
            texts.setdefault(case, f"{name} = {values[case]:g}: must be {variable.domain() or 'finite'}")
    return texts


def _run_failures(outputs: Floats, conditions: Floats, texts: tuple[str, ...], time: Floats) -> Failures:
    """Failures of cases that leave a domain or have outputs that are not finite.

    :param conditions: one row for each of the texts, > 0 while it holds.
    """
    checks = {f"{text} (t = {{:g}} s)": row > 0 for text, row in zip(texts, conditions, strict=True)}
    checks["no longer finite at t = {:g} s; take smaller steps"] = np.isfinite(outputs).all(axis=0)
    failures: Failures = {}
    for text, holds in checks.items():
        for case in np.flatnonzero(~holds.all(axis=0)).tolist():
            first = int(np.argmin(holds[:, case]))
            if first < failures.get(case, (len(time), ""))[0]:
                failures[case] = (first, text.format(time[first]))
    return failures


def _check_names(title: str, variables: Iterable[str], start_values: Mapping[str, ArrayLike]) -> None:
    """Check that all values are of variables that can be set.

    :raises ComponentError: naming one that is not.
    """
    for name in name_dictionary("start_values", start_values):
        if name not in variables:
            raise ComponentError(f"{title} has no value {name!r} to set{suggestion(name, variables)}")


def _thread_count(asked: int | None) -> int:
    """Number of threads: as asked, else one a core."""
    if asked is not None:
        check_integer("threads", asked)
    return min(asked or os.cpu_count() or 1, _MOST_THREADS)


def _check_steps(start_time: float, stop_time: float, step_size: float, most: float) -> None:
    """Check that there are not too many steps from start to stop [s].

    :raises SimulationError: if there are, or for a bad number.
    """
    checked_stop_and_step(start_time, stop_time, step_size)
    if not (stop_time - start_time) / step_size < most:
        raise SimulationError(
            f"step_size = {step_size!r}: too many steps until stop_time = {stop_time!r}; take larger ones"
        )
