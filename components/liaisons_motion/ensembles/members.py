"""Members of an ensemble as instances of an FMU's code, each of which goes from event to event by itself."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from importlib import resources
from itertools import pairwise
from threading import Lock
from typing import Any, final
from weakref import finalize

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.base.arrays import Floats
from liaisons.base.compiled_code import call_c_function, loaded_library
from liaisons.base.compiler import compile_library, host_target
from liaisons.base.port_names import port_names
from liaisons.composition import compose
from liaisons.errors import SimulationError
from liaisons.fmu import SELDOM_RUN, Core
from liaisons.mechanics import Model
from liaisons_motion.right_hand_sides import ContinuousModel

_MEMBER = np.dtype([("instance", np.uintp), ("reason", "S512")])
"""As in ``members.c``."""
EVENT = np.dtype([("time", "d"), ("scale", "d"), ("kind", "l"), ("which", "l")])
ACT = np.dtype([("impulse", "d"), ("rests_from", "d"), ("mode", "l"), ("approaches", "l"), ("counts", "l")])
"""As in ``contact_record.h``: an event of contacts, and what each contact does in it."""
_RECORDS = 1000
"""Records that there is room for at first."""
_LOCK = Lock()
"""Of the libraries, so that threads do not compile the same one at once."""


def model_with_operators(moved: ContinuousModel) -> Model:
    """Model composed with its operators, in which its own variables have names such as ``"Pendulum.theta"``."""
    model, moving = moved.model, moved.moving
    triples = [(a.value, a.rate, a.acceleration) for a in model.active if a.value in moving]
    sources = {
        f"{model.name}.{name}": f"{triple[0]}.{source}"
        for triple in triples
        for name, source in zip(triple, port_names("y"), strict=False)
    }
    return compose(model.name, {model.name: model, **moving}, sources) if moving else model


@final
class Members:
    """Instances of a model, which take the steps of its FMU.

    :param model: without arrays.
    :raises SimulationError: if memory runs out.
    :raises BuildError: if there is no compiler, or it fails.
    """

    def __init__(self, model: Model, count: int) -> None:
        with _LOCK:
            (self._code, references), self._prefix = _members_library(model), f"{model.name}."
        self._contacts = len(model.contacts)
        self._lock = Lock()  # an instance is of one thread at a time
        self._references = {name.removeprefix(self._prefix): number for name, number in references.items()}
        created = False
        with suppress(MemoryError, OverflowError, ValueError):
            self._members = np.zeros(count, _MEMBER)
            created = call_c_function(self._code, "create_members", count, self._members)
            finalize(self, call_c_function, self._code, "free_members", count, self._members)
        if not created:
            raise SimulationError(f"{model.name}: out of memory for {count} members; take fewer")

    def start(self, names: Sequence[str], values: Floats, *, time: float, tolerance: float, first: int = 0) -> None:
        """Reset members, set their values, and initialize them at a time.

        :param values: of parameters and inputs, (members, names).
        :param tolerance: 0: that of the model.
        :param first: member that the first row is of.
        """
        members, values = self._members[first : first + len(values)], np.ascontiguousarray(values)
        self._call("start_members", members, time, tolerance, names, values)

    def step(self, times: Floats, names: Sequence[str] = (), values: ArrayLike = (), origin: ArrayLike = 0.0) -> None:
        """Step all members from each time to the next one.

        :param values: of inputs, which are held, (members, names).
        :param origin: time [s] at which the times are 0, one for all members or one for each.
        """
        values, origins = np.array(values, dtype=float, order="C"), np.empty(len(self._members))
        origins[:] = origin
        self._call("step_members", self._members, origins, len(times) - 1, np.ascontiguousarray(times), names, values)

    def read(self, names: Sequence[str]) -> Floats:
        """Current values of variables, (members, names); not-a-number for a member that has failed."""
        values = np.full((len(self._members), len(names)), np.nan)
        self._call("read_values", self._members, names, values)
        return values

    def record(
        self, values: Mapping[str, float], inputs: Mapping[str, Floats], ends: Floats, *, time: float, tolerance: float
    ) -> list[tuple[NDArray[Any], NDArray[Any]]]:
        """Start the first member, step it from end to end, and return what its contacts do at events in each step.

        :param values: of parameters and inputs at the start.
        :param inputs: values and five derivatives at the start of each step, (steps, 6).
        :param ends: of steps [s], ascending; one that is not later than the one before takes no step.
        :returns: events, and acts of contacts (events, contacts), step by step; as in ``contact_record.h``.
        :raises SimulationError: where the motion ends before.
        """
        polynomials = np.ascontiguousarray(np.stack([*inputs.values()], axis=1)) if inputs else np.empty(0)
        start, most, numbers = np.array([*values.values()]), _RECORDS, np.zeros(len(ends) + 1, dtype=np.int_)
        while True:
            events, acts = np.empty(most, EVENT), np.empty((most, self._contacts), ACT)
            asked = [float(time), float(tolerance), *self._numbered(list(values)), start, len(ends), ends]
            asked += [*self._numbered(list(inputs)), polynomials, most, events, acts, numbers]
            with self._lock:
                call_c_function(self._code, "record_member", self._members[:1], *asked)
            if reasons := self.failures():
                raise SimulationError(reasons[0])
            if numbers[-1] <= most:
                parts = pairwise([0, *numbers[1:].tolist()])
                return [(events[begin:end], acts[begin:end]) for begin, end in parts]
            most = int(numbers[-1])

    def failures(self) -> dict[int, str]:
        """Reasons of the members that have failed."""
        reasons = self._members["reason"]
        failed = np.flatnonzero(reasons.astype("S1") != b"").tolist()  # behind the first 0 are rests of older ones
        return {i: reasons[i].partition(b"\0")[0].decode(errors="ignore").replace(self._prefix, "") for i in failed}

    def _call(self, function: str, members: NDArray, *arguments: Any) -> None:
        """Call a function of ``members.c``, with names passed as their number and their value references."""
        made = list[Any]()
        for argument in arguments:
            made += self._numbered(argument) if isinstance(argument, (list, tuple)) else [argument]
        with self._lock:
            call_c_function(self._code, function, len(members), members, *made)

    def _numbered(self, names: Sequence[str]) -> list[Any]:
        """How many names there are, and their value references."""
        return [len(names), np.array([self._references[name] for name in names], dtype=np.uintc)]


@lru_cache
def _members_library(model: Model) -> tuple[ctypes.CDLL, Mapping[str, int]]:
    """Loaded library of a model's code with ``members.c``, and the value references of its variables by name."""
    core = Core.of(model)
    return _compiled_members(tuple(core.files.items())), core.references


@lru_cache
def _compiled_members(sources: tuple[tuple[str, bytes], ...]) -> ctypes.CDLL:
    """Loaded library of sources with ``members.c``, compiled once for equal models."""
    own = resources.files("liaisons_motion.ensembles").joinpath("members.c").read_bytes()
    files = {**dict(sources), "members.c": own}
    return loaded_library(compile_library(files, host_target(), seldom_run=SELDOM_RUN))  # as in the FMU: compiled once
