"""Impacts and modes of contacts at one instant, with their derivatives by values, state and instant.

The rules are those of an FMU (``unilateral.c``): Newton's restitution and Moreau's rule, dry friction, and the end of
bounces that are too low to be followed.  Its code chooses modes; in these, impulses are a smooth function of the state
before them, which is differentiated.  Where a number by which modes are chosen is 0 there is a derivative
along those directions only in which it stays 0; it is handed on as a condition.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, TypeAlias, final

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons.derivatives.modes import ModeChoice
from liaisons.derivatives.steps import Floats
from liaisons.ensembles.right_hand_sides import RightHandSide
from liaisons.errors import SimulationError
from liaisons.expressions.algebra import stack
from liaisons.fmu.calls import Call

_TOUCHING, _STILL, _BALANCED, _OVERLAP, _DRIFT, _STUCK = 1e-12, 2e-12, 1e-13, 1e-9, 1e-3, 1e-9
"""Parts of the scales of positions, rates and accelerations that are rounding; an overlap; the drift of what is closed;
the rate of what sticks."""
_LOWEST, _LIFTED, _COUNTED = 1e-12, 1e-9, 1e-6
"""Parts of the scale: bounces below are summed; also those of what was closed; impacts count after a higher fall."""
_RESTORATIONS, _MOST_IMPACTS, _DEGENERATE = 2, 1000, 1e-9

Booleans: TypeAlias = NDArray[np.bool_]
Point: TypeAlias = tuple[float, Floats, Floats]
"""Instant [s], values and shared values."""
Modes: TypeAlias = tuple[int, ...]
"""Of gaps 1 (closed) or 0, of dry friction its direction, 0 where it sticks."""


@final
@dataclass(frozen=True, eq=False)
class Landing:
    """State after an event, and its derivatives.

    :param slopes: of the state, (states, 1 + values + states), by instant, values and state before.
    :param conditions: a row [by instant, values, state before] for each number that must stay 0, in units of its scale.
    """

    y: Floats
    slopes: Floats
    conditions: tuple[Floats, ...] = ()

    @classmethod
    def unchanged(cls, y: Floats, values: int) -> Landing:
        """The state before the event."""
        return cls(y, np.eye(len(y), 1 + values + len(y), 1 + values))

    @property
    def of_t(self) -> Floats:
        """Derivatives by the instant, (states, 1)."""
        return self.slopes[:, :1]

    @property
    def of_k(self) -> Floats:
        """Derivatives by the values, (states, values)."""
        return self.slopes[:, 1 : -len(self.y)]

    @property
    def of_y(self) -> Floats:
        """Derivatives by the state before."""
        return self.slopes[:, -len(self.y) :]

    def mapped(self, y: Floats, slopes: Floats) -> Landing:
        """After a further map of the state, with its derivatives [by instant, values, state]."""
        return Landing(y, self.rows(slopes), self.conditions)

    def rows(self, slopes: Floats) -> Floats:
        """Derivatives [by instant, values, state before the event], of those by instant, values and present state."""
        states = len(self.y)
        result = slopes[:, -states:] @ self.slopes
        result[:, :-states] += slopes[:, :-states]
        return result

    def conditioned(self, slopes: Floats) -> Landing:
        """With further numbers that must stay 0, by their derivatives [by instant, values, present state]."""
        return replace(self, conditions=(*self.conditions, *self.rows(slopes)))


@final
@dataclass(frozen=True, eq=False)
class _Numbers:
    """Numbers of the contacts at a state, as in ``core.h``."""

    v: Floats
    a: Floats
    G: Floats
    rate_scale: Floats
    acceleration_scale: Floats
    gap: Floats
    scale: Floats
    restitution: Floats
    stick: Floats
    slide: Floats


@final
class _Function:
    """A function of a point and more, called in place."""

    def __init__(self, function: ca.Function) -> None:
        """Take a function with dense results."""
        self._arguments = tuple(np.zeros(function.numel_in(i)) for i in range(function.n_in()))
        self._results = tuple(np.zeros(function.size_out(i)[::-1]) for i in range(function.n_out()))
        self._call = Call(function, self._arguments, self._results)

    def __call__(self, *arguments: float | Floats) -> list[Floats]:
        """Results at arguments, which may be used until the next call."""
        for array, argument in zip(self._arguments, arguments, strict=True):
            array[:] = argument
        self._call.run()
        return [array.T for array in self._results]


@final
class Contacts:
    """Contacts of a motion: unilateral liaisons, then dry friction."""

    def __init__(self, name: str, equations: RightHandSide) -> None:
        """Take the equations of the motion."""
        self._name, self._equations = name, equations
        contacts = equations.contacts
        assert contacts is not None
        self._contacts = contacts
        self.names = [contact.name for contact in contacts.contacts]
        self.gaps, self.count = contacts.gaps, len(self.names)
        self.remembered = self.count + 2 * self.gaps
        ends = np.cumsum([0, *(column.numel() for column in contacts.numbers.values())]).tolist()
        self._slices = {name: slice(*pair) for name, pair in zip(contacts.numbers, pairwise(ends), strict=True)}
        self._normals = [self.names.index(c.normal) if c.normal else -1 for c in contacts.contacts]

    # ---- functions

    @cached_property
    def _choice(self) -> ModeChoice:
        return ModeChoice(self.gaps, self._normals)

    @cached_property
    def _numbers_function(self) -> _Function:
        """Function of a point -> numbers."""
        return self._function([], ca.vertcat(*self._contacts.numbers.values()))

    @cached_property
    def _touch_slopes(self) -> _Function:
        """Function of a point -> derivatives of the gaps and of the rates."""
        numbers = self._contacts.numbers
        return self._function([], self._slopes(ca.vertcat(numbers["gap"], numbers["v"])))

    @cached_property
    def indicator_slopes(self) -> _Function:
        """Function of a point -> derivatives of the event indicators by instant, values and state."""
        return self._function([], self._slopes(self._contacts.indicators))

    @cached_property
    def _impact(self) -> _Function:
        """Function of a point, what is held, directions, and which gaps approach -> state, slacks, and their slopes."""
        held, direction, approaching = (ca.SX.sym(name, self.count) for name in ("held", "direction", "approaching"))
        numbers = self._contacts.numbers
        rebound = ca.vertcat(numbers["restitution"], ca.SX.zeros(self.count - self.gaps))
        rate = numbers["v"] * (1 + approaching * rebound)
        x = self._forces(rate, held, direction, impulses=True)
        pushed = ca.substitute(self._contacts.pushed, self._contacts.impulses, x)
        slack = stack(self._slacks(rate, x, self._matrix(), (held, direction), numbers["slide"]))
        return self._function([held, direction, approaching], pushed, slack, self._slopes(ca.vertcat(pushed, slack)))

    @cached_property
    def _restored(self) -> _Function:
        """Function of a point, and what is held -> state with gaps and rates of what is held put to 0, and slopes."""
        held, none, numbers = ca.SX.sym("held", self.count), ca.SX.zeros(self.count), self._contacts.numbers
        frictions = ca.SX.zeros(self.count - self.gaps)
        impulses = self._forces(numbers["v"], held, none, impulses=True)
        closed = ca.vertcat(held[: self.gaps, :], frictions)
        shifts = self._forces(ca.vertcat(numbers["gap"], frictions), closed, none, impulses=True)[: self.gaps, :]
        symbols = ca.vertcat(self._contacts.impulses, self._contacts.shifts)
        restored = ca.substitute(self._contacts.restored, symbols, ca.vertcat(impulses, shifts))
        return self._function([held], restored, self._slopes(restored))

    @cached_property
    def _rest_slopes(self) -> _Function:
        """Function of a point, what is held, and directions -> derivatives of the slacks at rest."""
        held, direction = (ca.SX.sym(name, self.count) for name in ("held", "direction"))
        a = self._contacts.numbers["a"]
        x = self._forces(a, held, direction, impulses=False)
        slack = stack(self._slacks(a, x, self._matrix(), (held, direction), self._contacts.numbers["stick"]))
        return self._function([held, direction], self._slopes(slack))

    def _function(self, further: list[ca.SX], *results: ca.SX) -> _Function:
        outputs = ca.cse([ca.densify(x) for x in results])
        return _Function(ca.Function("contact", [*self._equations.symbols, *further], outputs))

    def _slopes(self, value: ca.SX) -> ca.SX:
        """Derivatives by instant, values and state."""
        t, k, _, y = self._equations.symbols
        return ca.jacobian(value, ca.vertcat(t, k, y))

    def _forces(self, rate: ca.SX, held: ca.SX, direction: ca.SX, *, impulses: bool) -> ca.SX:
        """Forces x in modes, with G x = -rate where it is held."""
        acting = [0.0 if impulses and normal < 0 else 1.0 for normal in self._normals]
        slide = ca.vertcat(ca.SX.zeros(self.gaps), self._contacts.numbers["slide"])
        drag = -ca.DM(acting) * direction * slide
        return self._contacts.compliance.forces(rate, held, drag, self._normals)[0]

    def _matrix(self) -> ca.SX:
        return self._contacts.compliance.matrix

    def _slacks(self, rate: Any, x: Any, G: Any, modes: tuple[Any, Any], bound: Any) -> list[Any]:
        """What is >= 0 in consistent modes: forces of what is closed, rates of what is not; in units of rates.

        :param rate: without the forces x; ``modes``: what is held, and directions; of numbers, or of expressions.
        """
        after, (held, direction), rows = rate + G @ x, modes, []
        for i, normal in enumerate(self._normals):
            least = 0 if i < self.gaps else bound[i - self.gaps] * (x[normal] if normal >= 0 else 1)
            force = x[i] if i < self.gaps else least - abs(x[i])
            rows.append(held[i] * force * G[i, i] + (1 - held[i] if i < self.gaps else direction[i]) * after[i])
        return rows

    # ---- modes

    def _numbers(self, point: Point, y: Floats) -> _Numbers:
        (column,) = self._numbers_function(*point, y)
        numbers = column[:, 0].copy()
        values = {name: numbers[part] for name, part in self._slices.items()}
        return _Numbers(**values | {"G": values["G"].reshape(self.count, self.count).T})

    def _holds(self, modes: Modes, i: int) -> bool:
        if i < self.gaps:
            return modes[i] == 1
        return modes[i] == 0 and (self._normals[i] < 0 or modes[self._normals[i]] == 1)

    def _held(self, modes: Modes) -> Floats:
        return np.array([float(self._holds(modes, i)) for i in range(self.count)])

    def _directions(self, modes: Modes) -> Floats:
        """Directions of what slides, 0 of all others, and where there is no force."""
        touching = [self._normals[i] < 0 or modes[self._normals[i]] == 1 for i in range(self.count)]
        return np.array([float(i >= self.gaps and touching[i] and modes[i]) for i in range(self.count)])

    def _choose(
        self, c: _Numbers, time: float, first: list[int], chosen: list[int], rate: Floats | None = None
    ) -> tuple[Modes, Floats, Floats]:
        """Modes that are consistent, the present ones first, then those that hold most; forces and slacks in them.

        :param chosen: contacts whose modes are chosen.
        :param rate: before an impact, as it would be without impulses; None: at rest.
        """
        problem, impulses = self._choice, rate is not None
        own, scale = (c.a, c.acceleration_scale) if rate is None else (rate, c.rate_scale)
        bound = c.slide if impulses else c.stick
        problem.G[:], problem.rate[:], problem.tolerance[:] = c.G.T.ravel(), own, _BALANCED * scale
        problem.stick[: len(bound)], problem.slide[: len(bound)], problem.modes[:] = bound, c.slide, first
        why = problem.choose(chosen, impulses=impulses)
        if why:
            raise self._refusal(chosen, time, why)
        modes, x = tuple(problem.modes.tolist()), problem.forces.copy()
        flags = self._held(modes), self._directions(modes)
        return modes, x, np.array(self._slacks(own, x, c.G, flags, bound))

    def _refusal(self, contacts: list[int], time: float, why: str) -> SimulationError:
        return SimulationError(f"{self._name}: {', '.join(self.names[i] for i in contacts)} at t = {time:.9g} s: {why}")

    # ---- an event

    def restore(self, landing: Landing, point: Point, memory: ContactMemory) -> Landing:
        """The state before an event, without the drift of what is closed or sticks."""
        held = self._held(memory.modes)
        for _ in range(_RESTORATIONS * bool(held.any())):
            y, slopes = self._restored(*point, landing.y, held)
            landing = landing.mapped(y[:, 0].copy(), slopes)
        return landing

    def settle(
        self, landing: Landing, point: Point, memory: ContactMemory, which: int | None
    ) -> tuple[Landing, ContactMemory, float]:
        """State and memory after the impacts and mode changes of an instant, and the largest next step.

        :param landing: so far, at this instant.
        :param which: contact whose indicator is 0; None at a known instant.
        """
        c = self._numbers(point, landing.y)
        closed = np.array(memory.modes[: self.gaps]) == 1
        touching = self._touching(c, point[0], closed)
        new = [i for i in np.flatnonzero(touching & ~closed) if i != which]
        if new:
            (slopes,) = self._touch_slopes(*point, landing.y)
            landing = landing.conditioned(slopes[new] / c.scale[new, None])
        landing, c, impacts = self._struck(landing, point, c, touching)
        landing, c, modes, rests_from, size = self._rested(landing, point, c, touching, memory)
        holds = [memory.started and self._holds(memory.modes, i) for i in range(self.count)]
        still = np.flatnonzero((np.abs(c.v) <= _STILL * c.rate_scale) & ~np.array(holds)).tolist()
        still = [i for i in still if i != which and self._can_push(i, touching)]
        if still:
            (slopes,) = self._touch_slopes(*point, landing.y)
            landing = landing.conditioned(slopes[self.gaps :][still] / c.rate_scale[still, None])
        return landing, ContactMemory(modes, memory.impacts + impacts, rests_from), size

    def _touching(self, c: _Numbers, time: float, closed: Booleans) -> Booleans:
        """Which gaps are at 0; those that are closed may have drifted from it."""
        rounding = _TOUCHING * c.scale + 2 * np.spacing(abs(time)) * c.rate_scale[: self.gaps]
        for i in np.flatnonzero(c.gap < -_OVERLAP * c.scale - rounding):
            raise SimulationError(
                f"{self._name}: {self.names[i]} = {c.gap[i]:.6g} at t = {time:.9g} s: bodies overlap; "
                "start with a gap >= 0, and let no prescribed coordinate jump through a body"
            )
        return c.gap <= np.where(closed, _DRIFT * c.scale, rounding)

    def _struck(
        self, landing: Landing, point: Point, c: _Numbers, touching: Booleans
    ) -> tuple[Landing, _Numbers, Floats]:
        """State after impacts, one after the other, until nothing approaches; and how many of each gap count."""
        gaps, impacts, approaching = slice(self.gaps), np.zeros(self.gaps), np.zeros(self.count)
        for _ in range(_MOST_IMPACTS):
            least = _STILL * c.rate_scale[gaps]
            if not (touching & (c.v[gaps] < -least)).any():
                return landing, c, impacts
            takes = touching & (c.v[gaps] <= least)
            chosen = [
                i
                for i, normal in enumerate(self._normals)
                if (i < self.gaps and takes[i]) or (normal >= 0 and takes[normal])
            ]
            approaching[gaps] = c.v[gaps] < 0
            rate = c.v.copy()
            rate[gaps] *= 1 + approaching[gaps] * c.restitution
            first = [int(i in chosen or i >= self.gaps) for i in range(self.count)]
            modes, x, _ = self._choose(c, point[0], first, chosen, rate)
            fell = c.v[gaps] ** 2 > 2 * np.abs(c.a[gaps]) * _COUNTED * c.scale
            impacts += (x[gaps] > 0) & (c.v[gaps] < -least) & fell
            before, modes_of = c, (self._held(modes), self._directions(modes), approaching)
            landing = self._pushed(landing, point, c, modes_of, chosen)
            c = self._numbers(point, landing.y)
            loss = -x @ (before.v + c.v) / 2
            if loss < -1e-9 * np.abs(x) @ (np.abs(before.v) + 1e-2 * c.rate_scale):
                why = "Newton's restitution and friction would gain energy (Kane): take less of either"
                raise self._refusal(chosen, point[0], why)
        raise self._refusal(
            np.flatnonzero(touching).tolist(), point[0], f"more than {_MOST_IMPACTS} impacts at one instant"
        )

    def _pushed(
        self, landing: Landing, point: Point, c: _Numbers, modes: tuple[Floats, Floats, Floats], chosen: list[int]
    ) -> Landing:
        """State after impulses in some modes: what is held, directions, which gaps approach."""
        y, slack, slopes = self._impact(*point, landing.y, *modes)
        states = len(y)
        weak = [i for i in chosen if slack[i, 0] <= _DEGENERATE * c.rate_scale[i]]
        return landing.conditioned(slopes[states:][weak] / c.rate_scale[weak, None]).mapped(
            y[:, 0].copy(), slopes[:states]
        )

    def _rested(
        self, landing: Landing, point: Point, c: _Numbers, touching: Booleans, memory: ContactMemory
    ) -> tuple[Landing, _Numbers, Modes, Floats, float]:
        """State after the last of bounces that are summed; modes, instants of rest, and the next step at most."""
        closed, rests_from, stopped = np.array(memory.modes[: self.gaps]) == 1, memory.rests_from.copy(), set[int]()
        while True:
            modes, weak, rate = self._modes_at_rest(c, point[0], touching, memory.modes)
            bounces = [i for i in np.flatnonzero(touching).tolist() if modes[i] != 1 and i not in stopped]
            low, size = self._lowest(c, bounces, closed, rate)
            if low is None:
                break
            held = np.array([float(i < self.gaps and (i == low or modes[i] == 1)) for i in range(self.count)])
            lasts = 0.0 if closed[low] else 2 * c.v[low] / (-rate[low] * (1 - c.restitution[low]))
            rests_from[low] = point[0] + lasts
            landing = self._pushed(landing, point, c, (held, 0 * held, 0 * held), [])
            c = self._numbers(point, landing.y)
            stopped.add(low)
        for i in range(self.gaps):
            if modes[i] == 1 and not closed[i] and i not in stopped:
                rests_from[i] = point[0]
        if weak:
            (slopes,) = self._rest_slopes(*point, landing.y, self._held(modes), self._directions(modes))
            landing = landing.conditioned(slopes[weak] / c.acceleration_scale[weak, None])
        return landing, c, modes, rests_from, size

    def _can_push(self, i: int, touching: Booleans) -> bool:
        """Whether a contact can have a force."""
        normal = i if i < self.gaps else self._normals[i]
        return normal < 0 or bool(touching[normal])

    def _modes_at_rest(
        self, c: _Numbers, time: float, touching: Booleans, present: Modes
    ) -> tuple[Modes, list[int], Floats]:
        """Modes of what touches and rests, contacts that could as well be in another one, and slacks."""
        modes, chosen = list(present), list[int]()
        for i, normal in enumerate(self._normals):
            least = _STUCK if i >= self.gaps and self._holds(present, i) else _STILL
            still = abs(c.v[i]) <= least * c.rate_scale[i]
            if (i < self.gaps and not (touching[i] and still)) or (normal >= 0 and not touching[normal]):
                modes[i] = 0
            elif i >= self.gaps and not still:
                modes[i] = 1 if c.v[i] > 0 else -1
            else:
                chosen.append(i)
        chosen_modes, _, slack = self._choose(c, time, modes, chosen)
        low, closed = slack <= _DEGENERATE * c.acceleration_scale, np.array(chosen_modes[: self.gaps]) == 1
        return chosen_modes, [i for i in chosen if low[i] and self._can_push(i, closed)], slack

    def _lowest(self, c: _Numbers, gaps: list[int], closed: Booleans, rate: Floats) -> tuple[int | None, float]:
        """A gap whose bounces are summed from here on, and the step in which the next impact of all others lies."""
        size = np.inf
        for i in gaps:
            v, a = c.v[i], rate[i]
            if not (v > _STILL * c.rate_scale[i] and a < 0):
                continue
            if v * v / (-2 * a) <= (_LIFTED if closed[i] else _LOWEST) * c.scale[i]:
                return i, size
            size = min(size, -2.5 * v / a)
        return None, size


@final
@dataclass(frozen=True, eq=False)
class ContactMemory:
    """What an FMU remembers of contacts.

    :param impacts: of each gap; ``rests_from``: instant at which it rests [s].
    :param started: whether modes were chosen already.
    """

    modes: Modes
    impacts: Floats
    rests_from: Floats
    started: bool = True

    def values(self) -> Iterator[float]:
        """As shared values of the motion."""
        yield from (*self.modes, *self.impacts, *self.rests_from)
