"""Dry friction of FMUs that act on each other: which of it sticks is chosen at once, sticking first.

Each FMU chooses by accelerations and loads of others, which depend on what it chooses.  In one combination of modes all
FMUs are linear, so that these accelerations and loads follow from a linear system, with the coupled effective mass; the
combination is right if each FMU chooses its part of it by them.  Combinations in which more sticks come first.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import chain, combinations, islice, pairwise, product
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from liaisons.base.arrays import Floats, as_indices
from liaisons.cosim import Kernel, VariableReference, friction_variables
from liaisons.errors import RefusedError
from liaisons.impacts.impulses import ImpulsivePort

_AT_REST = 1e-12
"""Sliding velocity that is rounding, relative to the largest one."""
_CHANGES = 4.0 ** np.arange(-5, 7)
"""Changes of an input that are tried, relative to the input."""
_HALVINGS = 50
"""How often the interval that a change ends is halved."""
_MOST_COMBINATIONS = 1000
_DIFFERENCES = 1e-3 * 0.1 ** np.arange(10)
"""Changes of an input for derivatives in a mode, relative to the input: the first one that leaves the mode as it is."""

Action = Callable[[], None]


@final
class _Influence:
    """An input of an FMU by which others act on what sticks: an acceleration, or a load.

    :param variables: of the input and, of an acceleration, of the rate beside it.
    :param slip: velocity of the friction; of a load any rate of the FMU.
    """

    def __init__(self, variables: Sequence[VariableReference], slip: VariableReference, kernel: Kernel) -> None:
        simulation, signals, (first, *_) = kernel.simulation, kernel.signals, variables
        part, own = simulation.parts[slip[0]], kernel.instances[slip[0]]
        self._bus, self._columns = kernel.bus, kernel.bus.columns(variables)
        self._values, self._slip = np.zeros(len(variables)), np.zeros(1)
        self._put = own.setter([part.fmu.variables[name] for _, name in variables], self._values)
        self._get = own.getter([part.fmu.variables[slip[1]]], self._slip)
        self._signals, self._index = signals, signals.index[simulation.feeds[first]]
        self.is_load = len(variables) == 1
        self._factor = simulation.conversions[first].factor if first in simulation.conversions else 1.0

    def value(self, row: Floats) -> float:
        """Its value in a row of the bus."""
        return float(row[self._columns[0]])

    def add(self, row: Floats, change: float) -> None:
        """Add to it, and set the rate so that the velocity is 0, as it is to the tolerance of a step.

        :param row: values of the bus.
        """
        self._values[:] = row[self._columns]
        self._values[0] += change
        self._bus.perform([self._put, self._get])
        if not self.is_load:
            slip = float(self._slip[0])
            self._values[1] += 1.0
            self._bus.perform([self._put, self._get])
            slope = float(self._slip[0]) - slip
            self._values[1] = row[self._columns[1]] - (slip / slope if slope else 0.0)
            self._bus.perform([self._put])
            self._signals.before[self._index] += change / self._factor  # the slope of the rate

    def hand_over(self, row: Floats) -> None:
        """Let it have its value in another row while an instant is crossed."""
        self._signals.before[self._index] = self.value(row) / self._factor


@final
class _Friction:
    """Dry friction of an FMU, which others act on.

    :param variables: its velocity, and the direction of that.
    """

    def __init__(self, variables: Sequence[VariableReference], ports: Sequence[ImpulsivePort], kernel: Kernel) -> None:
        slip, direction = variables
        self._is_iterated = kernel.simulation.coupling == "waveform"
        self.name, self._direction = ".".join(slip), int(kernel.bus.columns([direction])[0])
        inputs = [(port.acceleration, port.rate.target.reference) for port in ports if port.moved == slip[0]]
        loads = [(port.load,) for port in ports if port.mover == slip[0]]
        self._influences = [_Influence(variables, slip, kernel) for variables in (*inputs, *loads)]

    @property
    def accelerations(self) -> list[_Influence]:
        """Those of its influences that are accelerations."""
        return [influence for influence in self._influences if not influence.is_load]

    def find_sticking(self, before: Floats, slides: float, cross: Callable[[Action], Floats]) -> Action | None:
        """Find an input with which it sticks at an instant at which its velocity is 0.

        :param before: values of the bus before the instant.
        :param slides: direction in which it slides with the present inputs.
        :param cross: crosses the instant after an action; returns the values of the bus behind it.
        :returns: the action that sets this input; None if there is none.
        :raises RefusedError: if there is none for which waveform iteration converges.
        """
        refusals = list[RefusedError]()
        for influence in self._influences:

            def direction(change: float, one: _Influence = influence) -> float:
                try:
                    return float(cross(partial(one.add, before, change))[self._direction])
                except RefusedError as refusal:
                    refusals.append(refusal)
                    return slides

            change = _find_zero(direction, slides, max(abs(influence.value(before)), 1.0))
            if change is not None:
                return partial(influence.add, before, change)
        if refusals and self._is_iterated:
            raise refusals[0]
        return None


def _find_zero(sign: Callable[[float], float], at_0: float, size: float) -> float | None:
    """A zero of a function that only rises or falls, with values -1, 0 and 1; None if none is found.

    :param at_0: its value at 0.
    :param size: of its argument.
    """
    for change in (side * size * factor for factor in _CHANGES for side in (1, -1)):
        low, high, found = 0.0, change, sign(change)
        for _ in range(_HALVINGS if found not in {0, at_0} else 0):
            middle = (low + high) / 2
            if (found := sign(middle)) == 0:
                return middle
            low, high = (middle, high) if found == at_0 else (low, middle)
        if found == 0:
            return high
    return None


class _Piece(NamedTuple):
    """A combination of modes of an FMU, in which what it returns is a linear function of its inputs.

    :param modes: direction of each of its dry frictions, 0 where it sticks.
    :param inputs: some with which it has these modes.
    :param results: what it returns with them.
    :param slopes: derivatives of the results.
    """

    modes: tuple[float, ...]
    inputs: Floats
    results: Floats
    slopes: Floats

    def at(self, inputs: Floats) -> Floats:
        """What it would return in these modes."""
        return self.results + self.slopes @ (inputs - self.inputs)


@final
class _Node:
    """An FMU in initialization mode: its reaction to accelerations and loads.

    :ivar inputs_of: indices of its inputs among the unknowns: of each port the acceleration, then the forces.
    :ivar outputs_of: indices of its outputs among the same.
    """

    def __init__(self, name: str, ports: Sequence[ImpulsivePort], kernel: Kernel) -> None:
        part, instance, bus, count = kernel.simulation.parts[name], kernel.instances[name], kernel.bus, len(ports)
        variables = part.fmu.variables
        moved = [j for j, port in enumerate(ports) if port.moved == name]
        moving = [j for j, port in enumerate(ports) if port.mover == name]
        places = [*(ports[j].acceleration for j in moved), *(ports[j].load for j in moving)]
        outputs = [*(ports[j].force for j in moved), *(ports[j].mover_acceleration for j in moving)]
        frictions = friction_variables(part)
        forces = [friction.force for friction in frictions]
        self.inputs_of = as_indices([*moved, *(count + j for j in moving)])
        self.outputs_of = as_indices([*(count + j for j in moved), *moving])
        factors = [*(ports[j].factors[1] for j in moved), *(ports[j].factors[0] for j in moving)]
        self._factors = np.array([*factors, *(1.0 for _ in forces)])
        self._bus, self._columns = bus, bus.columns(places)
        self._inputs, self._results = np.zeros(len(places)), np.zeros(len(outputs) + len(forces))
        self._modes = np.zeros(len(frictions))
        self._calls = [
            instance.setter([variables[variable] for _, variable in places], self._inputs),
            instance.getter([variables[variable] for _, variable in (*outputs, *forces)], self._results),
        ]
        if frictions:
            self._calls.append(instance.getter([variables[direction] for _, (_, direction) in frictions], self._modes))

    def respond(self, inputs: Floats) -> tuple[tuple[float, ...], Floats]:
        """The modes that it chooses alone; its outputs, in the units of the other side, and the forces of friction."""
        self._inputs[:] = inputs
        self._bus.perform(self._calls)
        return tuple(self._modes.tolist()), self._results * self._factors

    def is_consistent(self, piece: _Piece, pieces: Sequence[_Piece], inputs: Floats) -> bool:
        """Whether it can have the modes of a piece with other inputs.

        What it lets slide alone slides; what it lets stick may slide if its acceleration has the direction of that.
        """
        chosen, first = self.respond(inputs)[0], len(self.outputs_of)
        if chosen == piece.modes:
            return True
        held = next((other for other in pieces if other.modes == chosen), None)
        if held is None or any(mode not in {0, own} for mode, own in zip(chosen, piece.modes, strict=True)):
            return False
        gain = (piece.at(inputs) - held.at(inputs))[first:]
        return all(own == mode or own * more > 0 for mode, own, more in zip(chosen, piece.modes, gain, strict=True))

    def pieces(self) -> list[_Piece]:
        """The combinations of modes that it has by some value of one of its inputs, most sticking first."""
        start = self._bus.values[self._columns].copy()
        found = {self.respond(start)[0]: start}
        for k in range(len(start)) if len(self._modes) else ():
            sizes = max(abs(start[k]), 1.0) * np.concatenate([-_CHANGES[::-1], [0.0], _CHANGES])
            row = [(change, self._note(start, k, change, found)) for change in sizes.tolist()]
            intervals = list(pairwise(row))
            for _ in range(_HALVINGS):
                intervals = [
                    half
                    for (low, below), (high, above) in intervals
                    if np.abs(np.subtract(above, below)).max() > 1
                    for middle in [((low + high) / 2, self._note(start, k, (low + high) / 2, found))]
                    for half in (((low, below), middle), (middle, (high, above)))
                ]
        ordered = sorted(found.items(), key=lambda item: np.count_nonzero(item[0]))
        return [self._piece(modes, inputs) for modes, inputs in ordered]

    def _note(self, start: Floats, k: int, change: float, found: dict[tuple[float, ...], Floats]) -> tuple[float, ...]:
        inputs = start.copy()
        inputs[k] += change
        modes = self.respond(inputs)[0]
        found.setdefault(modes, inputs)
        return modes

    def _piece(self, modes: tuple[float, ...], inputs: Floats) -> _Piece:
        _, results = self.respond(inputs)
        slopes = np.zeros((len(results), len(inputs)))
        for k in range(len(inputs)):
            for change in (side * max(abs(inputs[k]), 1.0) * part for part in _DIFFERENCES for side in (1, -1)):
                other = inputs.copy()
                other[k] += change
                others, values = self.respond(other)
                if others == modes:
                    slopes[:, k] = (values - results) / change
                    break
        return _Piece(modes, inputs, results, slopes)


@final
class Frictions:
    """Dry friction of FMUs that act on each other through ports."""

    def __init__(self, ports: Sequence[ImpulsivePort], kernel: Kernel) -> None:
        """Take the ports through which impulses go, and forces with them."""
        bus, signals = kernel.bus, kernel.signals
        names = dict.fromkeys(name for port in ports for name in (port.moved, port.mover))
        parts = [kernel.simulation.parts[name] for name in names]
        frictions = [friction for part in parts for friction in friction_variables(part)]
        self._slips, self._directions = (bus.columns(friction[k] for friction in frictions) for k in range(2))
        self._motion = [
            bus.columns(port.rate.target.reference for port in ports),
            bus.columns(port.acceleration for port in ports),
        ]
        self._count, self._signals = len(ports), signals
        outputs = [*(port.mover_acceleration for port in ports), *(port.force for port in ports)]
        self._outputs = as_indices([signals.index[output] for output in outputs])
        self._factors = np.array([port.factors[k] for k in range(2) for port in ports])
        self._make_nodes = [partial(_Node, name, ports, kernel) for name in names if frictions]
        loads = [(port.load, port.rate.source.reference) for port in ports if frictions]
        self._loads = [_Influence([load], rate, kernel) for load, rate in loads]
        self._frictions = [_Friction(friction, ports, kernel) for friction in frictions]

    def have_changed(self, before: Floats, after: Floats) -> bool:
        """Whether a friction has begun or ended to slide, by values of the bus before and after."""
        return bool(np.any(before[self._directions] != after[self._directions]))

    def choose_at_start(self) -> bool:
        """Let FMUs in initialization mode choose modes that are consistent; whether there are such.

        Each is left with inputs with which it chooses its part of them alone.
        """
        nodes = [(node, node.pieces()) for node in (make() for make in self._make_nodes)]
        ordered = sorted(
            islice(product(*(pieces for _, pieces in nodes)), _MOST_COMBINATIONS),
            key=lambda combination: sum(np.count_nonzero(piece.modes) for piece in combination),
        )
        for combination in ordered:
            chosen = list(zip(nodes, combination, strict=True))
            z = self._agreed([(node, piece) for (node, _), piece in chosen])
            if not all(node.is_consistent(piece, own, z[node.inputs_of]) for (node, own), piece in chosen):
                continue
            if not all(self._must_slide(k, nodes, combination, z) for k in range(len(nodes))):
                continue
            for (node, _), piece in chosen:
                if node.respond(z[node.inputs_of])[0] != piece.modes:
                    node.respond(piece.inputs)
            self._signals.now[self._outputs] = z / self._factors
            return True
        return False

    def _must_slide(
        self, k: int, nodes: Sequence[tuple[_Node, list[_Piece]]], combination: Sequence[_Piece], z: Floats
    ) -> bool:
        """Whether what a node would let stick alone could not do so with the others as they are."""
        node, own = nodes[k]
        modes = node.respond(z[node.inputs_of])[0]
        if modes == combination[k].modes:
            return True
        held = [*combination]
        held[k] = next(piece for piece in own if piece.modes == modes)
        other = self._agreed([(one, piece) for (one, _), piece in zip(nodes, held, strict=True)])
        return node.respond(other[node.inputs_of])[0] != modes

    def _agreed(self, chosen: Sequence[tuple[_Node, _Piece]]) -> Floats:
        """Accelerations and forces on which nodes agree in some modes."""
        matrix, right = np.eye(2 * self._count), np.zeros(2 * self._count)
        for node, piece in chosen:
            some = slice(len(node.outputs_of))
            matrix[node.outputs_of[:, np.newaxis], node.inputs_of] -= piece.slopes[some]
            right[node.outputs_of] += piece.at(np.zeros(len(piece.inputs)))[some]
        return np.asarray(np.linalg.lstsq(matrix, right, rcond=None)[0], dtype=np.float64)

    def begins_to_slide(self, values: Floats, size: float) -> bool:
        """Whether any dry friction slides without a velocity; ``size`` of a step [s]."""
        return bool(np.any(self._slide_at_rest(values, size)))

    def _slide_at_rest(self, values: Floats, size: float) -> NDArray[np.bool_]:
        rates, accelerations = (np.abs(values[columns]).max(initial=0.0) for columns in self._motion)
        return (np.abs(values[self._slips]) <= _AT_REST * (rates + size * accelerations)) & (
            values[self._directions] != 0
        )

    def let_stick(
        self, before: Floats, after: Floats, size: float, crossings: tuple[Callable[..., Floats], Callable[[], Floats]]
    ) -> Floats:
        """Let dry friction stick that would slide on from a velocity of 0 as its FMU knows no more than its inputs.

        Each FMU chooses by the accelerations and loads of one way to slide, and others react to what it chooses.  Once
        all stick that can, all agree on these, and they stay so unless a force is too large; then fewer are tried.

        :param before: values of the bus before an instant.
        :param after: values behind it.
        :param size: of a step [s].
        :param crossings: the first goes back, and crosses that instant after some actions; the second goes on as far
            again; both return the values behind.
        :returns: the values behind it.
        """
        cross, go_on = crossings
        at_rest, actions, after = self._slide_at_rest(before, size), dict[int, Action](), after.copy()
        turned = [
            k
            for k, column in enumerate(self._directions)
            if before[column] * after[column] < 0 or (at_rest[k] and after[column] != 0)
        ]
        if not turned:
            return after
        for k in [*turned, *turned[:-1]]:  # what comes later may let another stick
            slides = float((cross(*actions.values()) if actions else after)[self._directions[k]])
            if k not in actions and slides != 0:
                action = self._frictions[k].find_sticking(before, slides, partial(cross, *actions.values()))
                actions |= {} if action is None else {k: action}
        for count in range(len(actions), 0, -1):
            for chosen in combinations(actions, count):
                columns, agreed = self._directions[list(chosen)], cross(*(actions[k] for k in chosen)).copy()
                if agreed[columns].any():
                    continue
                # By what each has found alone the others would have moved past it: they cross the instant as agreed.
                accelerations = chain(*(self._frictions[k].accelerations for k in chosen))
                agreeing = [
                    *(actions[k] for k in chosen),
                    *(partial(load.add, agreed, 0.0) for load in self._loads),
                    *(partial(influence.hand_over, agreed) for influence in chain(accelerations, self._loads)),
                ]
                cross(*agreeing)
                if not go_on()[columns].any():
                    return cross(*agreeing)
        return cross()
