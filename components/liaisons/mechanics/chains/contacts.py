"""Contacts of the links of a chain: their names, and the numbers of a link by which modes are chosen."""

from collections.abc import Iterable

import casadi as ca

from liaisons.expressions.algebra import stack
from liaisons.expressions.rows import Step, Sum, Vector, carry
from liaisons.language.chain import Chain
from liaisons.language.declarations import ContactFormula
from liaisons.language.variables import element
from liaisons.mechanics.chains.sweeps import Base, ChainLink, LinkMotion
from liaisons.mechanics.model import Contact
from liaisons.mechanics.unilateral import CONTACT_NUMBERS, refuse_long, refuse_many


def contacts_of_links(m: Chain) -> tuple[Contact, ...]:
    """The contacts of a chain: of each liaison one at each link, or that at the last link."""

    def numbers(item: ContactFormula) -> Iterable[int]:
        return (0,) if item.last else range(1, m.sizes["n"] + 1)

    def named(name: str, i: int) -> str:
        return element(name, i) if name and i else name

    contacts = (
        *(Contact(named(item.name, i)) for item in m.unilaterals for i in numbers(item)),
        *(
            Contact(named(item.name, i), friction=True, normal=named(item.normal or "", i))
            for item in m.dry_frictions
            for i in numbers(item)
        ),
    )
    refuse_many(type(m).__name__, contacts)
    if contacts:
        refuse_long(type(m).__name__, m.sizes["n"])
    return contacts


def link_contact_numbers(
    m: Chain, link: ChainLink, base: Base, slope: ca.SX, moving: LinkMotion
) -> tuple[list[Step], dict[str, Vector]]:
    """Columns of :data:`CONTACT_NUMBERS` of a link by name, and the steps that they need.

    :param slope: ∂w/∂s at the base.
    """
    rates, v, a = m.contact_rates(), link.v, moving.accelerations
    gaps = stack(map(m.expression_of, m.unilaterals))
    sizes = ca.SX(ca.DM([q.nominal for q in m.coordinates]))
    F_dot = link.rate(link.tip)
    w, w_dot, w_ddot = (ca.SX.sym(f"{name}_scale", link.w.shape[0]) for name in ("w", "w_dot", "w_ddot"))

    def scale(function: ca.SX, coordinates: ca.SX, joint: ca.SX) -> ca.SX:
        """Sum of the terms of a function of q and w, from theirs."""
        return ca.fabs(ca.jacobian(function, link.q)) @ coordinates + ca.fabs(ca.jacobian(function, link.w)) @ joint

    across, rest = ca.fabs(slope), link.rate(rates)
    moved, fast, forced = sizes + ca.fabs(link.q), sizes + ca.fabs(v), 1e-3 * sizes + ca.fabs(a)
    steps: list[Step] = [
        carry(w, across @ ca.fabs(m.s), scale(link.tip, moved, w)),
        carry(w_dot, across @ ca.fabs(m.s_dot), scale(link.tip, fast, w_dot)),
        carry(w_ddot, ca.fabs(base.w_ddot), scale(link.tip, forced, w_ddot) + ca.fabs(link.rate(F_dot))),
    ]
    along, over = ca.jacobian(rates, v), ca.jacobian(rates, link.w_dot)
    numbers = {
        "v": rates,
        "a": rest + along @ a + over @ moving.joint_accelerations,
        "rate_scale": ca.fabs(along) @ fast + ca.fabs(over) @ w_dot,
        "acceleration_scale": ca.fabs(along) @ forced + ca.fabs(over) @ w_ddot + ca.fabs(rest),
        "gap": gaps,
        "scale": scale(gaps, moved, w),
        "restitution": stack(m.contact_coefficient(item.restitution or "") for item in m.unilaterals),
        "stick": stack(m.contact_coefficient(item.static) for item in m.dry_frictions),
        "slide": stack(m.contact_coefficient(item.sliding) for item in m.dry_frictions),
    }
    declared = {False: m.unilaterals, True: m.dry_frictions}
    columns: dict[str, Vector] = {}
    for name, kinds in CONTACT_NUMBERS.items():
        items, rows = [item for kind in kinds for item in declared[kind]], ca.vertsplit(numbers[name])
        for i, item in enumerate(items):
            if item.last:
                steps.append(Sum(ca.SX.sym(name), link.last * rows[i]))
                rows[i] = steps[-1].symbols
        columns[name] = Vector(ca.densify(stack(rows)), tuple(not item.last for item in items))
    return [carry(link.last, ca.SX(1), ca.SX(0), inward=True), *steps], columns
