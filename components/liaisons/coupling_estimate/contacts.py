"""Coupling errors of mechanisms with contacts, which reach the motion through impacts only.

Where the height h over a table σ is off by x, its rate by v, and σ by d, the gap g = h - σ closes (x - d)/w later, with
the speed w.  With the coefficient of restitution e and the acceleration a of the gap (the saltation matrix; Leine,
Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems, 2004)::

    x⁺ = -e x + (1 + e) d,    v⁺ = -e v + (1 + e) (d' - a (x - d)/w),    |a (x - d)/w| <= √(2|a (x - d)|)

the bound being that of impacts that graze, or are missed.  Variances of what the steps add are added up.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from liaisons.base.arrays import Floats
from liaisons.base.hermite import upper_coefficients
from liaisons.base.logs import logger

_PEAK = 2.2
"""Largest value of a quintic's remainder θ³(1 - θ)³, relative to its mean."""
_SLOPE = 7.5
"""Largest slope of the same remainder, relative to its mean."""
_DIVERGED = 1e100
"""Distance or rate above which every error is the largest one, and squares would overflow."""
_TOUCHING = 1e-12
"""Distance, relative to the largest one, that is rounding, as in an FMU's core; relative to the inputs, if it is never
exceeded: the bodies touch all the time."""
_UNSURE = 16.0, 16.0, 6.0
"""Error of a distance inside a step, relative to that of the inputs, with none, one or both of its neighbours."""
_NARROWINGS = 3
"""How often the interval around the minimum of a polynomial is narrowed to an eighth: to 1e-5 of a step."""
_DEVIATIONS = 2
"""Number of standard deviations in an error."""


@final
@dataclass(frozen=True)
class ContactMechanism:
    """An FMU with contacts, by columns of the bus.

    :param contacts: distance, its rate, whether it is closed, and how many impacts there were, of each.
    :param inputs: those that follow something within a step.
    """

    name: str
    contacts: NDArray[np.intp]
    inputs: frozenset[int]


class UnresolvedContact(NamedTuple):
    """A step in which a distance comes closer to 0 than its error: its end [s] and size [s], distance, and error.

    :param contact: number of the contact.
    """

    contact: int
    time: float
    size: float
    least: float
    error: float

    def warn(self, contact: str, unit: str, connection: str, power: int) -> None:
        """Warn that a contact may have been missed, with the step size that would show it.

        :param power: of the step size in the error.
        """
        logger.warning(
            "%s: it comes as near as %.2g %s before t = %.6g s, where it is off by up to %.2g %s, as %s is handed over "
            "in steps of %.3g s: a contact may be missed or falsely found; a step_size of %.1g s would tell",
            contact,
            max(self.least, 0.0),
            unit,
            self.time,
            self.error,
            unit,
            connection,
            self.size,
            rounded_down(self.sufficient_size(power)),
        )

    def sufficient_size(self, power: int) -> float:
        """A step size that would tell [s] or, for very small distances, one with which they are known better."""
        return self.size * min((max(abs(self.least), self.error / 10) / (4 * self.error)) ** (1 / power), 0.5)

    def divisions(self, power: int) -> Floats:
        """Instants [s] that divide this step, and those beside it, by which its error is estimated, into such steps."""
        first, last = self.time - 2 * self.size, self.time + self.size
        return np.linspace(first, last, 1 + math.ceil((last - first) / self.sufficient_size(power)))


def divisions_between(divisions: Sequence[Floats], times: Floats) -> Floats:
    """Instants of divisions [s] that are clearly between communication points and each other, sorted."""
    apart = [(float(t), (own[1] - own[0]) / 4) for own in divisions for t in own.tolist()]
    found: list[float] = []
    for instant, least in sorted(apart):
        later = int(np.searchsorted(times, instant))
        is_inside = 0 < later < len(times) and min(instant - times[later - 1], times[later] - instant) > least
        if is_inside and (not found or instant - found[-1] > least):
            found.append(instant)
    return np.array(found)


def rounded_down(size: float) -> float:
    """A number > 0, rounded down to one digit."""
    digit = 10.0 ** math.floor(math.log10(size))
    return math.floor(size / digit) * digit


def accumulated_errors(
    mechanism: ContactMechanism,
    rows: Floats,
    times: Floats,
    off: Floats,
    added: Floats,
    *,
    crossing: NDArray[np.bool_],
) -> tuple[Floats, list[UnresolvedContact]]:
    """Error of a mechanism with contacts at each point, relative to its largest distance and rate, at most 1.

    A distance that falls and rises within a step, without an impact, is compared with its error there, which
    comes from the inputs, and from what earlier impacts have made of their errors.

    :param rows: values of the bus, shape (points, width).
    :param off: mean error of the inputs in the step that ends at a point, in units of distances.
    :param added: error that the step adds to the motion otherwise, relative to its size.
    :param crossing: which points are ends of tiny steps, in which impacts are not always counted.
    :returns: shape (points,), and the steps in which a contact may not be seen, the least sure one first.
    """
    steps, errors = np.diff(times), np.zeros(len(times))
    doubtful: list[UnresolvedContact] = []
    gaps, rates, closed, impacts = (rows[:, columns].T for columns in mechanism.contacts.T)
    length, speed = (float(np.max(np.abs(values), initial=0.0)) or 1.0 for values in (gaps, rates))
    if length < _TOUCHING * np.abs(rows[:, sorted(mechanism.inputs)]).max(initial=0.0):
        return errors, []
    if max(length, speed) > _DIVERGED:
        errors[1:] = 1.0
        return errors, []
    tiny = crossing[1:]
    turned = (closed[:, :-1] == 0) & (rates[:, :-1] < 0) & (rates[:, 1:] > rates[:, :-1] / 2)
    struck = (np.diff(impacts) != 0) | (tiny & turned)
    released = np.any(np.diff(closed) != 0, axis=0)
    accelerations = _accelerations(rates, steps, struck | tiny)
    lowest = _lower_bounds(gaps, rates, accelerations, steps)
    at_rest = np.all(closed != 0, axis=0)
    # Where both ends touch, the bodies move together, and shorter steps add rounding only.
    apart = np.abs(gaps) > _TOUCHING * length
    is_open = (closed[:, :-1] == 0) & (closed[:, 1:] == 0)
    dips, unsure = _dips(gaps, rates, times, ~struck & ~tiny & is_open & (apart[:, :-1] | apart[:, 1:]))
    xx = xv = vv = 0.0
    for k, H in enumerate(steps.tolist()):
        d, d_dot = _PEAK * off[k + 1], _SLOPE * off[k + 1] / H
        xx += H * (2 * xv + H * vv) + (added[k + 1] * length) ** 2
        xv += H * vv
        vv += (added[k + 1] * speed) ** 2
        if released[k]:
            vv += d_dot**2
        for c in range(len(gaps)):
            a, reach = accelerations[c, k], math.sqrt(xx) + d
            if struck[c, k]:
                e, w = _restitution_and_speed(gaps[c, k], rates[c, k : k + 2], a * H, a)
                b = math.copysign(min(abs(a) / w, math.sqrt(2 * abs(a) / reach)), a) * (1 + e) if reach else 0.0
                xx, xv, vv = (
                    e**2 * xx + ((1 + e) * d) ** 2,
                    e**2 * xv + e * b * xx,
                    e**2 * vv + 2 * e * b * xv + b**2 * xx + ((1 + e) * d_dot + abs(b) * d) ** 2,
                )
            elif not closed[c, max(k - 2, 0) : k + 1].any() and lowest[c, k] < reach:
                vv += 8 * abs(a) * (reach - max(lowest[c, k], 0.0))
            error, least = unsure[c, k] * reach, dips[c, k]
            if least < error and error > _TOUCHING * length:  # rounding no shorter step would resolve
                doubtful.append(UnresolvedContact(c, times[k + 1], H, least, error))
        xx, vv = min(xx, length**2), min(max(vv, 0.0), speed**2)
        xv = min(max(xv, -math.sqrt(xx * vv)), math.sqrt(xx * vv))
        errors[k + 1] = min(_DEVIATIONS * max(math.sqrt(xx) / length, math.sqrt(vv) / speed), 1.0)
        if at_rest[k + 1]:
            xx = xv = vv = 0.0
    return errors, sorted(doubtful, key=lambda one: one.least - one.error)


def _accelerations(rates: Floats, steps: Floats, struck: Floats) -> Floats:
    """Mean acceleration of each distance in each step; of a step with an impact, from the steps beside it."""
    accelerations = np.diff(rates) / steps
    for row, hit in zip(accelerations, struck, strict=True):
        free = np.flatnonzero(~hit)
        if len(free):
            row[hit] = np.interp(np.flatnonzero(hit), free, row[free])
    return accelerations


def _lower_bounds(gaps: Floats, rates: Floats, accelerations: Floats, steps: Floats) -> Floats:
    """Lower bound of the distance within each step, by the cubic through its ends; infinite where it is monotonic."""
    x = np.linspace(0, 1, 17)[:, None, None]
    g, v = begin = gaps[:, :-1], rates[:, :-1]
    c_2, c_3 = upper_coefficients(begin, (gaps[:, 1:], rates[:, 1:]), steps)
    cubic = g + x * v * steps + x**2 * c_2 + x**3 * c_3
    bend = np.abs(np.diff(accelerations, prepend=accelerations[:, :1]))
    slack = bend * steps / 8
    leaving = (accelerations > 0) & (np.append(accelerations[:, :1], accelerations[:, :-1], axis=1) > 0)
    falls_and_rises = (rates[:, :-1] < np.where(leaving, 0.0, slack)) & (rates[:, 1:] > -slack)
    return np.where(falls_and_rises, cubic.min(axis=0) - bend * steps**2 / 32, math.inf)


def _dips(gaps: Floats, rates: Floats, times: Floats, watched: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """Least distance inside each step, infinite where it is that of an end, and how unsure it is.

    It is that of the polynomial through ends of steps and the points beside them; its error is told in units of that
    of the inputs, which follow quintics through the ends.

    :param watched: steps without impacts, whose distances are looked at.
    """
    least, unsure, steps = np.full(watched.shape, math.inf), np.zeros(watched.shape), np.diff(times)
    fastest = np.maximum(np.abs(rates[:, :-1]), np.abs(rates[:, 1:]))
    fastest = np.maximum.reduce([fastest, np.roll(fastest, 1, axis=1), np.roll(fastest, -1, axis=1)])
    near = watched & (np.minimum(gaps[:, :-1], gaps[:, 1:]) < steps * fastest)
    before, after = np.zeros((2, *watched.shape), dtype=bool)
    before[:, 1:], after[:, :-1] = watched[:, :-1], watched[:, 1:]
    theta, theta_around = np.linspace(0, 1, 65)[:, None], np.linspace(-1, 1, 17)[:, None]
    for left, right in ((False, False), (True, False), (False, True), (True, True)):
        contact, step = np.nonzero(near & (before == left) & (after == right))
        points = step + np.repeat(np.arange(-left, 2 + right), 2)[:, None]
        x = (times[points] - times[step]) / steps[step]
        table, slopes, coefficients = gaps[contact, points], rates[contact, points] * steps[step], list[Floats]()
        for order in range(1, len(points) + 1):
            coefficients.append(table[0])
            spans = x[order:] - x[:-order]
            quotients = np.diff(table, axis=0) / np.where(spans > 0, spans, 1.0)
            table = np.where(spans > 0, quotients, slopes[: len(spans)])
        value = _newton_polynomials(coefficients, x, theta)
        lowest = value.argmin(axis=0) if len(step) else step
        inside = (lowest > 0) & (lowest < len(theta) - 1)
        at, width = theta[lowest, 0], float(theta[1, 0])
        for _ in range(_NARROWINGS if len(step) else 0):
            around = at + width * theta_around
            at = np.take_along_axis(around, _newton_polynomials(coefficients, x, around).argmin(axis=0)[None], axis=0)[
                0
            ]
            width *= float(theta_around[1, 0] - theta_around[0, 0])
        narrow = _newton_polynomials(coefficients, x, at[None])[0]
        least[contact, step] = np.where(inside, narrow, math.inf)
        unsure[contact, step] = _UNSURE[left + right]
    return least, unsure


def _newton_polynomials(coefficients: Sequence[Floats], nodes: Floats, theta: Floats) -> Floats:
    """Polynomials in Newton's form, one per column, at some arguments."""
    value = np.zeros(np.broadcast_shapes(theta.shape, coefficients[0].shape))
    for node, coefficient in zip(nodes[::-1], coefficients[::-1], strict=True):
        value = value * (theta - node) + coefficient
    return value


def _restitution_and_speed(gap: float, rates: Floats, change: float, acceleration: float) -> tuple[float, float]:
    """Coefficient of restitution and speed of an impact.

    :param gap: distance before it.
    :param rates: rates before and after.
    :param change: change of the rate by the acceleration.
    """
    jump, w = rates[1] - rates[0] - change, math.sqrt(max(rates[0] ** 2 - 2 * acceleration * gap, 0.0))
    if jump <= 0:
        return 1.0, max(w, 1e-300)
    w = min(max(w, jump / 2), jump)
    return jump / w - 1, w
