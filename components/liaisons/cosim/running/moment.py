"""The whole state of a run: one value, saved and restored in one place."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn, Protocol, final
from weakref import finalize

from liaisons.base.arguments import shown
from liaisons.cosim.compiled.calls import Call, Vector
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.instances.protocol import Instances
from liaisons.cosim.structure.simulation import Simulation
from liaisons.errors import SimulationError

FmuStates = Sequence[tuple[Call, Call]]
"""Calls that save and restore each FMU; they hold its state."""


class Remembering(Protocol):
    """What keeps a state from step to step, beside FMUs and bus."""

    def save(self) -> Any:
        """The state for :meth:`restore`; nothing changes it."""
        ...

    def restore(self, saved: Any, /) -> None:
        """Return to a saved state, any number of times."""
        ...


@final
@dataclass(frozen=True, eq=False, repr=False)
class Moment:
    """The state of a run at an instant, to which it can return any number of times.

    :param run: identifies the run whose state it is.
    :param time: [s].
    :param values: of the bus.
    :param fmus: the states of all FMUs.
    :param memories: states of all else, in the order of ``Moments``; recorded points are shared.
    """

    run: object
    time: float
    values: Vector
    fmus: FmuStates
    memories: Sequence[Any]

    def __repr__(self) -> str:
        return f"<state at t = {self.time:.10g} s>"

    def __reduce__(self) -> NoReturn:
        words = "has FMUs in memory, and cannot be copied or pickled; pickle its result"
        raise SimulationError(f"the state of a run at t = {self.time:.10g} s {words}")


@final
class Moments:
    """Saves the state of a run, and restores it.

    :ivar owners: all that keeps a state from step to step, beside FMUs and bus.
    :ivar run: identifies the moments of a run; not the run itself, which would keep it alive.
    """

    def __init__(self, instances: Instances, bus: Bus, owners: Iterable[Remembering]) -> None:
        self.run = object()
        self._instances, self._bus, self.owners = instances, bus, list(owners)
        self._unused: list[FmuStates] = []  # of moments that were collected

    def save(self, time: float) -> Moment:
        """Save the present state; all FMUs must be able to return to it.

        :param time: the present one [s].
        """
        fmus = self._unused.pop() if self._unused else state_calls(self._instances)
        self._bus.perform(save for save, _ in fmus)
        moment = Moment(self.run, time, self._bus.values.copy(), fmus, [owner.save() for owner in self.owners])
        finalize(moment, self._unused.append, fmus)
        return moment

    def check(self, title: str, moment: object) -> None:
        """Check that it is a saved state of this run.

        :raises SimulationError: if it is none.
        """
        if not isinstance(moment, Moment) or moment.run is not self.run:
            words = "is of another run" if isinstance(moment, Moment) else "is not a state of a run"
            raise SimulationError(f"{title}: {shown(moment)} {words}; restore what its own save() has returned")

    def restore(self, moment: Moment) -> None:
        """Return to a saved state."""
        self._bus.perform(restore for _, restore in moment.fmus)
        self._bus.values[:] = moment.values
        self._bus.set_step(moment.time, moment.time)
        for owner, memory in zip(self.owners, moment.memories, strict=True):
            owner.restore(memory)


def state_calls(instances: Instances) -> FmuStates:
    """Prepare calls that save and restore each FMU."""
    return [instance.save_and_restore_calls() for instance in instances.values()]


def check_goes_back(simulation: Simulation) -> None:
    """Check that all FMUs can return to a state.

    :raises SimulationError: naming one that cannot.
    """
    for name, part in simulation.parts.items():
        if not part.fmu.can_get_and_set_state:
            words = f"{name} ({part.fmu.path.name}) cannot go back: its canGetAndSetFMUstate is false"
            raise SimulationError(f"{simulation.title}: {words}; start another run")
