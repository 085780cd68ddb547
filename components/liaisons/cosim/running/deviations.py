"""Deviations of functions of time from the polynomials that inputs follow within a communication step, and breaks.

A deviation d of a polynomial from a function shrinks, where the step is halved, by 2⁴ for a cubic and 2⁶ for a quintic;
in the half that has a jump of the value not at all, of the rate by 2, of the acceleration by 4.  So bisection finds
these, to where the deviation is rounding, and tells them from functions that are merely fast.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from liaisons.base.hermite import coefficients
from liaisons.cosim.arrays import Vector
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.structure.sources import Drive, rounding
from liaisons.errors import SimulationError

_ROOTS, _WEIGHTS = np.polynomial.legendre.leggauss(4)
_NODES, _WEIGHTS = (1 + _ROOTS) / 2, _WEIGHTS / 2
"""Gauss's nodes and weights in a step: exact for the remainders of all polynomials that inputs follow."""
_ONCE_TWICE = np.stack([_WEIGHTS, _WEIGHTS * (1 - _NODES)], axis=-1)
_THIRDS = np.array([0.0, 1 / 3, 2 / 3, 1.0])
_CUBIC = np.vander(_NODES, increasing=True) @ np.linalg.inv(np.vander(_THIRDS, increasing=True))
_QUINTIC = np.vander(_NODES, 6, increasing=True) @ coefficients(3)
_SMOOTH = 1 / 10
"""A deviation that shrinks by more, where the step is halved and halved again, is that of a smooth function; that of a
break may do so once, where it comes to lie at an end.
"""
_NOTHING = 2e-14
"""Deviations below this, relative to the function, may be rounding."""
_MOST, _OFTEN = 20, 3
"""Breaks in a step, and number of steps with more, from which on a function is not searched any more."""


@final
class Deviations:
    """Integrals, once and twice, of the deviations of functions of time in the present step, on the bus.

    :param drives: those of integers and Booleans are left out: they are sampled.
    :param tolerance: relative to the function; a smaller deviation is no break.
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
        self.reset()

    def __bool__(self) -> bool:
        return bool(self._drives)

    def reset(self) -> None:
        """Forget everything."""
        self._sizes = np.zeros(len(self._drives))
        self._breaks = [0] * len(self._drives)
        self._overrun = [0] * len(self._drives)
        self._end = -math.inf

    def integrate_steps(self, times: Vector) -> Vector:
        """The integrals of steps from each of these instants [s] to the next, up to the first that may have a break.

        :returns: shape (steps, columns), of the columns :attr:`span` of the bus; no steps if a function raises.
        """
        steps, integrals = np.diff(times)[:, None], []
        nodes, thirds = times[:-1, None] + steps * _NODES, times[:-1, None] + steps * _THIRDS[1:-1]
        many, sizes = len(steps), self._sizes.copy()
        for k, drive in enumerate(self._drives):
            try:
                ends, inside = np.array([drive(t) for t in times.tolist()]), drive.sample(nodes)[..., 0]
                right = drive.sample(times[1:] + drive.rounding(times[1:]))
                between = drive.sample(thirds)[..., 0] if len(drive.inputs) < 3 else None
            except SimulationError:
                return np.empty((0, self._values.size))
            powers = steps ** np.arange(len(drive.inputs))
            begin, end = ends[:-1] * powers, ends[1:] * powers
            if between is not None:
                off = inside - np.hstack([begin[:, :1], between, end[:, :1]]) @ _CUBIC.T
            else:
                off = inside - np.hstack([begin, end]) @ _QUINTIC.T
            integrals.append(_integrals(off, steps[:, 0]))
            largest = np.abs(np.hstack([begin, end])).max(axis=1, initial=self._sizes[k])
            largest = np.maximum.accumulate(largest)
            allowed = self._allowed(largest)
            leaves = (np.abs(off).max(axis=1) > allowed) | (np.abs(right * powers - end).max(axis=1) > allowed)
            if self._overrun[k] < _OFTEN and leaves.any():
                many = min(many, int(np.argmax(leaves)))
            sizes[k] = largest[max(many, 1) - 1]
        if many:
            self._sizes = sizes
        if many and times[many] > self._end:  # not a step that was cut
            self._end = float(times[many])
            for k, count in enumerate(self._breaks):
                self._overrun[k] += count >= _MOST
                self._breaks[k] = 0
        return np.hstack(integrals)[:many]

    def _allowed(self, size: ArrayLike) -> Vector:
        """Largest deviation of a smooth function of this size."""
        return self._tolerance * np.where(np.asarray(size) > 0, size, 1.0)

    def integrate(self, start: float, end: float, *, locate: bool = True) -> float:
        """Evaluate the integrals between two instants [s].

        :param locate: search for breaks, too.
        :returns: the first break after the start and not after the end [s]; infinite if there is none.
        """
        size, first = end - start, math.inf
        for k, drive in enumerate(self._drives):
            off = _deviation(drive, start, end)
            self._values[k] = _integrals(off, size)
            if locate:
                first = min(first, self._break(k, start, end, float(np.max(np.abs(off)))))
        return first

    def _break(self, k: int, start: float, end: float, deviation: float) -> float:
        drive, powers = self._drives[k], (end - start) ** np.arange(len(self._drives[k].inputs))
        last = drive(end) * powers
        self._sizes[k] = size = max(self._sizes[k], float(np.max(np.abs([drive(start) * powers, last]))))
        allowed = self._allowed(size)
        if start >= self._end:  # not a step that was cut
            self._overrun[k] += self._breaks[k] >= _MOST
            self._breaks[k], self._end = 0, end
        if self._breaks[k] >= _MOST or self._overrun[k] >= _OFTEN:
            return math.inf
        instant = _locate_break(drive, start, end, deviation, _NOTHING * (size or 1.0)) if deviation > allowed else None
        if instant is None and np.max(np.abs(drive.right(end) * powers - last)) > allowed:
            instant = end
        if instant is None or instant <= start + rounding(start):
            return math.inf
        self._breaks[k] += 1
        return instant


def _integrals(off: Vector, size: ArrayLike) -> Vector:
    """∫ and ∫∫ of deviations at the nodes; each takes the sign of their mean, so that none cancel."""
    size = np.asarray(size)
    sizes = np.copysign(np.abs(off), (off @ _WEIGHTS)[..., None])
    return (sizes @ _ONCE_TWICE) * np.stack([size, size**2], -1)


def _locate_break(drive: Drive, start: float, end: float, deviation: float, nothing: float) -> float | None:
    """Locate the break of the largest deviation by bisection [s]; None if the function is smooth."""
    before = 0.0
    while start < (middle := (start + end) / 2) < end and deviation > nothing:
        left, right = (float(np.max(np.abs(_deviation(drive, *half)))) for half in ((start, middle), (middle, end)))
        shrunk = max(left, right) < _SMOOTH * deviation
        if shrunk and deviation < _SMOOTH * before:
            return None
        before = deviation
        start, end, deviation = (start, middle, left) if left >= right else (middle, end, right)
    return end


def _deviation(drive: Drive, start: float, end: float) -> Vector:
    """Deviation, at the nodes, from the quintic through both ends of a port, else from the cubic through the thirds."""
    size = end - start
    values = np.array([drive(start + size * node)[0] for node in _NODES])
    if len(drive.inputs) < 3:
        return values - _CUBIC @ [*(drive(start + size * part)[0] for part in _THIRDS[:-1]), drive(end)[0]]
    powers = size ** np.arange(3)
    return values - _QUINTIC @ np.concatenate([drive(start) * powers, drive(end) * powers])
