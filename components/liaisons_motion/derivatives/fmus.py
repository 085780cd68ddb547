"""Motions of FMUs that are not ours, and of systems that cannot be flattened, with derivatives by their values.

The variational equations of an FMU of Model Exchange take directional derivatives by states from the FMU, and those by
values from differences of the rates, for FMI has parameters among the known variables in initialization only.  Other
derivatives are extrapolated from differences of runs as ``simulate`` performs them, by Co-Simulation where an FMU is
made for it: the error of its steps is differentiated, too.  Where an event lies between the runs, their differences
contradict each other, and derivatives are not-a-number.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import count, pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self, final

import numpy as np
from numpy.typing import ArrayLike

from liaisons import Result, System, simulate
from liaisons.base.arguments import float_array, name_list
from liaisons.base.arrays import Floats
from liaisons.base.differences import SIZES, extrapolated_derivative
from liaisons.base.logs import logger
from liaisons.base.reference_integration import integrate
from liaisons.errors import RefusedError, SimulationError
from liaisons.linearization import FmuEquations
from liaisons_motion.derivatives.inputs import input_functions
from liaisons_motion.derivatives.motion import Branch

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

_RUN_SIZES = (4e-3, 2e-3, 1e-3)
"""Sizes of differences of runs, relative to those of the values."""
_SMOOTH_ERROR = 1e-3
"""Largest relative contradiction of differences."""
_SWITCHED_ERROR = 1e-5
"""The same where discrete variables of the runs differ."""
_NOISE = 1e-6
"""What the tolerances of two runs add to signals, relative to the change of a value."""
_MOST_CALLS = 200_000
"""Evaluations of the equations in one motion."""
_ROUNDING = 1e-12
"""Relative distance of two roundings of one instant."""
_MODES = frozenset({"Integer", "Boolean", "Enumeration"})
_EVENT_POINTS = 40
"""Instants to each side of a time at which an event is sought, each a fifth nearer."""
_RATE_POINTS = 8
"""Points in an interval for the time derivatives of signals."""


@final
@dataclass(frozen=True, eq=False)
class FmuMotion:
    """A motion of FMUs as a function of some values, with the interface of a ``DifferentiableMotion``.

    :param path: of the FMU, whose variables have no prefix; None: of a system.
    :param starts: start values that differ from those of the system.
    :param inputs: input -> piecewise polynomial of time.
    :param times: recorded [s], from ``start_time`` on, where runs have communication points.
    :param names: of the values, element by element; ``values`` as set or declared.
    :param signals: names of what is recorded; ``units`` of names and signals.
    :param method: how derivatives are calculated.
    """

    system: System
    path: Path | None
    starts: Mapping[str, Any]
    inputs: Mapping[str, PPoly]
    start_time: float
    tolerance: float
    times: Floats
    names: tuple[str, ...] = ()
    values: Floats = field(default_factory=lambda: np.empty(0))
    signals: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    method: str = "differences"
    has_contacts: ClassVar = False

    @property
    def name(self) -> str:
        """Name of the system."""
        return self.system.name

    def __call__(self, values: ArrayLike) -> Floats:
        """Signals, (signals, times)."""
        return self._signals_and_derivatives(values, derive=False)[0]

    def forward(self, values: ArrayLike) -> tuple[Floats, Floats]:
        """Signals, and their derivatives by the values, (signals, times, values); not-a-number beside events."""
        return self._signals_and_derivatives(values)

    def branch(self, values: ArrayLike) -> Branch:
        """Signals and their derivatives."""
        return Branch(*self.forward(values))

    def adjoint(self, values: ArrayLike, weights: ArrayLike | Callable[[Floats], ArrayLike]) -> tuple[Floats, Floats]:
        """Signals, and derivatives of their weighted sum by the values, (values,)."""
        signals, derivatives = self.forward(values)
        factors = np.asarray(weights(signals) if callable(weights) else weights, dtype=float)
        return signals, np.tensordot(factors, np.where(factors[..., None] == 0, 0.0, derivatives))

    def rates(self, values: ArrayLike) -> Floats:
        """Time derivatives of the signals, (signals, times), by a quintic spline through further points."""
        from scipy.interpolate import make_interp_spline

        ends = np.unique([self.start_time, *self.times])
        points = np.unique([np.linspace(*pair, _RATE_POINTS + 1) for pair in pairwise(ends)])
        return make_interp_spline(points, self.at(points)(values), k=5, axis=1).derivative()(self.times)

    def at(self, times: ArrayLike) -> Self:
        """The same motion, recorded at other times."""
        return replace(self, times=float_array("times", times))

    def frozen(self, values: ArrayLike) -> Self:  # noqa: ARG002
        """The same motion: FMUs choose their steps in each run."""
        return self

    def result(self, values: Mapping[str, Any], record: Sequence[str]) -> Result:
        """Result of a run of the FMUs with further start values."""
        starts, document = {**self.starts, **values}, replace(self.system.document, single=self.path is not None)
        options = {"times": self._integration_times(), "tolerance": self.tolerance, "record": record}
        functions = input_functions(document, self.inputs)
        if self.path is not None:
            return simulate(self.path, **options, inputs=functions, start_values=starts)
        return self.system.with_start_values(starts).simulate(**options, inputs=functions)

    def equations(self, values: Floats) -> FmuEquations:
        """Equations of the single FMU."""
        assert self.path is not None
        starts = {**self.starts, **self._values_by_name(values)}
        return FmuEquations(self.path, starts, inputs=self.inputs, outputs=self.signals, time=self.start_time)

    def _values_by_name(self, values: Floats) -> dict[str, float]:
        """Values as a dictionary by their names."""
        return dict(zip(self.names, values.tolist(), strict=True))

    def _integration_times(self) -> Floats:
        """Communication points of a run: start, recorded times, and breaks of inputs between them [s]."""
        ends = [x for polynomial in self.inputs.values() for x in polynomial.x]
        asked = np.array([self.start_time, *self.times])
        apart = [t for t in ends if np.abs(asked - t).min() > _ROUNDING * abs(t)]
        points = np.unique([*asked, *apart])
        return points[(self.start_time <= points) & (points <= self.times[-1])]

    def _signals_and_derivatives(self, values: ArrayLike, *, derive: bool = True) -> tuple[Floats, Floats]:
        """Signals, and their derivatives by the values unless these are not asked for."""
        numbers = np.asarray(values, dtype=float)
        changes = np.diag(np.where(numbers == 0, 1.0, np.abs(numbers)))[: len(numbers) * derive]
        return (self._runs_and_differences if self.method == "differences" else self._variational_solution)(
            numbers, changes
        )

    def _runs_and_differences(self, values: Floats, changes: Floats) -> tuple[Floats, Floats]:
        """Signals, and their derivatives by differences of runs; not-a-number where an event lies between the runs."""
        discrete = self._discrete_variables()

        def run(values: Floats) -> Floats:
            """Signals and discrete variables at the recorded times."""
            result = self.result(self._values_by_name(values), [*self.signals, *discrete])
            if result.time[-1] < self.times[-1]:
                raise SimulationError(f"{self.name} ends at t = {result.time[-1]:g} s; choose earlier times")
            return result.values[:, np.searchsorted(result.time, self.times)]

        count, middle = len(self.signals), run(values)
        signals, columns = middle[:count], list[Floats]()
        beside = np.zeros(len(self.times), dtype=bool)
        for change in changes:
            runs: dict[float, Floats] = {0.0: middle}

            def displaced(h: float, change: Floats = change, runs: dict[float, Floats] = runs) -> Floats:
                """Signals of the run that is displaced by a multiple of the change."""
                if h not in runs:
                    runs[h] = run(values + h * change)
                return runs[h][:count]

            unit = change.sum()
            column, error = extrapolated_derivative(displaced, unit, _RUN_SIZES)
            if all({h, -h} <= runs.keys() for h in _RUN_SIZES):  # half of what those to both sides differ by, at h = 0
                sides = [(displaced(h) - 2 * signals + displaced(-h)) / (2 * h * unit) for h in _RUN_SIZES]
                coarse, fine = (2 * small - large for large, small in pairwise(sides))
                error = np.fmax(error, np.abs(8 * fine - coarse) / 7)
            switched = np.any([(other[count:] != middle[count:]).any(axis=0) for other in runs.values()], axis=0)
            size = np.abs(column) + np.median(np.abs(column), axis=1, keepdims=True)
            noise = _NOISE * np.abs(signals).max(axis=1, keepdims=True) / unit
            wrong = error > np.where(switched, _SWITCHED_ERROR, _SMOOTH_ERROR) * size + noise
            beside |= wrong.any(axis=0)
            columns.append(np.where(wrong, np.nan, column))
        if beside.any():
            self._warn_of_events(values, discrete, self.times[beside])
        return signals, np.moveaxis(np.reshape(columns, (len(columns), *signals.shape)), 0, 2)

    def _discrete_variables(self) -> list[str]:
        """Names of the integer and Boolean variables, which change at events."""
        return [
            name if self.path else f"{part.name}.{name}"
            for part in self.system.parts.values()
            for entry in part.fmu.variables.entries.values()
            if entry.prototype.type in _MODES and entry.prototype.causality in {"output", "local"}
            for name in entry.names()
        ]

    def _warn_of_events(self, values: Floats, discrete: Sequence[str], times: Floats) -> None:
        """Log the times without derivatives, and the event beside the first of these."""
        text = "two branches of the motion meet there"
        if discrete:
            at = int(np.searchsorted(self.times, times[0]))
            low, high = self.times[at - 1] if at else self.start_time, self.times[min(at + 1, len(self.times) - 1)]
            near = 0.8 ** np.arange(_EVENT_POINTS)
            points = np.unique([times[0], *times[0] - near * (times[0] - low), *times[0] + near * (high - times[0])])
            result = self.at(points).result(self._values_by_name(values), discrete)
            steps = np.diff(result.values, axis=1) != 0
            if steps.any():
                changed = np.flatnonzero(steps.any(axis=0))
                middles = (result.time[1:] + result.time[:-1])[changed] / 2
                event = int(np.argmin(np.abs(middles - times[0])))
                name = discrete[int(steps[:, changed[event]].argmax())]
                text = f"{name} changes at {middles[event]:.5g} s"
        more = f" and {len(times) - 3} more" if len(times) > 3 else ""
        listed_times = ", ".join(f"{time:g}" for time in times[:3]) + more
        logger.warning("%s: derivatives are not-a-number at t = %s s: %s", self.name, listed_times, text)

    def _variational_solution(self, values: Floats, changes: Floats) -> tuple[Floats, Floats]:
        """Signals, and their derivatives from the variational equations."""
        with ExitStack() as stack:
            equations = stack.enter_context(self.equations(values))
            neighbours = [
                {h: stack.enter_context(self.equations(values + h * change)) for s in SIZES for h in (s, -s)}
                for change in changes
            ]
            states, calls = len(equations.x), count()

            derivatives_by_values = partial(_derivatives_by_values, neighbours, [change.sum() for change in changes])

            def rates_and_outputs(t: float, z: Floats, end: float) -> Floats:
                """Rates and outputs in the first column, their derivatives by the values in the others."""
                u = np.array([polynomial(min(t, np.nextafter(end, -np.inf))) for polynomial in self.inputs.values()])
                columns = [equations(t, z[:, 0], u)]
                if len(changes):
                    along = equations.directional_derivatives(np.pad(z[:, 1:], ((0, len(u)), (0, 0))))
                    columns += [*(along.T + derivatives_by_values(lambda fmu: fmu(t, z[:, 0], u)))]
                return np.transpose(columns)

            def rates(t: float, z: Floats, end: float) -> Floats:
                """Rates of states and derivatives; not-a-number where the FMU refuses them."""
                if next(calls) > _MOST_CALLS:
                    raise SimulationError(f"{self.name}: {_MOST_CALLS} evaluations are too few; it may be stiff")
                try:
                    return rates_and_outputs(t, z.reshape(states, -1), end)[:states].ravel()
                except RefusedError:  # a shorter step may do
                    return np.full_like(z, np.nan)

            z, recorded = np.transpose([equations.x, *derivatives_by_values(lambda fmu: fmu.x)]), {}
            tolerances = {"rtol": self.tolerance, "atol": self.tolerance * equations.sizes.min()}
            for begin, end in pairwise([self.start_time, *self._integration_times().tolist()]):
                if begin < end:
                    moving, span = partial(rates, end=end), (begin, end)
                    states_on_way = integrate(self.name, moving, z.ravel(), span, **tolerances, error=SimulationError)
                    z = states_on_way[:, -1].reshape(z.shape)
                recorded[end] = rates_and_outputs(end, z, end)[states:]
        result = np.stack([recorded[time] for time in self.times.tolist()], axis=1)
        return result[..., 0], result[..., 1:]


def fmu_motion(
    subject: Path | System,
    by: str | Iterable[str],
    times: Floats,
    *,
    start_time: float = 0.0,
    record: str | Iterable[str] | None = None,
    inputs: Mapping[str, PPoly] | None = None,
    start_values: Mapping[str, ArrayLike] | None = None,
    tolerance: float = 1e-10,
) -> FmuMotion:
    """The motion of an FMU or a system as a function of some of its values.

    :param by: parameters, start values and inputs; of a system ``"component.variable"``.
    :param record: outputs or other variables; None: all outputs.
    :param inputs: input or active coordinate -> piecewise polynomial of time.
    :param tolerance: relative.
    :raises SimulationError: for an unknown name or an invalid value, or if differences contradict directional
        derivatives by states.
    """
    system, path = (subject, None) if isinstance(subject, System) else (System(subject.stem), subject)
    if path is not None:
        system.add(system.name, path)
    motion = FmuMotion(system, path, start_values or {}, inputs or {}, start_time, tolerance, times)
    if record is None:
        outputs = [(part, name) for part in system.parts.values() for name in part.fmu.reals("output")]
        record = [name if path else f"{part.name}.{name}" for part, name in outputs]
    starts, signals = motion.result({}, name_list("by", by)), motion.result({}, name_list("record", record))
    motion = replace(
        motion,
        names=starts.names,
        values=starts.values[:, 0],
        signals=signals.names,
        units={**starts.units, **signals.units},
    )
    if path and FmuEquations.are_differentiable(path):
        with motion.equations(motion.values) as equations:
            if equations.states and not equations.has_events:
                equations.checked_jacobian()
                return replace(motion, method="directional derivatives")
    return motion


def _derivatives_by_values(
    neighbours: Sequence[Mapping[float, FmuEquations]],
    changes: Sequence[float],
    function: Callable[[FmuEquations], Floats],
) -> list[Floats]:
    """Derivatives of a function of the equations by each value, from differences.

    :param neighbours: of each value: multiple of its change -> the equations there.
    """
    return [
        extrapolated_derivative(lambda h, fmus=fmus: function(fmus[h]), change)[0]
        for fmus, change in zip(neighbours, changes, strict=True)
    ]
