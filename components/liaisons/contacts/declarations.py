"""Declarations of unilateral liaisons and dry friction."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import casadi as ca

from liaisons.algebra import jacobian
from liaisons.base import units
from liaisons.base.array_names import suffixed_name
from liaisons.errors import suggestion
from liaisons.language import (
    ContactFormula,
    Formulas,
    MechanicalComponent,
    Variable,
)


class unilateral(ContactFormula):
    """A unilateral liaison: an expression of the configuration that stays >= 0, such as the distance of two bodies.

    Impacts obey Newton's law, v⁺ = -e v⁻ (docs/explanation/unilateral.md).

    :param restitution: name of the parameter e, in [0, 1]; none: 0.
    :param size: of an array, which the method returns as a column: name of a Size, or that less a number, ``"n - 1"``.
    :param last: in a chain, whether only the last link has it; else each link has.
    """

    example = '@unilateral("m", "distance of ball and table", restitution="bounce")'
    names = ("restitution",)
    is_friction = False

    def __init__(
        self,
        unit: str,
        description: str,
        *,
        restitution: str | None = None,
        size: str = "",
        last: bool = False,
        unchecked: str | None = None,
    ) -> None:
        super().__init__(unit, description, unchecked=unchecked)
        self.restitution, self.size, self.last = restitution, size, last

    def variables(self, readable: Callable[..., Variable], at_events: Callable[..., Variable]) -> Iterator[Variable]:
        name, of = self.name, partial(suffixed_name, self.name)
        yield readable(name, self.unit, self.description)
        yield readable(of("_dot"), units.rate(self.unit), f"rate of {name}")
        yield readable(of("_force"), units.force(self.unit), f"force that upholds {name} >= 0")
        text = f"sum of the impulses of impacts at {name}"
        yield at_events(of("_impulse"), units.momentum(self.unit), text)
        yield at_events(of("_closed"), "1", f"whether {name} rests at 0", type="Boolean")
        text = f"how many impacts {name} has had, after falls from more than a millionth of its size"
        yield at_events(of("_impacts"), "1", text, type="Integer")
        text = f"when the bounces of {name} end, or have ended"
        yield at_events(of("_rests_from"), "s", text, causality="local")
        text = f"event indicator of {name}"
        yield readable(of("_indicator"), "1", text, causality="local")

    def check(
        self,
        m: Any,
        formulas: Any,
        configuration: Mapping[str, ca.SX],
        motion: Mapping[str, ca.SX],  # noqa: ARG002 - of frictions
        free: tuple[ca.SX, ca.SX],
    ) -> None:
        gap = formulas(self.name, configuration, self.unit)
        if ca.jacobian(gap, free[0]).is_zero():  # a comparison has no derivative
            self.refuse(f"depends on no free coordinate ({_names(free[0])}), so that nothing upholds it")
        if self.restitution is not None:
            _check_restitution(m, self, self.restitution)


class dry_friction(ContactFormula):
    """Dry friction against a relative velocity: an expression linear in the rates, including those of operators.

    :param static: name of the parameter, or method, that bounds the force during sticking [unit of the force].
    :param sliding: name of the parameter, or method, that is the force during sliding; none: the same as ``static``.
    :param normal: name of a unilateral liaison by whose force ``static`` and ``sliding`` are multiplied (Coulomb);
        none: they are forces.
    :param size: of an array, as of a unilateral liaison; each element is bounded by that of the arrays that are named.
    :param last: as of a unilateral liaison.
    """

    example = '@dry_friction("m/s", "sliding of the block on the belt", static="grip")'
    names = ("static", "sliding", "normal")
    is_friction = True

    def __init__(
        self,
        unit: str,
        description: str,
        *,
        static: str,
        sliding: str | None = None,
        normal: str | None = None,
        size: str = "",
        last: bool = False,
        unchecked: str | None = None,
    ) -> None:
        super().__init__(unit, description, unchecked=unchecked)
        self.static, self.sliding, self.normal = static, sliding or static, normal
        self.size, self.last = size, last

    def variables(self, readable: Callable[..., Variable], at_events: Callable[..., Variable]) -> Iterator[Variable]:
        name, of = self.name, partial(suffixed_name, self.name)
        yield readable(name, self.unit, self.description)
        text = f"force of dry friction along +{name}"
        yield readable(of("_force"), units.multiplier_unit(self.unit), text)
        yield at_events(of("_sticks"), "1", f"whether {name} is held at 0 by friction", type="Boolean")
        yield at_events(of("_direction"), "1", f"sign of {name} while it slides, else 0", causality="local")
        text = f"event indicator of {name}"
        yield readable(of("_indicator"), "1", text, causality="local")

    def check(
        self,
        m: Any,
        formulas: Any,
        configuration: Mapping[str, ca.SX],
        motion: Mapping[str, ca.SX],
        free: tuple[ca.SX, ca.SX],
    ) -> None:
        slip = formulas(self.name, motion, self.unit)
        if not ca.depends_on(slip, free[1]):
            self.refuse(f"depends on no rate of a free coordinate ({_names(free[0])}): take self.dot() of one into it")
        rates = ca.vertcat(*(symbol for name, symbol in motion.items() if name not in configuration))
        if ca.depends_on(jacobian(slip, rates), rates):
            self.refuse("must be linear in the rates")
        _check_bounds(m, formulas, self)


def _names(column: ca.SX) -> str:
    return ", ".join(map(str, ca.vertsplit(column)))


def _check_bounds(m: MechanicalComponent, formulas: Formulas, item: dry_friction) -> None:
    of_last = {liaison.name: liaison.last for liaison in m.unilaterals}
    if item.normal is not None and item.normal not in of_last:
        names = ", ".join(of_last) or "there is none"
        item.refuse(f"takes the force of normal = {item.normal!r}: name a unilateral liaison: {names}")
    if item.normal is not None and of_last[item.normal] != item.last:
        item.refuse(f"it and normal = {item.normal!r} are of different links; let both have last=True, or neither")
    unit = units.multiplier_unit(item.unit) if item.normal is None else "1"
    bounds = [_bound(m, formulas, item, name, unit) for name in (item.static, item.sliding)]
    if bounds[0] < bounds[1]:
        more = f"sliding = {item.sliding!r} is {bounds[1]:g}"
        item.refuse(f"has static = {item.static!r} of {bounds[0]:g}, but {more}: let static be no less")


def _bound(m: MechanicalComponent, formulas: Formulas, item: dry_friction, name: str, unit: str) -> float:
    """Value of a bound of dry friction for the default parameters, which may not be negative."""
    declared = {p.name: p for p in m.parameters}
    if not isinstance(name, str) or not (name in declared or hasattr(type(m), name)):
        more = suggestion(name if isinstance(name, str) else "", declared)
        item.refuse(f"is bounded by {name!r}, which is neither a parameter nor a method{more}")
    column = m.parameter_column
    bound = formulas.add(
        name, m.contact_coefficient(name), {str(symbol): symbol for symbol in ca.vertsplit(column)}, unit
    )
    lowest = declared[name].minimum if name in declared else 0
    if lowest is None or lowest < 0:
        item.refuse(f"is bounded by {name!r}, which may be negative: let it have minimum=0")
    value = float(ca.Function("bound", [column], [bound])(ca.DM([p.start for p in m.parameters for _ in p.names])))
    if value < 0:
        more = "for the default parameters; let it be >= 0"
        item.refuse(f"is bounded by {name!r}, which is {value:g} {more}")
    return value


def _check_restitution(m: MechanicalComponent, item: unilateral, name: str) -> None:
    declared = {p.name: (p.minimum, p.maximum, p.unit) for p in m.parameters}
    low, high, unit = declared.get(name, (None, None, "1"))
    if low is None or high is None or not 0 <= low <= high <= 1:
        item.refuse(f"has the restitution {name!r}: let it be a Parameter in [0, 1]: minimum=0, maximum=1")
    if unit != "1":
        item.refuse(f"has the restitution {name!r} in {unit}: let its unit be '1'")
