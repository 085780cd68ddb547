"""Unilateral liaisons and dry friction: from the motion under given contact forces to the motion in modes.

The force x_i of a contact acts along the gradient of a unilateral liaison, or along the relative velocity of dry
friction.  Rates v of the contacts obey, with a⁰ at x = 0 and the compliance G = C A⁻¹ Cᵀ,

    v̇ = a⁰ + G x

The modes, which an FMU chooses at events, say for each contact what determines x::

    open            x = 0                            closed, sticks     v̇ = 0
    slides          x = -direction T                 T: threshold, or μ times the force of a unilateral liaison

An impact is the limit of a force that acts ever shorter: states jump by (∂ẏ/∂x) Λ, because ẏ is linear in x.

Where rows of G depend on others (a table on four legs) x is what equal springs at the contacts would share: x in the
range of G, which is the least norm where nothing slides.
Source: docs/explanation/unilateral.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, final

import casadi as ca
import numpy as np

from liaisons.algebra import at_zero, jacobian, stack
from liaisons.base.array_names import array_and_index
from liaisons.base.contact_limits import MOST_CONTACTS
from liaisons.contacts.forces import Compliance
from liaisons.errors import ComponentError
from liaisons.language import Layout, MechanicalComponent, Mechanism, Orientation, element
from liaisons.mechanics import STABILISATION, Contact, impulsive_operators, model_functions

OPEN_MARGIN = 1e-13
"""Part of its scale by which a distance or a rate is beyond 0 when its event indicator crosses 0."""
FORCE_MARGIN = 1e-12
"""The same for a force."""

SAME = 1e-10
"""Largest contradiction between the accelerations of redundant contacts, relative to their scale."""

_SAMPLES = 5
"""Number of configurations in which redundant contacts are looked for."""

LEAVING = 1e-3
"""Factor of the rate of a growing gap in its indicator, so that errors right after an impact are not an event."""

MOST_LINKS = 300
"""Largest number of links of a chain in a model with contacts: its equations have no loops."""


def contacts_of(m: MechanicalComponent) -> tuple[Contact, ...]:
    """Contacts of a component, unilateral liaisons before dry friction; in a chain one a link, or of the last alone.

    :raises ComponentError: for more than ``MOST_CONTACTS``, or than :data:`MOST_LINKS` of a chain with contacts.
    """
    name, links, contacts = type(m).__name__, m.sizes["n"] if m.dimension else 0, list[Contact]()
    for item in m.contact_formulas:
        contact = Contact(item.name, item.is_friction, getattr(item, "normal", None) or "")
        numbers = range(1, links + 1)
        each = [contact.renamed(partial(element, index=i)) for i in numbers if not item.last]
        contacts += each or [contact]
    refuse_many(name, contacts, links)
    return tuple(contacts)


def refuse_many(name: str, contacts: Sequence[Contact], links: int) -> None:
    """Raise a ComponentError for more than ``MOST_CONTACTS``, or than :data:`MOST_LINKS` of a chain beside them."""
    if len(contacts) > MOST_CONTACTS:
        names = ", ".join(dict.fromkeys(array_and_index(contact.name)[0] for contact in contacts))
        raise ComponentError(
            f"{name}: {names} are {len(contacts)} contacts; an FMU takes {MOST_CONTACTS} at most: take a smaller size"
        )
    if contacts and links > MOST_LINKS:
        raise ComponentError(
            f"{name}: a chain of n = {links} links with contacts is written out link by link; take n <= {MOST_LINKS}"
        )


def contact_numbers(m: Mechanism) -> dict[str, ca.SX]:
    """Columns of ``CONTACT_NUMBERS`` of a mechanism, by name.

    A scale is the sum of the absolute terms of a number, with which its rounding errors are compared.
    """
    free, active = m.free, m.active
    gaps = stack(ca.SX(getattr(m, item.name)) for item in m.unilaterals)
    rates = m.contact_rates()
    accelerations = m.dot(rates)
    along, across = jacobian(rates, free.q_dot), jacobian(rates, active.s_dot)
    rest = accelerations - along @ free.q_ddot - across @ active.s_ddot
    forced = _term_sizes(along, free.q_ddot) + _term_sizes(across, active.s_ddot) + ca.fabs(rest)
    nominal = ca.fabs(along) @ free.rate_sizes
    moved = free.sizes + ca.fabs(free.q)
    prescribed = _term_sizes(ca.jacobian(gaps, active.s), active.s)
    return {
        "v": rates,
        "a": accelerations,
        "rate_scale": _term_sizes(along, free.q_dot) + nominal + _term_sizes(across, active.s_dot),
        "acceleration_scale": forced + 1e-3 * nominal,
        "gap": gaps,
        "scale": ca.fabs(ca.jacobian(gaps, free.q)) @ moved + prescribed,
        **contact_thresholds(m),
    }


def _term_sizes(matrix: ca.SX, column: ca.SX) -> ca.SX:
    """Sums of the absolute values of the terms of matrix @ column."""
    return ca.fabs(matrix) @ ca.fabs(column)


def contact_thresholds(m: MechanicalComponent) -> dict[str, ca.SX]:
    """Columns of the restitutions, and of what bounds dry friction, by their names in ``CONTACT_NUMBERS``."""
    return {
        "restitution": stack(m.contact_coefficient(item.restitution or "") for item in m.unilaterals),
        "stick": stack(m.contact_coefficient(item.static) for item in m.dry_frictions),
        "slide": stack(m.contact_coefficient(item.sliding) for item in m.dry_frictions),
    }


def functions_in_modes(**fields: Any) -> dict[str, Any]:
    """Functions of a model whose contacts are in modes, from the fields of :class:`ContactModes`."""
    return ContactModes(**fields).functions()


@final
@dataclass(frozen=True, eq=False)
class ContactModes:
    """Functions of a model whose contacts are in the modes that its memory holds.

    :param contacts: unilateral liaisons, then dry friction.
    :param vectors: t, y, u, k, m and the contact forces x, by letter.
    :param forced: results of the functions under given contact forces, see ``model_functions``.
    :param numbers: see :func:`contact_numbers`.
    :param layout: without arrays.
    :param memory: names of its numbers.
    :param condition_texts: one for each row of the result ``conditions``.
    """

    contacts: tuple[Contact, ...]
    vectors: Mapping[str, Any]
    forced: Mapping[str, Any]
    numbers: Mapping[str, ca.SX]
    layout: Layout
    memory: tuple[str, ...]
    condition_texts: tuple[str, ...]

    def functions(self) -> dict[str, Any]:
        """Functions of the model, and what belongs to them: arguments of :class:`liaisons.mechanics.model.Model`."""
        vectors, forced = self.vectors, self.forced
        painleve, (_, indicators) = self._painleve_conditions(), self._forces_and_indicators
        texts = (*painleve, *self.condition_texts)
        loaded = {
            name: self._with_contact_forces(value)
            for name, value in forced.items()
            if name != "start" and value is not None
        }
        impulses, shifts = ca.SX.sym("impulses", len(self.contacts)), ca.SX.sym("shifts", len(self._gaps))
        vectors = {**vectors, "Λ": impulses, "ν": shifts}
        motion = {name: forced[name] for name in ("derivatives", "outputs_function")}
        results = loaded | {
            "start": tuple(map(self._without_contact_forces, forced["start"])),
            "outputs_function": self._with_contact_forces(stack((self._outputs | self._outputs_by_modes()).values())),
            "conditions": self._with_contact_forces(ca.vertcat(*painleve.values(), forced["conditions"])),
            "contact": self._rows,
            "indicate": self._with_contact_forces(indicators),
            "push": self._state_and_operator_impulses(impulses, shifts),
            "forced_motion": motion | dict(self.numbers),
        }
        functions = model_functions(vectors, results)
        return {**functions, "condition_texts": texts, "memory": self.memory, "contacts": self.contacts}

    @property
    def _gaps(self) -> list[Contact]:
        """The unilateral liaisons."""
        return [contact for contact in self.contacts if not contact.friction]

    @property
    def _frictions(self) -> tuple[Contact, ...]:
        """The dry frictions."""
        return self.contacts[len(self._gaps) :]

    @property
    def _outputs(self) -> dict[str, ca.SX]:
        """Outputs under given contact forces, by name."""
        return dict(
            zip((v.name for v in self.layout.outputs), ca.vertsplit(self.forced["outputs_function"]), strict=True)
        )

    @cached_property
    def _rows(self) -> dict[str, ca.SX]:
        """Results of the function ``contact``, by name: numbers without contact forces, and the compliance."""
        rows = {"v": self.numbers["v"], "a": self.numbers["a"], **self._compliance.numbers()} | dict(self.numbers)
        return {name: self._without_contact_forces(column) for name, column in rows.items()}

    def _painleve_conditions(self) -> dict[str, ca.SX]:
        """Expressions that stay > 0, by message, while each normal force pushes apart under sliding friction, too."""
        conditions, G = {}, self._compliance.matrix
        for i, c in enumerate(self._frictions):
            if c.normal:
                n, row = self._gap_index(c), len(self._gaps) + i
                coefficient = self._memory_of(c, "direction") * self.numbers["slide"][i]
                text = f"{c.normal} must have one force while {c.name} slides (Painlevé)"
                conditions[text] = 1 - coefficient * G[n, row] / G[n, n]
        return conditions

    @cached_property
    def _compliance(self) -> Compliance:
        """Delassus matrix; in two factors if contacts are redundant near the start or near closed gaps."""
        t, y, u, k, x = (self.vectors[letter] for letter in "tyukx")
        regular = Compliance.from_matrix(jacobian(self.numbers["a"], x))
        if len(self.contacts) < 2:
            return regular
        U, V = jacobian(self.numbers["v"], y), jacobian(self.forced["derivatives"], x)
        moved = sorted({*V.sparsity().row()} & {*U.sparsity().get_col()})
        factors = Compliance(U[:, moved], V[moved, :], is_redundant=True)
        gap = self._without_contact_forces(self.numbers["gap"])
        starts = ca.Function("starts", [t, u, k], [self._without_contact_forces(self.forced["start"][0])])
        results = [self._without_contact_forces(factors.matrix), gap, ca.jacobian(gap, y)]
        point = ca.Function("point", [t, y, u, k], results)
        values = [
            np.array([v.start for v in group], dtype=float) for group in (self.layout.inputs, self.layout.parameters)
        ]
        first, random = starts(0, *values).full().ravel(), np.random.default_rng(0)
        for _ in range(_SAMPLES):
            near = first + 0.1 * random.normal(size=first.shape)
            for _ in range(_SAMPLES):
                G, off, slope = (x.full() for x in point(0, near, *values))
                if not np.isfinite(near).all() or not all(np.isfinite(x).all() for x in (G, off, slope)):
                    break
                if _has_dependent_rows(G):
                    return factors
                near -= np.linalg.lstsq(slope, off, rcond=None)[0].ravel()
        return regular

    def _with_contact_forces(self, expression: ca.SX) -> ca.SX:
        """Expression with the contact forces of the modes in place of symbols."""
        return ca.substitute(expression, self.vectors["x"], self._forces_and_indicators[0])

    def _without_contact_forces(self, expression: ca.SX) -> ca.SX:
        """Expression with 0 in place of the contact forces."""
        return at_zero(expression, self.vectors["x"])

    def _gap_index(self, friction: Contact) -> int:
        """Index of the gap whose normal force bounds a dry friction."""
        return self._gaps.index(Contact(friction.normal))

    def _memory_of(self, contact: Contact, ending: str) -> ca.SX:
        """Symbol of a number in the memory that belongs to a contact, by the ending of its name."""
        return self.vectors["m"][self.memory.index(contact.variable(ending))]

    def _is_closed(self, gap: Contact) -> ca.SX:
        """1 for a closed gap, 0 for an open one, whose number in the memory may be < 0: an overlap that is allowed."""
        return ca.fmax(self._memory_of(gap, "closed"), 0)

    def _can_press(self, friction: Contact) -> ca.SX:
        """1 if the gap whose force bounds a dry friction is closed, or if none bounds it; else 0."""
        return self._is_closed(Contact(friction.normal)) if friction.normal else ca.SX(1)

    @cached_property
    def _forces_and_indicators(self) -> tuple[ca.SX, ca.SX]:
        """Contact forces in the modes of the memory, and the event indicators.

        In the rows that are held (closed, sticks) v̇ = -2α v - α² g, α = STABILISATION, as for constraints.
        """
        numbers, alpha, first = self.numbers, STABILISATION, len(self._gaps)
        held, drag, normals = [self._is_closed(c) for c in self._gaps], [ca.SX(0)] * first, [-1] * first
        for i, c in enumerate(self._frictions):
            direction, touching = self._memory_of(c, "direction"), self._can_press(c)
            held.append((1 - direction**2) * touching)
            drag.append(-direction * numbers["slide"][i] * touching)
            normals.append(self._gap_index(c) if c.normal else -1)
        flags, gap = stack(held), ca.vertcat(numbers["gap"], ca.SX.zeros(len(self._frictions), 1))
        target = -2 * alpha * numbers["v"] - alpha**2 * gap
        forces, contradictions = self._compliance.forces(self._rows["a"], flags, stack(drag), normals, target)
        return forces, self._event_indicators(flags, forces, contradictions)

    def _event_indicators(self, flags: ca.SX, forces: ca.SX, contradictions: ca.SX) -> ca.SX:
        """Event indicators: each falls below 0 where the mode of its contact ends.

        :param contradictions: accelerations of redundant contacts that the others do not allow.
        """
        numbers, first = self.numbers, len(self._gaps)
        compliance, v = ca.diag(self._compliance.matrix) / self._rows["acceleration_scale"], numbers["v"]
        rows = []
        for i, c in enumerate(self._gaps):
            leaving = LEAVING * ca.fmax(v[i], 0) / numbers["rate_scale"][i]
            margin = ca.fmax(-self._memory_of(c, "closed"), 0) + OPEN_MARGIN
            distance = numbers["gap"][i] / numbers["scale"][i] + leaving + margin
            rows.append(flags[i] * (forces[i] * compliance[i] + FORCE_MARGIN) + (1 - flags[i]) * distance)
        for k, c in enumerate(self._frictions):
            i, direction, bound = first + k, self._memory_of(c, "direction"), numbers["stick"][k]
            touching = self._can_press(c)
            if c.normal:
                bound *= forces[self._gap_index(c)]
            sticks = (bound - ca.fabs(forces[i])) * compliance[i] + FORCE_MARGIN
            slides = direction * v[i] / numbers["rate_scale"][i] + FORCE_MARGIN
            own = flags[i] * sticks + direction**2 * slides
            rows.append(touching * own + 1 - touching)
        for i in contradictions.sparsity().row():
            same = 1 - ca.fabs(contradictions[i]) / (SAME * self._rows["acceleration_scale"][i])
            rows[i] = ca.fmin(rows[i], same)
        return stack(rows)

    def _outputs_by_modes(self) -> dict[str, ca.SX]:
        """Outputs that depend on modes, by name."""
        forces, indicators = self._forces_and_indicators
        outputs = {c.variable("indicator"): indicators[i] for i, c in enumerate(self.contacts)}
        for i, c in enumerate(self._gaps):
            ended = self.vectors["t"] >= self._memory_of(c, "rests_from")
            outputs[c.variable("closed")] = self._is_closed(c) * ended
            outputs[c.variable("force")] = ca.fmax(forces[i], 0)
        for c in self._frictions:
            outputs[c.variable("sticks")] = (1 - self._memory_of(c, "direction") ** 2) * self._can_press(c)
        return outputs

    def _state_and_operator_impulses(self, impulses: ca.SX, shifts: ca.SX) -> tuple[ca.SX, ca.SX]:
        """State after impulses of contacts and shifts along gaps, and the impulses of operators (a,)."""
        y, x, rates = self.vectors["y"], self.vectors["x"], self.forced["derivatives"]
        names, outputs = [state.name for state in self.layout.states], self._outputs
        slopes, own = ca.jacobian(rates, x), [name.rpartition(".")[2] for name in names]
        change = ca.DM([float(name != "dissipated") for name in own]) * (slopes @ impulses)
        momenta = ca.DM([float(name not in ("work", "dissipated")) for name in own])
        towards = momenta * (slopes[:, : len(self._gaps)] @ shifts)
        moved = ca.DM([float(_is_position(name, names)) for name in names]) * ca.jtimes(rates, y, towards)
        forces = (outputs[f"{name}_force"] for name in impulsive_operators(self.contacts, self.memory))
        operators = stack(ca.jtimes(force, x, impulses) for force in forces)
        return self._without_contact_forces(y + change + moved), self._without_contact_forces(operators)


def _is_position(name: str, names: Sequence[str]) -> bool:
    """Whether a state is a coordinate, with a momentum among the states, or of a quaternion."""
    part, dot, own = name.rpartition(".")
    return f"{part}{dot}p_{own}" in names or own.endswith(Orientation.quaternion)


def _has_dependent_rows(G: np.ndarray) -> bool:
    """Whether some row of a symmetric positive semidefinite matrix depends on those before it."""
    rest = G.copy()
    for i, pivot in enumerate(np.diag(G)):
        if abs(rest[i, i]) <= 1e-9 * abs(pivot):
            return True
        rest -= np.outer(rest[:, i], rest[i]) / rest[i, i]
    return False
