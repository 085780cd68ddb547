"""The instants to which steps lead: breaks, at which a source of an input jumps, or one of its first two derivatives.

FMUs announce them by a variable, functions of time by their ``breaks``; what these do not announce, a deviation tells.
Between two of them, in a *piece*, every signal is smooth, and no polynomial crosses one.  A communication step ends
shortly before a break; a tiny one, in which every input is extrapolated, leads to it, and there the next piece starts
with the limits from the right.

The deviation d of a function from the polynomial that an input follows tells where it breaks.
It shrinks, where the step is halved, by 2⁴ for a cubic and 2⁶ for a quintic; in the half that has a jump of the value
not at all, of the rate by 2, of the acceleration by 4.  So bisection finds these, to where the deviation is rounding,
and tells them from functions that are merely fast.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from typing import NamedTuple, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.base.clocks import CLOCK_ERROR, time_rounding
from liaisons.base.hermite import coefficient_matrix
from liaisons.cosim.compiled.calls import Call, Memory, Vector
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.instances.protocol import Instances
from liaisons.cosim.structure.schedule import component_of
from liaisons.cosim.structure.simulation import Simulation
from liaisons.cosim.structure.sources import Drive
from liaisons.errors import SimulationError

_NEVER = 1e300
"""An announced instant beyond this means never: FMUs announce the largest floating-point number [s]."""
_SHORT = 1e-9
"""Size of the tiny step to a break, relative to a communication step."""
_APART = 4 * CLOCK_ERROR
"""The same, relative to the sampling period: FMUs of ours may sample one CLOCK_ERROR too early."""
_ROOTS, _WEIGHTS = np.polynomial.legendre.leggauss(4)
_NODES = (1 + _ROOTS) / 2
"""Gauss's nodes in a step: exact for the remainders of all polynomials that inputs follow."""
_WEIGHTS = _WEIGHTS / 2
"""Weights of these nodes."""
_ONCE_TWICE = np.stack([_WEIGHTS, _WEIGHTS * (1 - _NODES)], axis=-1)
_THIRDS = np.array([0.0, 1 / 3, 2 / 3, 1.0])
_CUBIC = np.vander(_NODES, increasing=True) @ np.linalg.inv(np.vander(_THIRDS, increasing=True))
_QUINTIC = np.vander(_NODES, 6, increasing=True) @ coefficient_matrix(3)
_SMOOTH = 1 / 10
"""A deviation that shrinks by more, where the step is halved and halved again, is that of a smooth function; that of a
break may do so once, where it comes to lie at an end.
"""
_NOTHING = 2e-14
"""Deviations below this, relative to the function, may be rounding."""
_MOST = 20
"""Number of breaks in a step that are searched for, at most."""
_OFTEN = 3
"""A function that has more breaks in so many steps is no longer searched."""


@final
class Timeline:
    """The breaks of a simulation, in order of time.

    :ivar divides: whether all FMUs take steps of any size, so that steps can end at breaks.
    :ivar are_samples: whether all breaks are those of sampled FMUs, whose outputs hold between them.
    :ivar next: the next break [s], infinite if there is none; may be set to an earlier one.
    """

    def __init__(self, simulation: Simulation, instances: Instances, bus: Bus) -> None:
        parts, sources = simulation.parts, {*map(component_of, simulation.feeds.values())}
        self.divides = simulation.takes_steps_of_any_size
        self.are_samples, self._nearest = not simulation.drives, 0.0
        self._bus, self._drives, self.next = bus, simulation.drives, math.inf
        self._announced, self._calls = np.zeros(len(parts)), list[Call]()
        for k, (name, part) in enumerate(parts.items()):
            if self.divides and name in sources and (event := part.fmu.next_event_variable):
                self.are_samples &= part.fmu.has_sampled_outputs
                self._nearest = max(self._nearest, _APART * part.sampling_period)
                self._calls.append(instances[name].getter([event], self._announced[k : k + 1]))

    def begin_piece(self, time: float) -> None:
        """Start a smooth piece at an instant [s]: there, functions of time return their limits from the right."""
        for drive in self._drives:
            drive.begin_piece(time)

    def tiny_step(self, time: float, size: float) -> float:
        """Size of the tiny step to a break at a time, beside steps of some size [s]."""
        return max(_SHORT * size, 10 * time_rounding(time), self._nearest)

    def save(self) -> float:
        """The next break [s], for :meth:`restore`."""
        return self.next

    def restore(self, saved: float) -> None:
        """Set the next break to a saved one [s]."""
        self.next = saved

    def ends_before(self, now: float, ends: Sequence[float], size: float) -> Sequence[float]:
        """Those ends of steps that come before the next break, else an instant shortly before it [s].

        :param ends: of steps from an instant on, in their order.
        :param size: of a communication step [s].
        :returns: nothing if the break is so near that the next step crosses it.
        """
        if self.next == math.inf:
            return ends
        if before := bisect_left(ends, self.next - time_rounding(self.next)):
            return ends[:before]
        tiny = self.tiny_step(self.next, size)
        return [self.next - tiny] if self.next - now > 2 * tiny else []

    def is_next(self, time: float) -> bool:
        """Whether an instant [s] is the next break, or comes before it by rounding."""
        return time - self.next <= time_rounding(self.next)

    def is_at(self, time: float) -> bool:
        """Whether an instant [s] is the next break, up to rounding."""
        return abs(time - self.next) <= time_rounding(time)

    def find_next(self, time: float) -> None:
        """Set :attr:`next` to the first break after an instant [s] that all FMUs have reached."""
        if not (self._calls or self._drives):
            return
        self._bus.perform(self._calls)
        instants: list[float] = self._announced.tolist()
        if self.divides:
            instants += [instant for drive in self._drives if (instant := drive.next_break(time)) is not None]
        self.next = min((t for t in instants if time + time_rounding(time) < t < _NEVER), default=math.inf)


class _Comparison(NamedTuple):
    """A function of time beside its polynomials, in several steps.

    :param off: deviations at the nodes, shape (steps, nodes).
    :param sizes: its largest value so far, shape (steps,).
    :param leaves: whether a deviation exceeds the tolerance.
    :param jumps: whether the limit from the right at the end does.
    """

    off: Vector
    sizes: Vector
    leaves: NDArray[np.bool_]
    jumps: NDArray[np.bool_]


@final
class Deviations:
    """Integrals, once and twice, of the deviations of functions of time in the present step, on the bus.

    :param drives: functions of time, none of integers and Booleans.
    :param tolerance: relative to the function; a smaller deviation is not a break.
    :ivar memory: what was seen of the functions until now.
    :ivar columns: of each input: column of the first of the two integrals, and how many numbers its function returns;
        ``span`` are the columns of all integrals.
    """

    def __init__(self, drives: Sequence[Drive], bus: Bus, tolerance: float) -> None:
        self._drives, self._tolerance = drives, tolerance
        first, values = bus.add_columns(2 * len(drives))
        self.span = slice(first, first + 2 * len(drives))
        self._values = values.reshape(-1, 2)
        self.columns = {
            input_: (first + 2 * k, len(drive.inputs)) for k, drive in enumerate(drives) for input_ in drive.inputs
        }
        self._sizes, self._breaks, self._overrun = numbers = np.zeros((3, len(drives)))
        self._end = np.full(1, -np.inf)
        self.memory = Memory([numbers, self._end])

    def integrate_steps(self, times: Vector) -> Vector:
        """The integrals of steps between instants [s], up to the first step that may have a break.

        :returns: shape (steps, columns), of the columns :attr:`span` of the bus; no steps if a function raises.
        """
        try:
            compared = [self._compare_drive(k, times) for k in range(len(self._drives))]
        except SimulationError:
            return np.empty((0, self._values.size))
        breaks = [(one.leaves | one.jumps) & (self._overrun[k] < _OFTEN) for k, one in enumerate(compared)]
        many = min((int(np.argmax(steps)) for steps in breaks if steps.any()), default=len(times) - 1)
        if many:
            self._sizes[:] = [one.sizes[many - 1] for one in compared]
            if times[many] > self._end:  # not a step that was cut
                self._begin_count(float(times[many]))
        steps = np.diff(times)
        return np.hstack([_deviation_integrals(one.off, steps) for one in compared])[:many]

    def integrals(self, times: Vector) -> Vector:
        """The integrals of steps between instants [s], in which nothing is searched for; shape (steps, columns)."""
        off, steps = [_deviations(drive, times)[0] for drive in self._drives], np.diff(times)
        return np.hstack([_deviation_integrals(one, steps) for one in off])

    def integrate(self, start: float, end: float) -> float:
        """Put the integrals between two instants [s] on the bus, and search for breaks between them.

        :returns: the first break after the start and not after the end [s]; infinite if there is none.
        """
        times = np.array([start, end])
        compared = [self._compare_drive(k, times) for k in range(len(self._drives))]
        self._values[:] = [_deviation_integrals(one.off[0], end - start) for one in compared]
        self._sizes[:] = [one.sizes[0] for one in compared]
        if start >= self._end:  # not a step that was cut
            self._begin_count(end)
        first = math.inf
        for k in np.flatnonzero((self._breaks < _MOST) & (self._overrun < _OFTEN)).tolist():
            instant = self._locate_break(k, start, end, compared[k])
            self._breaks[k] += instant < math.inf
            first = min(first, instant)
        return first

    def _begin_count(self, end: float) -> None:
        """Begin to count the breaks in the step to an instant [s]; note the functions with too many in the last one."""
        self._end[:] = end
        self._overrun += self._breaks >= _MOST
        self._breaks[:] = 0

    def _compare_drive(self, k: int, times: Vector) -> _Comparison:
        """Deviations of the k-th function from its polynomial in each step between times [s]."""
        drive, steps = self._drives[k], np.diff(times)[:, None]
        off, begin, end = _deviations(drive, times)
        sizes = np.abs(np.hstack([begin, end])).max(axis=1, initial=self._sizes[k])
        sizes = np.maximum.accumulate(sizes)
        right = drive.sample(times[1:] + drive.break_margin(times[1:])) * steps ** np.arange(len(drive.inputs))
        allowed = self._tolerance * np.where(sizes > 0, sizes, 1.0)
        return _Comparison(off, sizes, np.abs(off).max(axis=1) > allowed, np.abs(right - end).max(axis=1) > allowed)

    def _locate_break(self, k: int, start: float, end: float, compared: _Comparison) -> float:
        """The first break of a function in a step [s]; infinite if there is none."""
        instant, drive = None, self._drives[k]
        if compared.leaves[0]:
            nothing = _NOTHING * float(compared.sizes[0] or 1.0)
            instant = _bisect_break(drive, start, end, float(np.abs(compared.off).max()), nothing)
        if instant is None and compared.jumps[0]:
            instant = end
        return math.inf if instant is None or instant <= start + time_rounding(start) else instant


def _deviation_integrals(off: Vector, size: ArrayLike) -> Vector:
    """∫ and ∫∫ of deviations over a step, from their absolute values at the nodes, with the sign of their mean."""
    size = np.asarray(size)
    sizes = np.copysign(np.abs(off), _multiply_rows(off, _WEIGHTS[:, None]))
    return _multiply_rows(sizes, _ONCE_TWICE) * np.stack([size, size**2], -1)


def _multiply_rows(rows: Vector, matrix: Vector) -> Vector:
    """Products of rows and a matrix, one row at a time: a single one gets the same bits as several."""
    return (rows[..., None, :] @ matrix)[..., 0, :]


def _bisect_break(drive: Drive, start: float, end: float, deviation: float, negligible: float) -> float | None:
    """Instant of a break by bisection [s] until a deviation is negligible; None if the function is smooth."""
    before = 0.0
    while start < (middle := (start + end) / 2) < end and deviation > negligible:
        left, right = np.abs(_deviations(drive, np.array([start, middle, end]))[0]).max(axis=1).tolist()
        shrunk = max(left, right) < _SMOOTH * deviation
        if shrunk and deviation < _SMOOTH * before:
            return None
        before = deviation
        start, end, deviation = (start, middle, left) if left >= right else (middle, end, right)
    return end


def _deviations(drive: Drive, times: Vector) -> tuple[Vector, Vector, Vector]:
    """Deviations of a function from its polynomials in steps: of a port the quintic, else the cubic through thirds.

    :returns: at the nodes, shape (steps, nodes); and the data of the polynomials at both ends, shape (steps, data).
    """
    steps = np.diff(times)[:, None]
    inside = drive.sample(times[:-1, None] + steps * _NODES)[..., 0]
    powers = steps ** np.arange(len(drive.inputs))
    ends = np.array([drive(t) for t in times.tolist()])
    begin, end = ends[:-1] * powers, ends[1:] * powers
    if len(drive.inputs) < 3:
        between = drive.sample(times[:-1, None] + steps * _THIRDS[1:-1])[..., 0]
        through = _multiply_rows(np.hstack([begin[:, :1], between, end[:, :1]]), _CUBIC.T)
    else:
        through = _multiply_rows(np.hstack([begin, end]), _QUINTIC.T)
    return inside - through, begin, end
