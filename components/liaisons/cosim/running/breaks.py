"""Breaks: instants at which the source of an input jumps, or one of its first two derivatives does.

FMUs announce them by a variable, functions of time by their ``breaks``.  Between two of them, in a *piece*, every
signal is smooth, and no polynomial crosses one.  A communication step ends shortly before a break; a tiny one, in which
every input is extrapolated, leads to it, and there the next piece starts with the limits from the right.

Where a function of time does not say where it breaks, its deviation d from the polynomial that an input follows tells.
It shrinks, where the step is halved, by 2⁴ for a cubic and 2⁶ for a quintic; in the half that has a jump of the value
not at all, of the rate by 2, of the acceleration by 4.  So bisection finds these, to where the deviation is rounding,
and tells them from functions that are merely fast.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.base.clocks import CLOCK_ERROR
from liaisons.base.hermite import coefficient_matrix
from liaisons.cosim.arrays import Memory, Vector
from liaisons.cosim.compiled.calls import Call
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.instances.protocol import Instances
from liaisons.cosim.structure.simulation import Simulation
from liaisons.cosim.structure.sources import Drive, rounding
from liaisons.errors import SimulationError

_NEVER = 1e300
"""An announced instant beyond this is none: FMUs announce the largest floating-point number [s]."""
_SHORT = 1e-9
"""Size of the tiny step to a break, relative to a communication step."""
_APART = 4 * CLOCK_ERROR
"""The same, relative to a period of samples, which FMUs of ours take by one CLOCK_ERROR too early."""
_ROOTS, _WEIGHTS = np.polynomial.legendre.leggauss(4)
_NODES, _WEIGHTS = (1 + _ROOTS) / 2, _WEIGHTS / 2
"""Gauss's nodes and weights in a step: exact for the remainders of all polynomials that inputs follow."""
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
_MOST, _OFTEN = 20, 3
"""Breaks in a step, and number of steps with more, from which on a function is not searched any more."""


@final
class Breaks:
    """The breaks of a simulation, in order of time.

    :ivar divides: whether steps can be divided: all FMUs take steps of any size.
    :ivar are_samples: whether all are samples and late outputs of sampled FMUs, which hold between them.
    :ivar next: the next one [s]; infinite if there is none; set to one before it that was found in between.
    """

    def __init__(self, simulation: Simulation, instances: Instances, bus: Bus) -> None:
        parts, sources = simulation.parts, {name for name, _ in simulation.feeds.values()}
        self.divides = all(part.fmu.variable_step for part in parts.values())
        announcing = {n: event for n, part in parts.items() if n in sources and (event := part.fmu.next_event_time)}
        events = announcing if self.divides else {}
        self.are_samples = not simulation.drives and all(parts[name].fmu.is_sampled for name in events)
        self._nearest = max((_APART * parts[name].sampling_period for name in events), default=0.0)
        self._bus = bus
        self._announced = np.zeros(len(events))
        self._calls: list[Call] = [
            instances[name].getter([event], self._announced[k : k + 1])
            for k, (name, event) in enumerate(events.items())
        ]
        self._drives = simulation.drives
        self.next = math.inf

    def begin_piece(self, time: float) -> None:
        """Start a smooth piece: functions of time return their limits from the right at this instant [s]."""
        for drive in self._drives:
            drive.begin_piece(time)

    def gap(self, time: float, size: float) -> float:
        """Size of the tiny step to a break, beside steps of a size [s]."""
        return max(_SHORT * size, 10 * rounding(time), self._nearest)

    def find_next(self, time: float) -> None:
        """Find the next break after an instant [s] that all FMUs have reached."""
        if not (self._calls or self._drives):
            return
        self._bus.perform(self._calls)
        instants: list[float] = self._announced.tolist()
        if self.divides:
            instants += [instant for drive in self._drives if (instant := drive.next_break(time)) is not None]
        self.next = min((t for t in instants if time + rounding(time) < t < _NEVER), default=math.inf)


class _Examined(NamedTuple):
    """A function of time in some steps.

    :param off: deviations at the nodes, shape (steps, nodes).
    :param sizes: its largest value so far, shape (steps,).
    :param leaves: whether it deviates by more than a smooth function does; ``jumps``: whether it does at the end.
    """

    off: Vector
    sizes: Vector
    leaves: NDArray[np.bool_]
    jumps: NDArray[np.bool_]


@final
class Deviations:
    """Integrals, once and twice, of the deviations of functions of time in the present step, on the bus.

    :param drives: those of integers and Booleans are left out: they are sampled.
    :param tolerance: relative to the function; a smaller deviation is no break.
    :ivar memory: what was seen of the functions until now.
    :ivar columns: of each input: column of the first of the two integrals, and how many numbers its function returns;
        ``span`` are the columns of all integrals.
    """

    def __init__(self, drives: Sequence[Drive], bus: Bus, tolerance: float) -> None:
        self._drives = drives = [drive for drive in drives if drive.among is None]
        self._tolerance = tolerance
        first, values = bus.add_columns(2 * len(drives))
        self.span = slice(first, first + 2 * len(drives))
        self._values = values.reshape(-1, 2)
        self.columns = {
            input_: (first + 2 * k, len(drive.inputs)) for k, drive in enumerate(drives) for input_ in drive.inputs
        }
        n = len(drives)
        self._sizes, self._breaks, self._overrun, self._end = np.zeros(n), np.zeros(n), np.zeros(n), np.full(1, -np.inf)
        self.memory = Memory([self._sizes, self._breaks, self._overrun, self._end])

    def __bool__(self) -> bool:
        return bool(self._drives)

    def integrate_steps(self, times: Vector) -> Vector:
        """The integrals of steps from each of these instants [s] to the next, up to the first that may have a break.

        :returns: shape (steps, columns), of the columns :attr:`span` of the bus; no steps if a function raises.
        """
        try:
            examined = [self._examine(k, times) for k in range(len(self._drives))]
        except SimulationError:
            return np.empty((0, self._values.size))
        breaks = [(one.leaves | one.jumps) & (self._overrun[k] < _OFTEN) for k, one in enumerate(examined)]
        many = min((int(np.argmax(steps)) for steps in breaks if steps.any()), default=len(times) - 1)
        if many:
            self._sizes[:] = [one.sizes[many - 1] for one in examined]
            if times[many] > self._end:  # not a step that was cut
                self._count_breaks(float(times[many]))
        steps = np.diff(times)
        return np.hstack([_integrals(one.off, steps) for one in examined])[:many]

    def integrate(self, start: float, end: float, *, locate: bool = True) -> float:
        """Evaluate the integrals between two instants [s].

        :param locate: search for breaks, too.
        :returns: the first break after the start and not after the end [s]; infinite if there is none.
        """
        times, first = np.array([start, end]), math.inf
        for k in range(len(self._drives)):
            if not locate:
                self._values[k] = _integrals(_compare(self._drives[k], times)[0][0], end - start)
                continue
            examined = self._examine(k, times)
            self._values[k] = _integrals(examined.off[0], end - start)
            self._sizes[k] = examined.sizes[0]
            if start >= self._end:  # not a step that was cut
                self._count_breaks(end)
            if self._breaks[k] < _MOST and self._overrun[k] < _OFTEN:
                instant = self._locate_break(k, start, end, examined)
                self._breaks[k] += instant < math.inf
                first = min(first, instant)
        return first

    def _count_breaks(self, end: float) -> None:
        """Count the functions with too many breaks in a step, and begin the next one, to an instant [s]."""
        self._end[:] = end
        self._overrun += self._breaks >= _MOST
        self._breaks[:] = 0

    def _examine(self, k: int, times: Vector) -> _Examined:
        """Compare a function with its polynomials in the steps from each of these instants [s] to the next."""
        drive, steps = self._drives[k], np.diff(times)[:, None]
        off, begin, end = _compare(drive, times)
        sizes = np.abs(np.hstack([begin, end])).max(axis=1, initial=self._sizes[k])
        sizes = np.maximum.accumulate(sizes)
        right = drive.sample(times[1:] + drive.rounding(times[1:])) * steps ** np.arange(len(drive.inputs))
        allowed = self._tolerance * np.where(sizes > 0, sizes, 1.0)
        return _Examined(off, sizes, np.abs(off).max(axis=1) > allowed, np.abs(right - end).max(axis=1) > allowed)

    def _locate_break(self, k: int, start: float, end: float, examined: _Examined) -> float:
        """The first break of a function in a step [s]; infinite if there is none."""
        instant, drive = None, self._drives[k]
        if examined.leaves[0]:
            nothing = _NOTHING * float(examined.sizes[0] or 1.0)
            instant = _bisect(drive, start, end, float(np.abs(examined.off).max()), nothing)
        if instant is None and examined.jumps[0]:
            instant = end
        return math.inf if instant is None or instant <= start + rounding(start) else instant


def _integrals(off: Vector, size: ArrayLike) -> Vector:
    """∫ and ∫∫ of deviations at the nodes; each takes the sign of their mean, so that none cancel."""
    size = np.asarray(size)
    sizes = np.copysign(np.abs(off), _multiply(off, _WEIGHTS[:, None]))
    return _multiply(sizes, _ONCE_TWICE) * np.stack([size, size**2], -1)


def _multiply(rows: Vector, matrix: Vector) -> Vector:
    """Rows times a matrix, row by row: a step alone gets the same bits as among others."""
    return (rows[..., None, :] @ matrix)[..., 0, :]


def _bisect(drive: Drive, start: float, end: float, deviation: float, nothing: float) -> float | None:
    """Locate the break of the largest deviation by bisection [s]; None if the function is smooth."""
    before = 0.0
    while start < (middle := (start + end) / 2) < end and deviation > nothing:
        left, right = np.abs(_compare(drive, np.array([start, middle, end]))[0]).max(axis=1).tolist()
        shrunk = max(left, right) < _SMOOTH * deviation
        if shrunk and deviation < _SMOOTH * before:
            return None
        before = deviation
        start, end, deviation = (start, middle, left) if left >= right else (middle, end, right)
    return end


def _compare(drive: Drive, times: Vector) -> tuple[Vector, Vector, Vector]:
    """Deviations of a function in steps from the quintic through both ends of a port, else the cubic through thirds.

    :returns: at the nodes, shape (steps, nodes); and the data of the polynomials at both ends, shape (steps, data).
    """
    steps = np.diff(times)[:, None]
    inside = drive.sample(times[:-1, None] + steps * _NODES)[..., 0]
    powers = steps ** np.arange(len(drive.inputs))
    ends = np.array([drive(t) for t in times.tolist()])
    begin, end = ends[:-1] * powers, ends[1:] * powers
    if len(drive.inputs) < 3:
        between = drive.sample(times[:-1, None] + steps * _THIRDS[1:-1])[..., 0]
        through = _multiply(np.hstack([begin[:, :1], between, end[:, :1]]), _CUBIC.T)
    else:
        through = _multiply(np.hstack([begin, end]), _QUINTIC.T)
    return inside - through, begin, end
