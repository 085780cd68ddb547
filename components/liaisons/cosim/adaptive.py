"""Communication steps of adapted size: one step of H beside two of H/2 tells the error; then the two are kept.

Step doubling with roll-back (Hairer, Norsett, Wanner, Solving ODEs I, II.4): if the error of a step is C H^(p+1), the
results differ by (2^p - 1) times the error of the two.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import final

import numpy as np
from numpy.typing import NDArray

from liaisons.cosim.bus import Bus
from liaisons.cosim.calls import Call
from liaisons.cosim.coupling.member import Judge
from liaisons.cosim.coupling.signals import Signals
from liaisons.cosim.instances import AnyInstance
from liaisons.cosim.parts import Part
from liaisons.cosim.refusal import RefusedError

_SAFETY, _SMALLEST_FACTOR, _LARGEST_FACTOR = 0.9, 0.2, 4.0
_SHORTEST = 1e-12
"""A step of this part of the whole time or less cannot be meant."""


@final
class Adaptive:
    """Steps whose error stays below the tolerance, relative to the largest value of the signal's unit so far.

    What is connected or recorded counts.

    :param signals: what the coupling remembers of earlier steps, if it does.
    :param perform: makes one communication step between two instants.
    :param order: p, the error of a step being of order p + 1 in its size.
    """

    def __init__(
        self,
        parts: Mapping[str, Part],
        instances: Mapping[str, AnyInstance],
        bus: Bus,
        *,
        signals: Signals | None,
        perform: Callable[[float, float], None],
        judge: Judge,
        tolerance: float,
        order: int,
    ) -> None:
        self._bus = bus
        self._signals = signals
        self._perform = perform
        self._judge = judge
        self._tolerance = tolerance
        self._order = order
        states = {name: instance.states() for name, instance in instances.items()}
        self._saves: dict[str, Call] = {name: save for name, (save, _) in states.items()}
        self._restores: dict[str, Call] = {name: restore for name, (_, restore) in states.items()}
        units = [  # a function of time is compared with nothing but itself
            parts[name].fmu.variables[variable].unit if name in parts else variable for name, variable in bus.index
        ]
        numbers = {unit: k for k, unit in enumerate(dict.fromkeys(units))}
        self._units = np.array([numbers[unit] for unit in units], dtype=np.intp)
        self._sizes = np.zeros(len(numbers))
        self._measure()

    def points(self, now: float, end: float, size: float) -> Iterator[tuple[float, NDArray[np.float64]]]:
        """Communication points after the begin [s], and what stands on the bus there.

        :param size: of the first attempt [s].
        :raises RefusedError: if even the smallest step fails, or its error is too large.
        """
        shortest = _SHORTEST * (end - now)
        last = size = min(size, end - now)
        while now < end:
            then = end if end - now <= size * (1 + 1e-9) else now + size
            middle = (now + then) / 2
            self._save()
            try:
                self._perform(now, then)
                whole = self._bus.values.copy()
                self._restore()
                self._perform(now, middle)
                half = self._bus.values.copy()
                self._perform(middle, then)
                error = self._error(whole)
                reason = f"the error of a step of {then - now:.3g} s is {error:.3g} times error_tolerance"
            except RefusedError as failure:
                error, reason, half = np.inf, str(failure), self._bus.values
            factor = _SAFETY * max(error, 1e-10) ** (-1 / (self._order + 1))
            last = then - now
            size = last * min(max(factor, _SMALLEST_FACTOR), _LARGEST_FACTOR)
            if error <= 1:
                self._measure()
                yield middle, half
                yield then, self._bus.values
                now = then
            elif size > shortest:
                self._restore()
            else:
                raise RefusedError(f"no step from t = {now:.10g} s is small enough: {reason}")

    def _error(self, whole: NDArray[np.float64]) -> float:
        """Of the two steps, in parts of the tolerance."""
        sizes = np.where(self._sizes > 0, self._sizes, 1.0)[self._units]
        difference = np.abs(self._bus.values - whole) / sizes
        return float(np.max(difference, initial=0.0)) / (2**self._order - 1) / self._tolerance

    def _measure(self) -> None:
        np.maximum.at(self._sizes, self._units, np.abs(self._bus.values))

    def _save(self) -> None:
        for name, save in self._saves.items():
            if status := save():
                self._judge(name, "save", status)
        self._kept = self._bus.values.copy(), self._signals and self._signals.snapshot()

    def _restore(self) -> None:
        for name, restore in self._restores.items():
            if status := restore():
                self._judge(name, "restore", status)
        values, signals = self._kept
        self._bus.values[:] = values
        if self._signals is not None and signals is not None:
            self._signals.rewind(signals)
