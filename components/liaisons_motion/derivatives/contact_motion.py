"""A motion with contacts as a function of values, with derivatives of the steps that were taken.

The last step before an event of a contact ends where an event indicator g is 0: its size h is an implicit function of
the state, dh = -(∂g/∂y δy + ∂g/∂k δk + ∂g/∂t δt)/(dg/dh).  The steps behind it move along with its instant, up to the
next recorded time.  So what textbooks write as a saltation matrix is a product of derivatives: of the last step, of the
impact, and of the steps behind it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Self, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.base.array_names import suffixed_name
from liaisons.base.logs import logger
from liaisons_motion.derivatives.contact_events import ContactEvents
from liaisons_motion.derivatives.contact_steps import ContactSteps, Entries
from liaisons_motion.derivatives.contacts import Contacts, Kind
from liaisons_motion.derivatives.motion import (
    CHUNK_NUMBERS,
    STAGE_NUMBERS,
    Branch,
    Integration,
    SteppedMotion,
    Undefined,
    Weights,
    recorded_times,
)
from liaisons_motion.derivatives.steps import METHOD, Floats, Segment

_AT_EVENT = 1e-12
"""Relative distance of a recorded time from an event at which there are two derivatives."""
_CONSTANT = 1e-6
"""Largest derivative of a number that stays 0, relative to the terms of the derivative."""
_NEGLIGIBLE = 1e-9
"""The same, relative to the scale of the number over the value."""


@final
@dataclass(frozen=True, eq=False)
class _Leg:
    """Part of a segment, whose states of stages fit into memory.

    :param y: first state.
    :param stages: states before entries, and of stages; None: to be calculated once more.
    :param landing: None if no known event was just before.
    :param slopes: derivatives of the first and of the last instant of the segment by the values.
    :param is_first: whether it is the first part of its segment.
    """

    entries: Entries
    y: Floats
    stages: Floats | None
    landing: tuple[Floats, Floats] | None
    slopes: tuple[Floats, Floats]
    is_first: bool


@final
@dataclass(frozen=True, eq=False, repr=False)
class ContactMotion(SteppedMotion):
    """A motion with unilateral liaisons and dry friction, whose events depend on its states."""

    has_contacts: ClassVar = True

    contacts: Contacts
    steps: ContactSteps
    events: ContactEvents

    def branch(self, values: ArrayLike) -> Branch:
        """Signals and instants of impacts, with their derivatives on the branch that the motion takes at events."""
        run = self._run(values, keep_stages=True)
        records, undefined, slopes = self._state_and_event_derivatives(run)
        settled, last = [leg.entries.of_kind(Kind.SETTLED) for leg in run.legs], -self.contacts.gaps
        instants = np.concatenate([entries["t"] for entries in settled])
        counts = np.concatenate([entries.shared[:, 2 * last : last] for entries in settled]).astype(int)
        events = np.diff(counts, axis=0, prepend=0).T
        impacts = {
            suffixed_name(name, "_impacts"): (np.repeat(instants, row), np.repeat(slopes, row, axis=0))
            for name, row in zip(self.contacts.names, events, strict=False)
        }
        signals = self._evaluate(run, self.functions.outputs)
        return Branch(signals, self._signal_derivatives(run, records), tuple(undefined), impacts)

    def forward(self, values: ArrayLike) -> tuple[Floats, Floats]:
        branch = self.branch(values)
        branch.derivatives[:, self._warn_of_undefined(branch.undefined)] = np.nan
        return branch.signals, branch.derivatives

    def adjoint(self, values: ArrayLike, weights: Weights) -> tuple[Floats, Floats]:
        f, run = self.functions, self._run(values, keep_stages=True)
        signals, factors, total, by_state = self._weighted_sum_derivatives(run, weights)
        if any(self._is_doubtful(leg.entries) for leg in run.legs):
            counts = (factors != 0).any(axis=0)
            total[self._warn_of_undefined(self._state_and_event_derivatives(run)[1])[counts].any(axis=0)] = np.nan
        of_y, of_slope = np.zeros(f.states), np.zeros(1)
        for leg in reversed(run.legs):
            of_k, of_last = self.steps.adjoint(
                leg.entries, run.k, self._stages(run, leg), by_state, of_y=of_y, of_slope=of_slope
            )
            total += of_k + of_last * leg.slopes[1]
            if leg.is_first:
                total += of_slope * leg.slopes[0]
                of_slope[:] = 0
            if leg.landing is not None:
                of_k, by_y = leg.landing
                total += of_y @ of_k
                of_y = of_y @ by_y
        return signals, total + of_y @ f.start_derivatives(run.k, self.table[0]).full()

    def _stages(self, run: Integration, leg: Any) -> Floats:
        if leg.stages is not None:
            return leg.stages
        return self.steps.retrace(leg.entries, run.k, leg.y, keep=True)[1]

    def _is_doubtful(self, entries: Entries) -> bool:
        """Whether derivatives by some values may not exist at one of these entries."""
        return bool(
            (entries["kind"] >= Kind.GRAZED).any() or self._is_recorded(entries.of_kind(Kind.SETTLED)["t"]).any()
        )

    def _is_recorded(self, instants: Floats) -> NDArray[np.bool_]:
        """Which events are at a recorded time, (events,)."""
        later = np.searchsorted(self.times, instants)
        neighbours = self.times[np.clip([later - 1, later], 0, len(self.times) - 1)]
        return np.any(np.abs(neighbours - instants) <= _AT_EVENT * np.maximum(1.0, np.abs(instants)), axis=0)

    def _warn_of_undefined(self, undefined: Sequence[Undefined]) -> NDArray[np.bool_]:
        """Log the derivatives that do not exist; return whether one is among these, (times, values)."""
        result = np.zeros((len(self.times), len(self.values)), dtype=bool)
        for instant, columns, reason, lasts in undefined:
            where = np.abs(self.times - instant) <= _AT_EVENT * max(1.0, abs(instant))
            where |= lasts & (self.times > instant)
            new = where[:, None] & columns & ~result
            if new.any():
                names, when = np.array(self.names)[new.any(axis=0)], "from here on" if lasts else "there"
                logger.warning(
                    "%s: t = %.9g s: %s: derivatives by %s are not-a-number %s",
                    *(self.name, instant, reason, ", ".join(names), when),
                )
            result |= new
        return result

    def at(self, times: ArrayLike) -> Self:
        """The same motion, recorded at other times."""
        return replace(self, times=recorded_times(times, self.start_time))

    def frozen(self, values: ArrayLike) -> Self:  # noqa: ARG002
        """The same motion: its steps are chosen in each run, as they end at events."""
        return self

    def _state_and_event_derivatives(self, run: Integration) -> tuple[Floats, list[Undefined], Floats]:
        """Derivatives of states and of instants of events, and where some do not exist.

        :returns: derivatives on the branch that is taken, of states at the recorded times (times, states, values); what
            is undefined; derivatives of the instants of settled events (events, values).
        """
        f, k, count = self.functions, run.k, len(run.k)
        of_y, slope = f.start_derivatives(k, self.table[0]).full(), np.zeros(count)
        records, undefined, slopes = np.empty((len(self.times), f.states, count)), list[Undefined](), list[Floats]()
        for leg in run.legs:
            entries, stages = leg.entries, self._stages(run, leg)
            if leg.landing is not None:
                by_k, by_y = leg.landing
                of_y = by_k + by_y @ of_y
            slope, record, kinds = leg.slopes[0] if leg.is_first else slope, entries["record"], entries["kind"]
            saved = (record >= 0) | (kinds == Kind.SETTLED) | (kinds >= Kind.GRAZED)
            (states, instants), (of_y, slope) = self.steps.tangents(
                entries, k, stages, of_y=of_y, slopes=(slope, leg.slopes[1]), saved=saved
            )
            numbers = np.flatnonzero(saved)
            record, kinds = record[numbers], kinds[numbers]
            is_recorded, settled = record >= 0, np.flatnonzero(kinds == Kind.SETTLED)
            records[record[is_recorded]] = states[is_recorded]
            slopes.append(instants[settled])
            meets = instants[settled].any(axis=1) & self._is_recorded(entries["t"][numbers[settled]])
            for n in np.union1d(settled[meets], np.flatnonzero(kinds >= Kind.GRAZED)).tolist():
                entry, before = entries.part([numbers[n]]), stages[numbers[n], 0]
                doubt = self._undefined_at(entry, k, before, states[n], instants[n])
                undefined += [doubt] if doubt[1].any() else []
        return records, undefined, np.concatenate(slopes)

    def _undefined_at(self, entry: Entries, k: Floats, y: Floats, of_y: Floats, slope: Floats) -> Undefined:
        """Derivatives that may not exist behind an entry, and why.

        :param of_y: derivatives of the state, (states, values), and of the instant, ``slope``, before it.
        """
        kind, instant = int(entry["kind"][0]), float(entry["t"][0])
        if kind == Kind.SETTLED:
            return instant, slope != 0, "two branches of the motion meet", False
        if kind == Kind.GRAZED:
            return instant, np.any(of_y != 0, axis=0), "a contact is grazed", True
        rows = self.contacts.condition_derivatives[kind](instant, k, entry.shared[0], y, entry["flags"][0]).full()
        row = rows[entry["which"][0]] / entry["h"][0]
        terms = np.vstack([row[0] * slope, row[1 : 1 + len(k)], row[1 + len(k) :, None] * of_y])
        change, size, values = terms.sum(axis=0), np.abs(terms).sum(axis=0), np.where(k == 0, 1.0, np.abs(k))
        changes = (np.abs(change) > _CONSTANT * size) & (np.abs(change) * values > _NEGLIGIBLE)
        return instant, changes, "contacts act in another order or mode for neighbouring values", True

    # ---- the run

    def _run(self, values: ArrayLike, *, keep_stages: bool = False) -> Integration:
        """Integrate the motion from the start to the last recorded time, event by event."""
        f, k, contacts = self.functions, self._checked_values(values), self.contacts
        y, sizes = (x.full().ravel() for x in f.start(k, self.table[0]))
        memory = np.zeros(contacts.remembered)
        memory[contacts.count + contacts.gaps :] = self.start_time
        records, shared = np.empty((len(self.times), f.states)), self.table[self._table_rows(self.times)]
        legs: list[_Leg] = []
        size, room, instants = np.array([self.times[-1] - self.start_time]), STAGE_NUMBERS, self.times.copy()
        numbers = (METHOD.stages + 1) * f.states
        most = max(1, CHUNK_NUMBERS // numbers)
        segments = self._segments(k) or [self._empty_segment(k)]
        recorded_events = self.events.record(k, segments, start_time=self.start_time, tolerance=self.step_tolerance)
        for segment, happened in zip(segments, recorded_events, strict=True):
            first, landing = self._state_after_event(k, segment.event, y)
            y, slopes = first.copy(), (segment.slopes[0], segment.slopes[-1])
            if not legs and self.times[0] == self.start_time:
                segment.records[0] = 0
            whole, short_at = self.steps.follow(
                segment, k, y, size, memory, record=happened, tolerance=self.step_tolerance, sizes=np.abs(sizes)
            )
            if np.isfinite(short_at):
                table = np.broadcast_to(whole.shared[-1], self.table.shape)
                stuck = replace(segment, table=table)
                self._refuse_stuck(stuck, k, y, np.array([short_at]), np.empty(0, dtype=np.int_))
            for begin in range(0, len(whole), most):
                entries, start = whole.part(slice(begin, begin + most)), first
                room -= len(entries) * numbers
                keep = keep_stages and room > 0
                states, stages = self.steps.retrace(entries, k, start, keep=keep)
                first, ends, row = states[-1], entries["t"] + entries["h"], entries["row"]
                is_recorded = entries["record"] >= 0
                checked = np.flatnonzero(is_recorded | (entries["kind"] == Kind.STEP))
                self._refuse_states(k, ends[checked], entries.table[row[checked]], states[checked])
                kept = np.flatnonzero(is_recorded)
                recorded = entries["record"][kept]
                records[recorded], shared[recorded] = states[kept], entries.table[row[kept]]
                instants[recorded] = np.maximum(instants[recorded], segment.limits[0])
                legs.append(_Leg(entries, start, stages if keep else None, landing, slopes, begin == 0))
                landing = None
        return Integration(k, legs, [instants[None], k[:, None], shared.T, records.T])

    def _empty_segment(self, k: Floats) -> Segment:
        """Segment of no length, for a motion of which the start alone is recorded."""
        ends, none = np.full(2, self.start_time), np.full(2, -1)
        row, limits = self._table_rows(ends[:1]), np.array([-np.inf, np.inf])
        return Segment(ends, np.zeros((2, len(k))), none, row, limits, self.table, None)


def with_contacts(motion: SteppedMotion, shared: Sequence[str], driven: Sequence[str]) -> ContactMotion:
    """The motion with its contacts; their modes are chosen anew after each break of an input.

    :param shared: names of the first shared values; ``driven``: of the inputs that are polynomials of time.
    """
    contacts = motion.functions.contacts
    assert contacts is not None
    settings: dict[str, Any] = {item.name: getattr(motion, item.name) for item in fields(SteppedMotion)}
    settings["table"] = np.hstack([motion.table, np.zeros((len(motion.table), contacts.remembered))])
    settings["jumps"] = motion.breaks[1:-1]
    events = ContactEvents(motion.name, motion.functions, motion.names, shared, driven)
    steps = ContactSteps(contacts, motion.functions.steps)
    return ContactMotion(**settings, contacts=contacts, steps=steps, events=events)
