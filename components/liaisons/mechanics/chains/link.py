"""The terms of one link of a chain, as the methods of the component give them."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from liaisons.expressions.algebra import stack
from liaisons.language.chain import Chain
from liaisons.mechanics.friction import Dissipation


@dataclass(frozen=True, eq=False)
class ChainLink:
    """The terms of one link: f coordinates, d axes of the joint, m point components; CasADi SX."""

    q: ca.SX  # coordinates (f,)
    v: ca.SX  # their rates
    p: ca.SX  # and momenta
    w: ca.SX  # joint (d,)
    w_dot: ca.SX
    drive: ca.SX  # q_force − q_load (f,)
    loads: ca.SX  # at the points (m,)
    bonded: ca.SX  # 0 for the first link of a free end, else 1
    tip: ca.SX  # F(q, w), the joint of the next link (d,)
    points: ca.SX  # (m,)
    kinetic: ca.SX  # T
    potential: ca.SX  # V
    friction: Dissipation

    def rate(self, expression: ca.SX) -> ca.SX:
        """d/dt of a column of functions of the motion, less what accelerations bring."""
        return ca.jtimes(expression, ca.vertcat(self.q, self.w), ca.vertcat(self.v, self.w_dot))


def link_of(m: Chain) -> ChainLink:
    """The terms of one link, as the methods of the component give them."""
    bonded, points = ca.SX.sym("bonded"), stack(m.point_components().values())
    kinetic = ca.SX(m.kinetic_energy())
    rubbing = ca.SX(m.dissipation_function()) + bonded * ca.SX(m.bond_dissipation())
    return ChainLink(
        q=m.q,
        v=m.q_dot,
        p=ca.SX.sym("p", m.q.shape[0]),
        w=m.w,
        w_dot=m.w_dot,
        drive=ca.SX.sym("drive", m.q.shape[0]),
        loads=ca.SX.sym("loads", points.shape[0]),
        bonded=bonded,
        tip=m.place(m.tip()),
        points=points,
        kinetic=kinetic,
        potential=ca.SX(m.potential_energy()) + bonded * ca.SX(m.bond_energy()),
        friction=Dissipation(ca.SX(m.friction_coefficient()), kinetic, rubbing),
    )
