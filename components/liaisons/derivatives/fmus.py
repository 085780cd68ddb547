"""Motions of FMUs that are not ours, and of systems that cannot be flattened, with derivatives by their values.

The variational equations of an FMU of Model Exchange take directional derivatives by states from the FMU, and those by
values from differences of the rates, for FMI has parameters among the known variables in initialization only.  Other
derivatives are extrapolated from differences of whole runs with the same communication points.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, final

import numpy as np
from numpy.typing import ArrayLike

from liaisons.arguments import listed, numbers
from liaisons.cosim import Port, Result, System
from liaisons.cosim.description.fmu import read
from liaisons.cosim.description.start_values import start_values as valid
from liaisons.cosim.running.run import performed
from liaisons.cosim.structure.simulation import SimulationSettings, checked, owned
from liaisons.derivatives.fmu_equations import Floats, FmuEquations, Method
from liaisons.ensembles.methods import METHODS
from liaisons.errors import LiaisonsError, RefusedError, SimulationError

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

_METHOD = METHODS["rk8"]
_MOST_STEPS = 2**12
"""Between two recorded times."""
_OF_EQUATIONS, _OF_RUNS = (1e-3, 5e-4), (4e-3, 2e-3, 1e-3)
"""Sizes of differences that are extrapolated, relative to those of the values."""
_FINER = 8
"""Points in an interval for the time derivatives of signals."""

Evaluation = Callable[[Floats, Floats, bool], tuple[Floats, Floats, Floats]]
"""From values and times: signals, (signals, times); if they are asked for, their derivatives, (signals, times, values),
and estimates of the errors of these, (signals, values)."""


@final
@dataclass(frozen=True, eq=False)
class FmuMotion:
    """A motion as a function of some values, with the interface of a ``DifferentiableMotion``.

    :param names: of the values, element by element; ``values`` as set or declared.
    :param signals: names of what is recorded; ``units`` of names and signals.
    :param times: recorded [s].
    :param method: how derivatives are calculated.
    """

    name: str
    names: tuple[str, ...]
    signals: tuple[str, ...]
    units: Mapping[str, str]
    values: Floats
    times: Floats
    start_time: float
    method: Method
    evaluation: Evaluation

    def __call__(self, values: ArrayLike) -> Floats:
        """Signals, (signals, times)."""
        return self.evaluation(np.asarray(values, dtype=float), self.times, False)[0]

    def forward(self, values: ArrayLike) -> tuple[Floats, Floats]:
        """Signals, and their derivatives by the values, (signals, times, values)."""
        return self.evaluation(np.asarray(values, dtype=float), self.times, True)[:2]

    def errors(self, values: ArrayLike) -> Floats:
        """Estimates of the largest errors of differences over time, (signals, values)."""
        return self.evaluation(np.asarray(values, dtype=float), self.times, True)[2]

    def adjoint(self, values: ArrayLike, weights: ArrayLike | Callable[[Floats], ArrayLike]) -> tuple[Floats, Floats]:
        """Signals, and derivatives of their weighted sum by the values, (values,)."""
        signals, derivatives = self.forward(values)
        factors = np.asarray(weights(signals) if callable(weights) else weights, dtype=float)
        return signals, np.tensordot(factors, derivatives)

    def rates(self, values: ArrayLike) -> Floats:
        """Time derivatives of the signals, (signals, times), of a quintic spline through more points."""
        from scipy.interpolate import make_interp_spline

        ends = np.unique([self.start_time, *self.times])
        points = np.unique([np.linspace(*pair, _FINER + 1) for pair in pairwise(ends)])
        return make_interp_spline(points, self.at(points)(values), k=5, axis=1).derivative()(self.times)

    def at(self, times: ArrayLike) -> Self:
        """The same with other times."""
        return replace(self, times=numbers("times", times))

    def frozen(self, values: ArrayLike) -> Self:  # noqa: ARG002
        """The same: FMUs choose their steps in each run."""
        return self


def fmu_motion(
    subject: Path | System,
    by: str | Iterable[str],
    times: ArrayLike,
    *,
    start_time: float = 0.0,
    record: str | Iterable[str] | None = None,
    inputs: Mapping[str, PPoly] | None = None,
    start_values: Mapping[str, ArrayLike] | None = None,
    tolerance: float = 1e-10,
) -> FmuMotion:
    """The motion of an FMU or a system as a function of some of its values.

    :param by: parameters, start values and inputs; of a system ``"component.variable"``.
    :param times: recorded [s], ascending; runs have their communication points there.
    :param record: outputs or other variables; None: all outputs, of runs inputs, too.
    :param inputs: input or active coordinate -> piecewise polynomial of time.
    :param start_values: where they differ from those of the FMU or the system.
    :param tolerance: relative.
    :raises SimulationError: for an unknown name or an invalid value, or if differences contradict directional
        derivatives by states.
    """
    single, points, starts = not isinstance(subject, System), numbers("times", times), dict(start_values or {})
    system = System(Path(subject).stem) if not isinstance(subject, System) else subject
    if not isinstance(subject, System):
        system.add(system.name, subject)
    runs = _Runs(system, single, starts, inputs or {}, start_time, tolerance)
    own, first = runs.result({}, listed("by", by), points), runs.result({}, runs.recorded(record), points)
    values, method, evaluation = own.values[:, 0], "differences", runs.evaluation(own.names, first.names)
    if not isinstance(subject, System) and read(subject, prefers="ModelExchange").provides_directional_derivatives:
        variational = _VariationalEquations(subject, own.names, first.names, starts, runs.inputs, start_time, tolerance)
        with variational.equations(values) as equations:
            if not equations.has_events:
                equations.jacobian()
                method, evaluation = "directional derivatives", variational.evaluate
    units = {**own.units, **first.units}
    return FmuMotion(system.name, own.names, first.names, units, values, points, start_time, method, evaluation)


def _moves(values: Floats) -> Floats:
    """The size of each value, in a row of its own."""
    return np.diag(np.where(values == 0, 1.0, np.abs(values)))


def _extrapolated(function: Callable[[float], Floats], sizes: Sequence[float], unit: float) -> tuple[Floats, Floats]:
    """Richardson's extrapolation of central differences, each half as large, and an estimate of its error."""
    try:
        row, ratio = [(function(h) - function(-h)) / (2 * h * unit) for h in sizes], 4.0
    except LiaisonsError:  # the edge of a domain: differences to one side
        begin = function(0.0)
        row, ratio = [(function(h) - begin) / (h * unit) for h in sizes], 2.0
    error, factor = np.zeros_like(row[0]), ratio
    while len(row) > 1:
        finer = [(factor * small - large) / (factor - 1) for large, small in pairwise(row)]
        error, row, factor = np.abs(finer[-1] - row[-1]), finer, ratio * factor
    return row[0], error


@final
@dataclass(frozen=True, eq=False)
class _Runs:
    """Runs of a system, or of a single FMU."""

    system: System
    single: bool
    starts: Mapping[str, Any]
    inputs: Mapping[str, PPoly]
    start_time: float
    tolerance: float

    def recorded(self, record: str | Iterable[str] | None) -> list[str]:
        """What is recorded; all outputs by default."""
        if record is not None:
            return listed("record", record)
        outputs = [(part, output) for part in self.system.parts.values() for output in part.fmu.reals("output")]
        return [output if self.single else f"{part.name}.{output}" for part, output in outputs]

    def result(self, values: Mapping[str, Any], record: Sequence[str], times: Floats) -> Result:
        """A run with further start values."""
        parts, name = self.system.filled(), self.system.name
        starts = {owner: dict(part.starts) for owner, part in parts.items()}
        for full, value in {**self.starts, **values}.items():
            owner, variable = owned(name, parts, "value", full, single=self.single)
            starts[owner][variable] = value
        functions = {}
        for full, polynomial in self.inputs.items():
            owner, variable = owned(name, parts, "input", full, single=self.single)
            curve = Port(parts[owner], variable).triple()
            functions[full] = partial(_triple, polynomial) if curve else polynomial
        points = np.unique([self.start_time, *times, *_breaks(self.inputs, self.start_time, times[-1])])
        settings = SimulationSettings(times=points, tolerance=self.tolerance, record=record, inputs=functions)
        parts = {owner: replace(part, starts=valid(owner, part.fmu, starts[owner])) for owner, part in parts.items()}
        return performed(checked(name, parts, self.system.connections, settings, single=self.single))

    def evaluation(self, names: Sequence[str], signals: Sequence[str]) -> Evaluation:
        def run(values: Floats, times: Floats) -> Floats:
            result = self.result(dict(zip(names, values.tolist(), strict=True)), signals, times)
            return result.values[:, np.searchsorted(result.time, times)]

        def evaluate(values: Floats, times: Floats, derive: bool) -> tuple[Floats, Floats, Floats]:
            result = run(values, times)
            columns = [
                _extrapolated(lambda h, move=move: run(values + h * move, times), _OF_RUNS, move.sum())
                for move in (_moves(values) if derive else ())
            ]
            stacked = np.array(columns).reshape(len(columns), 2, *result.shape)
            return result, np.moveaxis(stacked[:, 0], 0, 2), stacked[:, 1].max(axis=2).T

        return evaluate


def _breaks(inputs: Mapping[str, PPoly], begin: float, end: float) -> list[float]:
    """Ends of the pieces between two times [s]."""
    return [x for polynomial in inputs.values() for x in polynomial.x if begin < x < end]


def _triple(polynomial: PPoly, t: float) -> tuple[Any, ...]:
    return tuple(polynomial(t, order) for order in range(3))


@final
@dataclass(frozen=True, eq=False)
class _VariationalEquations:
    """Steps of an FMU of Model Exchange, and their derivatives."""

    path: Path
    names: Sequence[str]
    signals: Sequence[str]
    starts: Mapping[str, Any]
    inputs: Mapping[str, PPoly]
    start_time: float
    tolerance: float

    def equations(self, values: Floats) -> FmuEquations:
        starts = {**self.starts, **dict(zip(self.names, values.tolist(), strict=True))}
        return FmuEquations(self.path, starts, inputs=self.inputs, outputs=self.signals, time=self.start_time)

    def evaluate(self, values: Floats, times: Floats, derive: bool) -> tuple[Floats, Floats, Floats]:
        moves = _moves(values) if derive else np.empty((0, 0))
        with ExitStack() as stack:
            equations = stack.enter_context(self.equations(values))
            beside = [
                {h: stack.enter_context(self.equations(values + h * move)) for s in _OF_EQUATIONS for h in (s, -s)}
                for move in moves
            ]

            def calculate(t: float, z: Floats, end: float) -> Floats:
                """Rates and outputs, and in further columns their derivatives by the values."""
                u = np.array([polynomial(min(t, np.nextafter(end, -np.inf))) for polynomial in self.inputs.values()])
                result = equations(t, z[:, 0], u)[:, None]
                if z.shape[1] == 1:
                    return result
                along = equations.directional(np.pad(z[:, 1:], ((0, len(u)), (0, 0))))
                return np.hstack([result, along + by_values(lambda fmu: fmu(t, z[:, 0], u))])

            def by_values(function: Callable[[FmuEquations], Floats]) -> Floats:
                columns = [
                    _extrapolated(lambda h, fmus=fmus: function(fmus[h]), _OF_EQUATIONS, move.sum())[0]
                    for fmus, move in zip(beside, moves, strict=True)
                ]
                return np.transpose(columns)

            start = equations.x[:, None]
            steps = self._steps(partial(self._integrated, calculate, start, times))
            if derive:
                start = np.hstack([start, by_values(lambda fmu: fmu.x)])
            result = self._integrated(calculate, start, times, steps)
        return result[..., 0], result[..., 1:], np.zeros((len(result), len(moves)))

    def _steps(self, integrated: Callable[[int], Floats]) -> int:
        """How many steps between two times keep to the tolerance."""
        before, steps = np.array(np.nan), 1
        while steps <= _MOST_STEPS:
            after = np.array(np.nan)
            with suppress(RefusedError), np.errstate(over="ignore", invalid="ignore"):
                after = integrated(steps)
                sizes = np.abs(after).max(axis=1, keepdims=True)
                if np.all(np.abs(after - before) <= self.tolerance * sizes):
                    return steps
            before, steps = after, 2 * steps
        raise SimulationError(f"{self.path.name}: {_MOST_STEPS} steps between two times are too few; it may be stiff")

    def _integrated(
        self, calculate: Callable[[float, Floats, float], Floats], z: Floats, times: Floats, steps: int
    ) -> Floats:
        """Outputs at the times, with further columns."""
        points = np.unique([self.start_time, *times, *_breaks(self.inputs, self.start_time, times[-1])]).tolist()
        recorded = {self.start_time: calculate(self.start_time, z, points[-1])[len(z) :]}
        for begin, end in pairwise(points):
            h = (end - begin) / steps
            for k in range(steps):
                slopes: list[Floats] = []
                for node, row in zip(_METHOD.nodes, _METHOD.matrix, strict=True):
                    stage = z + h * sum(a * slope for a, slope in zip(row, slopes, strict=True))
                    slopes.append(calculate(begin + (k + node) * h, stage, end)[: len(z)])
                z = z + h * sum(b * slope for b, slope in zip(_METHOD.weights, slopes, strict=True))
            recorded[end] = calculate(end, z, end)[len(z) :]
        return np.stack([recorded[time] for time in times.tolist()], axis=1)
