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
from typing import Any

import casadi as ca
import numpy as np

from liaisons.base.array_names import array_and_index
from liaisons.errors import ComponentError
from liaisons.expressions.algebra import stack
from liaisons.language.declarations import Orientation
from liaisons.language.layout import Layout
from liaisons.language.mechanism import Mechanism
from liaisons.mechanics.constraints import STABILISATION
from liaisons.mechanics.contact_forces import Compliance
from liaisons.mechanics.functions import model_functions
from liaisons.mechanics.model import Contact, Model

OPEN_MARGIN, FORCE_MARGIN = 1e-13, 1e-12
"""Parts of its scale by which an event indicator is below the number that it watches when it crosses 0."""

SAME = 1e-10
"""Part of its scale by which the acceleration of a redundant contact may contradict those of others."""

MOST_CONTACTS, _SAMPLES = 64, 5
"""Of one model, as in complementarity.h; configurations in which it is looked for contacts that depend on others."""

LEAVING = 1e-3
"""Part of the rate of a gap that grows in its indicator: an importer's error right after an impact is no event."""

MOST_LINKS = 300
"""Links of a chain that has contacts, or is beside some, at most: its equations have no loops."""

CONTACT_NUMBERS: Mapping[str, tuple[bool, ...]] = {
    **dict.fromkeys(("v", "a", "rate_scale", "acceleration_scale"), (False, True)),
    **dict.fromkeys(("gap", "scale", "restitution"), (False,)),
    **dict.fromkeys(("stick", "slide"), (True,)),
}
"""Numbers by which modes are chosen, as in core.h, and the values of ``friction`` of the contacts that they are of."""


def contacts_of(m: Mechanism) -> tuple[Contact, ...]:
    """The contacts of a mechanism: unilateral liaisons, then dry friction.

    :raises ComponentError: for more than :data:`MOST_CONTACTS`.
    """
    contacts = (
        *(Contact(item.name) for item in m.unilaterals),
        *(Contact(item.name, friction=True, normal=item.normal or "") for item in m.dry_frictions),
    )
    refuse_many(type(m).__name__, contacts)
    return contacts


def refuse_many(name: str, contacts: Sequence[Contact]) -> None:
    """Raise a ComponentError for more than :data:`MOST_CONTACTS` of a component."""
    if len(contacts) > MOST_CONTACTS:
        names = ", ".join(dict.fromkeys(array_and_index(contact.name)[0] for contact in contacts))
        raise ComponentError(
            f"{name}: {names} are {len(contacts)} contacts; an FMU takes {MOST_CONTACTS} at most: take a smaller size"
        )


def refuse_long(name: str, links: int) -> None:
    """Raise a ComponentError for more than :data:`MOST_LINKS` of a chain with contacts, or beside them."""
    if links > MOST_LINKS:
        raise ComponentError(
            f"{name}: a chain of n = {links} links with contacts is written out link by link; take n <= {MOST_LINKS}"
        )


def contact_numbers(m: Mechanism) -> dict[str, ca.SX]:
    """Columns of :data:`CONTACT_NUMBERS` of a mechanism, by name.

    A scale is the sum of the terms of a number, from which rounding errors are told.
    """
    free, active = m.free, m.active
    gaps = stack(ca.SX(getattr(m, item.name)) for item in m.unilaterals)
    rates = m.contact_rates()
    accelerations = m.dot(rates)
    along, across = ca.jacobian(rates, free.q_dot), ca.jacobian(rates, active.s_dot)
    rest = accelerations - along @ free.q_ddot - across @ active.s_ddot
    forced = ca.fabs(along) @ ca.fabs(free.q_ddot) + ca.fabs(across) @ ca.fabs(active.s_ddot) + ca.fabs(rest)
    nominal = ca.fabs(along) @ free.rate_sizes
    moved = free.sizes + ca.fabs(free.q)
    prescribed = ca.fabs(ca.jacobian(gaps, active.s)) @ ca.fabs(active.s)
    return {
        "v": rates,
        "a": accelerations,
        "rate_scale": ca.fabs(along) @ ca.fabs(free.q_dot) + nominal + ca.fabs(across) @ ca.fabs(active.s_dot),
        "acceleration_scale": forced + 1e-3 * nominal,
        "gap": gaps,
        "scale": ca.fabs(ca.jacobian(gaps, free.q)) @ moved + prescribed,
        "restitution": stack(m.threshold(item.restitution or "") for item in m.unilaterals),
        "stick": stack(m.threshold(item.static) for item in m.dry_frictions),
        "slide": stack(m.threshold(item.sliding) for item in m.dry_frictions),
    }


def impulsive_operators(model: Model | ContactModes) -> list[str]:
    """Names of the active coordinates whose impulses are summed in the memory."""
    gaps = {c.variable("impulse") for c in model.contacts}
    return [name.removesuffix("_impulse") for name in model.memory if name.endswith("_impulse") and name not in gaps]


class ContactModes:
    """Functions of a model whose contacts are in the modes that its memory holds.

    :param contacts: unilateral liaisons, then dry friction.
    :param vectors: t, y, u, k, m and the contact forces x, by letter.
    :param results: of the functions under given contact forces, see :func:`model_functions`.
    :param numbers: see :func:`contact_numbers`.
    :param layout: without arrays.
    """

    def __init__(
        self,
        contacts: tuple[Contact, ...],
        vectors: Mapping[str, ca.SX],
        results: Mapping[str, Any],
        numbers: Mapping[str, ca.SX],
        layout: Layout,
        *,
        memory: Sequence[str],
    ) -> None:
        self.contacts, self._vectors, self._forced, self._numbers = contacts, vectors, results, numbers
        self._states, self.memory = [state.name for state in layout.states], memory
        outputs = (v.name for v in layout.outputs)
        self._outputs = dict(zip(outputs, ca.vertsplit(results["outputs_function"]), strict=True))
        self._gaps, self._frictions = ([c for c in contacts if c.friction is friction] for friction in (False, True))
        self._compliance = self._compliance_of(layout)
        rows = {"v": numbers["v"], "a": numbers["a"], **self._compliance.numbers()} | dict(numbers)
        self._rows = {name: self._without_contact_forces(column) for name, column in rows.items()}
        self._forces, self._indicators = self._forces_and_indicators()

    def functions(self, conditions: ca.SX) -> dict[str, Any]:
        """All functions of the model."""
        forced, outputs = self._forced, self._outputs | self._outputs_by_modes()
        loaded = {
            name: self._with_contact_forces(value)
            for name, value in forced.items()
            if name != "start" and value is not None
        }
        impulses, shifts = ca.SX.sym("impulses", len(self.contacts)), ca.SX.sym("shifts", len(self._gaps))
        results = loaded | {
            "start": tuple(map(self._without_contact_forces, forced["start"])),
            "outputs_function": self._with_contact_forces(stack(outputs.values())),
            "conditions": self._with_contact_forces(conditions),
            "contact": self._rows,
            "indicate": self._with_contact_forces(self._indicators),
            "push": self._after_impulses(impulses, shifts),
            "forced_motion": {name: forced[name] for name in ("derivatives", "outputs_function")} | dict(self._numbers),
        }
        return model_functions({**self._vectors, "Λ": impulses, "ν": shifts}, results)

    def painleve_conditions(self) -> dict[str, ca.SX]:
        """Expressions that stay > 0, by message, if each pressing force pushes apart, also while sliding."""
        conditions = {}
        for i, c in enumerate(self._frictions):
            if c.normal:
                n, row = self._gap_index(c), len(self._gaps) + i
                coefficient = self._memory_of(c, "direction") * self._numbers["slide"][i]
                text = f"{c.normal} must have one force while {c.name} slides (Painlevé)"
                G = self._compliance.element
                conditions[text] = 1 - coefficient * G(n, row) / G(n, n)
        return conditions

    def _compliance_of(self, layout: Layout) -> Compliance:
        """The Delassus matrix, in two factors where contacts are redundant: near the start, or where all gaps are 0."""
        t, y, u, k, x = (self._vectors[letter] for letter in "tyukx")
        regular = Compliance.regular(ca.jacobian(self._numbers["a"], x))
        if len(self.contacts) < 2:
            return regular
        U, V = ca.jacobian(self._numbers["v"], y), ca.jacobian(self._forced["derivatives"], x)
        moved = sorted({*V.sparsity().row()} & {*U.sparsity().get_col()})
        factors = Compliance(U[:, moved], V[moved, :], is_redundant=True)
        gap = self._without_contact_forces(self._numbers["gap"])
        starts = ca.Function("starts", [t, u, k], [self._without_contact_forces(self._forced["start"][0])])
        results = [self._without_contact_forces(factors.matrix), gap, ca.jacobian(gap, y)]
        point = ca.Function("point", [t, y, u, k], results)
        values = [np.array([v.start for v in group], dtype=float) for group in (layout.inputs, layout.parameters)]
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
        """Expression with the contact forces of the modes for their symbols."""
        return ca.substitute(expression, self._vectors["x"], self._forces)

    def _without_contact_forces(self, expression: ca.SX) -> ca.SX:
        """Expression with 0 for the symbols of the contact forces."""
        return ca.substitute(expression, self._vectors["x"], ca.SX.zeros(len(self.contacts)))

    def _gap_index(self, friction: Contact) -> int:
        """Index of the gap whose normal force bounds a dry friction."""
        return self._gaps.index(Contact(friction.normal))

    def _memory_of(self, contact: Contact, ending: str) -> ca.SX:
        """Number in the memory of a contact, by the ending of its name."""
        return self._vectors["m"][self.memory.index(contact.variable(ending))]

    def _is_closed(self, gap: Contact) -> ca.SX:
        """1 or 0 for a closed or open gap; the memory of an open one may be < 0, the overlap that it may have."""
        return ca.fmax(self._memory_of(gap, "closed"), 0)

    def _can_press(self, friction: Contact) -> ca.SX:
        """Whether the gap is closed whose force bounds dry friction; 1 without one."""
        return self._is_closed(Contact(friction.normal)) if friction.normal else ca.SX(1)

    def _forces_and_indicators(self) -> tuple[ca.SX, ca.SX]:
        """Contact forces in the modes of the memory, and the event indicators.

        In the rows that are held (closed, sticks) v̇ = -2α v - α² g, α = STABILISATION, as for constraints.
        """
        numbers, alpha, first = self._numbers, STABILISATION, len(self._gaps)
        held, drag, normals = [self._is_closed(c) for c in self._gaps], [ca.SX(0)] * first, [-1] * first
        for i, c in enumerate(self._frictions):
            direction, touching = self._memory_of(c, "direction"), self._can_press(c)
            held.append((1 - direction**2) * touching)
            drag.append(-direction * numbers["slide"][i] * touching)
            normals.append(self._gap_index(c) if c.normal else -1)
        flags, gap = stack(held), ca.vertcat(numbers["gap"], ca.SX.zeros(len(self._frictions), 1))
        target = -2 * alpha * numbers["v"] - alpha**2 * gap
        forces, contradictions = self._compliance.forces(self._rows["a"], flags, stack(drag), normals, target)
        return forces, self._watched(flags, forces, contradictions)

    def _watched(self, flags: ca.SX, forces: ca.SX, contradictions: ca.SX) -> ca.SX:
        """Event indicators: each falls below 0 where the mode of its contact ends.

        :param contradictions: accelerations of redundant contacts that the others do not allow.
        """
        numbers, first = self._numbers, len(self._gaps)
        compliance, v = self._compliance.diagonal() / self._rows["acceleration_scale"], numbers["v"]
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
        outputs = {c.variable("indicator"): self._indicators[i] for i, c in enumerate(self.contacts)}
        for i, c in enumerate(self._gaps):
            ended = self._vectors["t"] >= self._memory_of(c, "rests_from")
            outputs[c.variable("closed")] = self._is_closed(c) * ended
            outputs[c.variable("force")] = ca.fmax(self._forces[i], 0)
        for c in self._frictions:
            outputs[c.variable("sticks")] = (1 - self._memory_of(c, "direction") ** 2) * self._can_press(c)
        return outputs

    def _after_impulses(self, impulses: ca.SX, shifts: ca.SX) -> tuple[ca.SX, ca.SX]:
        """State after impulses of the contacts and moved along the gaps, and impulses of operators."""
        y, x, rates, names = self._vectors["y"], self._vectors["x"], self._forced["derivatives"], self._states
        slopes, own = ca.jacobian(rates, x), [name.rpartition(".")[2] for name in names]
        change = ca.DM([float(name != "dissipated") for name in own]) * (slopes @ impulses)
        momenta = ca.DM([float(name not in ("work", "dissipated")) for name in own])
        towards = momenta * (slopes[:, : len(self._gaps)] @ shifts)
        moved = ca.DM([float(_is_position(name, names)) for name in names]) * ca.jtimes(rates, y, towards)
        forces = (self._outputs[f"{name}_force"] for name in impulsive_operators(self))
        operators = stack(ca.jtimes(force, x, impulses) for force in forces)
        return self._without_contact_forces(y + change + moved), self._without_contact_forces(operators)


def _is_position(name: str, names: Sequence[str]) -> bool:
    """Whether a state is a coordinate: there is a momentum of it, or it belongs to a quaternion."""
    part, dot, own = name.rpartition(".")
    return f"{part}{dot}p_{own}" in names or own.endswith(Orientation.quaternion)


def _has_dependent_rows(G: np.ndarray) -> bool:
    """Whether rows of a symmetric matrix depend on those before them."""
    rest = G.copy()
    for i, pivot in enumerate(np.diag(G)):
        if abs(rest[i, i]) <= 1e-9 * abs(pivot):
            return True
        rest -= np.outer(rest[:, i], rest[i]) / rest[i, i]
    return False
