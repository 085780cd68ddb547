"""Unilateral liaisons and dry friction: from the motion under given contact forces to the motion in modes.

The *relaxed* model has the force x_i of each contact as an input: of a unilateral liaison along its gradient, of dry
friction along its relative velocity.  Rates v of the contacts obey, with a⁰ at x = 0 and the compliance G = C A⁻¹ Cᵀ,

    v̇ = a⁰ + G x

The modes, which an FMU chooses at events, say for each contact what holds in the place of x being given::

    open            x = 0                            closed, sticks     v̇ = 0
    slides          x = -direction T                 T: threshold, or μ times the force of a unilateral liaison

An impact is the limit of a force that acts ever shorter: states jump by (∂ẏ/∂x) Λ, because ẏ is linear in x.
Source: docs/explanation/unilateral.md.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import casadi as ca

from liaisons.base import units
from liaisons.base.array_names import suffixed
from liaisons.errors import ComponentError
from liaisons.expressions.algebra import stack
from liaisons.language.declarations import Orientation
from liaisons.language.layout import Layout, readable, zero
from liaisons.language.mechanism import Mechanism
from liaisons.language.variables import Variable
from liaisons.mechanics.constraints import STABILISATION
from liaisons.mechanics.functions import model_functions, results_of
from liaisons.mechanics.model import Contact, Model

OPEN_MARGIN, FORCE_MARGIN = 1e-13, 1e-12
"""Parts of its scale by which an event indicator is below the number that it watches when it crosses 0."""

LEAVING = 1e-3
"""Part of the rate of a gap that grows in its indicator: an importer's error right after an impact is no event."""

_SCALES = ("rate_scale", "acceleration_scale")
_HIDDEN = {
    False: ("acceleration", "restitution", "scale", *_SCALES),
    True: ("acceleration", "static", "sliding", *_SCALES),
}


def contacts_of(m: Mechanism) -> tuple[Contact, ...]:
    """The contacts of a mechanism: unilateral liaisons, then dry friction."""
    return (
        *(Contact(item.name) for item in m.unilaterals),
        *(Contact(item.name, friction=True, normal=item.normal or "") for item in m.dry_frictions),
    )


def relaxed_layout(m: Mechanism, layout: Layout) -> Layout:
    """Layout with the contact forces as inputs, and what modes are chosen by as outputs, behind all others."""
    unit_of = {item.name: units.rate(item.unit) for item in m.unilaterals}
    unit_of |= {item.name: item.unit for item in m.dry_frictions}
    forces = (zero(suffixed(name, "_multiplier"), units.multiplier(unit), name) for name, unit in unit_of.items())
    hidden = (readable(name, units.ANY, name) for contact in contacts_of(m) for name in _hidden(contact))
    return replace(layout, inputs=(*layout.inputs, *forces), outputs=(*layout.outputs, *hidden))


def contact_expressions(m: Mechanism) -> dict[str, ca.SX]:
    """Positions, rates, accelerations, thresholds and scales of the contacts, by the names of outputs."""
    expressions: dict[str, ca.SX] = {}
    for item in m.unilaterals:
        gap = ca.SX(getattr(m, item.name))
        rate = m.dot(gap)
        expressions |= {item.name: gap, suffixed(item.name, "_dot"): rate}
        expressions |= {suffixed(item.name, "_restitution"): m.threshold(item.restitution or "")}
        expressions |= {suffixed(item.name, "_scale"): _position_scale(m, gap)} | _scales(m, item.name, rate)
    for item in m.dry_frictions:
        rate = ca.SX(getattr(m, item.name))
        expressions |= {item.name: rate} | _scales(m, item.name, rate)
        expressions |= {suffixed(item.name, "_static"): m.threshold(item.static)}
        expressions |= {suffixed(item.name, "_sliding"): m.threshold(item.sliding)}
    return expressions


def with_modes(relaxed: Model) -> Model:
    """Model of a relaxed one in which each contact is in a mode, which its memory holds."""
    return _Modes(relaxed).model()


def _hidden(contact: Contact) -> Iterable[str]:
    return (contact.variable(end) for end in _HIDDEN[contact.friction])


# ---- scales, by which rounding errors are told from numbers ------------------------------------------------------


def _nominals(m: Mechanism) -> ca.SX:
    return ca.SX([*(q.nominal for q in m.coordinates), *([1.0] * 3 * len(m.orientations))])


def _position_scale(m: Mechanism, gap: ca.SX) -> ca.SX:
    turned = ca.DM([q.nominal for q in m.coordinates] + [0.0] * 4 * len(m.orientations))
    sizes, slopes = turned + ca.fabs(m.free.q), ca.fabs(ca.jacobian(gap, m.free.q))
    return slopes @ sizes + ca.fabs(ca.jacobian(gap, m.active.s)) @ ca.fabs(m.active.s)


def _scales(m: Mechanism, name: str, rate: ca.SX) -> dict[str, ca.SX]:
    """Sums of what a rate and its derivative are made of; and the derivative itself."""
    free, active = m.free, m.active
    along, across = ca.jacobian(rate, free.q_dot), ca.jacobian(rate, active.s_dot)
    acceleration = m.dot(rate)
    rest = acceleration - along @ free.q_ddot - across @ active.s_ddot
    nominal = ca.fabs(along) @ _nominals(m)
    driven = ca.fabs(across) @ ca.fabs(active.s_dot)
    forced = ca.fabs(along) @ ca.fabs(free.q_ddot) + ca.fabs(across) @ ca.fabs(active.s_ddot) + ca.fabs(rest)
    return {
        suffixed(name, "_acceleration"): acceleration,
        suffixed(name, "_rate_scale"): ca.fabs(along) @ ca.fabs(free.q_dot) + nominal + driven,
        suffixed(name, "_acceleration_scale"): forced + 1e-3 * nominal,
    }


# ---- modes --------------------------------------------------------------------------------------------------------


class _Modes:
    """Vectors of a model in modes, and the contact forces that follow from them."""

    def __init__(self, relaxed: Model) -> None:
        called = relaxed.outputs_function
        if not called.is_a("SXFunction"):
            raise ComponentError(f"{relaxed.name}: unilateral liaisons beside a chain are not supported")
        self.relaxed = relaxed
        contacts = relaxed.contacts
        self.gaps = [c for c in contacts if not c.friction]
        self.frictions = [c for c in contacts if c.friction]
        self.contacts = (*self.gaps, *self.frictions)
        self.t, self.y, u, self.k, self.m = called.sx_in()
        flat = relaxed.flat()
        names = [v.name for v in flat.inputs]
        inner = [names.index(c.variable("multiplier")) for c in self.contacts]
        outer = [i for i in range(len(names)) if i not in inner]
        self.inputs = tuple(v for v in relaxed.inputs if v.name not in {names[i] for i in inner})
        self.x, self.u, self.all = u[inner], u[outer], u
        self.z = called.call([self.t, self.y, u, self.k, self.m], True, False)[0]
        self.rates = relaxed.derivatives.call([self.t, self.y, u, self.k], True, False)[0]
        self.row = {v.name: i for i, v in enumerate(flat.outputs)}
        self.states = [state.name for state in flat.states]
        self.slot = {name: i for i, name in enumerate(relaxed.memory)}

        accelerations = self._each("_acceleration")
        self.G = ca.jacobian(accelerations, self.x)
        self.resting = self._unloaded(accelerations)
        self.forces, self.indicators = self._solve()

    # ---- numbers of the contacts

    def _read(self, name: str) -> ca.SX:
        return self.z[self.row[name]]

    def _each(self, ending: str, contacts: Iterable[Contact] | None = None) -> ca.SX:
        return stack(self._read(suffixed(c.name, ending)) for c in (self.contacts if contacts is None else contacts))

    def _remembered(self, name: str) -> ca.SX:
        return self.m[self.slot[name]]

    def _closed(self, gap: str) -> ca.SX:
        """1 or 0: an open gap may remember, below 0, by how much it may overlap."""
        return ca.fmax(self._remembered(suffixed(gap, "_closed")), 0)

    def _unloaded(self, expression: ca.SX) -> ca.SX:
        return ca.substitute(expression, self.x, ca.SX.zeros(*self.x.shape))

    def _velocities(self) -> ca.SX:
        return ca.vertcat(self._each("_dot", self.gaps), self._each("", self.frictions))

    def _solve(self) -> tuple[ca.SX, ca.SX]:
        """Contact forces x = P ζ + d in the modes of the memory, and the event indicators.

        In the rows that are held (closed, sticks) v̇ = -2α v - α² g, α = STABILISATION, as for constraints; in the
        others ζ = 0.
        """
        count, first = len(self.contacts), len(self.gaps)
        closed = {c.name: self._closed(c.name) for c in self.gaps}
        held = [closed[c.name] for c in self.gaps]
        P, d = ca.SX.eye(count), ca.SX.zeros(count, 1)
        sliding = self._each("_sliding", self.frictions)
        for i, c in enumerate(self.frictions):
            direction, on = self._remembered(c.variable("direction")), closed.get(c.normal, ca.SX(1))
            held.append((1 - direction**2) * on)
            if c.normal:
                P[first + i, self.gaps.index(Contact(c.normal))] = -direction * sliding[i] * on
            else:
                d[first + i] = -direction * sliding[i]
        flags = stack(held)
        v, alpha = self._velocities(), STABILISATION
        wanted = -2 * alpha * v - alpha**2 * ca.vertcat(self._each("", self.gaps), ca.SX.zeros(count - first, 1))
        K = ca.diag(flags) @ self.G @ P + ca.diag(1 - flags)
        forces = P @ _eliminated(K, flags * (wanted - self.resting - self.G @ d)) + d
        return forces, self._watched(flags, forces, v)

    def _watched(self, flags: ca.SX, forces: ca.SX, v: ca.SX) -> ca.SX:
        """Event indicators: each falls below 0 where the mode of its contact ends."""
        compliance = ca.diag(self.G) / self._unloaded(self._each("_acceleration_scale"))
        rows = []
        for i, c in enumerate(self.gaps):
            leaving = LEAVING * ca.fmax(v[i], 0) / self._read(c.variable("rate_scale"))
            margin = ca.fmax(-self._remembered(c.variable("closed")), 0) + OPEN_MARGIN
            distance = self._read(c.name) / self._read(c.variable("scale")) + leaving + margin
            rows.append(flags[i] * (forces[i] * compliance[i] + FORCE_MARGIN) + (1 - flags[i]) * distance)
        for i, c in enumerate(self.frictions, start=len(self.gaps)):
            direction, bound = self._remembered(c.variable("direction")), self._read(c.variable("static"))
            touching = ca.SX(1)
            if c.normal:
                touching = self._closed(c.normal)
                bound *= forces[self.gaps.index(Contact(c.normal))]
            sticks = (bound - ca.fabs(forces[i])) * compliance[i] + FORCE_MARGIN
            slides = direction * v[i] / self._read(c.variable("rate_scale")) + FORCE_MARGIN
            own = flags[i] * sticks + direction**2 * slides
            rows.append(touching * own + 1 - touching)
        return stack(rows)

    # ---- the model

    def model(self) -> Model:
        """The model in modes."""
        relaxed = self.relaxed
        hidden = {name for c in relaxed.contacts for name in _hidden(c)}
        outputs = [v for v in relaxed.outputs if v.name not in hidden]
        read = self._booked(v for array in outputs for v in array.elements())
        rates, z = ca.vertsplit(
            self._loaded(ca.vertcat(self.rates, stack(read))), [0, self.y.shape[0], self.y.shape[0] + len(read)]
        )
        impulses, shifts = ca.SX.sym("impulses", len(self.contacts)), ca.SX.sym("shifts", len(self.gaps))
        vectors = {"t": self.t, "y": self.y, "u": self.u, "k": self.k, "m": self.m, "Λ": impulses, "ν": shifts}
        painleve = self._painleve()
        lasting = len(relaxed.condition_texts) - relaxed.start_only
        conditions = ca.vertsplit(self._loaded(*self._called("conditions"))) if relaxed.condition_texts else []
        conditions = [*conditions[:lasting], *painleve.values(), *conditions[lasting:]]
        texts = relaxed.condition_texts
        results = {
            "start": tuple(map(self._unloaded, self._called("start"))),
            "derivatives": rates,
            "outputs_function": z,
            "conditions": stack(conditions),
            "contact": self._measured(),
            "indicate": self._loaded(self.indicators),
            "push": self._push(impulses, shifts),
        }
        for name in ("jump", "remember", "nominals", "project", "draw"):
            results[name] = getattr(relaxed, name) and self._loaded(*self._called(name))
        return replace(
            relaxed,
            inputs=self.inputs,
            outputs=tuple(outputs),
            condition_texts=(*texts[:lasting], *painleve, *texts[lasting:]),
            contacts=self.contacts,
            relaxed=relaxed,
            **model_functions(vectors, results),
        )

    def _called(self, name: str) -> list[ca.SX]:
        vectors = {"t": self.t, "y": self.y, "u": self.all, "k": self.k, "m": self.m}
        return results_of(name, getattr(self.relaxed, name), vectors)

    def _loaded(self, expression: ca.SX) -> ca.SX:
        return ca.substitute(expression, self.x, self.forces)

    def _booked(self, outputs: Iterable[Variable]) -> list[ca.SX]:
        """Expressions of the outputs, with those that depend on modes."""
        special = {c.variable("indicator"): self.indicators[i] for i, c in enumerate(self.contacts)}
        for i, c in enumerate(self.gaps):
            ended = self.t >= self._remembered(c.variable("rests_from"))
            special[c.variable("closed")] = self._closed(c.name) * ended
            special[c.variable("force")] = ca.fmax(self.forces[i], 0)
        for c in self.frictions:
            touching = self._closed(c.normal) if c.normal else 1
            special[c.variable("sticks")] = (1 - self._remembered(c.variable("direction")) ** 2) * touching
        return [special.get(v.name, self._read(v.name)) for v in outputs]

    def _painleve(self) -> dict[str, ca.SX]:
        """What has to stay > 0, by its message: a force that presses must push apart, also while it slides."""
        conditions = {}
        for i, c in enumerate(self.frictions, start=len(self.gaps)):
            if c.normal:
                n = self.gaps.index(Contact(c.normal))
                coefficient = self._remembered(c.variable("direction")) * self._read(c.variable("sliding"))
                text = f"{c.normal} must have one force while {c.name} slides (Painlevé)"
                conditions[text] = 1 - coefficient * self.G[n, i] / self.G[n, n]
        return conditions

    def _measured(self) -> dict[str, ca.SX]:
        """Numbers that modes are chosen by, without contact forces, by the names of ``ContactRows`` in core.h."""
        numbers = {
            "v": self._velocities(),
            "a": self.resting,
            "G": ca.vec(self.G),
            "rate_scale": self._each("_rate_scale"),
            "acceleration_scale": self._each("_acceleration_scale"),
            "gap": self._each("", self.gaps),
            "scale": self._each("_scale", self.gaps),
            "restitution": self._each("_restitution", self.gaps),
            "stick": self._each("_static", self.frictions),
            "slide": self._each("_sliding", self.frictions),
        }
        return {name: self._unloaded(column) for name, column in numbers.items()}

    def _push(self, impulses: ca.SX, shifts: ca.SX) -> tuple[ca.SX, ca.SX]:
        """State after impulses of the contacts and moved along the gaps, and impulses of operators."""
        names = self.states
        slopes = ca.jacobian(self.rates, self.x)
        kept = ca.DM([0.0 if name.rpartition(".")[2] == "dissipated" else 1.0 for name in names])
        change = kept * (slopes @ impulses)
        momenta = ca.DM([0.0 if name.rpartition(".")[2] in ("work", "dissipated") else 1.0 for name in names])
        towards = momenta * (slopes[:, : len(self.gaps)] @ shifts)
        moved = ca.DM([float(_is_position(name, names)) for name in names]) * ca.jtimes(self.rates, self.y, towards)
        forces = (self._read(f"{name}_force") for name in operators_of(self.relaxed))
        operators = stack(ca.jtimes(force, self.x, impulses) for force in forces)
        return self._unloaded(self.y + change + moved), self._unloaded(operators)


def operators_of(model: Model) -> list[str]:
    """Names of the active coordinates of a model whose impulses are summed."""
    gaps = {c.variable("impulse") for c in model.contacts}
    return [name.removesuffix("_impulse") for name in model.memory if name.endswith("_impulse") and name not in gaps]


def _is_position(name: str, names: list[str]) -> bool:
    part, dot, own = name.rpartition(".")
    return f"{part}{dot}p_{own}" in names or own in Orientation.quaternion


def _eliminated(K: ca.SX, right: ca.SX) -> ca.SX:
    """K⁻¹ right by Gauss's elimination without pivoting: modes are chosen so that it needs none."""
    n = K.shape[0]
    rows = [[K[i, j] for j in range(n)] + [right[i]] for i in range(n)]
    for i in range(n):
        for below in range(i + 1, n):
            factor = rows[below][i] / rows[i][i]
            rows[below] = [a if factor.is_zero() else a - factor * b for a, b in zip(rows[below], rows[i], strict=True)]
    solved: list[ca.SX] = [ca.SX(0)] * n
    for i in reversed(range(n)):
        solved[i] = (rows[i][n] - sum(rows[i][j] * solved[j] for j in range(i + 1, n))) / rows[i][i]
    return stack(solved)
