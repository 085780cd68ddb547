"""Expressions of the output variables that mechanisms and chains have in common."""

from collections.abc import Mapping, Sequence

import casadi as ca

from liaisons.base.array_names import suffixed_name
from liaisons.language import Layout, MechanicalComponent


def mechanical_outputs(
    m: MechanicalComponent,
    layout: Layout,
    rates: ca.SX,
    *,
    forces: tuple[ca.SX, ca.SX],
    points: Mapping[str, Sequence[ca.SX]],
    energies: tuple[ca.SX, ca.SX],
) -> dict[str, ca.SX]:
    """Expressions of the output variables by name, without those of the energy balance.

    :param rates: of the states, in the order of the layout.
    :param forces: of the active coordinates λ (M eq. 27) and the rates σ̇, columns.
    :param points: position, velocity and acceleration of each component of a point.
    :param energies: T and V.
    """
    outputs = dict(zip((state.derivative for state in layout.states), ca.vertsplit(rates), strict=True)) | m.symbols
    for s, force, rate in zip(m.actives, *map(ca.vertsplit, forces), strict=True):
        outputs |= {f"{s.name}_force": force, f"{s.name}_power": force * rate}
    for name, motion in points.items():
        outputs |= {f"{name}{end}": x for end, x in zip(("", "_dot", "_ddot"), motion, strict=True)}
    kinetic, potential = energies
    outputs |= {"kinetic_energy": kinetic, "potential_energy": potential, "energy": kinetic + potential}
    return outputs | {item.name: m.expression_of(item) for item in (*m.outputs, *m.calculated_parameters)}


def contact_outputs(m: MechanicalComponent, gaps: ca.SX, rates: ca.SX) -> dict[str, ca.SX]:
    """Expressions of the outputs of contacts by name: gaps, their rates, relative velocities.

    :param rates: of the unilateral liaisons, then the relative velocities.
    """
    names = [item.name for item in m.unilaterals]
    rubbing = [item.name for item in m.dry_frictions]
    names += [*(suffixed_name(name, "_dot") for name in names), *rubbing]
    return dict(zip(names, ca.vertsplit(ca.vertcat(gaps, rates)), strict=True))
