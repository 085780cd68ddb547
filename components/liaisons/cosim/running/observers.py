"""What observes a run: a clock that it waits for, its result, constraints and energies, and warnings of what was seen.

An FMU of ours shows what it does not keep of a constraint ``c`` as ``c_residual``, beside its multiplier, and what its
account of energies is off by as ``energy_balance``.  Others have no such variables, and are not watched.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import chain, repeat
from operator import attrgetter
from time import perf_counter, sleep
from typing import final

import numpy as np

from liaisons.base.logs import logger
from liaisons.base.published import registered
from liaisons.cosim.compiled.calls import DISCARD, OK, WATCH, Action, Call, Indices, Vector
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.instances.buffer_layouts import text_of
from liaisons.cosim.running.contacts import (
    connections_losing_impulses,
    contact_variables,
    friction_variables,
    missing_impulses,
)
from liaisons.cosim.running.kernel import CouplingEstimate, Impulses, Kernel
from liaisons.cosim.structure.components import SystemComponent
from liaisons.cosim.structure.connections import Connection
from liaisons.cosim.structure.schedule import VariableReference, component_of
from liaisons.cosim.structure.simulation import Simulation
from liaisons.errors import RefusedError
from liaisons.fmu_files import Fmu
from liaisons.results import Result

_CONSISTENT = 1e-6
"""Residual, in its own unit, above which an FMU refuses to start; projections leave rounding, 1e-15."""
_EXTRAPOLATED = 1e-3
"""The same where inputs are extrapolated, and jump at the end of a step: an FMU follows in the next one."""
_STEPS = 100
"""Least number of solver steps: each, and each communication step, may add the tolerance to the account."""
_EXCHANGE = 30.0
"""Steps that an importer's solver takes for one of ours: BDF of order 2 instead of a method of order 8."""
_UNCONTROLLED = 0.01
"""Part of the energies that an account may be off by along steps whose size it does not control: symplectic ones, which
are chosen whatever the tolerance, and those of the stiff solver, which looks at the motion alone."""
_CHOOSE_STEPS = {"symplectic_steps", "stiff_solver"}
_ROUNDING = 1e-6
"""Smallest part that an account may be off by: rounding in sums and long runs."""
_RESTING = 1e-24
"""Part of the nominal energy, that of nominal rates, that an account may be off by: 1e-12 of a rate is rounding, with
which bodies at rest may move, and of the energies of such rates every part may be."""
_MOST = 0.5
"""Largest part that it may be off by, which tolerances of 1e-2 reach."""
_ENERGIES = ("kinetic_energy", "potential_energy", "work", "dissipated")
_UNNOTICED_DELAY = 1e-3
"""Lateness below which there is no warning [s]: the resolution of clocks and schedulers."""
_MOST_NAMED = 20
"""Number of signals that are not finite, each of which is named in a warning."""


@final
class Watchdog:
    """Constraints after each step, and energy accounts, of all FMUs of a run, recorded or not.

    :ivar variables: what is read for it.
    :ivar calls: those that refuse a step after which a constraint is not kept.
    :ivar refusal: the last error of these.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._residuals: list[VariableReference] = []
        self._accounts: list[list[VariableReference]] = []
        for name, part in simulation.parts.items():
            residuals, accounts = _watched(part.fmu)
            self._residuals += zip(repeat(name), residuals)
            for account in accounts:
                self._accounts.append([*zip(repeat(name), account)])
        self.variables = [*self._residuals, *chain.from_iterable(self._accounts)]
        self.calls: Sequence[Call] = ()
        self.refusal: RefusedError | None = None

    def prepare(self, bus: Bus) -> None:
        """Find the columns of the bus, and prepare the calls."""
        self._bus = bus
        self._columns = [*map(bus.columns, self._accounts)]
        if self._residuals:
            parts, self._watched = self._simulation.parts, bus.columns(self._residuals)
            self._limits = np.array([self._largest_residual(parts[name]) for name, _ in self._residuals])
            call = Call(self._status).set_failure("step", self._refusal)
            columns, limits = self._watched.ctypes.data, self._limits.ctypes.data
            values, count = bus.values.ctypes.data, len(self._residuals)
            self.calls = [call.set_record(WATCH, None, source=columns, count=count, values=values, more=limits)]

    def _largest_residual(self, part: SystemComponent) -> float:
        """Largest residual that is allowed; an importer's solver keeps constraints by stabilisation only."""
        if self._simulation.coupling == "jacobi" or part.name in self._simulation.chosen_reconstructions:
            return _EXTRAPOLATED
        return max(_CONSISTENT, self._tolerance(part)) if part.fmu.is_model_exchange else _CONSISTENT

    def _tolerance(self, part: SystemComponent) -> float:
        return self._simulation.tolerance or part.fmu.experiment.tolerance or self._simulation.step_tolerance

    def _status(self) -> int:
        return DISCARD if np.any(np.abs(self._bus.values[self._watched]) > self._limits) else OK

    def _refusal(self, _action: Action, _status: int, when: str) -> RefusedError:
        """Error of the constraint that is kept least."""
        sizes = np.abs(self._bus.values[self._watched])
        worst = int(np.argmax(sizes / self._limits))
        (owner, name), size, limit = self._residuals[worst], sizes[worst], self._limits[worst]
        unit = self._simulation.parts[owner].fmu.variables[name].unit
        words = f"{name} = {size:.3g} {unit}{when}, {limit:.3g} {unit} are allowed; do inputs lead out of its reach?"
        self.refusal = RefusedError(f"{owner}: a constraint is not kept: {words}")
        return self.refusal

    def warn(self, rows: Vector, times: Vector) -> None:
        """Warn of each FMU whose energy account is off by more than tolerance and energies allow.

        :param rows: values of the bus at the times [s], shape (points, width).
        """
        warned: set[str] = set()
        for account, (balance, *energies) in zip(self._accounts, self._columns, strict=True):
            (owner, name), (_, work) = account[0], account[1 + _ENERGIES.index("work")]
            part = self._simulation.parts[owner]
            steps = max(len(times), _STEPS) * (_EXCHANGE if part.fmu.is_model_exchange else 1.0)
            least = _UNCONTROLLED if _CHOOSE_STEPS & part.starts.keys() else _ROUNDING
            margin = min(max(steps * self._tolerance(part), least), _MOST)
            off = np.nan_to_num(np.abs(rows[:, balance]))
            worst = int(np.argmax(off))
            if off[worst] <= margin * np.abs(rows[worst, energies]).sum() or owner in warned:
                continue  # most runs: the other points need not be looked at
            sizes = np.abs(rows[:, energies]).sum(axis=1)
            allowed = max(margin * float(np.nanmax(sizes)), _RESTING * part.fmu.nominals.get(work, 1.0))
            if off[worst] > allowed:
                warned.add(owner)
                words = "%s: the energy account does not close: %s = %.3g J at t = %.6g s, where %.3g J are allowed, "
                more = "exceeded from t = %.6g s on; try smaller steps and tolerances, and look for inputs that jump"
                value, first = rows[worst, balance], times[int(np.argmax(off > allowed))]
                logger.warning(words + more, owner, name, value, times[worst], allowed, first)


@lru_cache(maxsize=64)
def _watched(fmu: Fmu) -> tuple[list[str], list[list[str]]]:
    """Names of residuals of constraints; and, of each account, of balance, energies, and what impacts have taken."""
    variables, residuals, accounts = fmu.variables.entries, list[str](), list[list[str]]()
    for name in variables:
        before, prefix = name.removesuffix("_residual"), name.removesuffix("energy_balance")
        owner, dot, own = before.rpartition(".")
        energies = [f"{prefix}{energy}" for energy in _ENERGIES]
        if before != name and (f"{owner}{dot}lambda_{own}" in variables or f"{before}_force" in variables):
            residuals.append(name)
        elif prefix != name and variables.keys() >= {*energies}:
            accounts.append([name, *energies, *variables.keys() & {f"{prefix}impact_loss"}])
    return residuals, accounts


@final
class RealTime:
    """Waits after each step until the clock has advanced as much as the run.

    :param factor: simulated seconds per second.
    :param time: at which it begins, now [s].
    :param lateness: how late each step ended until now [s]; it grows.
    """

    def __init__(self, factor: float, time: float, lateness: list[float]) -> None:
        self._begin, self.lateness = (factor, perf_counter(), time), lateness

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
    :ivar watchdog: that of constraints and energies; ``clock`` the one that is waited for, if the run has a pace.
    """

    def __init__(self, simulation: Simulation, impulses: Impulses | None) -> None:
        self.watchdog = Watchdog(simulation)
        self.estimate: CouplingEstimate | None = None
        self.clock: RealTime | None = None
        self._sums: Mapping[VariableReference, Connection] = {}
        self.variables: list[VariableReference] = []
        if any(map(attrgetter("is_reaction"), simulation.connections)):
            self._sums = connections_losing_impulses(simulation, () if impulses is None else impulses.forces)
        self.variables += self._sums
        fed = {*map(component_of, simulation.feeds)}
        for name, part in simulation.parts.items():
            if part.fmu.has_contacts and (impulses or name in fed):
                self.variables += chain.from_iterable((*contact_variables(part), *friction_variables(part)))
        self.variables += self.watchdog.variables
        self.variables += impulses.variables if impulses else ()

    def prepare(self, kernel: Kernel) -> None:
        """Prepare what they read on the bus."""
        if kernel.simulation.feeds:
            (estimate,) = registered("liaisons.coupling_estimate")
            self.estimate = estimate(kernel)
        self.watchdog.prepare(kernel.bus)

    def recorded_result(self, kernel: Kernel) -> tuple[Result, list[tuple[Indices, str]]]:
        """The result of all that was recorded so far, and the impulses that went missing in it."""
        simulation, recorder = kernel.simulation, kernel.recorder
        in_result, times = recorder.result_rows()
        rows = recorder.rows[in_result]
        values = np.ascontiguousarray(rows.T[kernel.bus.columns(simulation.recorded.values())])
        strings, jumping = list[str](), set[str]()
        for name, scalar in simulation.recorded_scalars.items():
            if scalar.type == "String":
                strings.append(name)
            if not scalar.continuous:
                jumping.add(name)
        texts = _numbered_texts(values, [*simulation.recorded], strings) if strings else {}
        errors, lost = self._errors_by_point(kernel, in_result), list[tuple[Indices, str]]()
        if self._sums:
            columns = {place: rows[:, k] for place, k in kernel.bus.index.items()}
            lost = missing_impulses(self._sums, times, columns)
        for points, _ in lost:
            errors[points] = np.nan
        result = Result(
            simulation.title,
            times,
            tuple(simulation.recorded),
            values,
            simulation.units,
            texts=texts,
            jumping=frozenset(jumping),
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
        if self.clock is not None:
            self.clock.warn(result.title)
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


def _numbered_texts(values: Vector, names: Sequence[str], strings: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Name of a signal of strings -> its texts; their numbers in the values become indices of these."""
    rows = [*map(names.index, strings)]
    numbers, indices = np.unique(values[rows], return_inverse=True)
    values[rows] = indices.reshape(values[rows].shape)
    return dict.fromkeys(strings, tuple(text_of(number).decode(errors="replace") for number in numbers))


def add_warnings(result: Result, warnings: tuple[str, ...]) -> Result:
    """Result with further warnings appended to its own."""
    return replace(result, warnings=tuple(dict.fromkeys((*result.warnings, *warnings)))) if warnings else result


def warn_of_non_finite_values(result: Result) -> None:
    """Log a warning for each signal of a result that is not finite everywhere."""
    wrong = ~np.isfinite(result.values)
    rows = np.flatnonzero(wrong.any(axis=1)).tolist()
    for row in rows[:_MOST_NAMED]:
        first, signal = int(np.argmax(wrong[row])), result.values[row]
        words = "%s: %s is %g at t = %.10g s, and not finite at %d of %d points"
        said = result.title, result.names[row], signal[first], result.time[first], wrong[row].sum(), len(signal)
        logger.warning(words, *said)
    if len(rows) > _MOST_NAMED:
        logger.warning("%s: %d more signals are not finite", result.title, len(rows) - _MOST_NAMED)
