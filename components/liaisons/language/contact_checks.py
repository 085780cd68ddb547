"""Checks of the unilateral liaisons and dry frictions that a mechanism or a chain declares."""

from collections.abc import Mapping

import casadi as ca

from liaisons.algebra import jacobian
from liaisons.base import units
from liaisons.errors import suggestion
from liaisons.language.checks import Formulas
from liaisons.language.declarations import Declaration, dry_friction
from liaisons.language.mechanical import MechanicalComponent


def check_contacts(
    m: MechanicalComponent,
    formulas: Formulas,
    configuration: Mapping[str, ca.SX],
    motion: Mapping[str, ca.SX],
    *,
    q: ca.SX,
    q_dot: ca.SX,
) -> None:
    """Raise a ComponentError for a unilateral liaison or dry friction that is declared wrongly.

    :param configuration: symbols that a gap may depend on, by name, ``motion`` those of a slip.
    :param q: free coordinates, ``q_dot`` their rates.
    """
    free = ", ".join(map(str, ca.vertsplit(q)))
    for item in m.contact_formulas:
        if item.last and m.dimension is None:
            item.refuse("has last=True, which is of a Chain; leave it out")
    for item in m.unilaterals:
        gap = formulas(item.name, configuration, item.unit)
        if ca.jacobian(gap, q).is_zero():  # a comparison has no derivative
            item.refuse(f"depends on no free coordinate ({free}), so that nothing upholds it")
        if item.restitution is not None:
            _check_restitution(m, item, item.restitution)
    rates = ca.vertcat(*(symbol for name, symbol in motion.items() if name not in configuration))
    for item in m.dry_frictions:
        slip = formulas(item.name, motion, item.unit)
        if not ca.depends_on(slip, q_dot):
            item.refuse(f"depends on no rate of a free coordinate ({free}): take self.dot() of one into it")
        if ca.depends_on(jacobian(slip, rates), rates):
            item.refuse("must be linear in the rates")
        _check_bounds(m, formulas, item)


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


def _bound(m: MechanicalComponent, formulas: Formulas, item: Declaration, name: str, unit: str) -> float:
    """Value of a bound of dry friction for the default parameters, which may not be negative."""
    declared = {p.name: p for p in m.parameters}
    if not isinstance(name, str) or not (name in declared or hasattr(type(m), name)):
        more = suggestion(name if isinstance(name, str) else "", declared)
        item.refuse(f"is bounded by {name!r}, which is no parameter and no method{more}")
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


def _check_restitution(m: MechanicalComponent, item: Declaration, name: str) -> None:
    declared = {p.name: (p.minimum, p.maximum, p.unit) for p in m.parameters}
    low, high, unit = declared.get(name, (None, None, "1"))
    if low is None or high is None or not 0 <= low <= high <= 1:
        item.refuse(f"has the restitution {name!r}: let it be a Parameter in [0, 1]: minimum=0, maximum=1")
    if unit != "1":
        item.refuse(f"has the restitution {name!r} in {unit}: let its unit be '1'")
