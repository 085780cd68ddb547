"""What every run watches, recorded or not: constraints after each step, and the energy account of each mechanism.

An FMU of ours shows what it does not keep of a constraint ``c`` as ``c_residual``, beside its multiplier, and what its
account of energies is off by as ``energy_balance``.  Others have no such variables, and are not watched.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import numpy as np

from liaisons.cosim.arrays import Vector
from liaisons.cosim.compiled.calls import WATCH, Action, Call
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.messages import DISCARD, OK, logger
from liaisons.cosim.structure.components import SystemComponent
from liaisons.cosim.structure.schedule import VariableReference
from liaisons.cosim.structure.simulation import Simulation
from liaisons.errors import RefusedError

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
_MOST = 0.5
"""Largest part that it may be off by, which tolerances of 1e-2 reach."""
_ENERGIES = ("kinetic_energy", "potential_energy", "work", "dissipated")


@final
class Watchdog:
    """Residuals and accounts of all FMUs of a run.

    :ivar variables: what is read for it.
    :ivar calls: those that refuse a step after which a constraint is not kept.
    :ivar refusal: the last error of these.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._residuals: list[VariableReference] = []
        self._accounts: list[list[VariableReference]] = []
        for part in simulation.parts.values():
            for name in part.fmu.variables.entries:
                if _is_residual(part, name):
                    self._residuals.append((part.name, name))
                elif account := _account(part, name):
                    self._accounts.append([(part.name, variable) for variable in account])
        self.variables = [*self._residuals, *(one for account in self._accounts for one in account)]
        self.calls: Sequence[Call] = ()
        self.refusal: RefusedError | None = None

    def prepare(self, bus: Bus) -> None:
        """Find the columns of the bus, and prepare the calls."""
        self._bus = bus
        self._columns = [bus.columns(account) for account in self._accounts]
        self._watched = bus.columns(self._residuals)
        self._limits = np.array([self._largest_residual(self._simulation.parts[name]) for name, _ in self._residuals])
        if self._residuals:
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
        for ((owner, name), *_), (balance, *energies) in zip(self._accounts, self._columns, strict=True):
            part = self._simulation.parts[owner]
            steps = max(len(times), _STEPS) * (_EXCHANGE if part.fmu.is_model_exchange else 1.0)
            least = _UNCONTROLLED if _CHOOSE_STEPS & part.starts.keys() else _ROUNDING
            margin = min(max(steps * self._tolerance(part), least), _MOST)
            off = np.nan_to_num(np.abs(rows[:, balance]))
            worst = int(np.argmax(off))
            if off[worst] <= margin * np.abs(rows[worst, energies]).sum() or owner in warned:
                continue  # most runs: the other points need not be looked at
            allowed = margin * float(np.nanmax(np.abs(rows[:, energies]).sum(axis=1)))
            if off[worst] > allowed:
                warned.add(owner)
                words = "%s: the energy account does not close: %s = %.3g J at t = %.6g s, where %.3g J are allowed, "
                more = "exceeded from t = %.6g s on; try smaller steps and tolerances, and look for inputs that jump"
                value, first = rows[worst, balance], times[int(np.argmax(off > allowed))]
                logger.warning(words + more, owner, name, value, times[worst], allowed, first)


def _is_residual(part: SystemComponent, name: str) -> bool:
    """Whether a variable is the residual of a constraint."""
    before, ending, after = name.rpartition("_residual")
    prefix, dot, own = before.rpartition(".")
    variables = part.fmu.variables.entries
    return bool(ending and not after) and (f"{prefix}{dot}lambda_{own}" in variables or f"{before}_force" in variables)


def _account(part: SystemComponent, name: str) -> list[str]:
    """Names of balance, energies and, where there are impacts, what these have taken; empty if it is not a balance."""
    prefix, ending, after = name.rpartition("energy_balance")
    names, variables = [f"{prefix}{energy}" for energy in _ENERGIES], part.fmu.variables.entries
    if not ending or after or not all(other in variables for other in names):
        return []
    return [name, *names, *(other for other in [f"{prefix}impact_loss"] if other in variables)]
