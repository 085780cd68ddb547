"""The coupled step of a whole system: its strong components in execution order."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from ctypes import addressof, byref, c_double
from functools import partial
from itertools import chain, repeat
from typing import Any, NoReturn, final

import numpy as np

from liaisons.base.clocks import time_rounding
from liaisons.base.hermite import upper_coefficients
from liaisons.cosim.compiled import library as compiled
from liaisons.cosim.compiled.calls import COUPLED, RAISED, Action, Call, Memory, Record, Vector
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.coupling.explicit import CommunicationCalls
from liaisons.cosim.coupling.records import SignalHistoryRecord, StrongComponentRecord, SystemRecord
from liaisons.cosim.coupling.signals import Curve, SignalHistory, Signals
from liaisons.cosim.coupling.strong_component import INSIDE, Node, Phase, Polynomial, StrongComponent
from liaisons.cosim.instances.protocol import Instances
from liaisons.cosim.structure.schedule import VariableReference
from liaisons.cosim.structure.simulation import Simulation
from liaisons.cosim.structure.sources import SIGNALS, Drive

_ROOM = 17
"""Doubles of scratch memory for each unknown: secants of the iteration, and the present values."""


@final
class Coupled:
    """All strong components of a system; each step is repeated until inputs and outputs agree.

    :ivar calls: those of initialization, an instant and a step.
    :ivar polynomials: input -> polynomial that it follows within a step.
    :ivar error_order: order in H of the error of a step: that of the coarsest polynomial.
    """

    def __init__(self, simulation: Simulation, instances: Instances, bus: Bus) -> None:
        self._bus = bus
        self._times = simulation.times
        references = [*chain.from_iterable(map(bus.connected_outputs.__getitem__, (SIGNALS, *simulation.parts)))]
        self.signals = signals = Signals(simulation, references)
        self._drives: list[tuple[Drive, list[int], list[int]]] = []
        for drive in simulation.drives:
            indices = [*map(signals.index.__getitem__, drive.references)]
            self._drives.append((drive, indices, [*map(signals.slope_index, drive.references[2:])]))
        self._components = _strong_components(simulation, instances, bus, signals)
        self._matrices, nodes = list[Record](), list[Node]()
        for component in self._components:
            nodes += component.nodes
            for newton in component.newtons:
                self._matrices += newton.record, newton.elimination.record
        self.error_order, self.polynomials = 6, dict[VariableReference, Polynomial]()
        for node in nodes:
            self.error_order = min(self.error_order, node.error_order)
            self.polynomials |= zip(bus.inputs[node.name], node.polynomials, strict=True)
        leading = _leading_curves(simulation, signals)
        *self._histories, self._driven = histories = [*map(SignalHistory, repeat(signals), leading)]
        arrays = [*signals.memory.arrays]
        for history in histories:
            arrays += history.memory.arrays
        self._memory = Memory(arrays)
        library = compiled.step_library(coupled=True)
        assert library is not None  # the choice of the coupling has seen to that
        self._library = library
        self._record = self._system_record()
        library.forget.restype = None
        self._address = byref(self._record)
        advance = self._coupled_call(library.advance_coupled, "step")
        settle = [Call(self._evaluate_drives_at_instant)] if self._drives else []
        settle.append(self._coupled_call(library.settle_coupled, "instant"))
        read = _reading_calls(simulation, instances, bus)
        instant = [*settle, *read]
        self.calls = CommunicationCalls(
            [Call(self._initialize)], instant, [advance, *read], [Call(self._cross), *instant]
        )

    def _coupled_call(self, function: Callable[..., int], phase: Phase) -> Call:
        """Call of compiled code for the whole system."""
        call = Call(function, self._address, self._bus.start, self._bus.size)
        failure = partial(self._raise_failure, phase)
        return call.set_record(COUPLED, addressof(self._record)).set_failure("couple", failure)

    def _system_record(self) -> Record:
        """Prepare the system for compiled code."""
        signals, components = self.signals, self._components
        self._drive_call = Call(self._evaluate_drives_in_step)
        self._source_calls: list[Call | None] = []
        for k, component in enumerate(components):
            self._source_calls.append(Call(self._step_source_in_thirds, k) if component.source_node else None)
        calls = *self._source_calls, None
        self._referenced = histories = [*map(SignalHistory.record, (*self._histories, self._driven), calls)]
        records = [*map(partial(StrongComponent.equations, phase="step"), components)]
        settled = map(partial(StrongComponent.equations, phase="instant"), components)
        record = SystemRecord(outputs=signals.count, kinds=len(signals.sizes), count=len(components))
        record.point(components=(StrongComponentRecord * len(components))(*records))
        record.point(settled=(StrongComponentRecord * len(components))(*settled))
        record.point(histories=(SignalHistoryRecord * len(histories))(*histories))
        record.drive = self._drive_call.compiled_record().function if self._drives else None
        record.orders, record.instants = INSIDE.shape
        record.point(before=signals.before, now=signals.now, earlier=signals.earlier, since=signals.since)
        record.point(sizes=signals.sizes, result=signals.result, rates=signals.rates, kind=signals.kinds, inside=INSIDE)
        unknowns = room = 0
        for component in records:
            unknowns = max(unknowns, component.n)
            for node in component.targets["nodes"]:
                room = max(room, node.data + node.derivatives)
        record.point(held=signals.held, room=np.empty(room))
        record.point(scratch=np.empty(_ROOM * unknowns + len(signals.sizes)))
        return record

    def _raise_failure(self, phase: Phase, _action: Action, status: int, _when: str) -> NoReturn:
        """Raise the error of a step in which compiled code has failed."""
        failure = self._record.failure
        for call in (self._drive_call, *self._source_calls):
            if status == RAISED and call is not None and call.raised is not None:
                self._bus.check_status(call, status)
        self._components[failure.component].raise_failure(phase, failure, status)
        raise AssertionError(status)

    def _solve(self, component: StrongComponent, phase: Phase, size: float = 0.0) -> None:
        """Solve the equations of a strong component in the present step, or, of size 0, at one instant."""
        equations, start = byref(component.equations(phase)), self._bus.start
        if status := self._library.solve_component(self._address, equations, start, c_double(size)):
            component.raise_failure(phase, self._record.failure, status)

    def reset(self) -> None:
        """Forget all steps, before a run starts again."""
        self._memory.reset()
        self.signals.sizes[:] = 0.0
        self.signals.result[:] = 0.0
        for component in self._components:
            for newton in component.newtons:
                newton.record.ready = False  # the next step calculates it again

    def _initialize(self) -> None:
        """Solve the equations of initialization, from the start values on."""
        if self._drives:
            self._evaluate_drives_at_instant()
        for component in self._components:
            component.read_start_values()
            self._solve(component, "initialization")
        self.signals.before[:] = self.signals.now

    def _cross(self) -> None:
        """Make the tiny step to a break with extrapolated inputs, and forget what is before it."""
        signals = self.signals
        signals.now[:] = signals.before
        self._evaluate_drives_at_instant()
        held = signals.held.copy()
        signals.held[:] = True
        try:
            for component in self._components:
                self._solve(component, "crossing", self._bus.size.value)
        finally:
            signals.held[:] = held
        self._library.forget(self._address)

    def forget_past(self) -> None:
        """Forget the points before the present one, and the derivatives of outputs by inputs."""
        self._bus.set_step(self._bus.end.value, self._bus.end.value)
        self._library.forget(self._address)

    def save(self) -> list[Any]:
        """The state of the coupling, for :meth:`restore`."""
        return [self._memory.save(), self.signals.sizes.copy(), [matrix.save() for matrix in self._matrices]]

    def restore(self, saved: Sequence[Any]) -> None:
        """Restore a saved state; the steps that follow repeat to the last bit."""
        memory, self.signals.sizes[:], matrices = saved
        self._memory.restore(memory)
        for matrix, content in zip(self._matrices, matrices, strict=True):
            matrix.restore(content)

    def _later_instant_of_piece(self, time: float) -> float | None:
        """A later instant of the piece that starts at this one [s]; None without one, or without functions of time."""
        if not self._drives:
            return None
        index = bisect_right(self._times, time + time_rounding(time))
        if index == len(self._times):
            return None
        breaks = [(time + instant) / 2 for drive, *_ in self._drives if (instant := drive.next_break(time)) is not None]
        return min([self._times[index], *breaks])

    def _step_source_in_thirds(self, component: int) -> int:
        """Step a source whose outputs have no past yet in thirds; returns 1, for compiled code."""
        history, source = self._histories[component], self._components[component].source_node
        size = self._bus.size.value
        assert source is not None
        history.others[:] = source.step_in_thirds()[:, history.made - source.values.start]
        history.instants[:] = size / 3, 2 * size / 3
        source.copy_outputs(self.signals.now)
        return 1

    def _evaluate_drives_in_step(self) -> int:
        """Evaluate the functions of time at the end of the step and, for slopes that none gives, at its thirds.

        :returns: 1 if there are such slopes, for compiled code.
        """
        start, end, size, driven = self._bus.start.value, self._bus.end.value, self._bus.size.value, self._driven
        self._evaluate_drives(end, start)
        if not driven.made.size:
            return 0
        inside = np.zeros((2, self.signals.count))
        driven.instants[:] = size / 3, 2 * size / 3
        for drive, indices, _ in self._drives:
            if len(indices) < 3:
                inside[:, indices] = [drive(start + instant) for instant in driven.instants]
        driven.others[:] = inside[:, driven.made]
        driven.memory.reset()  # what is seen inside a step is better than the past
        return 1

    def _evaluate_drives_at_instant(self) -> None:
        time = self._bus.end.value
        self._evaluate_drives(time, self._later_instant_of_piece(time))

    def _evaluate_drives(self, time: float, other: float | None) -> None:
        """Evaluate the functions of time at an instant [s], and the slopes of accelerations by another instant [s]."""
        for drive, indices, slopes in self._drives:
            values = drive(time)
            self.signals.now[indices] = values
            if slopes:
                self.signals.now[slopes] = 0.0 if other is None else _jerk_at_end(values, drive(other), time - other)


def _reading_calls(simulation: Simulation, instances: Instances, bus: Bus) -> list[Call]:
    """Calls that read what is recorded, and feeds nothing."""
    calls: list[Call] = []
    for name, part in simulation.parts.items():
        if references := bus.recorded_only[name]:
            calls.append(instances[name].getter(part.scalars(references), bus.view(references)))
    return calls


def _strong_components(
    simulation: Simulation, instances: Instances, bus: Bus, signals: Signals
) -> list[StrongComponent]:
    """The strong components of a system in execution order, with the nodes of their FMUs."""
    parts, prescribed = simulation.parts, simulation.chosen_reconstructions
    components: list[StrongComponent] = []
    for names in simulation.strong_components:
        cycle = frozenset(names if names[0] in simulation.cyclic else ())
        nodes = [
            Node(parts[name], instances[name], bus, signals, cycle, prescribed=name in prescribed) for name in names
        ]
        components.append(StrongComponent(nodes, signals, bus, simulation, cyclic=bool(cycle)))
    return components


def _leading_curves(simulation: Simulation, signals: Signals) -> list[list[Curve]]:
    """Curves of the inputs that each strong component, and last the functions of time, feed in later components."""
    number, leading = dict[str, int](), list[list[Curve]]()
    for group in (*simulation.strong_components, [SIGNALS]):
        number |= dict.fromkeys(group, len(leading))
        leading.append([])
    for target, (source, _) in simulation.feeds.items():
        if number[source] != number[target[0]] and target[0] not in simulation.chosen_reconstructions:
            leading[number[source]].append(signals.curve(target))
    return leading


def _jerk_at_end(end: Vector, start: Vector, size: float) -> float:
    """Third derivative, at its end, of the quintic through value, rate and acceleration at both ends."""
    c_3, c_4, c_5 = upper_coefficients(start, end, size)
    return float((6 * c_3 + 24 * c_4 + 60 * c_5) / size**3)
