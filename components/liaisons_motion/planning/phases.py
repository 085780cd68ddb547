"""Phases of contacts: the problem of a plan whose contacts change modes in an order that the caller gives.

In a phase every contact keeps its mode, so that the equations are smooth; between two phases lie conditions:

================================  =====================================================================================
open -> closed                    gap = 0; without restitution the states jump to the rate 0, else it is 0 before
open -> open, named again         gap = 0; the states jump by Newton's law: a bounce
closed -> open                    the force that would keep it closed is <= 0
sticks -> forward, backward       the force that would make it stick is at least its bound
forward, backward -> sticks       the sliding velocity is 0
================================  =====================================================================================

Along a phase gaps are >= 0 where they are open, forces >= 0 where they are closed, frictions within their bounds where
they stick, and sliding velocities have their direction.  σ̈ is controlled, and may jump between phases.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np

from liaisons.algebra import stack
from liaisons.base.arguments import shown
from liaisons.base.array_names import by_name, suffixed_name
from liaisons.contacts import Compliance
from liaisons.errors import PlanError, suggestion
from liaisons.mechanics import Contact
from liaisons_motion.goals import Goal, GoalSymbols, duration_range, goal_symbols
from liaisons_motion.planning import problems
from liaisons_motion.planning.goal_rows import GoalRows, Row, goal_rows, with_sizes
from liaisons_motion.planning.problems import Problem, Rows

_DIRECTIONS = {"sticks": 0, "forward": 1, "backward": -1}
"""Directions of sliding by modes of dry friction."""
_DEPENDENT = 1e-8
"""Singular values below this, of gradients in units of sizes, say that rows follow from others."""
_PROJECTIONS = 10
"""Newton's steps onto rows."""


@dataclass(frozen=True, eq=False)
class _Phase:
    """A phase: modes of the contacts by name, those among them that the caller names, and its duration [s].

    Dry friction without a mode is that of an open gap.
    """

    goal_symbols: GoalSymbols
    modes: Mapping[str, str]
    named: Collection[str]
    duration: tuple[float, float]

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """Unilateral liaisons, then dry friction."""
        return self.goal_symbols.model.contacts

    @property
    def gaps(self) -> dict[int, bool]:
        """Whether each gap is closed, by its index among the contacts."""
        return {i: self.modes[c.name] == "closed" for i, c in enumerate(self.contacts) if not c.friction}

    @property
    def frictions(self) -> dict[int, int]:
        """Direction of sliding of each friction that can act, 0 if it sticks, by its index among the contacts."""
        acting = [(i, c.name) for i, c in enumerate(self.contacts) if c.friction and self.modes.get(c.normal) != "open"]
        return {i: _DIRECTIONS[self.modes[name]] for i, name in acting}

    @property
    def mode_values(self) -> dict[str, float]:
        """Values of the FMU's variables for modes, by name: 1 for a contact that is closed or sticks, else 0."""
        flags = {self.contacts[i].variable("closed"): float(closed) for i, closed in self.gaps.items()}
        return flags | {self.contacts[i].variable("sticks"): float(not d) for i, d in self.frictions.items()}

    @cached_property
    def symbols(self) -> GoalSymbols:
        """Symbols of the mechanism in the modes of the phase."""
        numbers = self.mode_values | {
            self.contacts[i].variable("direction"): float(d) for i, d in self.frictions.items()
        }
        memory = self.goal_symbols.model.memory
        return replace(self.goal_symbols, memory=tuple(numbers.get(name, 0.0) for name in memory))

    @cached_property
    def contact_terms(self) -> Mapping[str, ca.SX]:
        """Gaps, velocities, accelerations without contact forces, ... by name, with a row for each contact."""
        contact: Any = self.symbols.model.contact
        terms = by_name(contact.name_out(), contact.call([ca.SX(x) for x in self.symbols.model_arguments[:4]]))
        padding = ca.SX.zeros(len(self.gaps))
        return terms | {name: ca.vertcat(padding, terms[name]) for name in ("stick", "slide")}

    @cached_property
    def forces(self) -> ca.SX:
        """Contact forces x, with which v̇ = a + G x is 0 where a gap is closed or friction sticks."""
        contacts = range(len(self.contacts))
        held = ca.SX([float(self.gaps.get(i, self.frictions.get(i) == 0)) for i in contacts])
        drag = -ca.DM([self.frictions.get(i, 0) for i in contacts]) * self.contact_terms["slide"]
        normals = [*map(self.normal, contacts)]
        return Compliance.of_numbers(self.contact_terms).forces(self.contact_terms["a"], held, drag, normals)[0]

    def normal(self, friction: int) -> int:
        """Index of the gap whose force bounds a friction; -1 if its bound is a force."""
        return next((i for i in self.gaps if self.contacts[i].name == self.contacts[friction].normal), -1)

    def margins(self, friction: int) -> dict[int, ca.SX]:
        """Distances of a friction force from the bounds at which it slips, by the direction of sliding."""
        normal, force = self.normal(friction), self.forces[friction]
        bound = self.contact_terms["stick"][friction] * (1 if normal < 0 else self.forces[normal])
        return {1: bound + force, -1: bound - force}

    def rows(self) -> GoalRows:
        """Constraints and cost of the goal, with those of the contacts along the phase."""
        rows = goal_rows(self.symbols)
        values = [(i, self.forces[i]) for i, closed in self.gaps.items() if closed]
        sticking = (i for i, direction in self.frictions.items() if not direction)
        values += [(i, margin) for i in sticking for margin in self.margins(i).values()]
        forces = (Row(suffixed_name(self.contacts[i].name, "_force"), value, 0.0, np.inf) for i, value in values)
        return replace(rows, path=[*rows.path, *self.sign_rows(), *with_sizes(self.symbols, forces)])

    def sign_rows(self) -> list[Row]:
        """Rows of what has a sign: gaps that are open, and sliding velocities."""
        v, gap, names = self.contact_terms["v"], self.contact_terms["gap"], [c.name for c in self.contacts]
        rows = [Row(names[i], gap[i], 0.0, np.inf) for i, is_closed in self.gaps.items() if not is_closed]
        ends = {1: (0.0, np.inf), -1: (-np.inf, 0.0)}
        rows += [Row(names[i], v[i], *ends[direction]) for i, direction in self.frictions.items() if direction]
        return with_sizes(self.symbols, rows)

    def held_rows(self) -> list[Row]:
        """Rows of what stays 0: gap and rate where it is closed, sliding velocity where it sticks."""
        v, gap, names = self.contact_terms["v"], self.contact_terms["gap"], [c.name for c in self.contacts]
        closed = [i for i, is_closed in self.gaps.items() if is_closed]
        rows = [row for i in closed for row in (Row(names[i], gap[i]), Row(suffixed_name(names[i], "_dot"), v[i]))]
        rows += [Row(names[i], v[i]) for i, direction in self.frictions.items() if not direction]
        return with_sizes(self.symbols, rows)


def optimal_control_problem(goal: Goal) -> Problem:
    """The problem of optimal control of a goal, with or without phases.

    :raises PlanError: for an unknown name or mode, with the nearest one, or what cannot be reached.
    """
    if not goal.phases:
        return problems.smooth_problem(goal)
    symbols = goal_symbols(goal)
    phases = _phases(symbols)
    rows = [phase.rows() for phase in phases]
    last, size = len(rows) - 1, next((one.cost_size for one in rows if one.cost.n_dep()), rows[0].cost_size)
    start = [*rows[0].start, *problems.rows_at_rest(symbols, {row.label for row in rows[0].start})]
    start += _independent_rows(symbols, "start", start, phases[0].held_rows(), phases[0].sign_rows())
    held = [*_independent_rows(symbols, "end", [], phases[-1].held_rows(), [])]
    end = [*_independent_rows(symbols, "end", held, rows[-1].end, phases[-1].sign_rows())]
    parts = []
    for k, (phase, one) in enumerate(zip(phases, rows, strict=True)):
        own = replace(one, start=start if k == 0 else [], end=end if k == last else [], cost_size=size)
        parts.append(
            replace(
                problems.problem_in_all_states(phase.symbols, own), duration=phase.duration, modes=phase.mode_values
            )
        )
    return replace(
        parts[0],
        terminal_state=parts[-1].terminal_state,
        end=parts[-1].end,
        duration=_total_duration(goal.duration, phases),
        phases=tuple(parts),
        junctions=tuple(_Junction(*pair).rows() for pair in pairwise(phases)),
    )


def _phases(symbols: GoalSymbols) -> list[_Phase]:
    """Phases of a goal.

    :raises PlanError: for an unknown name or mode, or one that is missing.
    """
    goal, contacts, modes = symbols.goal, symbols.model.contacts, dict[str, str]()
    choices = {c.name: [*_DIRECTIONS] if c.friction else ["closed", "open"] for c in contacts}
    if not choices:
        raise PlanError(f"{symbols.name} has no unilateral liaison and no dry friction; leave phases out")
    phases: list[_Phase] = []
    for k, entries in enumerate(goal.phases):
        label = f"{symbols.name}: phases[{k}]"
        named = {name: mode for name, mode in entries.items() if name != "duration"}
        for name in named.keys() - choices.keys():
            raise PlanError(f"{label} has no contact {name!r}{suggestion(name, choices)}")
        if phases and not named:
            raise PlanError(f"{label} names no contact; name one with its mode in this phase")
        modes = modes | named
        for c in contacts:
            is_open, mode = modes.get(c.normal) == "open", modes.get(c.name)
            if is_open and c.name in named:
                raise PlanError(f"{label}: {c.name} = {mode!r}, but {c.normal} is open; leave {c.name} out")
            if not is_open and mode not in choices[c.name]:
                raise PlanError(f"{label}: {c.name} = {shown(mode)}: give {' or '.join(map(repr, choices[c.name]))}")
        duration = duration_range(entries.get("duration", goal.duration[1]), f"{label}: duration")
        phases.append(_Phase(symbols, modes, named.keys(), duration if "duration" in entries else (0.0, duration[1])))
    return phases


def _total_duration(duration: tuple[float, float], phases: Sequence[_Phase]) -> tuple[float, float]:
    """Range of the duration of all phases [s].

    :raises PlanError: if their own durations leave none.
    """
    least, most = (sum(phase.duration[i] for phase in phases) for i in (0, 1))
    low, high = max(duration[0], least), min(duration[1], most)
    if low > high * (1 + GoalSymbols.rounding):
        raise PlanError(f"phases last {least:g} s to {most:g} s, and duration = {duration}; change one of them")
    return low, max(low, high)


def _independent_rows(
    symbols: GoalSymbols, label: str, rows: list[Row], further: list[Row], signs: list[Row]
) -> Iterator[Row]:
    """The further rows that are independent of the rows and of each other, at a state where all of them hold.

    :param signs: rows of what has a sign.
    :raises PlanError: if a row follows with another value, or sign, or has no derivative.
    """
    states = problems.candidate_states(symbols, 2)
    X, sizes = stack(state.symbol for state in states), np.array([state.size for state in states])
    first = problems.initial_values(symbols, states, [*rows, *further])
    x = np.array([first[state.name] for state in states])
    independent = [row for row in rows if row.low == row.high]
    for row in (*further, *signs):
        columns = stack((one.expression - one.nearest_to_zero) / one.size for one in (*independent, row))
        results = [ca.densify(columns), ca.densify(symbols.scaled_jacobian(columns, X))]
        function = ca.Function("rows", [X, symbols.motion[2]], results)
        values = gradients = np.zeros((0, 0))
        for _ in range(_PROJECTIONS):
            values, gradients = map(np.array, function(x, 0))  # σ̈ = 0
            if not (np.isfinite(values).all() and np.isfinite(gradients).all()):
                raise PlanError(f"{symbols.name}: {label}: {row.label} has no derivative there; move it")
            x = x - sizes * (np.linalg.pinv(gradients[:-1], rcond=_DEPENDENT) @ values[:-1]).ravel()
        is_free = np.linalg.matrix_rank(gradients, tol=_DEPENDENT) == len(gradients)
        value, shift = row.nearest_to_zero + values[-1].item() * row.size, _DEPENDENT * row.size
        where = f"{symbols.name}: {label}: phases make {row.label} = {value:g} there"
        if any(row is one for one in signs):
            if not (is_free or row.low - shift <= value <= row.high + shift):
                raise PlanError(f"{where}, not in {row.range}")
        elif row.low < row.high or is_free:
            independent += [row] if row.low == row.high else []
            yield row
        elif abs(value - row.low) > shift:
            raise PlanError(f"{where}, not {row.low:g}")


@dataclass(frozen=True, eq=False)
class _Junction:
    """Two phases with the conditions between them: of states before and after, impulses by their sizes, and σ̈ after."""

    before: _Phase
    after: _Phase

    @cached_property
    def scaled_impulses(self) -> ca.SX:
        """Symbols of the impulses, divided by their typical sizes."""
        return ca.SX.sym("impulses", len(self.before.contacts))

    @cached_property
    def sizes(self) -> list[float]:
        """Sizes of the impulses."""
        symbols = self.before.symbols
        return [symbols.sizes[c.variable("force")] * symbols.time for c in self.before.contacts]

    @cached_property
    def struck_gaps(self) -> list[int]:
        """Indices of the gaps that close or bounce at the junction."""
        after = self.after
        opens = [i for i, closed in self.before.gaps.items() if not closed]
        return [i for i in opens if after.gaps[i] or after.contacts[i].name in after.named]

    @cached_property
    def impact_gaps(self) -> list[int]:
        """Indices of the gaps that have an impact: those that bounce, or close without restitution."""
        symbols, e = self.before.symbols, self.before.contact_terms["restitution"]
        return [i for i in self.struck_gaps if not self.after.gaps[i] or symbols.evaluate(e[i], 0.0).item() == 0]

    def rows(self) -> Rows:
        """All conditions as one function.

        :raises PlanError: for an impact that has no law.
        """
        symbols, terms = self.before.symbols, self.before.contact_terms
        states, n = problems.candidate_states(symbols, 2), symbols.state.numel()
        X = stack(state.symbol for state in states)
        X0, push = ca.SX.sym("before", X.numel()), symbols.model.push
        assert push is not None
        pushed = push(
            *symbols.model_arguments, self.scaled_impulses * ca.DM(self.sizes), ca.SX.zeros(len(self.before.gaps))
        )
        columns = (ca.vertcat(pushed[0][:n], *symbols.motion[:2]), terms["gap"], terms["v"])
        started, gap, v = ca.substitute([ca.SX(column) for column in columns], [X], [X0])
        rows = [Row(state.name, state.symbol - started[i]) for i, state in enumerate(states)]
        for i in self.before.gaps:
            rows += self._gap_rows(i, gap[i], v[i])
        for i in range(len(self.before.gaps), len(self.sizes)):
            rows += self._friction_rows(i)
        arguments = [X0, X, self.scaled_impulses, symbols.motion[2]]
        function = ca.Function("junction", arguments, [ca.densify(stack(row.expression for row in rows))])
        low, high = (np.array([getattr(row, name) for row in rows]) for name in ("low", "high"))
        sizes = np.array([symbols.sizes.get(row.label, 1.0) for row in rows])
        return Rows(tuple(row.label for row in rows), function, low, high, sizes)

    def _gap_rows(self, i: int, gap: ca.SX, v: ca.SX) -> Iterator[Row]:
        """Conditions on the i-th gap, from its value and its rate before."""
        name, stays, terms = self.before.contacts[i].name, self.after.gaps[i], self.before.contact_terms
        jumps = i in self.impact_gaps
        is_pushed = bool(self.impact_gaps) if stays else jumps
        if i in self.struck_gaps:
            yield Row(name, gap)
            if not jumps:
                yield Row(suffixed_name(name, "_dot"), v)
        if is_pushed:
            yield Row(suffixed_name(name, "_dot"), terms["v"][i] + (0 if stays else terms["restitution"][i] * v))
        yield Row("", self.scaled_impulses[i], 0.0, np.inf if is_pushed else 0.0)
        if self.before.gaps[i] and not stays:
            yield Row(suffixed_name(name, "_force"), -self.before.forces[i], 0.0, np.inf)

    def _friction_rows(self, i: int) -> Iterator[Row]:
        """Conditions on the i-th contact, a dry friction: its impulse is bounded by sliding, as in FMUs.

        :raises PlanError: if the gap that presses it bounces.
        """
        before, name, normal = self.before, self.before.contacts[i].name, self.before.normal(i)
        earlier, later = before.frictions.get(i), self.after.frictions.get(i)
        if normal in self.impact_gaps and later is None:
            raise PlanError(
                f"{before.symbols.name}: {before.contacts[i].normal} bounces where {name} rubs; let it close"
            )
        rubs = normal >= 0 and later is not None and bool(self.impact_gaps)
        if rubs:
            most = (
                before.contact_terms["slide"][i] * self.scaled_impulses[normal] * (self.sizes[normal] / self.sizes[i])
            )
            signs, high = ((later,), 0.0) if later else ((1, -1), np.inf)
            yield from (Row("", most + sign * self.scaled_impulses[i], 0.0, high) for sign in signs)
        else:
            yield Row("", self.scaled_impulses[i])
        slips = bool(later) and not rubs and earlier is not None and earlier != later
        if (slips and earlier) or (later == 0 and (earlier != 0 or self.impact_gaps)):
            yield Row(name, before.contact_terms["v"][i])
        if slips:
            stuck = replace(before, modes=dict(before.modes) | {name: "sticks"})
            yield Row(suffixed_name(name, "_force"), -stuck.margins(i)[later or 0], 0.0, np.inf)
