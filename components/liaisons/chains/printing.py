"""Equations of a link, for the documentation inside the FMU."""

import casadi as ca

from liaisons.algebra import stack
from liaisons.chains.chain import Chain
from liaisons.contacts import friction_equations
from liaisons.mechanics import Equation, dissipation_equation, row_equations


def of_chain(chain: Chain) -> tuple[Equation, ...]:
    """Equations of a link of a chain: energies, joint of the next link, points, contacts."""
    base = chain.base() or {}
    dissipated = ca.SX(chain.friction_coefficient()) * ca.SX(chain.kinetic_energy())
    dissipated += ca.SX(chain.dissipation_function()) + ca.SX(chain.bond_dissipation())
    points = chain.point_components()
    return (
        Equation("link", "kinetic_energy", ca.SX(chain.kinetic_energy())),
        Equation("link", "potential_energy", ca.SX(chain.potential_energy()) + ca.SX(chain.bond_energy())),
        *dissipation_equation("link", dissipated),
        *(Equation("joints", f"joint_{axis}[i+1]", ca.SX(position)) for axis, position in chain.tip().items()),
        *(Equation("joints", f"joint_{axis}[1]", ca.SX(position)) for axis, position in base.items()),
        *row_equations("points", points, stack(points.values())),
        *(Equation("unilateral", item.name, chain.expression_of(item)) for item in chain.unilaterals),
        *friction_equations(chain),
    )
