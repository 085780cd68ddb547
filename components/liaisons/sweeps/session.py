"""One case after the other in one process: FMUs are extracted, loaded and instantiated once.

Between two cases every FMU goes back to the state it had when it was instantiated, so that a case gives the same
numbers whichever ran before it.  One that cannot go back is instantiated anew, and so is everything after a failure.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TypeAlias, final

import numpy as np

from liaisons.cosim import Result, schedule
from liaisons.cosim.bus import Bus, Clock
from liaisons.cosim.calls import Call
from liaisons.cosim.explicit import Explicit
from liaisons.cosim.instances import AnyInstance, extract, make
from liaisons.cosim.loop import Loop
from liaisons.cosim.messages import WARNING
from liaisons.cosim.parts import Part
from liaisons.cosim.probe import try_to_start
from liaisons.cosim.schedule import Place
from liaisons.cosim.simulation import run
from liaisons.errors import LiaisonsError
from liaisons.sweeps.kept import evaluate
from liaisons.sweeps.outcome import Failure, Outcome, failure
from liaisons.sweeps.plan import Plan

Task: TypeAlias = tuple[Plan, Mapping[Path, Path], str]
"""What a process needs to know: the sweep, where each FMU lies extracted, and a folder for what it leaves behind."""


@final
class Session:
    """A context manager that holds running FMUs.

    :param folders: where each FMU lies extracted; see :func:`extract_all`.
    """

    def __init__(self, plan: Plan, folders: Mapping[Path, Path]) -> None:
        self._plan = plan
        self._folders = folders
        self._run: _Prepared | None = None

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release all instances; the next case makes new ones."""
        if self._run is not None:
            self._run.close()
            self._run = None

    def outcome(self, case: int) -> Outcome:
        """Simulate one case; what goes wrong comes back in words."""
        try:
            parts = self._plan.starts(case)
        except LiaisonsError as error:  # a value that does not fit never will
            return Failure(str(error), refused=True)
        try:
            return evaluate(self._plan.keep, self._result(parts))
        except Exception as error:  # noqa: BLE001 - whatever it is, the other cases go on
            self.close()
            return failure(error)

    def _result(self, parts: dict[str, Part]) -> Result:
        plan = self._plan
        if plan.coupling not in {"gauss-seidel", "jacobi"}:
            return run(
                plan.title,
                parts,
                recorded=plan.recorded,
                times=plan.times,
                connections=plan.connections,
                tolerance=plan.tolerance,
                coupling=plan.coupling,
            )
        if self._run is None:
            self._run = _Prepared(plan, self._folders)
        result = self._run.result(parts)
        if not self._run.restores:
            self.close()
        return result


@final
class _Prepared:
    """Instances of all FMUs with their calls, for explicit coupling.

    :param folders: where each FMU lies extracted.
    """

    def __init__(self, plan: Plan, folders: Mapping[Path, Path]) -> None:
        self._plan = plan
        self._stack = ExitStack()
        self._instances: dict[str, AnyInstance] = {}
        self._terminable: list[Call] = []
        self.restores = all(part.fmu.restores for part in plan.parts.values())
        try:
            for name, part in plan.parts.items():
                folder = folders[part.fmu.path]
                try_to_start(part, folder, plan.times)
                instance = make(name, part.fmu, folder)
                self._instances[name] = self._stack.enter_context(instance)
            self._prepare()
        except BaseException:
            self._stack.close()
            raise

    def close(self) -> None:
        """Release the instances.

        FMI forbids to terminate one that is about to be initialized, as after a failure another one may be: so all go
        back to an initialized state, if there was one.
        """
        for call in self._terminable:
            call()
        self._stack.close()

    def result(self, parts: dict[str, Part]) -> Result:
        """Simulate with these start values."""
        plan, clock, times = self._plan, self._clock, self._plan.times
        self._perform(self._restore)
        self._bus.values[:] = 0.0
        clock.set(times[0], times[0])
        for name, instance in self._instances.items():
            instance.setup(plan.tolerance, times[0], times[-1])
            for variable, value in parts[name].starts.items():
                instance.assign(variable, value)
            instance.enter_initialization()
        self._perform(self._initial)
        for instance in self._instances.values():
            instance.exit_initialization()
        if self.restores and not self._terminable:
            self._terminable = self._saved()
        self._perform(self._settle)
        self._loop.begin()
        self._loop.advance(len(times))
        values = np.ascontiguousarray(self._loop.rows.T[self._columns])
        return Result(plan.title, np.array(times), tuple(plan.recorded), values, self._units)

    def _prepare(self) -> None:
        plan = self._plan
        feeds = {connection.target.place: connection.source.place for connection in plan.connections}
        order = schedule.order(plan.parts, feeds)
        recorded = list(plan.recorded.values())
        self._clock, self._bus = Clock(plan.times[0]), Bus(order, feeds, [], recorded)
        explicit = Explicit(plan.parts, self._instances, feeds, self._bus, order=order, signals=[], clock=self._clock)
        assert plan.coupling is not None
        self._owners = explicit.owners
        self._initial = explicit.consistent(self._depends_initially, initial=True)
        self._settle = explicit.consistent(self._depends, initial=False)
        step = explicit.step(self._depends, plan.coupling)
        rows = np.empty((len(plan.times), self._bus.values.size))
        self._loop = Loop(step, self._clock, self._bus, plan.times, rows=rows, judge=self._judge)
        self._columns = [self._bus.index[place] for place in recorded]
        self._units = {name: plan.unit(place) for name, place in plan.recorded.items()}
        self._restore = self._saved() if self.restores else []

    def _saved(self) -> list[Call]:
        """Calls that bring the present states back."""
        calls = []
        for name, instance in self._instances.items():
            save, restore = instance.states()
            self._owners |= {save: ("save", name), restore: ("restore", name)}
            self._perform([save])
            calls.append(restore)
        return calls

    def _perform(self, calls: Sequence[Call]) -> None:
        for call in calls:
            if status := call():
                self._judge(call, status)

    def _judge(self, call: Call, status: int) -> None:
        if status != WARNING:
            action, name = self._owners[call]
            raise self._instances[name].failure(action, status, self._clock.when(action))

    def _depends(self, output: Place, input_: Place) -> bool:
        return self._plan.parts[output[0]].fmu.depends(output[1], input_[1])

    def _depends_initially(self, output: Place, input_: Place) -> bool:
        return self._plan.parts[output[0]].fmu.depends(output[1], input_[1], initially=True)


def session_of(task: Task) -> Session:
    """The session of a process that has no other purpose, and may be killed in its midst.

    What it puts into temporary folders is in that of the sweep, and goes with that.
    """
    plan, folders, tempfile.tempdir = task
    return Session(plan, folders)


def extract_all(plan: Plan, folder: Path) -> dict[Path, Path]:
    """Extract each FMU once.

    :param folder: where.
    :returns: path of the FMU -> its own folder.
    :raises SimulationError: if a file is damaged.
    """
    found: dict[Path, Path] = {}
    for part in plan.parts.values():
        path = part.fmu.path
        if path not in found:
            found[path] = extract(path, folder / str(len(found)))
    return found
