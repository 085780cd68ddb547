"""FMUs that feed each other in a cycle, solved together; a single FMU outside of cycles is a group of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, final

import numpy as np
from scipy.sparse import coo_array, eye_array
from scipy.sparse.linalg import splu

from liaisons.cosim.coupling.member import Derivatives, Member
from liaisons.cosim.coupling.signals import Curve, Indices, Signals, Vector
from liaisons.cosim.refusal import RefusedError
from liaisons.cosim.schedule import Depends
from liaisons.errors import SimulationError

MOST_ITERATIONS = 100
_DENSE = 60
"""Up to so many unknowns an inverse is faster than a sparse factorization."""
_SECANTS = 4
_SLOW = 3
"""A step that took more evaluations than this has the derivatives calculated anew for the next one."""
_NOISE = 1e4
"""An iteration that has stopped to contract is good enough within this multiple of the tolerance: FMUs round, too."""


@final
class Group:
    """Members that are solved together.

    :param newton: solve by Newton's method, else by repetition, one member after the other.
    :param depends: which outputs depend directly on which inputs, while stepping and in initialization.
    """

    def __init__(
        self,
        members: Sequence[Member],
        signals: Signals,
        *,
        cyclic: bool,
        newton: bool,
        depends: Depends,
        depends_initially: Depends,
        tolerance: float,
    ) -> None:
        self._members = members
        self._signals = signals
        self._cyclic = cyclic
        self._newton = newton and cyclic
        self._tolerance = tolerance
        self._result = np.zeros_like(signals.now)
        fed = {i for member in members for curve in member.curves for i in (*curve.data, curve.rate)} - {signals.zero}
        own = {i for m in members for part in (m.values, m.slopes if m.sloped else range(0)) for i in _range(part)}
        self._unknowns: Indices = np.array(sorted(fed & own), dtype=np.intp)
        self._running = _Jacobian(members, signals, self._unknowns, depends, initial=False)
        self._starting = _Jacobian(members, signals, self._unknowns, depends_initially, initial=True)
        self._solve: Callable[[Vector], Vector] | None = None

    @property
    def order(self) -> int:
        """Order of the error in H: that of the coarsest polynomial."""
        return min((member.order for member in self._members), default=6)

    def settle(self, time: float, *, initial: bool) -> None:
        """Make outputs and inputs fit at one instant, the begin; with slopes once initialization is over."""
        jacobian = self._starting if initial else self._running

        def evaluate(member: Member, _: int) -> None:
            member.match(initial=initial)
            if not initial:
                member.incline()

        if initial and self._cyclic:  # a first guess that the FMUs can live with: what follows from their start values
            for member in self._members:
                member.read()
                member.collect(self._signals.now)
        self._solve = None
        self._iterate(evaluate, jacobian, 0.0, time)
        self._solve = None

    def advance(self, end: float, size: float) -> None:
        """Find what the signals are at t + H."""

        def evaluate(member: Member, iteration: int) -> None:
            member.step(again=iteration > 0)

        if self._iterate(evaluate, self._running, size, end) > _SLOW:
            self._solve = None

    def _iterate(self, evaluate: Callable[[Member, int], None], jacobian: _Jacobian, size: float, time: float) -> int:
        """Solve x = F(x); returns how often F was evaluated."""
        signals, unknowns, result = self._signals, self._unknowns, self._result
        if not self._cyclic:
            evaluate(self._members[0], 0)
            self._members[0].collect(signals.now)
            return 1
        if self._newton and self._solve is None:
            self._solve = self._solver(jacobian, size, time)
        secants = _Secants()
        before, errors, iteration = np.inf, np.empty(0), 0
        for iteration in range(MOST_ITERATIONS):
            x = signals.now[unknowns]
            for member in self._members:
                self._evaluate(evaluate, member, iteration)
                member.collect(result)
                if not self._newton:
                    member.collect(signals.now)
            change = result[unknowns] - x
            if self._solve is not None:
                change = self._solve(change)
            errors = np.abs(change) / (signals.scales(size or 1.0)[unknowns] * self._tolerance)
            error = float(np.max(errors, initial=0.0))
            if error <= 1 or (iteration > 2 and before / 2 < error <= _NOISE):
                break
            if self._newton:
                signals.now[unknowns] = secants.next(x, change)
            before = error
        else:
            self._give_up(time, errors)
        self._hand_on()
        return iteration + 1

    @staticmethod
    def _evaluate(evaluate: Callable[[Member, int], None], member: Member, iteration: int) -> None:
        try:
            evaluate(member, iteration)
        except RefusedError as refusal:
            if iteration == 0:
                raise
            hint = f"with inputs of iteration {iteration}, which leads away: choose a smaller step_size"
            raise RefusedError(f"{refusal}; {hint}") from refusal

    def _solver(self, jacobian: _Jacobian, size: float, time: float) -> Callable[[Vector], Vector]:
        try:
            return jacobian.solver(size)
        except (np.linalg.LinAlgError, RuntimeError):  # of the dense and of the sparse factorization
            names = ", ".join(member.name for member in self._members)
            raise SimulationError(
                f"{names}: what they hand each other at t = {time:.10g} s depends on itself without a single solution, "
                "as with a body that carries itself or two that prescribe each other: change the connections"
            ) from None

    def _hand_on(self) -> None:
        """What no member of the group takes is as it was read."""
        signals = self._signals
        kept = signals.now[self._unknowns]
        for member in self._members:
            member.collect(signals.now)
        signals.now[self._unknowns] = kept

    def _give_up(self, time: float, errors: Vector) -> None:
        worst = int(self._unknowns[int(np.argmax(errors))]) % self._signals.count
        place = ".".join(self._signals.places[worst])
        names = ", ".join(member.name for member in self._members)
        cure = "choose a smaller step_size" + ("" if self._newton else ", or coupling='implicit'")
        raise RefusedError(
            f"{names}: what they hand each other does not converge at t = {time:.10g} s, {place} least of all, "
            f"after {MOST_ITERATIONS} iterations: {cure}"
        )


@final
class _Jacobian:
    """∂F/∂x as far as it is known.

    Outputs depend on inputs directly, and so do their slopes; and where the acceleration of a port does, an input that
    changes at the end of a step changes rate and value there too: by the integrals of its polynomial.
    """

    def __init__(
        self, members: Sequence[Member], signals: Signals, unknowns: Indices, depends: Depends, *, initial: bool
    ) -> None:
        self._derivatives: list[Derivatives] = []
        self._count = len(unknowns)
        place = {int(index): k for k, index in enumerate(unknowns)}
        entries: list[tuple[int, int, int, float, int]] = []
        number = 0
        for member in members:
            derivatives = member.derivatives(depends)
            self._derivatives.append(derivatives)
            for i, k in derivatives.pairs:
                curve, value = member.curves[k], member.values.start + i
                source = member.sources[k]
                effects = [(value, source, 1.0, 0), (member.slopes.start + i, curve.rate, 1.0, 0)]
                if not initial:
                    effects += _through_motion(signals.triple(value), curve)
                entries += [
                    (place[row], place[column], number, factor, power)
                    for row, column, factor, power in effects
                    if row in place and column in place
                ]
                number += 1
        self._rows, self._columns, self._numbers = (
            np.array([entry[k] for entry in entries], dtype=np.intp) for k in range(3)
        )
        self._factors = np.array([entry[3] for entry in entries])
        self._powers = np.array([entry[4] for entry in entries], dtype=float)

    def solver(self, size: float) -> Callable[[Vector], Vector]:
        """A function that applies (1 - ∂F/∂x)⁻¹."""
        found = np.concatenate([derivatives() for derivatives in self._derivatives])
        values = found[self._numbers] * self._factors * size**self._powers
        n = self._count
        matrix = coo_array((values, (self._rows, self._columns)), (n, n))
        if n <= _DENSE:
            inverse = np.linalg.inv(np.eye(n) - matrix.toarray())
            return inverse.__matmul__
        factors: Any = splu((eye_array(n) - matrix).tocsc())
        return factors.solve


def _through_motion(triple: Sequence[int], curve: Curve) -> list[tuple[int, int, float, int]]:
    """How the data of an input at t + H move a port: (of the port, of the input, factor, power of H)."""
    if len(triple) < 3 or len(curve.data) > len(_INTEGRALS) or curve.order > 0:
        return []
    integrals = _INTEGRALS[len(curve.data)]
    return [
        (triple[row], datum, factor, power + 2 - row)
        for power, (datum, factors) in enumerate(zip(curve.data, integrals, strict=True))
        for row, factor in enumerate(factors)
    ]


_INTEGRALS = {1: [(1 / 6, 1 / 2)], 2: [(3 / 20, 1 / 2), (-1 / 30, -1 / 12)]}
"""∫ (1 - θ) h and ∫ h over the step, for the Hermite polynomials h of value (and rate) at its end."""


@final
class _Secants:
    """Anderson acceleration: the step that earlier ones, taken linearly, would have been right with.

    Anderson, J. ACM 12 (1965); Walker and Ni, SIAM J. Numer. Anal. 49 (2011), type II.
    """

    def __init__(self) -> None:
        self._points: list[Vector] = []
        self._changes: list[Vector] = []

    def next(self, x: Vector, change: Vector) -> Vector:
        """Where to go from x, if the iteration by itself would make this change."""
        self._points.append(x)
        self._changes.append(change)
        if len(self._points) < 3:
            return x + change
        points = np.diff(self._points[-_SECANTS:], axis=0).T
        changes = np.diff(self._changes[-_SECANTS:], axis=0).T
        weights = np.linalg.lstsq(changes, change, rcond=1e-12)[0]
        return x + change - (points + changes) @ weights


def _range(part: slice | range) -> range:
    return range(part.start, part.stop)
