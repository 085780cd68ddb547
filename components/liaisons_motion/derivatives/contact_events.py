"""What contacts do in a motion, as the core of its FMU writes it down: when, which of them, and in which modes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias, final

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval
from numpy.typing import NDArray

from liaisons.base.arrays import Floats
from liaisons.errors import SimulationError
from liaisons_motion.derivatives.contacts import Kind
from liaisons_motion.derivatives.functions import MotionFunctions
from liaisons_motion.derivatives.motion import event_margin
from liaisons_motion.derivatives.steps import Segment

ContactRecord: TypeAlias = tuple[NDArray[Any], NDArray[Any]]
"""Events, and what contacts do at them, (events, contacts), as in ``contact_record.h``."""


@final
@dataclass(frozen=True, eq=False)
class ContactEvents:
    """Events of a motion's contacts, recorded by the core of its FMU.

    :param names: of the values of the motion; ``shared``: of the first shared values.
    :param driven: inputs and active coordinates that are polynomials of time.
    """

    name: str
    functions: MotionFunctions
    names: Sequence[str]
    shared: Sequence[str]
    driven: Sequence[str]

    def record(
        self, k: Floats, segments: Sequence[Segment], *, start_time: float, tolerance: float
    ) -> list[ContactRecord]:
        """Records of the events in each segment.

        :raises SimulationError: where the motion ends before.
        """
        rows, ends = segments[0].table, np.array([segment.instants[-1] for segment in segments])
        inputs = self._polynomials(segments)
        values = dict(zip(self.names, k.tolist(), strict=True)) | dict(zip(self.shared, rows[0].tolist(), strict=False))
        values |= {name: float(polynomial[0, 0]) for name, polynomial in inputs.items()}
        try:
            parts = self.functions.members.record(values, inputs, ends, time=start_time, tolerance=tolerance)
        except SimulationError as error:
            raise SimulationError(f"{self.name}: {error}") from None
        records, left = list[ContactRecord](), (parts[0][0][:0], parts[0][1][:0])
        for segment, part in zip(segments, parts, strict=True):
            events, acts = (np.concatenate(pair) for pair in zip(left, part, strict=True))
            begin, end = segment.instants[[0, -1]]
            fixed = (events["kind"] == Kind.SETTLED) & (events["which"] < 0)
            late = np.flatnonzero(fixed & (events["time"] > begin + event_margin(begin)))
            first = _first_of_event(events, int(late[0])) if late.size else len(events)
            left = events[first:], acts[first:]
            events["time"] = np.clip(events["time"], begin, end)
            records.append((events[:first].copy(), acts[:first].copy()))
        return records

    def _polynomials(self, segments: Sequence[Segment]) -> dict[str, Floats]:
        """Values and five derivatives of the driven inputs at the start of each segment, (segments, 6)."""
        rows = np.array([segment.table[segment.rows[0]] for segment in segments])
        times = np.array([segment.instants[0] for segment in segments]) - rows[:, len(self.shared) + 1]
        triples = {a.value: (a.value, a.rate, a.acceleration) for a in self.functions.model.active}
        result, first, count = dict[str, Floats](), len(self.shared) + 2, 6
        for name in self.driven:
            coefficients, first = rows[:, first : first + count].T, first + count
            orders = [polyval(times, polyder(coefficients, order), tensor=False) for order in range(count)]
            slopes = np.array(orders, dtype=np.float64)
            for order, input_name in enumerate(triples.get(name, (name,))):
                result[input_name] = np.pad(slopes[order:], ((0, order), (0, 0))).T
        return result


def _first_of_event(events: NDArray[Any], last: int) -> int:
    """Index of the first record of the event that ends with a record."""
    first = last
    while first and events["kind"][first - 1] not in (Kind.SETTLED, Kind.GRAZED):
        first -= 1
    return first
