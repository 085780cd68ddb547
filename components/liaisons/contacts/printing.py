"""Equations of contacts, for the documentation inside the FMU."""

from collections.abc import Iterator

import casadi as ca

from liaisons.algebra import solve_symmetric
from liaisons.base.array_names import suffixed_name
from liaisons.contacts.modes import contact_numbers
from liaisons.language import MechanicalComponent
from liaisons.mechanics import Equation, Equations, row_equations


def contact_equations(equations: Equations) -> Iterator[Equation]:
    """Yield gaps, impacts (rate v, restitution e, compliance G = C A⁻¹ Cᵀ) and thresholds of friction as equations."""
    m = equations.mechanism
    numbers, gaps = contact_numbers(m), [item.name for item in m.unilaterals]
    yield from row_equations("unilateral", gaps, numbers["gap"])
    C = ca.jacobian(numbers["v"], m.free.q_dot)[: len(gaps), :]
    G = C @ solve_symmetric(equations.mass_matrix, C.T) if gaps else ca.SX(0, 0)
    for i, name in enumerate(gaps):
        yield Equation("impacts", f"v_{name}", numbers["v"][i])
        yield Equation("impacts", f"e_{name}", numbers["restitution"][i])
        yield from row_equations("impacts", [f"G[{name},{other}]" for other in gaps[i:]], G[i, i:].T)
    yield from friction_equations(m)


def friction_equations(m: MechanicalComponent) -> Iterator[Equation]:
    """Yield relative velocities of dry friction, and their thresholds."""
    for item in m.dry_frictions:
        yield Equation("dry_friction", item.name, m.expression_of(item))
        normal = m.symbols[suffixed_name(item.normal, "_force")] if item.normal else ca.SX(1)
        for letter, threshold in zip("SK", dict.fromkeys((item.static, item.sliding)), strict=False):
            yield Equation("dry_friction", f"{letter}_{item.name}", m.contact_coefficient(threshold) * normal)
