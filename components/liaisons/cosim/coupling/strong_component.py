"""FMUs that feed each other in a cycle, solved together; a single FMU outside of cycles is a group of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from ctypes import pointer
from functools import partial
from typing import final

import numpy as np

from liaisons.cosim.compiled.calls import RAISED, Call
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.coupling.newton import Newton
from liaisons.cosim.coupling.node import Node
from liaisons.cosim.coupling.records import DIVERGED, FailureRecord, NodeRecord, StrongComponentRecord
from liaisons.cosim.coupling.signals import Indices, Signals, Vector
from liaisons.cosim.structure.simulation import Simulation
from liaisons.errors import RefusedError, SimulationError

MOST_ITERATIONS = 100
_SECANTS = 3
_DEPENDENT = 1e-12
"""A secant of which the others leave no larger part says nothing new."""
_SLOW = 3
"""A step that took more evaluations than this has the derivatives calculated anew for the next one."""
_NOISE = 1e4
"""An iteration that has stopped to contract is good enough within this multiple of the tolerance: FMUs round, too."""
_SMALLEST = 1e-3
"""What is always 0 but for rounding has this size, a part of 1, FMI's nominal value where none is given."""


@final
class StrongComponent:
    """Members that are solved together.

    Implicit coupling solves by Newton's method, else it is repeated, one member after the other.

    :param cyclic: they feed each other, or one feeds itself.
    """

    def __init__(
        self, members: Sequence[Node], signals: Signals, bus: Bus, simulation: Simulation, *, cyclic: bool
    ) -> None:
        self.members = members
        self._signals = signals
        self._bus = bus
        self._cyclic = cyclic
        self._tolerance = simulation.interface_tolerance
        fed = {i for member in members for curve in member.curves for i in (*curve.data, curve.rate)} - {signals.zero}
        own = {i for m in members for part in (m.values, m.slopes if m.sloped else range(0)) for i in _range(part)}
        self._unknowns: Indices = np.array(sorted(fed & own), dtype=np.intp)
        self._kinds = signals.kinds[self._unknowns % signals.count]
        self._valued = int(np.searchsorted(self._unknowns, signals.count))  # behind these are slopes
        starting = partial(simulation.depends, initially=True)
        self._running, self._starting = (
            Newton(members, signals, self._unknowns, depends, bus, initial=depends is starting)
            if cyclic and simulation.coupling == "implicit"
            else None
            for depends in (simulation.depends, starting)
        )

    def record(self) -> StrongComponentRecord:
        """The same, for compiled code."""
        self._errors = np.empty(len(self._unknowns))
        self._member_records = [member.record() for member in self.members]
        record = StrongComponentRecord(cyclic=self._cyclic, tolerance=self._tolerance, count=len(self.members))
        record.n, record.valued = len(self._unknowns), self._valued
        record.members = (NodeRecord * len(self.members))(*self._member_records)
        record.point(unknowns=self._unknowns, kinds=self._kinds, errors=self._errors)
        if self._running is not None:
            self._order = Call(self._attempt, self._running.order)
            record.newton = pointer(self._running.told(self._order))
        return record

    def reset(self) -> None:
        """Forget everything."""
        self._forget()
        for member in self.members:
            member.reset()

    def _forget(self) -> None:
        for newton in (self._running, self._starting):
            if newton is not None:
                newton.ready = False

    @property
    def order(self) -> int:
        """Order of the error in H: that of the coarsest polynomial."""
        return min((member.order for member in self.members), default=6)

    def settle(self, time: float, *, initial: bool) -> None:
        """Make outputs and inputs fit at one instant, the begin; with slopes once initialization is over."""
        newton = self._starting if initial else self._running

        def evaluate(member: Node, _: int) -> None:
            member.match(initial=initial)
            if not initial:
                member.read_output_derivatives()

        if initial and self._cyclic:  # a first guess that the FMUs can live with: what follows from their start values
            for member in self.members:
                member.read()
                member.collect(self._signals.now)
        self._forget()
        self._iterate(evaluate, newton, 0.0, time)
        self._forget()

    def advance(self, end: float, size: float) -> None:
        """Find what the signals are at t + H."""

        def evaluate(member: Node, iteration: int) -> None:
            member.step(again=iteration > 0)

        if self._iterate(evaluate, self._running, size, end) > _SLOW:
            self._forget()

    @property
    def source(self) -> Node | None:
        """The one that can be stepped as is wanted, for nothing feeds it; None if there is none."""
        first = self.members[0]
        return None if self._cyclic or first.inputs or not first.part.fmu.variable_step else first

    def _iterate(self, evaluate: Callable[[Node, int], None], newton: Newton | None, size: float, time: float) -> int:
        """Solve x = F(x); returns how often F was evaluated."""
        signals, unknowns, result = self._signals, self._unknowns, self._signals.result
        if not self._cyclic:
            evaluate(self.members[0], 0)
            self.members[0].collect(signals.now)
            return 1
        if newton is not None and not newton.ready:
            self._attempt(partial(newton.prepare, size))
        points: list[Vector] = []
        changes: list[Vector] = []
        before, errors, iteration = np.inf, np.empty(0), 0
        for iteration in range(MOST_ITERATIONS):
            x = signals.now[unknowns]
            for member in self.members:
                self._evaluate(evaluate, member, iteration)
                member.collect(result)
                if newton is None:
                    member.collect(signals.now)
            change = result[unknowns] - x
            if newton is not None:
                change = newton.solve(change)
            errors = np.abs(change) / (self._scales(x, size or 1.0) * self._tolerance)
            error = float(np.max(errors, initial=0.0))
            if error <= 1 or (iteration > 2 and before / 2 < error <= _NOISE):
                break
            if newton is not None:
                points, changes = [*points, x][-_SECANTS - 1 :], [*changes, change][-_SECANTS - 1 :]
                signals.now[unknowns] = _next(points, changes)
            before = error
        else:
            self._give_up(time, errors)
        self._hand_on()
        return iteration + 1

    def _scales(self, x: Vector, size: float) -> Vector:
        """What errors are compared with: the largest value of this unit so far; of slopes, that over H."""
        sizes, n = self._signals.sizes.copy(), self._valued
        np.maximum.at(sizes, self._kinds[:n], np.abs(x[:n]))
        scales = np.maximum(sizes, _SMALLEST)[self._kinds]
        scales[n:] /= size
        return scales

    @staticmethod
    def _evaluate(evaluate: Callable[[Node, int], None], member: Node, iteration: int) -> None:
        try:
            evaluate(member, iteration)
        except RefusedError as refusal:
            if iteration == 0:
                raise
            hint = f"with inputs of iteration {iteration}, which leads away: choose a smaller step_size"
            raise RefusedError(f"{refusal}; {hint}") from refusal

    def fail(self, failure: FailureRecord, status: int) -> None:
        """Say why compiled code went no further.

        :raises SimulationError: always.
        """
        if status == DIVERGED:
            self._give_up(self._bus.end.value, self._errors)
        if status == RAISED and self._running is not None and self._order.raised is not None:
            self._bus.check_status(self._order, status)
        assert self._running is not None or not failure.deriving
        calls = self._running.calls if failure.deriving and self._running else self.members[failure.member].calls
        self._evaluate(
            lambda *_: self._bus.check_status(calls[failure.call], status), self.members[0], failure.iteration
        )

    def _attempt(self, elimination: Callable[[], None]) -> None:
        try:
            elimination()
        except RuntimeError:
            names = ", ".join(member.name for member in self.members)
            raise SimulationError(
                f"{names}: what they hand each other at t = {self._bus.end.value:.10g} s depends on itself without a "
                "single solution, as with a body that carries itself or two that prescribe each other: change the "
                "connections"
            ) from None

    def _hand_on(self) -> None:
        """What no member of the group takes is as it was read."""
        signals = self._signals
        kept = signals.now[self._unknowns]
        for member in self.members:
            member.collect(signals.now)
        signals.now[self._unknowns] = kept

    def _give_up(self, time: float, errors: Vector) -> None:
        worst = int(self._unknowns[int(np.argmax(errors))]) % self._signals.count
        place = ".".join(self._signals.places[worst])
        names = ", ".join(member.name for member in self.members)
        cure = "choose a smaller step_size" + ("" if self._running is not None else ", or coupling='implicit'")
        raise RefusedError(
            f"{names}: what they hand each other does not converge at t = {time:.10g} s, {place} least of all, "
            f"after {MOST_ITERATIONS} iterations: {cure}"
        )


def _next(points: list[Vector], changes: list[Vector]) -> Vector:
    """Where to go from the last point, by the step that earlier ones, taken linearly, would have been right with.

    Anderson acceleration: J. ACM 12 (1965); Walker and Ni, SIAM J. Numer. Anal. 49 (2011), type II.  The secants are
    made orthogonal one after the other, the latest first (modified Gram-Schmidt).

    :param changes: those that the iteration by itself would make at the points.
    """
    x, change = points[-1], changes[-1]
    going, rest = x + change, change
    if len(points) < 3:
        return going
    found: list[tuple[Vector, Vector]] = []  # directions of changes, and how far one goes with each
    for k in range(len(points) - 1, 0, -1):
        direction = changes[k] - changes[k - 1]
        way = (points[k] - points[k - 1]) + direction
        length = np.sqrt(_product(direction, direction))
        for other, other_way in found:
            part = _product(other, direction)
            direction, way = direction - part * other, way - part * other_way
        left = np.sqrt(_product(direction, direction))
        if left > _DEPENDENT * length:
            direction, way = direction / left, way / left
            found.append((direction, way))
            part = _product(direction, rest)
            rest, going = rest - part * direction, going - part * way
    return going


def _product(one: Vector, other: Vector) -> float:
    """Of two vectors, summed up in order: rounded alike everywhere."""
    return float(np.add.accumulate(one * other)[-1])


def _range(part: slice | range) -> range:
    return range(part.start, part.stop)
