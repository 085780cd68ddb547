"""Motion of one instance: its numbers, and how they change in a communication step.

Names are those of ``fmu/python_functions.py``, which makes the functions.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from .component import ComponentTable
from .rates import GIVEN, Row, derived_numbers, may_miss_rates, missing_level, remember

# Error of an internal step: this part of the importer's tolerance, so that hundreds of periods stay near it, and not
# less than rounding allows.
_PART, _LEAST = 0.02, 1e-14
_MOST_STEPS, _SMALLEST = 100_000, 1e-13  # internal steps in an interval; smallest one relative to it
_CHANGED = 1e-6  # a rate that is further from its start value, of 1, is another
_SHRINK, _GROW, _SAFETY = 0.2, 6.0, 0.85  # factors of the step size: limits, and what keeps most from rejection


_DRIFT = 1e3  # multiple of what a projection leaves by which internal steps may leave the constraints
_GAIN, _MOST_PROJECTIONS = 0.9, 100  # as in messages.c


class MotionError(Exception):
    """The motion does not start or go on; the message says why."""


class Motion:
    """The numbers of an instance.

    :ivar all: all of them, shape (numbers,).
    :ivar n: the same by name; each is an array.
    :ivar views: the same as memory views, of which single numbers are three times quicker.
    :ivar reals: the Real variables among them, as a memory view.
    """

    def __init__(self, component: ComponentTable) -> None:
        self._component, self._warned = component, set[int]()
        self._found: dict[int, tuple[str, Row]] = {}  # by mismatch: a warning, numbers of the coordinate
        self.all = np.concatenate([*component.numbers.values()])
        ends = np.cumsum([len(numbers) for numbers in component.numbers.values()]).tolist()
        parts = dict(zip(component.numbers, np.split(self.all, ends), strict=False))
        self.n, first = SimpleNamespace(**parts), ends[[*parts].index("k")] - parts["k"].size
        self.views = SimpleNamespace(**{name: _memory_view(part) for name, part in parts.items()})
        self.reals = _memory_view(self.all[first : first + len(component.names) - component.first])
        self._coordinates = [*self._prescribed_coordinates()]
        after = self.all.copy()
        self._numbers, self._after = _memory_view(self.all), _memory_view(after)
        self._calls, self._buffers = {}, []
        for name, function in component.functions.items():
            unbound, evaluate = function.buffer()
            buffer: Any = unbound
            buffer.set_arg(0, self._numbers)  # bare pointers: the arrays live as long as this object
            buffer.set_res(0, self._after)
            self._buffers.append(buffer)
            self._calls[name] = evaluate

    def apply_function(self, name: str) -> None:
        """Replace all numbers by the results of a function of the component."""
        self._calls[name]()
        self._numbers[:] = self._after

    def initialize(self) -> None:
        """Initialize the states at t, after checks of domains and conditions.

        :raises MotionError: with what forbids it.
        """
        self.apply_function("start")
        n, component = self.n, self._component
        n.looked[:] = 0
        for c in self._coordinates:
            c.row[GIVEN], c.row[GIVEN + 1] = n.given[c.numbers[1:]]
        self._check_domains(np.concatenate([n.k, n.given]), 0, n.t[0])
        if not np.isfinite(n.y).all():
            raise MotionError("the initial state is not finite")
        try:
            self._check_conditions(n.t[0], 0.0, len(component.condition_texts))
        except MotionError as reason:
            contradicted = "the rate of " in str(reason)
            words = self._given_rates() if contradicted else self._prescribed(str(reason))
            raise MotionError(f"{reason}{words}") from None
        if not np.isfinite(n.m).all():
            raise MotionError("the initial energy is not finite")
        self.apply_function("outputs")
        z, t, n.t[0] = n.z.copy(), n.t[0], 0.0
        self.apply_function("outputs")
        n.t[0] = t
        for i in np.flatnonzero(~np.isfinite(z)) if np.isfinite(n.z).all() else ():  # functions of time overflow
            name = component.names[component.first + n.k.size + n.given.size + i - 1]
            raise MotionError(f"{name} = {z[i]:g} at t = {t:.9g}: it must be finite")

    def _given_rates(self) -> str:
        """Words for the rates that are not at their defaults, of which not all can hold."""
        component, k = self._component, self.n.k
        given = [start for start, _ in component.start_rates if k[start] != component.numbers["k"][start]]
        words = (f"{component.names[component.first + i - 1]} = {k[i]:.9g}" for i in given)
        return f"; given are {', '.join(words)}" if given else ""

    def _prescribed(self, reason: str) -> str:
        """Words for what is prescribed for the constraint that a reason begins with."""
        n, reaches = self.n, self._component.reaches
        first = len(reaches)
        for text, names in reaches:
            if names and reason.startswith(text):
                n.trial[:], n.x[0] = n.y, 0.0
                self.apply_function("reach")
                values = zip(names, n.reached[first:], strict=False)
                return f"; prescribed: {', '.join(f'{name} = {value:.9g}' for name, value in values)}"
            first += len(names)
        return ""

    def changed_rates(self) -> str:
        """Words for rates that are others than their start values, for constraints; empty: there are none."""
        n, component = self.n, self._component
        first, words = n.k.size + n.given.size, []
        if component.start_rates:
            self.apply_function("outputs")
        for start, rate in component.start_rates:
            value, given = n.z[rate - first], n.k[start]
            if abs(value - given) > _CHANGED * (1 + abs(given)):
                found, parameter = (component.names[component.first + i - 1] for i in (rate, start))
                words.append(f"{found} = {value:.6g} for {parameter} = {given:.6g}")
        return f"rates at the start follow from the constraints: {', '.join(words)}" if words else ""

    def apply_inputs(self) -> None:
        """Set the inputs at the present time to those that the importer gave, unless they are interpolated."""
        n, v = self.n, self.views
        mode = v.mode[0]
        if mode < 2 and n.u.tobytes() != n.given.tobytes():  # 2: they are interpolated
            v.u[:], v.jumped[0] = v.given, 1
        for c in self._coordinates if mode == 1 else ():
            if level := v.m[c.derived]:
                n.u[c.numbers] = derived_numbers(c.row, level, v.t[0], n.u[c.numbers])[0]

    def _prescribed_coordinates(self) -> Iterator[SimpleNamespace]:
        """Numbers, indices and texts of each prescribed coordinate of which mismatch and missing rates are shown."""
        component, rows = self._component, self.n.looked.reshape(len(self._component.active) or 1, -1)
        parts = enumerate(zip(rows, component.active, component.warnings, strict=False))
        for i, (row, (*numbers, derived), (mismatch, texts)) in parts:
            if derived >= 0:
                yield SimpleNamespace(
                    row=_memory_view(row), numbers=numbers, derived=derived, mismatch=mismatch, texts=texts, index=i
                )

    def _derive_rates(self, H: float) -> None:
        """Replace rates that nobody gives, of the present inputs or of those to interpolate to, in a step of size H."""
        v, ahead = self.views, self.views.mode[0] > 1
        t, given = v.t[0], v.given
        inputs, before, end, size = (given, v.u, t + H, H) if ahead else (v.u, v.past_u, t, v.past_H[0])
        for c in self._coordinates:
            row, derived, (value, rate, acceleration) = c.row, c.derived, c.numbers
            known = level = v.m[derived]
            numbers = given[value], given[rate], given[acceleration]
            if ahead:
                remember(row, level, t, (before[value], before[rate], before[acceleration]))
            if size > 0:
                v.m[derived] = level = missing_level(row, level, size, before[value], numbers)
            followed = derived_numbers(row, level, end, numbers)[0] if level else numbers
            if level or known:
                inputs[value], inputs[rate], inputs[acceleration] = followed
            if not ahead:
                remember(row, level, t, followed)
            row[GIVEN], row[GIVEN + 1] = numbers[1:]

    def _note_warnings(self, before: list[float]) -> None:
        """Note the first mismatch of each coordinate, unless its rates are missing; and since when they are derived.

        :param before: what was missing of each coordinate before the step.
        """
        v = self.views
        for c, level_before in zip(self._coordinates, before, strict=True):
            if level := v.m[c.derived]:
                v.m[c.mismatch] *= 0
            if level > level_before:
                self._found[c.mismatch] = c.texts[1 + int(level)].format(t=v.t[0]), c.row[:0]
            elif mismatch := v.m[c.mismatch]:
                text = c.texts[int(v.far[c.index])].format(mismatch=mismatch, t=v.compared[0])
                self._found.setdefault(c.mismatch, (text, c.row))

    def step(self, H: float) -> None:
        """Advance by a communication step of size H [s].

        :raises MotionError: if the motion does not reach its end; then the numbers are undefined.
        """
        n, v = self.n, self.views
        v.H[0] = H
        self.apply_inputs()
        given, missing = n.given.copy(), [v.m[c.derived] for c in self._coordinates]
        if v.mode[0] > 0:
            self._derive_rates(H)
        self.apply_function("compare")
        leaps = any(v.leaps)
        if v.jumped[0]:
            self._jump_states(leap=not leaps)
        if leaps:
            self._check_domains(n.given, n.k.size, n.t[0] + H)
        self._advance_inside(H)
        self.apply_function("finish")
        if leaps:
            v.u[:] = v.given
            self._jump_states(leap=True)
            self.apply_function("remember")
        v.given[:], v.jumped[0] = given, 0
        self._note_warnings(missing)

    def _advance_inside(self, H: float) -> None:
        """Advance states and time by H [s], from one instant at which the component is not smooth to the next."""
        v = self.views
        t, x = v.t[0], 0.0
        v.earliest[0] = t
        while x < H:
            instant = self._next_instant(v.earliest[0])
            v.latest[0] = math.nextafter(instant, t)
            x = self._integrate("advance", x, min(instant - t, H))
            v.earliest[0] = instant
        rounding = 1e-12 * (1 + abs(t + H))  # by which an end may miss an instant: 3 * 0.3 is not 0.9
        instant = self._next_instant(t + H - rounding)
        v.t[0] = instant if instant <= t + H + rounding else t + H

    def _jump_states(self, *, leap: bool) -> None:
        """Book the work of a jump of the inputs; with ``leap``, move states along with a jump of σ that has a limit."""
        if leap and any(self.views.jump):
            before = self.all.copy()
            try:
                self._integrate("leap", 0.0, 1.0)
            except MotionError:  # through a singularity there is no limit
                self.all[:] = before
        self.apply_function("jump")

    def _integrate(self, name: str, begin: float, end: float) -> float:
        """Advance y from ``begin`` to ``end`` by a function, with error control; returns the end.

        :raises MotionError: if it is not reached.
        """
        n, v = self.n, self.views
        allowed, x, rest = max(_PART * v.tolerance[0], _LEAST), begin, end - begin
        h = rest
        for _ in range(_MOST_STEPS):
            v.x[0], v.h[0] = x, h
            self.apply_function(name)
            error = v.error[0] / allowed
            beyond = self._out_of_reach(x + h, n.y_next) if error <= 1 and v.away[0] > _DRIFT else ""
            if beyond and h > _SMALLEST * (end - begin):
                error = math.inf
            elif beyond:
                raise MotionError(beyond)
            if error <= 1:
                v.y[:], x, rest = v.y_next, x + h, rest - h
                if rest == 0:
                    return end
            elif h < _SMALLEST * (end - begin):
                break
            # The error is of order 5; where it is not a number the step shrinks.
            h = min(rest, h * min(_GROW, max(_SHRINK, _SAFETY * (error + 1e-9) ** -0.2)))
        else:
            raise MotionError(f"more than {_MOST_STEPS} internal steps are needed: choose a smaller step")
        start, t = n.u.copy(), n.t[0] + x
        for n.x[0] in (*np.linspace(x, end, 1025), x):
            n.u[:] = start
            self.apply_function("inputs")
            self._check_domains(n.u, n.k.size, n.t[0] + n.x[0])
        now, n.u[:] = n.u.copy(), start  # inputs of the communication step's begin, from which others follow
        for ahead in np.geomspace(_SMALLEST, 1e-2, 100) if self._component.reaches else ():
            if beyond := self._out_of_reach(x + ahead * (end - begin), n.y):
                raise MotionError(beyond)
        n.u[:] = now
        # Conditions are distances from a singularity, of order 1 elsewhere.
        self._check_conditions(t, 1e-3, self._component.lasting)
        raise MotionError(f"no step from t = {t:.9g} is small enough for the tolerance {n.tolerance[0]:g}")

    def _out_of_reach(self, x: float, y: NDArray[np.float64]) -> str:
        """Sentence on the constraint that cannot be kept at x near a state; empty if all can."""
        n, reaches, before, start = self.n, self._component.reaches, math.inf, float(self.n.x[0])
        n.trial[:], n.x[0], text = y, x, ""
        for _ in range(_MOST_PROJECTIONS if reaches else 0):
            self.apply_function("reach")
            left = np.abs(n.reached[: len(reaches)])
            if np.max(left) <= 1:
                break
            if not np.sum(left) < _GAIN * before:
                worst, where = int(np.argmax(left)), f"t = {n.t[0] + x:.9g}"
                first, (text, names) = len(reaches) + sum(len(names) for _, names in reaches[:worst]), reaches[worst]
                values = ", ".join(f"{name} = {n.reached[first + i]:.9g}" for i, name in enumerate(names))
                text += (
                    f" cannot be kept: {values} at {where} is out of reach; stay within it"
                    if values
                    else (f" cannot be kept at {where}: no motion leads on from there")
                )
                break
            before = float(np.sum(left))
        n.x[0] = start
        return text

    def _check_domains(self, values: NDArray[np.float64], first: int, t: float) -> None:
        """Raise MotionError for the first value outside of its domain.

        :param first: index of the first value among parameters and inputs.
        """
        for i, value in enumerate(values.tolist(), first):
            low, high, domain = self._component.domains[i]
            if not low <= value <= high:
                name = self._component.names[self._component.first + i - 1]
                raise MotionError(f"{name} = {value:.9g} at t = {t:.9g}: it must be {domain}")

    def _check_conditions(self, t: float, least: float, count: int) -> None:
        """Raise MotionError for the first of ``count`` conditions whose margin is not greater than ``least``."""
        self.apply_function("outputs")
        for text, margin in zip(self._component.condition_texts[:count], self.n.margins[:count], strict=True):
            if not margin > least:
                does = "hardly does" if margin > 0 else "does not"
                raise MotionError(f"{text}; at t = {t:.9g} it {does} ({margin:.3g})")

    def _next_instant(self, t: float) -> float:
        """First instant after t [s] at which the component is not smooth; inf if there is none."""
        if not self.views.instants:
            return math.inf
        self.views.x[0] = t
        self.apply_function("events")
        return min((instant for instant in self.views.instants if instant > t), default=math.inf)

    def new_warnings(self, *, last: bool = False) -> Iterator[str]:
        """Yield what was noted of each coordinate, once; before the last time not of one whose rate may be missing."""
        for name, (text, row) in self._found.items():
            if name not in self._warned and (last or not may_miss_rates(row)):
                self._warned.add(name)
                yield text


def _memory_view(array: NDArray[np.float64]) -> memoryview[float]:
    """Memory view of an array, for CasADi's buffers."""
    return memoryview(cast("Any", array))
