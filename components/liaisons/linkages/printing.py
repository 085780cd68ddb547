"""Equations of a linkage for the documentation inside the FMU, frame by frame."""

from typing import Any

import casadi as ca

from liaisons.algebra import at_zero
from liaisons.contacts import contact_equations
from liaisons.linkages.dynamics import elastic_forces
from liaisons.linkages.linkage import Linkage
from liaisons.linkages.recursion import Recursion
from liaisons.mechanics import Equation, Equations, constraint_equations, row_equations

_SPATIAL = {"v": ("omega", "v"), "h": ("L", "P"), "w": ("", "g"), "W": ("M", "G")}
"""Angular and linear parts of spatial vectors."""

_PRINTED = 200
"""Number of operations of its Lagrangian above which the equations of a linkage are written frame by frame."""


def of_large_linkage(equations: Equations) -> tuple[Equation, ...] | None:
    """Equations of a linkage that is too large for them to be printed without its frames; None of any other."""
    m: Any = equations.mechanism
    is_large = m.has_derived_energies and ca.n_nodes(equations.lagrangian) > _PRINTED
    return of_linkage(equations, m) if is_large else None


def of_linkage(equations: Equations, m: Linkage) -> tuple[Equation, ...]:
    """Equations of a linkage by recursion over its frames, short ones for each frame."""
    rows: list[Equation] = []

    def share(letter: str, i: int, vector: ca.SX) -> ca.SX:
        names = [f"{part}_{m.frames[i].name}_{axis}" for part in _SPATIAL[letter] for axis in "xyz"]
        symbols = [ca.SX.sym(name) if vector.sparsity().has_nz(k, 0) else ca.SX(1, 1) for k, name in enumerate(names)]
        rows.extend(Equation(f"spatial_{letter}", name, vector[k]) for k, name in enumerate(names) if symbols[k].nnz())
        return ca.vertcat(*symbols)

    recursion = Recursion(m, share)
    momenta = [f"p_{rate}".removesuffix("_dot") for rate in ca.vertsplit(m.free.q_dot)]
    on_free = equations.applied_forces[: m.free.q_dot.shape[0], 0]
    unloaded = at_zero(on_free, equations.applied.point_loads)
    slope, applied = recursion.lagrangian_gradient, unloaded + elastic_forces(m)[0]
    return (
        *rows,
        *row_equations("momenta", momenta, recursion.generalised_momenta),
        *row_equations("motion", [f"{name}_dot" for name in momenta], slope + applied),
        *constraint_equations(equations),
        *contact_equations(equations),
    )
