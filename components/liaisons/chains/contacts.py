"""Numbers of the contacts of a link by which modes are chosen."""

import casadi as ca

from liaisons.algebra import stack
from liaisons.chains.chain import Chain
from liaisons.chains.rows import Step, Sum, Vector, carry
from liaisons.chains.sweeps import Base, ChainLink, LinkMotion
from liaisons.contacts import contact_thresholds
from liaisons.mechanics import CONTACT_NUMBERS


def link_contact_numbers(
    m: Chain, link: ChainLink, base: Base, moving: LinkMotion
) -> tuple[list[Step], dict[str, Vector]]:
    """Steps that the numbers of the contacts of a link need, and columns of :data:`CONTACT_NUMBERS` by name."""
    rates, v, a = m.contact_rates(), link.v, moving.accelerations
    gaps = stack(map(m.expression_of, m.unilaterals))
    sizes = ca.SX(ca.DM([q.nominal for q in m.coordinates]))
    F_dot = link.rate(link.tip)
    w, w_dot, w_ddot = (ca.SX.sym(f"{name}_scale", link.w.shape[0]) for name in ("w", "w_dot", "w_ddot"))

    def term_sum(function: ca.SX, coordinates: ca.SX, joint: ca.SX) -> ca.SX:
        """Sum of the absolute terms of a function of q and w, from their sizes."""
        return ca.fabs(ca.jacobian(function, link.q)) @ coordinates + ca.fabs(ca.jacobian(function, link.w)) @ joint

    across, rest = ca.fabs(base.slope), link.rate(rates)
    moved, fast, forced = sizes + ca.fabs(link.q), sizes + ca.fabs(v), 1e-3 * sizes + ca.fabs(a)
    steps: list[Step] = [
        carry(w, across @ ca.fabs(m.s), term_sum(link.tip, moved, w)),
        carry(w_dot, across @ ca.fabs(m.s_dot), term_sum(link.tip, fast, w_dot)),
        carry(w_ddot, ca.fabs(base.w_ddot), term_sum(link.tip, forced, w_ddot) + ca.fabs(link.rate(F_dot))),
    ]
    along, over = ca.jacobian(rates, v), ca.jacobian(rates, link.w_dot)
    numbers = {
        "v": rates,
        "a": rest + along @ a + over @ moving.joint_accelerations,
        "rate_scale": ca.fabs(along) @ fast + ca.fabs(over) @ w_dot,
        "acceleration_scale": ca.fabs(along) @ forced + ca.fabs(over) @ w_ddot + ca.fabs(rest),
        "gap": gaps,
        "scale": term_sum(gaps, moved, w),
        **contact_thresholds(m),
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
