"""Dry friction of FMUs that act on each other: which of it sticks is chosen at once, sticking first.

Each FMU chooses by accelerations and loads of others, which depend on what it chooses.  In one combination of modes all
FMUs are linear, so that these accelerations and loads follow from a linear system, with the coupled effective mass; the
combination is right if each FMU chooses its part of it by them.  Combinations in which more sticks come first.  That is
the same at the start and later, where a sum of impulses that grows lets an FMU choose.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice, pairwise, product
from typing import NamedTuple, final

import numpy as np

from liaisons.base.arrays import Floats, as_indices
from liaisons.base.contact_limits import STILL
from liaisons.cosim import Kernel, contact_variables, friction_variables
from liaisons.impacts.impulses import ImpulsivePort
from liaisons.impacts.impulsive_fmus import ImpulsiveFmu, grown

_CHANGES = 4.0 ** np.arange(-5, 7)
"""Changes of an input that are tried, relative to the input."""
_HALVINGS = 50
"""How often the interval that a change ends is halved."""
_MOST_COMBINATIONS = 1000
_DIFFERENCES = 1e-3 * 0.1 ** np.arange(10)
"""Changes of an input for derivatives in a mode, relative to the input: the first one that leaves the mode as it is."""


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
class _Choosing:
    """An FMU that chooses modes of its contacts by accelerations and loads."""

    def __init__(self, fmu: ImpulsiveFmu, kernel: Kernel) -> None:
        part = kernel.simulation.parts[fmu.name]
        frictions = friction_variables(part)
        inputs = fmu.each(lambda port: port.acceleration, lambda port: port.load)
        outputs = fmu.each(lambda port: port.force, lambda port: port.mover_acceleration)
        directions = [friction.direction for friction in frictions]
        closed = [contact.closed for contact in contact_variables(part)]
        self.fmu, self.slides = fmu, slice(len(frictions))
        self._columns = fmu.bus.columns(inputs)
        self._factors = np.concatenate([fmu.factors, np.ones(len(frictions))])
        self._inputs, self._results = np.zeros(1 + len(inputs)), np.zeros(len(self._factors))
        self._modes = np.zeros(len(directions) + len(closed))
        told = [fmu.told[0], *inputs]
        read = [*outputs, *(friction.force for friction in frictions)]
        self._calls = [fmu.setter(told, self._inputs), fmu.getter(read, self._results)]
        if len(self._modes):
            self._calls.append(fmu.getter([*directions, *closed], self._modes))

    def begin(self, *, initial: bool) -> None:
        """Begin a choice in the present state.

        :param initial: whether it is in initialization mode, in which it settles with whatever is set.
        """
        self._inputs[0] = self.fmu.sums[0] if initial else grown(self.fmu.sums[0])
        self._first = [] if initial else [self.fmu.restore]
        self.fmu.bus.perform([] if initial else [self.fmu.save])

    def respond(self, inputs: Floats) -> tuple[tuple[float, ...], Floats]:
        """The modes that it chooses alone; its outputs, in the units of the other side, and the forces of friction."""
        self._inputs[1:] = inputs
        self.fmu.bus.perform([*self._first, *self._calls])
        return tuple(self._modes.tolist()), self._results * self._factors

    def keep(self) -> None:
        """Keep what it has chosen last."""
        self.fmu.sums[0] = self._inputs[0]

    def undo(self) -> None:
        """Return to where it began, unless in initialization mode."""
        self.fmu.bus.perform(self._first)

    def is_consistent(self, piece: _Piece, pieces: Sequence[_Piece], inputs: Floats) -> bool:
        """Whether it can have the modes of a piece with other inputs.

        What it lets slide alone slides; what it lets stick may slide if its acceleration has the direction of that.
        """
        chosen, slides = self.respond(inputs)[0], self.slides
        if chosen == piece.modes:
            return True
        held = next((other for other in pieces if other.modes == chosen), None)
        pairs = list(zip(chosen, piece.modes, strict=True))
        if held is None or any(mode != own for mode, own in pairs[slides.stop :]):
            return False
        if any(mode not in {0, own} for mode, own in pairs[slides]):
            return False
        gain = (piece.at(inputs) - held.at(inputs))[len(self.fmu.returned) :]
        return all(own == mode or own * more > 0 for (mode, own), more in zip(pairs[slides], gain, strict=True))

    def pieces(self) -> list[_Piece]:
        """The combinations of modes that it has by some value of one of its inputs, most sticking first."""
        start = self.fmu.bus.values[self._columns].copy()
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
        ordered = sorted(found.items(), key=lambda item: np.count_nonzero(item[0][self.slides]))
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


_Choices = Sequence[tuple[_Choosing, list[_Piece]]]


@final
class Frictions:
    """Dry friction of FMUs that act on each other through ports."""

    def __init__(self, fmus: Sequence[ImpulsiveFmu], ports: Sequence[ImpulsivePort], kernel: Kernel) -> None:
        """Take the ports through which impulses go, and forces with them."""
        bus, signals = kernel.bus, kernel.signals
        frictions = [friction for fmu in fmus for friction in friction_variables(kernel.simulation.parts[fmu.name])]
        self._slips, self._directions = (bus.columns(friction[k] for friction in frictions) for k in range(2))
        self._motion = [
            bus.columns(port.rate.target.reference for port in ports),
            bus.columns(port.acceleration for port in ports),
        ]
        self._count, self._signals = len(ports), signals
        outputs = [*(port.mover_acceleration for port in ports), *(port.force for port in ports)]
        self._outputs = as_indices([signals.index[output] for output in outputs])
        self._factors = np.array([port.factors[k] for k in range(2) for port in ports])
        self._choosing = [_Choosing(fmu, kernel) for fmu in fmus] if frictions else []

    def have_changed(self, before: Floats, after: Floats) -> bool:
        """Whether a friction has begun or ended to slide, by values of the bus before and after."""
        return bool(np.any(before[self._directions] != after[self._directions]))

    def have_stopped(self, before: Floats, after: Floats) -> bool:
        """Whether a friction slides no longer as before, by values of the bus before and after."""
        return bool(np.any((before[self._directions] != 0) & (before[self._directions] != after[self._directions])))

    def begin_to_slide(self, values: Floats, size: float) -> bool:
        """Whether any dry friction slides without a velocity; ``size`` of a step [s]."""
        rates, accelerations = (np.abs(values[columns]).max(initial=0.0) for columns in self._motion)
        rests = np.abs(values[self._slips]) <= STILL * (rates + size * accelerations)
        return bool(np.any(rests & (values[self._directions] != 0)))

    def choose(self, *known: Floats, initial: bool = False) -> bool:
        """Let FMUs choose modes that are consistent with each other, or leave them as they are.

        Each is left with inputs with which it chooses its part of them alone, and has to be settled with all others.

        :param known: values of the bus with modes that are not to be chosen: all FMUs have come to them alone.
        :param initial: whether FMUs are in initialization mode.
        :returns: whether there are such modes.
        """
        if not self._choosing:
            return False
        for one in self._choosing:
            one.begin(initial=initial)
        choices = [(one, one.pieces()) for one in self._choosing]
        alone = {tuple(row[self._directions].tolist()) for row in known}
        for combination, z in islice(self._consistent(choices), 1):
            chosen = list(zip(self._choosing, combination, strict=True))
            if tuple(mode for one, piece in chosen for mode in piece.modes[one.slides]) in alone:
                continue
            for one, piece in chosen:
                if one.respond(z[one.fmu.taken])[0] != piece.modes:
                    one.respond(piece.inputs)
                one.keep()
            self._signals.now[self._outputs] = z / self._factors
            return True
        for one in self._choosing:
            one.undo()
        return False

    def _consistent(self, choices: _Choices) -> Iterator[tuple[Sequence[_Piece], Floats]]:
        """Combinations of modes that are consistent, most sticking first, and what FMUs hand over in them."""
        ordered = sorted(
            islice(product(*(pieces for _, pieces in choices)), _MOST_COMBINATIONS),
            key=lambda combination: sum(
                np.count_nonzero(piece.modes[one.slides]) for (one, _), piece in zip(choices, combination, strict=True)
            ),
        )
        for combination in ordered:
            z = self._agreed(choices, combination)
            chosen = zip(choices, combination, strict=True)
            if all(one.is_consistent(piece, own, z[one.fmu.taken]) for (one, own), piece in chosen) and all(
                self._must_slide(k, choices, combination, z) for k in range(len(choices))
            ):
                yield combination, z

    def _must_slide(self, k: int, choices: _Choices, combination: Sequence[_Piece], z: Floats) -> bool:
        """Whether what an FMU would let stick alone could not do so with the others as they are."""
        one, own = choices[k]
        modes = one.respond(z[one.fmu.taken])[0]
        if modes == combination[k].modes:
            return True
        held = [*combination]
        held[k] = next(piece for piece in own if piece.modes == modes)
        return one.respond(self._agreed(choices, held)[one.fmu.taken])[0] != modes

    def _agreed(self, choices: _Choices, combination: Sequence[_Piece]) -> Floats:
        """Accelerations and forces on which FMUs agree in some modes."""
        matrix, right = np.eye(2 * self._count), np.zeros(2 * self._count)
        for (one, _), piece in zip(choices, combination, strict=True):
            some, returned, taken = slice(len(one.fmu.returned)), one.fmu.returned, one.fmu.taken
            matrix[returned[:, np.newaxis], taken] -= piece.slopes[some]
            right[returned] += piece.at(np.zeros(len(piece.inputs)))[some]
        return np.asarray(np.linalg.lstsq(matrix, right, rcond=None)[0], dtype=np.float64)
