"""Expressions of a motion: a model with its operators, without states that no recorded output depends on.

The vectors of :class:`liaisons.mechanics.Model` become columns of SX symbols: ``t``; ``lanes``, values that
differ between the cases; ``shared``, values that all cases share; ``y``, the states that count.  All
others keep their start values and are numbers in the expressions.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, final

import casadi as ca
import numpy as np

from liaisons.algebra import closure, stack
from liaisons.base.arrays import Floats
from liaisons.contacts import Compliance
from liaisons.errors import ComponentError, suggestion
from liaisons.language import Variable
from liaisons.mechanics import Model

Expressions = dict[str, ca.SX]
"""Expressions by name."""

CArray = tuple[ca.SX, str]
"""Symbols or expressions, and the name of the array in C that has them; ``"*y"``: with D numbers an entry."""
DEGREE = 5
"""Of polynomials that drive inputs."""
LEFT = 100.0
"""Multiple of what keeps a constraint that one projection may leave, for the next one to take away."""
_GAIN, _MOST_PROJECTIONS = 0.9, 100  # as in messages.c


@final
@dataclass(frozen=True, eq=False)
class ContactColumns:
    """Expressions of the contacts of a motion, whose modes are the last shared values.

    :param names: of the unilateral liaisons, then of dry friction; ``gaps``: number of the former.
    :param normals: of each the index of the gap whose force bounds it, or -1.
    :param numbers: by which modes are chosen, without contact forces, as in ``core.h``.
    :param compliance: change of rates by contact forces, G in ``numbers``.
    :param indicators: each falls below 0 where the mode of its contact ends.
    :param pushed: y after ``impulses`` of the contacts; ``restored``: also moved along the gaps, and nothing is summed.
    """

    names: tuple[str, ...]
    normals: tuple[int, ...]
    gaps: int
    numbers: Expressions
    compliance: Compliance
    indicators: ca.SX
    pushed: ca.SX
    restored: ca.SX
    impulses: ca.SX
    shifts: ca.SX


@final
@dataclass(frozen=True, eq=False)
class RightHandSide:
    """Expressions of a motion in columns of symbols.

    :param symbols: t, lanes, shared and y, what expressions are made of.
    :param start: y at the start, of lanes and shared alone.
    :param rates: of y.
    :param projected: y put back onto constraints; y itself where there are none.
    :param outputs: what is recorded.
    :param conditions: must stay > 0.
    :param condition_texts: one a condition.
    :param prescribed: active coordinates that move, by their names.
    :param landed: y after these have jumped, of ``before``, too; None: as before.
    :param before: t and the shared values before a jump.
    :param events: instants at which the equations are not smooth; where they recur, the first ones after t.
    :param sizes: nominal values of y.
    :param reach: residuals of constraints as in the model's function, then what is prescribed for them.
    :param full_rank: time [s] within which constraints may lose rank, by the rates of coordinates.
    :param model: of which they were made.
    :param contacts: None: there are none.
    """

    symbols: tuple[ca.SX, ca.SX, ca.SX, ca.SX]
    start: ca.SX
    rates: ca.SX
    projected: ca.SX
    outputs: ca.SX
    conditions: ca.SX
    condition_texts: tuple[str, ...]
    prescribed: Expressions
    landed: ca.SX | None
    before: tuple[ca.SX, ca.SX]
    events: ca.SX
    sizes: ca.SX
    reach: ca.SX
    full_rank: ca.SX
    model: Model
    contacts: ContactColumns | None = None

    @property
    def guarded(self) -> ca.SX:
        """y put back onto constraints; no number where they are out of reach, or a step is too long for that."""
        if not self.model.reaches:
            return self.projected
        left = ca.substitute(self.reach[: len(self.model.reaches)], self.symbols[3], self.projected)
        return self.projected + ca.if_else(ca.norm_inf(left) <= LEFT, 0, np.nan)

    def c_arguments(self, *, packed: bool = True) -> list[CArray]:
        """Symbols and C arrays of t, the lanes k, the shared values s and the states y.

        :param packed: whether k and y have D numbers an entry, not one.
        """
        star = "*" * packed
        return list(zip(self.symbols, ("t", f"{star}k", "s", f"{star}y"), strict=True))

    def out_of_reach(self, begin: float, end: float, k: Floats, s: Floats, y: Floats) -> str:
        """Sentence on the first constraint that cannot be kept from a state at ``begin`` on; empty if all can.

        :param end: last instant that is looked at [s].
        """
        if not self.model.reaches:
            return ""
        function = ca.Function("reach", [*self.symbols], [self.projected, self.reach])
        count, found = len(self.model.reaches), ""

        def put_onto_constraints(t: float) -> tuple[str, Floats]:
            near, before = y, np.inf
            for _ in range(_MOST_PROJECTIONS):
                after, left = (np.asarray(x).ravel() for x in function(t, k, s, near))
                if np.max(np.abs(left[:count])) <= 1:
                    break
                total = float(np.sum(np.abs(left[:count])))
                if not total < _GAIN * before:
                    return _reach_text(self.model, left, t), near
                near, before = after, total
            return "", near

        good, bad = begin, begin
        for bad in np.linspace(begin, end, 65)[1:].tolist():
            found, near = put_onto_constraints(bad)
            if found:
                break
            good, y = bad, near
        for _ in range(40 if found else 0):
            middle = (good + bad) / 2
            text, near = put_onto_constraints(middle)
            found, good, bad, y = (text, good, middle, y) if text else (found, middle, bad, near)
        return found

    def prescribed_values(self, t: float, k: Floats, s: Floats, y: Floats) -> str:
        """What is prescribed for the constraint that is kept least in a state, with its values; empty if nothing is."""
        if not self.model.reaches:
            return ""
        left = ca.Function("reach", [*self.symbols], [self.reach])(t, k, s, y).full().ravel()
        return _prescribed(self.model, left)[1]


def checked_output_rows(model: Model, record: Iterable[str]) -> dict[str, int]:
    """Row of each output by name; a ComponentError if a name to be recorded is no output."""
    rows = {variable.name: row for row, variable in enumerate(model.outputs)}
    for name in record:
        if name not in rows:
            raise ComponentError(f"record: {model.name} has no output {name!r}{suggestion(name, rows)}")
    return rows


def right_hand_side(
    model: Model,
    moving: Mapping[str, Model],
    *,
    lanes: Iterable[str],
    shared: Iterable[str],
    record: Sequence[str],
    start_time: float = 0.0,
    driven: Sequence[str] | None = None,
) -> RightHandSide:
    """Expressions of a motion, as :meth:`liaisons_motion.right_hand_sides.ContinuousModel.right_hand_side` says.

    :param moving: active coordinate -> model of the operator that moves it.
    """
    rows = checked_output_rows(model, record)
    given = _given(model, moving, lanes=lanes, shared=shared, start_time=start_time, driven=driven)
    t, u, k, y = given.t, stack(given.inputs.values()), given.parameters, ca.SX.sym("y", len(model.states))
    at_start = [given.start_time, ca.substitute(u, t, given.start_time), k]
    start, memory = _scalar_results(model.start, *at_start)
    at_start.insert(1, start)
    memory = stack(given.symbols.get(name, x) for name, x in zip(model.memory, ca.vertsplit(memory), strict=True))
    point = (t, y, u, k, memory)
    remembered = _scalar_results(model.remember, *point)[0]  # what outputs see after a completed step
    rates = _scalar_results(model.derivatives, *point)[0]
    sizes = _scalar_results(model.nominals, *at_start)[0]
    conditions, texts = _conditions(model, given, point, at_start)
    before = ca.SX.sym("t_before"), ca.SX.sym("shared_before", given.shared.numel())
    prescribed = {*moving, *(driven or ())}
    whole = RightHandSide(
        symbols=(t, given.lanes, given.shared, y),
        start=start,
        rates=rates,
        projected=y if model.project is None else _scalar_results(model.project, t, y, u, k)[0],
        outputs=_scalar_results(model.outputs_function, t, y, u, k, remembered)[0][[rows[name] for name in record]],
        conditions=conditions,
        condition_texts=texts,
        prescribed={a.value: given.inputs[a.value] for a in model.active if a.value in prescribed},
        landed=None if driven is None else _landed(model, given, point, before),
        before=before,
        events=stack([_event_instants(model, k, t), *(_event_instants(op, p, t) for op, p in given.operators)]),
        sizes=sizes,
        reach=ca.SX(0, 1) if model.reach is None else _scalar_results(model.reach, t, y, u, k)[0],
        full_rank=_time_of_full_rank(model, (t, y, u, k), rates, sizes),
        model=model,
    )
    reduced = _reduced_to_needed_states(_with_contacts(whole, model, point, given.sums) if model.contacts else whole)
    if reduced is None:
        raise ComponentError(f"record: nothing of {record} depends on a state of {model.name}; record one")
    return reduced


@final
@dataclass(frozen=True, eq=False)
class _Given:
    """What a motion is a function of, and what this makes of the inputs and parameters of its model.

    :param symbols: of the values that are given, by name.
    :param sums: to which impacts add.
    :param inputs: of the model as functions of t, lanes and shared values, by name.
    :param operators: that move the model, each with its parameters.
    """

    t: ca.SX
    start_time: ca.SX
    symbols: Expressions
    lanes: ca.SX
    shared: ca.SX
    sums: ca.SX
    inputs: Expressions
    parameters: ca.SX
    operators: Sequence[tuple[Model, ca.SX]]


def _given(
    model: Model,
    moving: Mapping[str, Model],
    *,
    lanes: Iterable[str],
    shared: Iterable[str],
    start_time: float,
    driven: Sequence[str] | None,
) -> _Given:
    """Symbols of a motion, and inputs that are polynomials of time or follow operators."""
    symbols: Expressions = {}

    def new(title: str, names: Iterable[str]) -> ca.SX:
        """Column of new symbols, registered by their names."""
        listed = list(names)
        column = ca.SX.sym(title, len(listed))
        symbols.update((name, column[i]) for i, name in enumerate(listed))
        return column

    def values(variables: Iterable[Variable], prefix: str = "") -> Expressions:
        """Symbols of variables by name, or their declared numbers where they have no symbols."""
        return {v.name: symbols.get(f"{prefix}{v.name}", ca.SX(v.starts[0])) for v in variables}

    t, each, once, instant = ca.SX.sym("t"), new("lanes", lanes), new("shared", shared), ca.SX(start_time)
    inputs = values(model.inputs)
    if driven is not None:
        extra = ca.SX.sym("extra", 2 + (DEGREE + 1) * len(driven))
        once, instant = ca.vertcat(once, extra), extra[0]
        inputs |= _polynomial_inputs(model, driven, extra[1:], t)
    once, sums = ca.vertcat(once, new("modes", _contact_memory_names(model))), new("sums", _impulse_sum_names(model))
    operators = list[tuple[Model, ca.SX]]()
    for triple in model.active:
        if triple.value in moving:
            operator = moving[triple.value]
            parameters = stack(values(operator.parameters, f"{triple.value}.").values())
            operators.append((operator, parameters))
            z = _scalar_results(operator.outputs_function, t, [], [], parameters, [])[0]
            inputs |= {triple.value: z[0], triple.rate: z[1], triple.acceleration: z[2]}
    parameters = stack(values(model.parameters).values())
    return _Given(t, instant, symbols, each, once, sums, inputs, parameters, operators)


def _conditions(
    model: Model, given: _Given, point: Sequence[ca.SX], at_start: Sequence[ca.SX]
) -> tuple[ca.SX, tuple[str, ...]]:
    """Conditions that must stay > 0: of the model, there or at the start, and domains of inputs that move; their texts.

    :param point: t, y, u, k and memory; ``at_start``: the first four there.
    """
    lasting = len(model.condition_texts) - model.start_only
    conditions, begun = (_scalar_results(model.conditions, *x, point[4])[0] for x in (point[:4], at_start))
    moving = [v for v in model.inputs if v.name not in given.symbols and not given.inputs[v.name].is_constant()]
    domains = [(v, gap) for v in moving for gap in domain_gaps(v, given.inputs[v.name])]
    texts = (*model.condition_texts, *(f"{v.name} must stay {v.domain()}" for v, _ in domains))
    return ca.vertcat(conditions[:lasting, :], begun[lasting:, :], *(gap for _, gap in domains)), texts


def _landed(model: Model, given: _Given, point: Sequence[ca.SX], before: tuple[ca.SX, ca.SX]) -> ca.SX:
    """State after a jump of inputs.

    :param point: t, y, u, k and memory after it; ``before``: t and the shared values there.
    """
    t, y, u, k, memory = point
    u_before = ca.substitute(u, ca.vertcat(t, given.shared), ca.vertcat(*before))
    booked = _scalar_results(model.remember, t, y, u_before, k, memory)[0]
    return _scalar_results(model.jump, t, y, u, k, booked)[0]


def _reduced_to_needed_states(whole: RightHandSide) -> RightHandSide | None:
    """Equations of only the states on which outputs, conditions and contacts depend; None if they need no state."""
    y, contacts, landed = whole.symbols[3], whole.contacts, whole.landed
    maps = [x for x in (whole.rates, whole.projected, landed) if x is not None]
    watched = [whole.outputs, whole.conditions, whole.reach, whole.full_rank]
    if contacts:
        maps += [contacts.pushed, contacts.restored]
        watched += [contacts.indicators, *contacts.numbers.values()]
    needed = _needed_states(ca.vertcat(*watched), y, maps)
    if not needed:
        return None
    return replace(
        whole,
        symbols=(*whole.symbols[:3], y[needed]),
        start=whole.start[needed],
        rates=whole.rates[needed],
        projected=whole.projected[needed],
        landed=None if landed is None or ca.is_equal(landed[needed], y[needed], 1) else landed[needed],
        sizes=whole.sizes[needed],
        contacts=contacts and replace(contacts, pushed=contacts.pushed[needed], restored=contacts.restored[needed]),
    )


def _prescribed(model: Model, left: Floats) -> tuple[str, str]:
    """Text of the constraint of which most is left, and what is prescribed for it."""
    reaches = model.reaches
    worst = int(np.argmax(np.abs(left[: len(reaches)])))
    first, reach = len(reaches) + sum(len(r.prescribed) for r in reaches[:worst]), reaches[worst]
    pairs = zip(reach.prescribed, left[first:], strict=False)
    return reach.text, ", ".join(f"{name} = {value:.9g}" for name, value in pairs)


def _reach_text(model: Model, left: Floats, t: float) -> str:
    """Sentence on the constraint of which most is left; of the residuals, and what is prescribed for each."""
    text, values = _prescribed(model, left)
    if not values:
        return f"{text} cannot be kept at t = {t:.9g}: no motion leads on from there"
    return f"{text} cannot be kept: {values} at t = {t:.9g} is out of reach; stay within it"


def _contact_memory_names(model: Model) -> list[str]:
    """Names of the contacts' memory, which changes at events only: modes, counts of impacts, starts of rests."""
    gaps = [c for c in model.contacts if not c.friction]
    modes = [c.variable("direction" if c.friction else "closed") for c in model.contacts]
    return modes + [c.variable(ending) for ending in ("impacts", "rests_from") for c in gaps]


def _impact_loss_name(contact: str) -> str:
    """Name of the output of the energy that impacts of a contact dissipate."""
    part, dot, _ = contact.rpartition(".")
    return f"{part}{dot}impact_loss"


def _impulse_sum_names(model: Model) -> list[str]:
    """Names of the sums to which impacts add: impulses of contacts and of operators, and dissipated energies."""
    impulses = [c.variable("impulse") for c in model.contacts if not c.friction]
    operators = [f"{name}_impulse" for name in model.impulsive_operators]
    return [*impulses, *operators, *dict.fromkeys(_impact_loss_name(contact.name) for contact in model.contacts)]


def _with_contacts(whole: RightHandSide, model: Model, point: Sequence[ca.SX], sums: ca.SX) -> RightHandSide:
    """Equations with contacts, and with the sums of impacts as further states behind the others.

    :param point: t, y, u, k and memory.
    """
    assert model.contact is not None
    assert model.push is not None
    assert model.indicate is not None
    contacts, gaps, y = model.contacts, sum(not c.friction for c in model.contacts), point[1]
    names = tuple(contact.name for contact in contacts)
    numbers = dict(zip(model.contact.name_out(), _scalar_results(model.contact, *point), strict=True))
    impulses, shifts, unmoved = ca.SX.sym("impulses", len(contacts)), ca.SX.sym("shifts", gaps), ca.SX.zeros(gaps)
    once, _ = _scalar_results(model.push, *point, impulses, unmoved)
    twice, operators = _scalar_results(model.push, point[0], once, *point[2:], impulses, unmoved)
    compliance = Compliance.of_numbers(numbers)
    numbers = {name: column for name, column in numbers.items() if name not in compliance.numbers()}
    numbers["G"] = ca.vec(compliance.matrix)
    change = compliance.U @ (compliance.V @ impulses)
    lost = -impulses * (numbers["v"] + change / 2)  # at the mean of the rates before and after
    losses = list(map(_impact_loss_name, names))
    of_parts = [sum(lost[i] for i, name in enumerate(losses) if name == part) for part in dict.fromkeys(losses)]
    columns = ContactColumns(
        names,
        tuple(names.index(contact.normal) if contact.normal else -1 for contact in contacts),
        gaps,
        numbers,
        compliance,
        indicators=_scalar_results(model.indicate, *point)[0],
        pushed=ca.vertcat((y + twice) / 2, sums + ca.vertcat(impulses[:gaps, :], operators, *of_parts)),
        restored=ca.vertcat(_scalar_results(model.push, *point, impulses, shifts)[0], sums),
        impulses=impulses,
        shifts=shifts,
    )
    still = ca.SX.zeros(sums.numel())
    return replace(
        whole,
        symbols=(*whole.symbols[:3], ca.vertcat(y, sums)),
        start=ca.vertcat(whole.start, still),
        rates=ca.vertcat(whole.rates, still),
        projected=ca.vertcat(whole.projected, sums),
        landed=None if whole.landed is None else ca.vertcat(whole.landed, sums),
        sizes=ca.vertcat(whole.sizes, still + 1),
        contacts=columns,
    )


def _polynomial_inputs(model: Model, driven: Sequence[str], numbers: ca.SX, t: ca.SX) -> Expressions:
    """Inputs as polynomials of time by name, with the rate and acceleration of an active coordinate.

    :param numbers: origin of the time, then the coefficients of each input.
    """
    triples, values = {a.value: (a.value, a.rate, a.acceleration) for a in model.active}, {}
    for i, name in enumerate(driven):
        coefficients = numbers[1 + i * (DEGREE + 1) : 1 + (i + 1) * (DEGREE + 1)]
        value = ca.polyval(coefficients[::-1], t - numbers[0])
        for input_name in triples.get(name, (name,)):
            values[input_name], value = value, ca.jacobian(value, t)
    return values


def _time_of_full_rank(model: Model, point: Sequence[ca.SX], rates: ca.SX, sizes: ca.SX) -> ca.SX:
    """Time within which constraints may lose rank: their gradients change by 1 where coordinates do by their sizes."""
    if model.margin is None:
        return ca.SX(np.inf)
    moving = [i for i, state in enumerate(model.states) if state.name in model.configuration]
    return ca.sqrt(_scalar_results(model.margin, *point)[0]) / ca.norm_inf(rates[moving] / sizes[moving])


def _event_instants(model: Model, k: ca.SX, t: ca.SX) -> ca.SX:
    """Instants at which the equations of a model are not smooth; a column."""
    return _scalar_results(model.events, *(k, t)[: model.events.n_in()])[0]


def domain_gaps(variable: Variable, value: Any) -> list[Any]:
    """Expressions or numbers that are > 0 while a variable is in its domain."""
    gaps = [value - variable.minimum] if variable.minimum is not None else []
    gaps += [variable.maximum - value] if variable.maximum is not None else []
    return [gap if variable.strict else gap >= 0 for gap in gaps]


def _scalar_results(function: ca.Function, *arguments: Any) -> list[ca.SX]:
    """Results of a function as expressions of scalar operations, also where its own graph is of matrices."""
    columns = [ca.SX(0, 1) if isinstance(argument, list) else argument for argument in arguments[: function.n_in()]]
    try:
        return [ca.densify(result) for result in function.call(columns, True, False)]
    except RuntimeError as error:
        reason = str(error).strip().splitlines()[-1]
        raise ComponentError(f"{function.name()} cannot be written in scalar operations: {reason}") from None


def _needed_states(expressions: ca.SX, y: ca.SX, maps: Iterable[ca.SX]) -> list[int]:
    """Indices of the states on which expressions depend, directly or through rates and other maps of the state."""
    first, *uses = (np.array(ca.DM(ca.jacobian_sparsity(x, y), 1)) != 0 for x in (expressions, *maps))
    return closure(np.any(uses, axis=0), first.any(axis=0))
