"""Signals of a motion and their derivatives, by name; and the gradient of one number that is made of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, final

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from liaisons import Result
from liaisons.base.arguments import check_finite, merged_start_values, shown
from liaisons.base.array_names import array_and_index
from liaisons.base.clocks import communication_points
from liaisons.base.logs import collected_warnings
from liaisons.base.units import quotient
from liaisons.errors import InvalidValueError, SimulationError, UnknownSignalError, suggestion
from liaisons_motion.derivatives.steps import Floats
from liaisons_motion.derivatives.subjects import Subject, motion_of

_INTERVALS = 200
"""Number of intervals between recorded times, unless their distance is set."""
_MOST = 1e6
"""Most such intervals: derivatives at more do not fit into memory."""


@final
@dataclass(frozen=True, eq=False, repr=False)
class Sensitivities:
    """Signals of a motion over time, ``s["theta"]``, and their derivatives, ``s.derivative("theta", "theta_0")``.

    :param signals: by name, with units.
    :param names: of the values with respect to which they are differentiated.
    :param derivatives: shape (signals, times, values); not-a-number, with a warning, where they do not exist: at an
        event; after an event that happens only for some neighbouring values; and next to an event if runs are compared
        by finite differences across it.
    :param units: of the values.
    :param method: ``"steps"``: of the steps that were taken; ``"directional derivatives"`` of FMUs; ``"differences"``.
    """

    signals: Result
    names: tuple[str, ...]
    derivatives: Floats
    units: Mapping[str, str]
    method: str

    def __repr__(self) -> str:
        return f"<Sensitivities by {', '.join(self.names)}, {self.method}, of {self.signals!r}>"

    @property
    def time(self) -> Floats:
        """Recorded times [s]."""
        return self.signals.time

    def __getitem__(self, name: str) -> Floats:
        """A signal, (times,), or an array of signals."""
        return self.signals[name]

    def derivative(self, signal: str, value: str) -> Floats:
        """Derivative of a signal by a value, (times,); of arrays (times, signals), (times, values) or all three.

        :raises UnknownSignalError: with the nearest name.
        """
        rows, columns = _name_indices(signal, self.signals.names), _name_indices(value, self.names)
        return self.derivatives.swapaxes(0, 1)[:, rows][..., columns]

    def unit(self, signal: str, value: str) -> str:
        """Unit of a derivative; empty where one of the two has none."""
        first = np.ravel(_name_indices(value, self.names))[0]
        return quotient(self.signals.units[signal], self.units[self.names[first]])

    def to_result(self) -> Result:
        """Signals and derivatives, ``"d(theta)/d(theta_0)"``, as a result that can be plotted and written."""
        pairs = [(signal, value) for signal in self.signals.names for value in self.names]
        labels = {f"d({signal})/d({value})": self.unit(signal, value) for signal, value in pairs}
        rows = np.moveaxis(self.derivatives, 2, 1).reshape(len(pairs), -1)
        return Result(
            self.signals.title,
            self.time,
            (*self.signals.names, *labels),
            np.vstack([self.signals.values, rows]),
            dict(self.signals.units) | labels,
        )


@final
@dataclass(frozen=True, eq=False)
class Gradient:
    """A number that is a function of signals, and its derivatives.

    :param value: the number.
    :param derivatives: value of the motion -> derivative of the number; not-a-number, with a warning that is logged,
        where a signal that counts has no derivative, as beside an event.
    :param method: as of :class:`Sensitivities`.
    """

    value: float
    derivatives: Mapping[str, float]
    method: str

    def __getitem__(self, name: str) -> float:
        """Derivative by a value."""
        if name not in self.derivatives:
            raise UnknownSignalError(f"there is no derivative by {name!r}{suggestion(name, self.derivatives)}")
        return self.derivatives[name]


def sensitivities(
    subject: Subject,
    by: str | Iterable[str],
    *,
    stop_time: float | None = None,
    step_size: float | None = None,
    start_time: float = 0.0,
    times: ArrayLike | None = None,
    start_values: Mapping[str, ArrayLike] | None = None,
    record: str | Iterable[str] | None = None,
    operators: Mapping[str, Any] | None = None,
    inputs: Mapping[str, Any] | None = None,
    tolerance: float = 1e-10,
    **keywords: ArrayLike,
) -> Sensitivities:
    """Derivatives of the signals of a motion by start values, parameters and inputs.

    The steps that were taken are differentiated, so finite differences of the same steps agree::

        s = sensitivities("Pendulum", by=["theta_0", "gravity"], stop_time=9, theta_0=2)
        s["theta"], s.derivative("theta", "gravity")

    :param subject: a component by its name, file or class; a model; an FMU of any make; a system.
    :param by: names of values; parameters of operators are ``"length.amplitude"``.
    :param stop_time: end [s]; ``step_size``: distance of the recorded times, of which there are 201 if it is None.
    :param times: recorded times [s], in place of these.
    :param start_values: where they differ from the declared ones; ``keywords`` are further ones.
    :param record: outputs; coordinates and momenta if None.
    :param operators: active coordinate -> operator that moves it.
    :param inputs: input or active coordinate -> SciPy's ``PPoly`` of time, of degree five at most.
    :param tolerance: of a step, relative to the size of each state.
    :raises ComponentError: for an unknown name, with the nearest one.
    :raises SimulationError: for a bad number, or where the motion comes to an end.
    """
    motion = motion_of(
        subject,
        by,
        _recorded_times(start_time, stop_time, step_size, times),
        start_time=start_time,
        record=record,
        operators=operators,
        inputs=inputs,
        start_values=merged_start_values("sensitivities", start_values, keywords),
        tolerance=tolerance,
    )
    with collected_warnings() as warned:
        signals, derivatives = motion.forward(motion.values)
    units = {name: motion.units[name] for name in motion.signals}
    result = Result(motion.name, motion.times, motion.signals, signals, units, warnings=warned.texts)
    return Sensitivities(result, motion.names, derivatives, motion.units, motion.method)


def gradient(
    subject: Subject,
    cost: Callable[[Mapping[str, Any]], Any],
    by: str | Iterable[str],
    *,
    stop_time: float | None = None,
    step_size: float | None = None,
    start_time: float = 0.0,
    times: ArrayLike | None = None,
    start_values: Mapping[str, ArrayLike] | None = None,
    record: str | Iterable[str] | None = None,
    operators: Mapping[str, Any] | None = None,
    inputs: Mapping[str, Any] | None = None,
    tolerance: float = 1e-10,
    **keywords: ArrayLike,
) -> Gradient:
    """Gradient of one number that is a function of the signals of a motion, by adjoint derivatives.

    ::

        gradient("Pendulum", lambda m: ca.sumsqr(m["theta"] - data), by=["theta_0", "length"], stop_time=9)

    Its cost does not grow with the number of values in ``by``.

    :param cost: CasADi expression of ``m["theta"]``, a column over the recorded times; of an array a matrix.
    :param by: this and the further parameters are those of :func:`sensitivities`.
    :raises SimulationError: also if the cost is not one number.
    """
    if not callable(cost):
        raise InvalidValueError(f"cost = {shown(cost)}: give a function of the signals")
    motion = motion_of(
        subject,
        by,
        _recorded_times(start_time, stop_time, step_size, times),
        start_time=start_time,
        record=record,
        operators=operators,
        inputs=inputs,
        start_values=merged_start_values("gradient", start_values, keywords),
        tolerance=tolerance,
    )
    columns = ca.MX.sym("signals", len(motion.times), len(motion.signals))
    signals_by_name = _Signals({"time": ca.DM(motion.times)})
    for name in dict.fromkeys((*motion.signals, *(array_and_index(name)[0] for name in motion.signals))):
        signals_by_name[name] = columns[:, _name_indices(name, motion.signals)]
    value = cost(signals_by_name)
    try:
        number = ca.MX(value)
    except NotImplementedError:
        raise SimulationError(f"gradient: the cost is {shown(value)}; it must be one number, ca.sumsqr(...)") from None
    if number.shape != (1, 1):
        raise SimulationError(f"gradient: the cost has shape {number.shape}; it must be one number, ca.sumsqr(...)")
    evaluate = ca.Function("cost", [columns], [number, ca.densify(ca.gradient(number, columns))])
    values: list[float] = []

    def weights(signals: Floats) -> Floats:
        """Derivatives of the number by the signals, (signals, times)."""
        value, slopes = evaluate(signals.T)
        values.append(float(value))
        return np.array(slopes.full()).T

    _, derivatives = motion.adjoint(motion.values, weights)
    return Gradient(values[0], dict(zip(motion.names, derivatives.tolist(), strict=True)), motion.method)


class _Signals(dict[str, Any]):
    """Symbols of the recorded signals by name."""

    def __missing__(self, name: str) -> Any:
        """Raise an error that names the nearest signal."""
        raise UnknownSignalError(f"gradient: {name!r} is not recorded{suggestion(name, self)}; name it in record=[...]")


def _name_indices(name: str, names: tuple[str, ...]) -> int | list[int]:
    """Index of a name among names, or indices of the elements of an array."""
    if name in names:
        return names.index(name)
    if not (indices := [i for i, element in enumerate(names) if name == array_and_index(element)[0]]):
        raise UnknownSignalError(f"there is no {name!r}{suggestion(name, names)}")
    return indices


def _recorded_times(
    start_time: float, stop_time: float | None, step_size: float | None, times: ArrayLike | None
) -> ArrayLike:
    """Recorded times [s]: as set, or in steps from start to stop."""
    if times is not None:
        if stop_time is not None or step_size is not None:
            raise InvalidValueError("times are the recorded times; leave out stop_time and step_size")
        return times
    if stop_time is None:
        raise InvalidValueError("give stop_time, or the recorded times themselves as times")
    check_finite("start_time", start_time)
    check_finite("stop_time", stop_time)
    step = (abs(stop_time - start_time) or 1.0) / _INTERVALS if step_size is None else step_size
    points = communication_points(start_time, stop_time, step)
    if len(points) > _MOST:
        raise InvalidValueError(f"step_size = {step:g}: {len(points)} recorded times are too many; take larger steps")
    return points
