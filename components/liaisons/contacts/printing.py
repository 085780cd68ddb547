"""Equations of contacts, for the documentation inside the FMU."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import casadi as ca

from liaisons.algebra import solve_symmetric
from liaisons.base.array_names import suffixed_name
from liaisons.contacts.modes import contact_numbers, contacts_of
from liaisons.language import MechanicalComponent
from liaisons.mechanics import Contact, Equation, Equations, row_equations


@dataclass(frozen=True, eq=False)
class ContactLaws:
    """Contacts of a mechanism, with what their equations consist of.

    :param numbers: columns of :func:`contact_numbers` by name.
    :param along: gradient C of their rates (contacts, rates).
    :param compliance: C A⁻¹ Cᵀ (contacts, contacts).
    :param free_accelerations: along the contacts while no contact force acts (contacts,).
    """

    contacts: tuple[Contact, ...]
    numbers: Mapping[str, ca.SX]
    along: ca.SX
    compliance: ca.SX
    free_accelerations: ca.SX


def contact_laws(equations: Equations) -> ContactLaws | None:
    """Contacts of a mechanism, to be printed; None if there are none."""
    m, contacts = equations.mechanism, contacts_of(equations.mechanism)
    if not contacts:
        return None
    numbers = contact_numbers(m)
    along = ca.jacobian(numbers["v"], m.free.q_dot)
    compliance = ca.sparsify(along @ solve_symmetric(equations.mass_matrix, along.T))
    held = equations.in_motion(m.dot(numbers["v"]))
    freely = ca.substitute(held, m.contact_forces, ca.SX.zeros(len(contacts)))
    return ContactLaws(contacts, numbers, along, compliance, freely)


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
