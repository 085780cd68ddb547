"""What observes a run: a clock that it waits for, its result, and warnings of what was seen."""

from __future__ import annotations

from time import perf_counter, sleep
from typing import final

import numpy as np

from liaisons.cosim.arrays import Indices, Vector
from liaisons.cosim.instances.texts import text
from liaisons.cosim.messages import logger, warn_of_non_finite_values
from liaisons.cosim.running.contacts import (
    connections_losing_impulses,
    contact_variables,
    friction_variables,
    missing_impulses,
)
from liaisons.cosim.running.kernel import Impulses, Kernel, coupling_estimate
from liaisons.cosim.running.watchdog import Watchdog
from liaisons.cosim.structure.simulation import Simulation
from liaisons.results import Result

_UNNOTICED_DELAY = 1e-3
"""Lateness below which there is no warning [s]: the resolution of clocks and schedulers."""


@final
class RealTime:
    """Waits after each step until the clock has advanced as much, once it has a pace.

    :ivar is_paced: whether it has one.
    :ivar lateness: how late each step ended [s].
    """

    def __init__(self) -> None:
        self.lateness: list[float] = []
        self.reset()

    def reset(self) -> None:
        """Forget pace and lateness."""
        self.is_paced, self._begin = False, (1.0, 0.0, 0.0)  # seconds per second, instant of the clock, and simulated
        self.lateness.clear()

    def pace(self, factor: float, time: float) -> None:
        """Begin at a simulated time [s], at ``factor`` simulated seconds per second."""
        self.is_paced, self._begin = True, (factor, perf_counter(), time)

    def wait(self, time: float) -> None:
        """Wait for the instant of the clock that belongs to a simulated time [s]."""
        factor, begin, first = self._begin
        late = perf_counter() - begin - (time - first) / factor
        self.lateness.append(max(late, 0.0))
        sleep(max(-late, 0.0))

    def warn(self, title: str) -> None:
        """Warn of steps that ended late."""
        if late := [one for one in self.lateness if one > _UNNOTICED_DELAY]:
            words = "%s: %d of %d paced steps end late, by up to %.3g s: choose a smaller pace, or larger steps"
            logger.warning(words, title, len(late), len(self.lateness), max(late))


@final
class Observers:
    """Observes a run without changing it: the estimate of errors, the watchdog, the clock, impulses that are lost.

    :param impulses: those that go through connections.
    :ivar variables: what they read, recorded or not.
    :ivar estimate: that of errors, if any can be estimated.
    :ivar watchdog: that of constraints and energies; ``real_time`` the clock.
    """

    def __init__(self, simulation: Simulation, impulses: Impulses | None) -> None:
        self.watchdog, self.real_time = Watchdog(simulation), RealTime()
        self._sums = connections_losing_impulses(simulation, () if impulses is None else impulses.forces)
        fed = {name for name, _ in simulation.feeds}
        contacts = [
            variable
            for name, part in simulation.parts.items()
            if impulses or name in fed
            for variables in (*contact_variables(part), *friction_variables(part))
            for variable in variables
        ]
        self.variables = [*self._sums, *contacts, *self.watchdog.variables, *(impulses.variables if impulses else ())]

    def prepare(self, kernel: Kernel) -> None:
        """Prepare what they read on the bus."""
        self.estimate = coupling_estimate(kernel)
        self.watchdog.prepare(kernel.bus)

    def recorded_result(self, kernel: Kernel) -> tuple[Result, list[tuple[Indices, str]]]:
        """The result of all that was recorded so far, and the impulses that went missing in it."""
        simulation, recorder = kernel.simulation, kernel.recorder
        in_result, times = recorder.result_rows()
        rows = recorder.rows[in_result]
        values = np.ascontiguousarray(rows.T[kernel.bus.columns(simulation.recorded.values())])
        names = tuple(simulation.recorded)
        kinds = {n: simulation.parts[p].fmu.variables[v].type for n, (p, v) in simulation.recorded.items()}
        strings = [row for row, name in enumerate(names) if kinds[name] == "String"]
        numbers, indices = np.unique(values[strings], return_inverse=True)
        values[strings] = indices.reshape(values[strings].shape)
        words = tuple(text(number).decode(errors="replace") for number in numbers)
        errors = self._errors_by_point(kernel, in_result)
        columns = {place: rows[:, k] for place, k in kernel.bus.index.items()} if self._sums else {}
        lost = missing_impulses(self._sums, times, columns)
        for points, _ in lost:
            errors[points] = np.nan
        result = Result(
            simulation.title,
            times,
            names,
            values,
            simulation.units,
            texts={names[row]: words for row in strings},
            jumping=simulation.discrete_signals,
            ports=simulation.renamed_ports,
            coupling_error=errors,
            scene=simulation.document.scene,
            warnings=simulation.warnings,
        )
        return result, lost

    def conclude(self, kernel: Kernel, recorded: tuple[Result, list[tuple[Indices, str]]] | None = None) -> Result:
        """Return the result; warn of not-a-numbers, lost impulses, late steps and large coupling errors.

        :param recorded: what :meth:`recorded_result` has returned, if it is known.
        """
        result, lost = recorded or self.recorded_result(kernel)
        recorder = kernel.recorder
        warn_of_non_finite_values(result)
        for _, words in lost:
            logger.warning("%s: %s", result.title, words)
        self.watchdog.warn(recorder.rows[: recorder.done], recorder.times[: recorder.done])
        self.real_time.warn(result.title)
        if self.estimate is not None:
            self.estimate.warn(kernel.progress.errors, is_complete=not lost)
        return result

    def _errors_by_point(self, kernel: Kernel, in_result: Indices) -> Vector:
        """Coupling error that each point of the result adds to that of the point before, shape (points,)."""
        if kernel.progress.errors:
            return np.array([0.0, *kernel.progress.errors])
        recorder, sums, points = kernel.recorder, np.zeros(len(in_result)), slice(kernel.recorder.done)
        if self.estimate is None:
            return sums
        self.estimate.reset()
        errors = self.estimate.estimate(recorder.rows[points], recorder.times[points], recorder.after_break[points])
        if len(in_result) > 1:
            sums[1:] = np.add.reduceat(errors[: in_result[-1] + 1], in_result[:-1] + 1)
        return sums
