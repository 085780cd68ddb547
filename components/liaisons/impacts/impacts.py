"""Impacts that several FMUs take part in, where impulses are connected: located by going back, and solved together.

A connection hands the rate of a port to the FMU that is moved, and the sum of its operator's impulses back::

    mover                                   moved
    q_dot                    ------->       s_dot, s_dot_jump       jump w of the rate
    q_impulse                <-------       s_impulse               impulse I

In an impact each FMU returns I as a function of w, or w as a function of I: by Newton's restitution and Moreau's rule
with the rates from before the jumps, piecewise linear.  Newton's method solves for all w and I at once, with exact
derivatives of the linear pieces, so that the impact is that of the whole system.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import final

import numpy as np

from liaisons.base.arrays import Floats
from liaisons.base.contact_limits import ENERGY_GAIN, MOST_IMPACTS
from liaisons.base.logs import logger
from liaisons.cosim import LEAST_IMPULSE, Kernel, Memory, contact_variables
from liaisons.errors import RefusedError
from liaisons.impacts.friction import Frictions
from liaisons.impacts.impulses import ImpulsivePort, connections_that_stop_impulses, forces_through, impulse_sums
from liaisons.impacts.impulsive_fmus import ImpulsiveFmu, grown

_MOST_ITERATIONS, _MOST_STEPS = 50, 200
_DIFFERENCE = 1e-3
"""Change of an unknown for derivatives, relative to the unknown, so that it stays in a linear piece."""
_LEAST_DIFFERENCE = 1e-7
"""Least such change, relative to the size of the unknown."""
_AGREEING = 1e-14
"""Difference of both sides of an interface, relative to jumps, up to which they agree."""
_ROUNDING = 8 * np.finfo(float).eps
"""The same, relative to the sums on both sides."""
_MOST_ROUNDING = 1e3
"""Factor by which the difference may be larger if further iterations leave it as it is."""
_LOSS = "impact_loss"
_EARLY = 1e-11
"""How long before an impact FMUs stop, relative to a communication step."""


@final
class _Struck:
    """An FMU in an impact.

    :ivar increments: indices, among the unknowns, of what its inputs increase by: rates, then sums.
    """

    def __init__(self, fmu: ImpulsiveFmu) -> None:
        self.fmu, self._bus = fmu, fmu.bus
        moved = len(fmu.handed)
        rates = fmu.each(lambda port: port.rate.target.reference, None)
        outputs = fmu.each(lambda port: port.impulse.source.reference, lambda port: port.rate.source.reference)
        self.increments = np.concatenate([fmu.taken[:moved], fmu.taken])
        self.inputs, self.outputs = np.zeros(len(self.increments)), np.zeros(len(outputs))
        self._rates, self.impulses = self._bus.columns(rates), self._bus.columns(outputs[:moved])
        self._set, self._get = fmu.setter([*rates, *fmu.told], self.inputs), fmu.getter(outputs, self.outputs)
        loss = (fmu.name, _LOSS)
        self._lost, self._lost_before = np.zeros(1), 0.0
        self._get_loss = [fmu.getter([loss], self._lost)] if fmu.has(loss) else []

    def energy_loss(self) -> float:
        """Energy that its contacts have lost in this impact [J]."""
        self._bus.perform(self._get_loss)
        return float(self._lost[0] - self._lost_before)

    def begin(self, rates: Floats | None = None) -> None:
        """Begin an impact in the present state.

        :param rates: of its moved ports; None: those on the bus.
        """
        self._bus.perform([self.fmu.save, self._get, *self._get_loss])
        self._lost_before = float(self._lost[0])
        self.before = self.outputs.copy()
        self.before[: len(self._rates)] = self.fmu.handed
        self.starts = np.concatenate([self._bus.values[self._rates] if rates is None else rates, self.fmu.sums])

    def respond(self, unknowns: Floats) -> Floats:
        """Increments of its outputs, in the units of the other side, when its inputs increase by the unknowns."""
        self.inputs[:] = self.starts + unknowns[self.increments]
        first = len(self._rates)
        if np.array_equal(self.inputs[first:], self.starts[first:]):  # a sum that changes begins the impact
            self.inputs[first] = grown(self.inputs[first])
        self._bus.perform([self.fmu.restore, self._set, self._get])
        return (self.outputs - self.before) * self.fmu.factors

    def end(self) -> Floats:
        """End the impact with the present inputs; returns the rates among them."""
        rates = len(self._rates)
        self.fmu.sums[:] = self.inputs[rates:]
        self.fmu.handed[:] = self.outputs[:rates]
        return self.inputs[:rates].copy()


@final
class Impacts:
    """Impacts of FMUs whose impulses are connected.

    :param ports: those through which impulses go.
    :ivar memory: sums of jumps and impulses so far.
    """

    def __init__(self, ports: Sequence[ImpulsivePort], kernel: Kernel) -> None:
        simulation, bus = kernel.simulation, kernel.bus
        self._title, self._bus = simulation.title, bus
        names = dict.fromkeys(name for port in ports for name in (port.moved, port.mover))
        fmus = [ImpulsiveFmu(name, ports, kernel) for name in names]
        self._struck, self._count = [_Struck(fmu) for fmu in fmus], len(ports)
        self.memory = Memory(array for fmu in fmus for array in (fmu.sums, fmu.handed))
        received = {port.impulse.target.reference: port.impulse.target.force or "" for port in ports}
        ends = connections_that_stop_impulses(simulation, forces_through(ports), received)
        self._ends = [ends.get(port.impulse.target.reference) for port in ports]
        contacts = [contact for name in names for contact in contact_variables(simulation.parts[name])]
        self._gaps, self._rates, self._closed = (bus.columns(c[k] for c in contacts) for k in range(3))
        sums = impulse_sums(simulation, ports)
        self._sums, self._forces = map(bus.columns, (sums, sums.values()))
        self._pushing = bus.columns(contact.force for contact in contacts)
        self.frictions = Frictions(fmus, ports, kernel)

    def initialize(self, initialize: Callable[[], None]) -> None:
        """Initialize all FMUs, and choose the modes of dry friction together where they do not agree on them.

        :raises RefusedError: if there are none on which they agree.
        """
        try:
            initialize()
        except RefusedError:
            if not self.frictions.choose(initial=True):
                raise

    def start(self) -> None:
        """Read the sums of impulses at the start time; warn of impacts there, which each FMU has resolved alone."""
        for one in self._struck:
            one.fmu.sums[:], one.fmu.handed[:] = 0.0, self._bus.values[one.impulses]
        if alone := [variable for variable, k in self._bus.index.items() if k in self._sums and self._bus.values[k]]:
            logger.warning(
                "%s: there is an impact at the start, which takes no part in others: %s = %.4g N.s; start with a gap",
                self._title,
                ".".join(alone[0]),
                self._bus.values[self._bus.index[alone[0]]],
            )

    def has_impact(self, before: Floats, after: Floats, size: float) -> bool:
        """Whether there was an impact in a step, beyond rounding.

        :param before: values of the bus at its start.
        :param after: values at its end.
        :param size: of the step [s].
        """
        sums, forces = after[self._sums], np.fmax(np.abs(before[self._forces]), np.abs(after[self._forces]))
        least = LEAST_IMPULSE * (np.abs(sums) + size * forces)
        return bool(np.any(np.abs(sums - before[self._sums]) > least))

    def has_changed_contact(self, before: Floats, after: Floats) -> bool:
        """Whether a contact has begun or ended to push or to slide, by values of the bus before and after."""
        pushed, pushes = ((row[self._closed] != 0) | (row[self._pushing] > 0) for row in (before, after))
        return bool(np.any(pushed != pushes)) or self.frictions.have_changed(before, after)

    def _time_to_contact(self, values: Floats) -> float:
        """Time until the first distance is 0 at its present rate [s]; infinite if none decreases."""
        gaps, rates = values[self._gaps], values[self._rates]
        closing = (rates < 0) & (gaps > 0)
        return float(np.min(gaps[closing] / -rates[closing], initial=math.inf))

    def step_to_first(self, start: float, stop: float, attempt: Callable[[float], bool]) -> float:
        """Step from one instant to shortly before the first impact, which lies before another; returns its end [s].

        :param attempt: steps from the start to an instant; returns whether there was no impact, and no refusal.
        """
        low, high, near = start, stop, max(_EARLY * (stop - start), 32 * math.ulp(stop))
        instant, left = start + (stop - start) / 2, math.inf
        for k in range(_MOST_STEPS):
            if attempt(instant):
                low, left = instant, self._time_to_contact(self._bus.values)
                if left <= near or high - low <= near:
                    return low
                instant += max(left, near / 4) - near / 4
            else:
                high = instant
                if high - start <= near:  # it begins with the impact
                    return start
                instant = low + (high - low) * (0.5 if k % 4 else 0.1)
            if not low < instant < high:
                instant = (low + high) / 2
            if not low < instant < high:
                break
        attempt(low)
        return low

    def solve(self, time: float) -> None:
        """Solve the impacts at the present state, one after the other: all rates and momenta jump.

        :raises RefusedError: if Newton's method does not converge, if they have no end or gain energy, or if they act
            on what passes on no impulses.
        """
        for one in self._struck:
            one.begin()
        for _ in range(MOST_IMPACTS):
            z, energy = self._solve_one(time)
            losses = [one.energy_loss() for one in self._struck]
            self._check_impact(time, z, sum(losses), _ROUNDING * _MOST_ROUNDING * energy)
            left = [one.end() for one in self._struck]
            if not np.any(z) and not np.any(losses):
                return
            for one, rates in zip(self._struck, left, strict=True):
                one.begin(rates)
        words = f"more than {MOST_IMPACTS} impacts at t = {time:.10g} s: make one FMU of the system by flatten()"
        raise RefusedError(f"{self._title}: {words}")

    def _check_impact(self, time: float, z: Floats, loss: float, rounding: float) -> None:
        """Refuse an impact that acts on what passes on no impulses, or that gains energy by more than rounding [J]."""
        jumps, impulses = np.split(z, 2)
        ends = [end for end, impulse in zip(self._ends, impulses, strict=True) if end and impulse]
        if ends:
            why = f"acts through {ends[0]} too, which passes on no impulses: make one FMU of the system by flatten()"
        elif loss < -ENERGY_GAIN * (np.abs(jumps) @ np.abs(impulses)) - rounding:
            why = "would gain energy by Newton's restitution and friction (Kane): take less of either"
        else:
            return
        raise RefusedError(f"{self._title}: the impact at t = {time:.10g} s {why}")

    def _solve_one(self, time: float) -> tuple[Floats, float]:
        """Solve one impact; returns the jumps of rates followed by the impulses, and the size of their energy [J]."""
        z = np.zeros(2 * self._count)
        F = self._residual(z)
        sizes = self._sizes(F)
        allowed = _AGREEING * sizes + _ROUNDING * self._magnitudes(sizes)
        for _ in range(_MOST_ITERATIONS):
            error = np.max(np.abs(F) / allowed)
            if error <= 1:
                break
            step = np.linalg.lstsq(self._jacobian(z, sizes), -F, rcond=None)[0]
            for part in (1.0, 0.5, 0.25, 0.125):
                trial = z + part * step
                other = self._residual(trial)
                if (better := np.max(np.abs(other) / allowed)) < error:
                    break
            if better >= error:
                if error <= _MOST_ROUNDING:
                    break
                trial, other = z + step, self._residual(z + step)
            z, F = trial, other
        else:
            error = np.max(np.abs(F) / allowed)
        if not error <= _MOST_ROUNDING:
            raise RefusedError(
                f"{self._title}: the impact at t = {time:.10g} s, in which several FMUs take part, does not converge: "
                "make one FMU of the system by flatten()"
            )
        for one in self._struck:
            one.respond(z)
        return z, float(sizes[: self._count] @ sizes[self._count :])

    def _residual(self, z: Floats) -> Floats:
        """Increments of outputs, less the unknowns."""
        F = -z
        for one in self._struck:
            F[one.fmu.returned] += one.respond(z)
        return F

    def _jacobian(self, z: Floats, sizes: Floats) -> Floats:
        """Derivatives of the residual by the unknowns."""
        J = -np.eye(len(z))
        for one in self._struck:
            middle = one.respond(z)
            for k in dict.fromkeys(one.increments.tolist()):
                other = z.copy()
                other[k] += max(_DIFFERENCE * abs(z[k]), _LEAST_DIFFERENCE * sizes[k])
                J[one.fmu.returned, k] += (one.respond(other) - middle) / (other[k] - z[k])
        return J

    def _magnitudes(self, sizes: Floats) -> Floats:
        """Magnitudes of the numbers that FMUs add the unknowns to."""
        magnitudes = sizes.copy()
        for one in self._struck:
            np.maximum.at(magnitudes, one.increments, np.abs(one.starts))
            np.maximum.at(magnitudes, one.fmu.returned, np.abs(one.before))
        return magnitudes

    def _sizes(self, F: Floats) -> Floats:
        """Sizes of jumps of rates, then of impulses, which are at least those that rates of this size would exchange.

        :param F: the residual at z = 0.
        """
        count = self._count
        rates = np.abs(self._bus.values[self._rates]).max(initial=0.0)
        speed = max(rates, np.abs(F[:count]).max(initial=0.0)) or 1.0
        impulse = np.abs(F[count:]).max(initial=0.0)
        for jump in (-_LEAST_DIFFERENCE, _LEAST_DIFFERENCE):
            z = np.append(np.full(count, jump * speed), np.zeros(count))
            impulse = max(impulse, np.abs(self._residual(z)[count:] - F[count:]).max() / _LEAST_DIFFERENCE)
        return np.concatenate([np.full(count, speed), np.full(count, impulse or 1.0)])
