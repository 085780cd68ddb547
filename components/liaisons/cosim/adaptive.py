"""Communication steps of adapted size: one step of H beside two of H/2 tells the error; then the two are kept.

Step doubling with roll-back (Hairer, Norsett, Wanner, Solving ODEs I, II.4): if the error of a step is C H^(p+1), the
results differ by (2^p - 1) times the error of the two.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from liaisons.cosim.bus import Bus
from liaisons.cosim.calls import Call
from liaisons.cosim.coupling.coupled import Coupled
from liaisons.cosim.coupling.signals import Snapshot, Vector
from liaisons.cosim.instances import Instance
from liaisons.cosim.simulation import Simulation
from liaisons.errors import RefusedError

_SAFETY, _SMALLEST_FACTOR, _LARGEST_FACTOR = 0.9, 0.2, 4.0
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
            coupled.signals.rewind(snapshot)

    while now < end:
        np.maximum.at(sizes, numbers, np.abs(bus.values[: len(numbers)]))
        then = end if end - now <= size * (1 + 1e-9) else now + size
        middle = (now + then) / 2
        bus.perform(saves)
        before = bus.values.copy(), coupled and coupled.signals.snapshot()
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


def kinds(simulation: Simulation, bus: Bus) -> NDArray[np.intp]:
    """What is on the bus, numbered by its unit; what is no Real or a function of time is compared with itself only."""
    variables = {name: part.fmu.variables for name, part in simulation.parts.items()}

    def kind(name: str, variable: str) -> str:
        found = variables[name][variable] if name in variables else None
        return found.unit if found is not None and found.type == "Real" else f"{name}.{variable}"

    return np.unique([kind(*place) for place in bus.index], return_inverse=True)[1]
