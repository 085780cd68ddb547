"""Unilateral liaisons and dry friction: equations of two modes each, and ``when`` clauses that change them.

Impacts, thresholds and the end of bounces are those of the FMU, docs/explanation/unilateral.md.  Contacts that act on
each other obey a rule for all of them at once, which is not written.
"""

from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Any

import casadi as ca

from liaisons.base import units
from liaisons.contacts import contact_laws
from liaisons.errors import ComponentError
from liaisons.mechanics import Equations
from liaisons_exchange.modelica_text.text import Section, declaration, statement_lines

# Bounces lower than 1e-12 of the gap's scale are left out; impacts after a fall from higher than 1e-6 of it count.
# What is held moves by more than 1e-6 of the scale of its rate only if a prescribed coordinate has jumped.
_LOW = "({n}_restitution*{v})^2 < -2e-12*{n}_scale*{a}"
_GAP = """\
0 = if {n}_closed then {held} + {square:g}*{n} else {n}_force;
when {v} < (if pre({n}_closed) then -1e-6*{v}_scale else 0) and (pre({n}_closed) or {n} < 0) then
  {n}_closed = {low};
  {n}_impulse = pre({n}_impulse) - {n}_mass*{v}*(if {low} then 1 else 1 + {n}_restitution);
  {n}_impacts = pre({n}_impacts) + (if {v}^2 > 2e-6*{n}_scale*abs({a}) then 1 else 0);
  {jumps}
elsewhen pre({n}_closed) and {n}_force < 0 then
  {n}_closed = false; {n}_impulse = pre({n}_impulse); {n}_impacts = pre({n}_impacts);
end when;"""
_FRICTION = """\
0 = if {n}_direction == 0 then {held} else {n}_force + {n}_direction*{n}_sliding;
{n}_sticks = {n}_direction == 0;
when pre({n}_direction) == 0 and abs({n}_force) > {n}_static or \
(if pre({n}_direction) == 0 then abs({v}) else -pre({n}_direction)*{v}) > 1e-6*{v}_scale then
  {n}_direction = if {v} > 1e-6*{v}_scale then 1 elseif {v} < -1e-6*{v}_scale or {n}_force > 0 then -1 else 1;
elsewhen pre({n}_direction)*{v} < -1e-12*{v}_scale then
  {n}_direction = 0;
  {jumps}
end when;"""


_OF_FRICTION = {"_static": "stick", "_sliding": "slide"}
_OF_GAP = {"": "gap", "_scale": "scale", "_restitution": "restitution"}
"""Ending of a variable -> name of the contact's numbers."""


def _refuse_coupled_contacts(e: Equations, contacts: Sequence[Any], compliance: ca.SX) -> None:
    """Refuse contacts that act on each other, on constraints or on orientations."""
    pairs = combinations(range(len(contacts)), 2)
    coupled = any(c.normal for c in contacts) or any(compliance.has_nz(i, j) for i, j in pairs)
    if coupled or e.constraints.residuals.numel() or e.mechanism.orientations:
        why = "that act on each other" if coupled else "beside constraints or orientations"
        listed = ", ".join(c.name for c in contacts)
        raise ComponentError(f"{e.name}: Modelica text takes no contacts ({listed}) {why}; import its FMU")


def _add_units(unit: dict[str, str], n: str, v: str, a: str, *, friction: bool) -> None:
    """Add the units of the variables of a contact.

    :param n: its name; ``v``, ``a``: names of its rate and of the acceleration.
    """
    rate = unit[n] if friction else units.rate(unit[n])
    unit |= {v: rate, a: units.rate(rate), f"{v}_scale": rate}
    unit[f"{n}_mass"] = units.quotient(unit[f"{n}_force"], unit[a])
    if friction:
        unit |= dict.fromkeys((f"{n}_static", f"{n}_sliding"), unit[f"{n}_force"])
    else:
        unit |= {f"{n}_scale": unit[n], f"{n}_restitution": "1"}


def add_contacts(
    e: Equations, section: Section, unit: dict[str, str], with_outer_forces: Callable[[ca.SX], ca.SX]
) -> tuple[list[str], list[str], list[str]]:
    """Write the equations of unilateral liaisons and dry frictions without events, and return those with events.

    :param with_outer_forces: replaces drives and loads by outer forces Q.
    :param unit: units by name, to which those of further variables are added.
    :returns: declarations of discrete variables, initial equations, and lines of equations with events.
    :raises ComponentError: for contacts that act on each other, on constraints or on orientations.
    """
    laws = contact_laws(e)
    if laws is None:
        return [], [], []
    m, contacts, numbers, along, compliance = e.mechanism, laws.contacts, laws.numbers, laws.along, laws.compliance
    freely, alpha = with_outer_forces(laws.free_accelerations), e.constraints.alpha
    _refuse_coupled_contacts(e, contacts, compliance)
    declarations, initial, clauses = list[str](), list[str](), list[str]()
    for i, c in enumerate(contacts):
        n, row = c.name, i - len(m.unilaterals) if c.friction else i
        v, a = (n, f"{n}_dot") if c.friction else (f"{n}_dot", f"{n}_ddot")
        own = {v: numbers["v"][i], a: m.dot(numbers["v"][i]), f"{v}_scale": numbers["rate_scale"][i]}
        own |= {
            f"{n}{ending}": numbers[name][row] for ending, name in (_OF_FRICTION if c.friction else _OF_GAP).items()
        }
        _add_units(unit, n, v, a, friction=c.friction)
        section.add_rows([*own, f"{n}_mass"], ca.vertcat(*own.values(), 1 / compliance[i, i]))
        impulse = f"{n}_mass*{v}" if c.friction else f"(pre({n}_impulse) - {n}_impulse)"
        jumps = [
            f"reinit(p_{q.name}, p_{q.name} - ({section.write_expression(along[i, k])})*{impulse});"
            for k, q in enumerate(m.coordinates)
            if along.has_nz(i, k)
        ]
        words = {"n": n, "v": v, "a": a, "low": _LOW.format(n=n, v=v, a=a), "square": alpha**2}
        words |= {"held": f"{a} + {2 * alpha:g}*{v}", "jumps": " ".join(jumps).replace("(1)*", "")}
        lines = (_FRICTION if c.friction else _GAP).format_map(words).splitlines()
        clauses += [line for statement in lines for line in statement_lines(statement)]
        free = section.write_expression(freely[i])
        if c.friction:
            declarations.append(f'Integer {n}_direction(start=0) "of sliding; 0: sticks"; Boolean {n}_sticks;')
            start = f"if {n} > 0 then 1 elseif {n} < 0 then -1 elseif ({free})*{n}_mass > {n}_static then 1"
            initial.append(f"pre({n}_direction) = {start} elseif ({free})*{n}_mass < -{n}_static then -1 else 0;")
        else:
            text = "bounces lower than 1e-12 of its scale are left out"
            declarations.append(f'Boolean {n}_closed(start=false) "{text}"; Integer {n}_impacts(start=0, fixed=true);')
            declarations.append(f"Real {declaration(f'{n}_impulse', unit[f'{n}_impulse'], start='0', fixed='true')};")
            initial.append(f'assert({n} > -1e-9*{n}_scale, "bodies overlap: start with {n} >= 0");')
            initial.append(f"pre({n}_closed) = {n} < 1e-9*{n}_scale and abs({v}) < 1e-9*{v}_scale and {free} < 0;")
    return declarations, initial, clauses
