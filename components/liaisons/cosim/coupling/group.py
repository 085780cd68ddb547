"""FMUs that feed each other in a cycle, solved together; a single FMU outside of cycles is a group of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, final

import numpy as np
from scipy.sparse import coo_array, eye_array
from scipy.sparse.linalg import splu

from liaisons.cosim.coupling.handed import Others
from liaisons.cosim.coupling.member import Member
from liaisons.cosim.coupling.signals import Curve, Indices, Signals, Vector
from liaisons.cosim.schedule import Depends
from liaisons.cosim.simulation import Simulation
from liaisons.errors import RefusedError, SimulationError

MOST_ITERATIONS = 100
_DENSE = 60
"""Up to so many unknowns an inverse is faster than a sparse factorization."""
_SECANTS = 4
_SLOW = 3
"""A step that took more evaluations than this has the derivatives calculated anew for the next one."""
_NOISE = 1e4
"""An iteration that has stopped to contract is good enough within this multiple of the tolerance: FMUs round, too."""

Solve = Callable[[Vector], Vector]
Factorize = Callable[[float], Solve]


@final
class Group:
    """Members that are solved together.

    Implicit coupling solves by Newton's method, else it is repeated, one member after the other.

    :param cyclic: they feed each other, or one feeds itself.
    """

    def __init__(self, members: Sequence[Member], signals: Signals, simulation: Simulation, *, cyclic: bool) -> None:
        self._members = members
        self._signals = signals
        self._cyclic = cyclic
        self._newton = cyclic and simulation.coupling == "implicit"
        self._tolerance = simulation.interface_tolerance
        self._result = np.zeros_like(signals.now)
        fed = {i for member in members for curve in member.curves for i in (*curve.data, curve.rate)} - {signals.zero}
        own = {i for m in members for part in (m.values, m.slopes if m.sloped else range(0)) for i in _range(part)}
        self._unknowns: Indices = np.array(sorted(fed & own), dtype=np.intp)
        self._running, self._starting = (
            _newton(members, signals, self._unknowns, partial(simulation.depends, initially=initial), initial=initial)
            for initial in (False, True)
        )
        self._solve: Solve | None = None

    def begin_anew(self) -> None:
        """Forget everything."""
        self._result[:] = 0.0
        self._solve = None
        for member in self._members:
            member.begin_anew()

    @property
    def order(self) -> int:
        """Order of the error in H: that of the coarsest polynomial."""
        return min((member.order for member in self._members), default=6)

    def settle(self, time: float, *, initial: bool) -> None:
        """Make outputs and inputs fit at one instant, the begin; with slopes once initialization is over."""
        newton = self._starting if initial else self._running

        def evaluate(member: Member, _: int) -> None:
            member.match(initial=initial)
            if not initial:
                member.incline()

        if initial and self._cyclic:  # a first guess that the FMUs can live with: what follows from their start values
            for member in self._members:
                member.read()
                member.collect(self._signals.now)
        self._solve = None
        self._iterate(evaluate, newton, 0.0, time)
        self._solve = None

    def advance(self, end: float, size: float) -> None:
        """Find what the signals are at t + H."""

        def evaluate(member: Member, iteration: int) -> None:
            member.step(again=iteration > 0)

        if self._iterate(evaluate, self._running, size, end) > _SLOW:
            self._solve = None

    def advance_in_thirds(self, wanted: Indices, size: float) -> Others | None:
        """The same for a source that can be stepped so; returns what some signals were on the way."""
        source = self._members[0]
        if self._cyclic or source.inputs or not source.part.fmu.variable_step:
            return None
        inside = source.step_in_thirds()
        source.collect(self._signals.now)
        return (size / 3, 2 * size / 3), inside[:, wanted - source.values.start]

    def _iterate(self, evaluate: Callable[[Member, int], None], newton: Factorize, size: float, time: float) -> int:
        """Solve x = F(x); returns how often F was evaluated."""
        signals, unknowns, result = self._signals, self._unknowns, self._result
        if not self._cyclic:
            evaluate(self._members[0], 0)
            self._members[0].collect(signals.now)
            return 1
        if self._newton and self._solve is None:
            self._solve = self._solver(newton, size, time)
        points: list[Vector] = []
        changes: list[Vector] = []
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
                points.append(x)
                changes.append(change)
                signals.now[unknowns] = _next(points, changes)
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

    def _solver(self, newton: Factorize, size: float, time: float) -> Solve:
        try:
            return newton(size)
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


def _newton(
    members: Sequence[Member], signals: Signals, unknowns: Indices, depends: Depends, *, initial: bool
) -> Factorize:
    """Makes, for a step of a size, a function that applies (1 - ∂F/∂x)⁻¹, with ∂F/∂x as far as it is known.

    Outputs depend on inputs directly, and so do their slopes; and where the acceleration of a port does, an input that
    changes at the end of a step changes rate and value there too: by the integrals of its polynomial.
    """
    place = {int(index): k for k, index in enumerate(unknowns)}
    entries: list[tuple[int, int, int, float, int]] = []  # row, column, which derivative, factor, power of H
    calculated: list[Callable[[], Vector]] = []
    number = 0
    for member in members:
        pairs, values = member.derivatives(depends)
        calculated.append(values)
        for i, k in pairs:
            curve, value = member.curves[k], member.values.start + i
            effects = [(value, member.sources[k], 1.0, 0), (member.slopes.start + i, curve.rate, 1.0, 0)]
            if not initial:
                effects += _through_motion(signals.triple(value), curve)
            entries += [
                (place[row], place[column], number, factor, power)
                for row, column, factor, power in effects
                if row in place and column in place
            ]
            number += 1
    rows, columns, numbers = (np.array([entry[k] for entry in entries], dtype=np.intp) for k in range(3))
    factors, powers = (np.array([entry[k] for entry in entries], dtype=float) for k in (3, 4))
    n = len(unknowns)

    def factorized(size: float) -> Solve:
        found = np.concatenate([values() for values in calculated])
        matrix = coo_array((found[numbers] * factors * size**powers, (rows, columns)), (n, n))
        if n <= _DENSE:
            return np.linalg.inv(np.eye(n) - matrix.toarray()).__matmul__
        sparse: Any = splu((eye_array(n) - matrix).tocsc())
        return sparse.solve

    return factorized


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


def _next(points: list[Vector], changes: list[Vector]) -> Vector:
    """Where to go from the last point, by the step that earlier ones, taken linearly, would have been right with.

    Anderson acceleration: J. ACM 12 (1965); Walker and Ni, SIAM J. Numer. Anal. 49 (2011), type II.

    :param changes: those that the iteration by itself would make at the points.
    """
    x, change = points[-1], changes[-1]
    if len(points) < 3:
        return x + change
    between = np.diff(points[-_SECANTS:], axis=0).T
    differences = np.diff(changes[-_SECANTS:], axis=0).T
    weights = np.linalg.lstsq(differences, change, rcond=1e-12)[0]
    return x + change - (between + differences) @ weights


def _range(part: slice | range) -> range:
    return range(part.start, part.stop)
