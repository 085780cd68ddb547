"""Phases of contacts: the problem of a plan whose contacts change modes in an order that the caller gives.

In a phase every contact keeps its mode, so that the equations are smooth; between two phases lie conditions:

================================  =====================================================================================
open -> closed                    gap = 0; the states jump by Newton's law, whose rate after it has to be 0
open -> open, named again         gap = 0; they jump by Newton's law: a bounce
closed -> open                    the force that would keep it closed is <= 0
sticks -> forward, backward       the force that would make it stick is at least its bound
forward, backward -> sticks       the sliding velocity is 0
================================  =====================================================================================

Along a phase gaps are >= 0 where they are open, forces >= 0 where they are closed, frictions within their bounds where
they stick, and sliding velocities have their direction.  σ̈ is controlled, and may jump between phases.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from liaisons.base.arguments import shown
from liaisons.errors import PlanError, suggestion
from liaisons.expressions.algebra import stack
from liaisons.mechanics.model import Contact
from liaisons.planning import problems
from liaisons.planning.goal_rows import GoalRows, Row, goal_rows, with_sizes
from liaisons.planning.goals import Goal, by_name, duration_range
from liaisons.planning.problems import Problem, Rows
from liaisons.planning.symbols import ROUNDING, GoalSymbols, goal_symbols

_DIRECTIONS = {"sticks": 0, "forward": 1, "backward": -1}
"""Directions of sliding by modes of dry friction."""
_DEPENDENT = 1e-8
"""Singular values below this, of gradients in units of sizes, say that rows follow from others."""
_PROJECTIONS = 10
"""Newton's steps onto rows."""


@dataclass(frozen=True)
class _Phase:
    """A phase: modes of the contacts by name, those among them that the caller names, and its duration [s].

    Dry friction without a mode is that of an open gap.
    """

    contacts: tuple[Contact, ...]
    modes: Mapping[str, str]
    named: frozenset[str]
    duration: tuple[float, float]

    @property
    def gaps(self) -> list[int]:
        """Indices of the closed gaps."""
        return [i for i, c in enumerate(self.contacts) if self.modes.get(c.name) == "closed"]

    @property
    def frictions(self) -> dict[int, int]:
        """Directions of sliding, 0 where it sticks, by the indices of the frictions that can act."""
        return {
            i: _DIRECTIONS[self.modes[c.name]]
            for i, c in enumerate(self.contacts)
            if c.friction and (not c.normal or self.modes[c.normal] == "closed")
        }

    def normal(self, friction: int) -> int | None:
        """Index of the gap whose force bounds a friction; None if its bound is a force."""
        name = self.contacts[friction].normal
        return [c.name for c in self.contacts].index(name) if name else None

    def sticking(self, friction: int) -> _Phase:
        """The phase in which this friction sticks."""
        return replace(self, modes=dict(self.modes) | {self.contacts[friction].name: "sticks"})

    @property
    def flags(self) -> dict[str, float]:
        """1 for what is closed or sticks, else 0, by the names of the FMU's variables."""
        flags = {c.variable("closed"): float(i in self.gaps) for i, c in enumerate(self.contacts) if not c.friction}
        return flags | {self.contacts[i].variable("sticks"): float(not d) for i, d in self.frictions.items()}

    def memory(self, names: Sequence[str]) -> tuple[float, ...]:
        """Numbers of the model's memory, by their names."""
        directions = {self.contacts[i].variable("direction"): float(d) for i, d in self.frictions.items()}
        return tuple((self.flags | directions).get(name, 0.0) for name in names)


def problem_of(goal: Goal) -> Problem:
    """The problem of optimal control of a goal, with its phases if it has some.

    :raises PlanError: for an unknown name or mode, with the nearest one, or what cannot be reached.
    """
    if not goal.phases:
        return problems.smooth_problem(goal)
    symbols = goal_symbols(goal)
    phases = _phases(symbols)
    by_phase = [replace(symbols, memory=phase.memory(symbols.model.memory)) for phase in phases]
    rows = [_rows(*pair) for pair in zip(by_phase, phases, strict=True)]
    size = next((one.cost_size for one in rows if one.cost.n_dep()), rows[0].cost_size)
    start = rows[0].start
    start = [*start, *problems.rows_at_rest(symbols, {row.label for row in start})]
    starts, ends = ([[]] * len(phases) for _ in range(2))
    label = "phases[0], as the contacts are at the start"
    starts[0] = [*start, *_independent_rows(symbols, label, start, _held_rows(symbols, phases[0]))]
    label = "end, as the contacts are in the last phase"
    ends[-1] = [*_independent_rows(symbols, label, _held_rows(symbols, phases[-1]), rows[-1].end)]
    parts = [
        replace(
            problems.problem_in_all_states(own, GoalRows(start, end, one.path, one.cost, size)),
            duration=phase.duration,
            modes=phase.flags,
        )
        for own, phase, one, start, end in zip(by_phase, phases, rows, starts, ends, strict=True)
    ]
    pairs = zip(by_phase, phases, phases[1:], strict=False)
    return replace(
        parts[0],
        terminal_state=parts[-1].terminal_state,
        end=parts[-1].end,
        duration=_total_duration(goal.duration, phases),
        phases=tuple(parts),
        junctions=tuple(_junction(*pair) for pair in pairs),
    )


# ---- what the caller says -----------------------------------------------------------------------------------------


def _phases(symbols: GoalSymbols) -> list[_Phase]:
    """Phases of a goal.

    :raises PlanError: for an unknown name or mode, one that is missing, or an order that is impossible.
    """
    contacts, longest = symbols.model.contacts, symbols.goal.duration[1]
    if not contacts:
        raise PlanError(f"{symbols.name} has no unilateral liaison and no dry friction; leave phases out")
    phases: list[_Phase] = []
    for k, entries in enumerate(symbols.goal.phases):
        label = f"{symbols.name}: phases[{k}]"
        named = {name: mode for name, mode in entries.items() if name != "duration"}
        for name, mode in named.items():
            choices = _modes(contacts, name)
            if not choices:
                raise PlanError(f"{label} has no contact {name!r}{suggestion(name, [c.name for c in contacts])}")
            if mode not in choices:
                raise PlanError(f"{label}: {name} = {shown(mode)}: give {' or '.join(map(repr, choices))}")
        if phases and not named:
            raise PlanError(f"{label} names no contact; name one with its mode in this phase")
        duration = (
            duration_range(entries["duration"], f"{label}: duration") if "duration" in entries else (0.0, longest)
        )
        modes = dict(phases[-1].modes if phases else {}) | named
        phase = _Phase(contacts, modes, frozenset(named), duration)
        _refuse_missing_modes(label, phase)
        phases.append(phase)
    return phases


def _modes(contacts: Sequence[Contact], name: str) -> tuple[str, ...]:
    """Modes that a contact can have; none if there is no such contact."""
    friction = {c.name: c.friction for c in contacts}
    return () if name not in friction else (*_DIRECTIONS,) if friction[name] else ("closed", "open")


def _refuse_missing_modes(label: str, phase: _Phase) -> None:
    """Raise an error for a contact without a mode, and for friction that is named where its gap is open."""
    for c in phase.contacts:
        mode, is_open = phase.modes.get(c.name), phase.modes.get(c.normal) == "open"
        if mode is None and not is_open:
            raise PlanError(
                f"{label}: {c.name} has no mode; give {' or '.join(map(repr, _modes(phase.contacts, c.name)))}"
            )
        if is_open and c.name in phase.named:
            raise PlanError(f"{label}: {c.name} = {mode!r}, but {c.normal} is open; leave {c.name} out")


def _total_duration(duration: tuple[float, float], phases: Sequence[_Phase]) -> tuple[float, float]:
    """Range of the duration of all phases [s].

    :raises PlanError: if their own durations leave none.
    """
    least, most = (sum(phase.duration[i] for phase in phases) for i in (0, 1))
    low, high = max(duration[0], least), min(duration[1], most)
    if low > high * (1 + ROUNDING):
        raise PlanError(f"phases last {least:g} s to {most:g} s, and duration = {duration}; change one of them")
    return low, max(low, high)


# ---- rows of the contacts -----------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Contacts:
    """Expressions of a mechanism's contacts, one row each, and the forces in the modes of a phase."""

    symbols: GoalSymbols

    def __getitem__(self, name: str) -> ca.SX:
        function = self.symbols.model.contact
        assert function is not None
        return by_name(function.name_out(), function.call([ca.SX(x) for x in self.symbols.model_arguments[:4]]))[name]

    def forces(self, phase: _Phase) -> ca.SX:
        """Contact forces: v̇ = a + G x is 0 where a gap is closed or friction sticks."""
        n, frictions = len(phase.contacts), phase.frictions
        held = [*phase.gaps, *(i for i, direction in frictions.items() if direction == 0)]
        P, offset, slide = ca.SX.eye(n), ca.SX.zeros(n), self["slide"]
        for i, direction in frictions.items():
            drag, normal = -direction * slide[i - self.first_friction(phase)], phase.normal(i)
            if direction and normal is None:
                offset[i] = drag
            elif direction:
                P[i, normal] = drag
        if not held:
            return offset
        G = ca.reshape(self["G"], n, n)
        required = ca.solve((G @ P)[held, held], -(self["a"] + G @ offset)[held])
        return P[:, held] @ required + offset

    @staticmethod
    def first_friction(phase: _Phase) -> int:
        """Count of the gaps."""
        return sum(not c.friction for c in phase.contacts)

    def bound(self, phase: _Phase, friction: int, forces: ca.SX) -> ca.SX:
        """Force up to which friction sticks."""
        normal = phase.normal(friction)
        return self["stick"][friction - self.first_friction(phase)] * (1 if normal is None else forces[normal])


def _rows(symbols: GoalSymbols, phase: _Phase) -> GoalRows:
    """Constraints and cost of a goal in a phase, with those of its contacts along it."""
    rows, contacts = goal_rows(symbols), _Contacts(symbols)
    forces, v = contacts.forces(phase), contacts["v"]
    own = []
    for i, c in enumerate(phase.contacts):
        force = f"{c.name}_force"
        if i in phase.gaps:
            own.append(Row(force, forces[i], 0, np.inf))
        elif not c.friction:
            own.append(Row(c.name, contacts["gap"][i], 0, np.inf))
        elif phase.frictions.get(i) == 0:
            own += [Row(force, contacts.bound(phase, i, forces) - sign * forces[i], 0, np.inf) for sign in (1, -1)]
        elif i in phase.frictions:
            own.append(Row(c.name, phase.frictions[i] * v[i], 0, np.inf))
    return replace(rows, path=[*rows.path, *with_sizes(symbols, own)])


def _held_rows(symbols: GoalSymbols, phase: _Phase) -> list[Row]:
    """Rows of what a phase conserves: gap and rate 0 where it is closed, sliding velocity 0 where it sticks."""
    contacts, names = _Contacts(symbols), [c.name for c in phase.contacts]
    v = contacts["v"]
    rows = [row for i in phase.gaps for row in (Row(names[i], contacts["gap"][i]), Row(f"{names[i]}_dot", v[i]))]
    return with_sizes(symbols, [*rows, *(Row(names[i], v[i]) for i, d in phase.frictions.items() if not d)])


def _independent_rows(symbols: GoalSymbols, label: str, rows: list[Row], further: list[Row]) -> Iterator[Row]:
    """Further rows that do not follow from rows, at states where all of these hold.

    :raises PlanError: if one follows with another value.
    """
    states = problems.candidate_states(symbols, 2)
    X, sizes = stack(state.symbol for state in states), np.array([state.size for state in states])
    first = problems.initial_values(symbols, states, [*rows, *further])
    x = np.array([first[state.name] for state in states])
    known = [row for row in rows if row.low == row.high]
    for row in further:
        if row.low < row.high:
            yield row
            continue
        columns = stack((one.expression - one.low) / one.size for one in (*known, row))
        results = [ca.densify(columns), ca.densify(symbols.scaled_jacobian(columns, X))]
        function = ca.Function("rows", [X, symbols.motion[2]], results)
        for _ in range(_PROJECTIONS):
            values, gradients = map(np.array, function(x, 0))
            x = x - sizes * (np.linalg.pinv(gradients[:-1], rcond=_DEPENDENT) @ values[:-1]).ravel()
        values, gradients = map(np.array, function(x, 0))
        if np.linalg.matrix_rank(gradients, tol=_DEPENDENT) == len(gradients):
            known.append(row)
            yield row
        elif abs(values[-1].item()) > _DEPENDENT:
            value = row.low + values[-1].item() * row.size
            raise PlanError(f"{symbols.name}: {label}: {row.label} is {value:g} there, not {row.low:g}")


# ---- conditions between phases ------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Junction:
    """Two phases with what lies between them: rates of the contacts before and after, and impulses in their units."""

    contacts: _Contacts
    before: _Phase
    after: _Phase
    rates: tuple[ca.SX, ca.SX]
    impulses: ca.SX

    @property
    def struck(self) -> list[int]:
        """Indices of the gaps that close, or bounce."""
        names, after = (c.name for c in self.before.contacts if not c.friction), self.after
        closed = self.before.gaps
        return [i for i, name in enumerate(names) if i not in closed and (i in after.gaps or name in after.named)]

    @property
    def jumping(self) -> list[int]:
        """Indices of the gaps that have an impact: those that bounce, or close without restitution."""
        symbols, e = self.contacts.symbols, self.contacts["restitution"]
        return [i for i in self.struck if i not in self.after.gaps or symbols.evaluate(e[i], 0.0).item() == 0]

    def gap_conditions(self, i: int, gap: ca.SX) -> Iterator[Row]:
        """Conditions on a gap.

        :param gap: its value before.
        """
        name, (v0, v1) = self.before.contacts[i].name, self.rates
        jumps, stays = i in self.jumping, i in self.after.gaps
        if i in self.struck:
            yield Row(name, gap)
        if jumps:
            yield Row(f"{name}_dot", v1[i] if stays else v1[i] + self.contacts["restitution"][i] * v0[i])
        elif i in self.struck:
            yield Row(f"{name}_dot", v0[i])
        is_pushed = bool(stays and self.jumping)
        if is_pushed and not jumps:
            yield Row(f"{name}_dot", v1[i])
        yield Row("", self.impulses[i], 0.0, np.inf if jumps or is_pushed else 0.0)
        if i in self.before.gaps and not stays:
            yield Row(f"{name}_force", -self.contacts.forces(self.before)[i], 0.0, np.inf)

    def friction_conditions(self, i: int) -> Iterator[Row]:
        """Conditions on dry friction, whose impulse is bounded by the sliding coefficient, as in FMUs.

        :raises PlanError: if the gap that presses it bounces.
        """
        name, v, impulses = self.before.contacts[i].name, self.rates[1], self.impulses
        earlier, later, normal = self.before.frictions.get(i), self.after.frictions.get(i), self.before.normal(i)
        if normal in self.jumping and later is None:
            gap = self.before.contacts[normal or 0].name
            raise PlanError(f"{self.contacts.symbols.name}: {gap} bounces where {name} rubs; let it close at rest")
        rubs = later is not None and normal is not None and bool(self.jumping)
        if rubs:
            most = self.contacts["slide"][i - self.contacts.first_friction(self.before)] * impulses[normal]
            if later:
                yield Row("", impulses[i] + later * most)
            else:
                yield from (Row("", most - sign * impulses[i], 0.0, np.inf) for sign in (1, -1))
        else:
            yield Row("", impulses[i])
        if later == 0 and (earlier != 0 or self.jumping):
            yield Row(name, v[i])
        elif later and not rubs and earlier is not None and earlier != later:
            if earlier:
                yield Row(name, v[i])
            stuck = self.before.sticking(i)
            forces = self.contacts.forces(stuck)
            excess = -later * forces[i] - self.contacts.bound(stuck, i, forces)
            yield Row(f"{name}_force", excess, 0.0, np.inf)


def _junction(symbols: GoalSymbols, before: _Phase, after: _Phase) -> Rows:
    """Conditions between two phases, of the states before and after, of impulses by their sizes, and of σ̈ after.

    :raises PlanError: for an impact that has no law.
    """
    states, contacts = problems.candidate_states(symbols, 2), _Contacts(symbols)
    X, U = stack(state.symbol for state in states), symbols.motion[2]
    X0, relative = ca.SX.sym("before", X.numel()), ca.SX.sym("impulses", len(before.contacts))

    def earlier(expression: ca.SX) -> ca.SX:
        """An expression of the states before."""
        return ca.substitute(expression, X, X0)

    impulses = relative * ca.DM([symbols.sizes[f"{c.name}_force"] * symbols.time for c in before.contacts])
    gaps, v = earlier(contacts["gap"]), contacts["v"]
    assert symbols.model.push is not None
    pushed = symbols.model.push(*symbols.model_arguments, impulses, ca.SX.zeros(gaps.numel()))[0]
    started = earlier(ca.vertcat(pushed[: symbols.state.numel()], *symbols.motion[:2]))
    rows = [Row(state.name, state.symbol - started[i]) for i, state in enumerate(states)]
    junction = _Junction(contacts, before, after, (earlier(v), v), relative)
    for i, c in enumerate(before.contacts):
        rows += junction.friction_conditions(i) if c.friction else junction.gap_conditions(i, gaps[i])
    function = ca.Function("junction", [X0, X, relative, U], [ca.densify(stack(row.expression for row in rows))])
    low, high = (np.array([getattr(row, name) for row in rows]) for name in ("low", "high"))
    sizes = np.array([symbols.sizes.get(row.label, 1.0) for row in rows])
    return Rows(tuple(row.label for row in rows), function, low, high, sizes)
