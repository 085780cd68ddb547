"""Communication steps of adapted size, taken back where their error is too large.

* ``error_tolerance``: one step of H beside two of H/2 tells the error; then the two are kept.  Step doubling (Hairer,
  Norsett, Wanner, Solving ODEs I, II.4): if the error of a step is C H^(p+1), the results differ by (2^p - 1) times the
  error of the two.
* no ``step_size``: between any two communication points as many equal steps as the estimate of their error asks for
  (:mod:`liaisons.cosim.estimate`), which costs no step.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from liaisons.cosim.bus import Bus
from liaisons.cosim.calls import Call
from liaisons.cosim.coupling.coupled import Coupled, Snapshot
from liaisons.cosim.coupling.signals import Vector
from liaisons.cosim.estimate import Estimate
from liaisons.cosim.instances import Instance
from liaisons.cosim.simulation import Simulation
from liaisons.errors import RefusedError

_SAFETY, _SMALLEST_FACTOR, _LARGEST_FACTOR = 0.9, 0.2, 4.0
_FIRST, _MOST = 4, 1000
"""Steps between two communication points: at the begin, and at most."""
_MEMORY = 5
"""Points that are kept for the estimate."""
_SHORTEST = 1e-12
"""A step of this part of the whole time or less cannot be meant."""


def adapted(
    simulation: Simulation, instances: Mapping[str, Instance], bus: Bus, calls: Iterable[Call], coupled: Coupled | None
) -> Iterator[tuple[float, Vector]]:
    """Steps whose error stays below the tolerance, relative to the largest value of the signal's unit so far.

    What is connected or recorded counts.

    :param calls: those of a communication step.
    :param coupled: the coupling, if it remembers earlier steps.
    :returns: communication points after the begin [s], and what stands on the bus there.
    :raises RefusedError: if even the smallest step fails, or its error is too large.
    """
    tolerance = simulation.error_tolerance
    assert tolerance is not None
    order = 1 if coupled is None else coupled.order  # p, the error of a step being of order p + 1 in its size
    numbers = kinds(simulation, bus)
    sizes = np.zeros(int(numbers.max(initial=-1)) + 1)
    saves, restores = zip(*(instance.states() for instance in instances.values()), strict=True)
    now, first, end = simulation.times
    size, shortest = min(first - now, end - now), _SHORTEST * (end - now)

    def stepped(start: float, stop: float) -> Vector:
        bus.turn(start, stop)
        bus.perform(calls)
        return bus.values.copy()

    def go_back(values: Vector, snapshot: Snapshot | None) -> None:
        bus.perform(restores)
        bus.values[:] = values
        if coupled is not None and snapshot is not None:
            coupled.rewind(snapshot)

    while now < end:
        np.maximum.at(sizes, numbers, np.abs(bus.values[: len(numbers)]))
        then = end if end - now <= size * (1 + 1e-9) else now + size
        middle = (now + then) / 2
        bus.perform(saves)
        before = bus.values.copy(), coupled and coupled.snapshot()
        try:
            whole = stepped(now, then)
            go_back(*before)
            half, last = stepped(now, middle), stepped(middle, then)
            scales = np.where(sizes > 0, sizes, 1.0)[numbers]
            off = np.abs(last - whole)[: len(numbers)]
            error = float(np.max(off / scales, initial=0.0)) / (2**order - 1) / tolerance
            reason = f"the error of a step of {then - now:.3g} s is {error:.3g} times error_tolerance"
        except RefusedError as failure:
            half = last = bus.values
            error, reason = np.inf, str(failure)
        factor = _SAFETY * max(error, 1e-10) ** (-1 / (order + 1))
        size = (then - now) * min(max(factor, _SMALLEST_FACTOR), _LARGEST_FACTOR)
        if error <= 1:
            yield middle, half
            yield then, last
            now = then
        elif size > shortest:
            go_back(*before)
        else:
            raise RefusedError(f"no step from t = {now:.10g} s is small enough: {reason}")


def divided(  # noqa: PLR0917 - what a run consists of
    simulation: Simulation,
    instances: Mapping[str, Instance],
    bus: Bus,
    calls: Iterable[Call],
    coupled: Coupled,
    estimate: Estimate,
) -> Iterator[tuple[float, Vector, float]]:
    """Steps between the communication points whose estimated error stays below the tolerance.

    :returns: communication points after the begin [s], what stands on the bus there, and the largest of the errors.
    :raises RefusedError: if even the smallest steps fail.
    """
    saves, restores = zip(*(instance.states() for instance in instances.values()), strict=True)
    rows, times = [bus.values.copy()], [simulation.times[0]]
    count = _FIRST
    for now, then in pairwise(simulation.times):
        bus.perform(saves)
        snapshot, known = coupled.snapshot(), estimate.snapshot()
        while True:
            instants = [*(now + (then - now) * k / count for k in range(1, count)), then]
            try:
                for here, there in pairwise((now, *instants)):
                    bus.turn(here, there)
                    bus.perform(calls)
                    rows.append(bus.values.copy())
                    times.append(there)
                error = estimate.latest(np.array(rows), np.array(times), count)
            except RefusedError:
                if count > _MOST:
                    raise
                error = np.inf
            factor = (max(error, 1e-30) / simulation.step_tolerance) ** (1 / 5) / _SAFETY
            if factor <= 1 / _SAFETY or count > _MOST:
                break
            count = min(max(math.ceil(count * min(factor, 4.0)), count + 1), 2 * _MOST)
            del rows[bisect_right(times, now) :], times[bisect_right(times, now) :]
            bus.perform(restores)
            bus.values[:] = rows[-1]
            coupled.rewind(snapshot)
            estimate.rewind(known)
        yield then, rows[-1], error
        del rows[:-_MEMORY], times[:-_MEMORY]
        count = max(1, math.ceil(count * max(factor, 0.5)))


def kinds(simulation: Simulation, bus: Bus) -> NDArray[np.intp]:
    """What is on the bus, numbered by its unit; what is no Real or a function of time is compared with itself only."""
    variables = {name: part.fmu.variables for name, part in simulation.parts.items()}

    def kind(name: str, variable: str) -> str:
        found = variables[name][variable] if name in variables else None
        return found.unit if found is not None and found.type == "Real" else f"{name}.{variable}"

    return np.unique([kind(*place) for place in bus.index], return_inverse=True)[1]
