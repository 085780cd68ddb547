"""Results without solving the equations of motion: conservation laws, similarity, virial (K 2.4, 2.5, 2.7)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.algebra import at_zero, gradient, stack
from liaisons.base.array_names import suffixed_name
from liaisons.errors import ComponentError, suggestion
from liaisons.language import Mechanism, checked_scalar
from liaisons.mechanics import Equations
from liaisons_motion.analysis.numeric import checked_times
from liaisons_motion.analysis.phase_space import poisson_bracket
from liaisons_motion.analysis.quantity import (
    STATES,
    Quantity,
    Source,
    Values,
    all_rates,
    equations_of,
    generator_matrix,
    random_states,
    require_conservative,
    require_independent_coordinates,
    require_no_constraints,
    require_no_contacts,
    where_nonzero,
)

_FITTED = 1e-8
"""Relative error of coefficients that were fitted to numbers."""


def cyclic_coordinates(source: Source, **values: float) -> dict[str, Quantity]:
    """Constant momenta p = ∂L/∂q̇ of the coordinates that L does not contain (K eq. 32, 33).

    The operator may move the active coordinates.  Coordinates along which constraints, contacts, friction, drives or
    loads have a force are none.

    :param values: parameters, forces, or coordinates that are held, where they differ from their defaults.
    :returns: the momentum by the name of the coordinate, in the rates.
    :raises ComponentError: for an unknown symbol or a value outside its domain.
    """
    equations = equations_of(source)
    m, L = equations.mechanism, equations.lagrangian
    return {
        item.name: Quantity(equations, equations.momenta[k])
        for k, item in enumerate(m.coordinates)
        if not where_nonzero(equations, gradient(L, m.free.q[k]), values)
        and not _working_forces_text(equations, ca.SX.eye(m.free.q_dot.shape[0])[:, k], values)
    }


def noether(source: Source, field: Callable[[Any], Mapping[str, Any]], **values: float) -> Quantity:
    """Conserved quantity Σ ξ^k ∂L/∂q̇_k of a symmetry, the invariance of L under q → q + ε ξ(q) (K 2.4, eq. 43-52).

    On constraints L need be invariant there only.  Their forces, C ξ = 0, and those of contacts, friction, drives and
    loads must do no work along ξ.

    :param field: the symmetry, ξ by the names of the coordinates; those not named are kept.  A rotation is
        ``lambda m: {"x": -m.y, "y": m.x}``; that of an orientation, which has the axis in the inertial frame,
        ``lambda m: {"attitude": (0, 0, 1)}``.
    :param values: parameters and forces where they differ from their defaults.
    :returns: the conserved quantity, in the rates.
    :raises ComponentError: if δL = Σ (ξ^k ∂L/∂q_k + ξ̇^k ∂L/∂q̇_k) is not zero, or a force does work along ξ, with the
        name of the constraint or contact; for an unknown coordinate.
    """
    equations = equations_of(source)
    momenta = equations.mechanism.free.frame @ equations.momenta
    return Quantity(equations, ca.dot(_symmetry(equations, field, values), momenta))


def _symmetry(equations: Equations, field: Callable[[Any], Mapping[str, Any]], values: Values) -> ca.SX:
    """Components ξ of a field along the momenta; a ComponentError unless it is a symmetry, see :func:`noether`."""
    m, owner = equations.mechanism, equations.name
    components = dict(field(m))
    sizes = dict.fromkeys((q.name for q in m.coordinates), 1) | {item.name: 3 for item in m.orientations}
    for name in components:
        if name not in sizes:
            raise ComponentError(f"{owner}: a symmetry moves free coordinates, not {name!r}{suggestion(name, sizes)}")
    symbols = {str(symbol): symbol for symbol in ca.vertsplit(ca.vertcat(m.free.q, m.active.s, m.parameter_column))}
    shifts = {
        name: _checked_components(owner, name, components.get(name, (0.0,) * size), size)
        for name, size in sizes.items()
    }
    xi = stack(
        checked_scalar(type(m), f"noether[{name!r}]", part, symbols) for name, parts in shifts.items() for part in parts
    )
    slope = generator_matrix(equations).T @ gradient(equations.lagrangian, m.free.q)
    change = ca.dot(xi, slope) + ca.sum1(m.dot(xi) * (m.free.frame @ equations.momenta))
    if where := where_nonzero(equations, change, values):
        raise ComponentError(
            f"{owner}: the field {', '.join(f'{k}: {v}' for k, v in components.items())} is no symmetry: it changes L "
            f"{where}; choose a field that leaves T and V as they are"
        )
    if forces := _working_forces_text(equations, xi, values):
        raise ComponentError(f"{owner}: the field {forces} what it would conserve; choose one along which none works")
    return xi


@dataclass(frozen=True, eq=False)
class MomentumMap:
    """Momentum map J of a group that leaves L as it is: a component for each of its generators ξ_a."""

    components: Mapping[str, Quantity]  # J_a = Σ ξ_a^k p_k by the name of the generator
    structure: NDArray  # c with {J_a, J_b} = Σ_c c[a, b, c] J_c, in the sign of poisson_bracket; (k, k, k)

    def evaluate(self, **values: ArrayLike) -> dict[str, Any]:
        """Values of the components by name; see :meth:`Quantity.evaluate`."""
        return {name: component.evaluate(**values) for name, component in self.components.items()}


def momentum_map(
    source: Source, group: Mapping[str, Callable[[Any], Mapping[str, Any]]], **values: float
) -> MomentumMap:
    """Momentum map of a group of symmetries; the brackets of its components are combinations of these.

    :param group: generators by name, each a field of :func:`noether`, whose quantity is the component: of rotations in
        the plane and translations ``{"turn": lambda m: {"x": -m.y, "y": m.x}, "x": lambda m: {"x": 1.0}, "y": lambda
        m: {"y": 1.0}}``.  Together they must span all their brackets.
    :param values: parameters and forces where they differ from their defaults.
    :raises ComponentError: if a generator is no symmetry, as :func:`noether`; if a bracket is no combination of the
        components with constant coefficients, so that the generators span no group, or the action has no equivariant
        map, as translations in a magnetic field; for constraints.
    """
    equations = equations_of(source)
    require_no_constraints(equations, "a momentum map")
    fields = {name: _symmetry(equations, field, values) for name, field in group.items()}
    p, names = equations.mechanism.free.p, list(fields)
    maps = [Quantity(equations, ca.dot(xi, p)) for xi in fields.values()]
    samples = np.array([component.evaluate(**random_states(equations, values)) for component in maps])
    structure = np.zeros((len(names),) * 3)
    for a, first in enumerate(maps):
        for b, second in enumerate(maps[:a]):
            bracket = poisson_bracket(first, second)
            numbers = bracket.evaluate(**random_states(equations, values))
            structure[a, b] = np.linalg.lstsq(samples.T, numbers, rcond=None)[0]
            structure[b, a] = -structure[a, b]
            rest = bracket.expression - sum(c * J.expression for c, J in zip(structure[a, b], maps, strict=True))
            if where_nonzero(equations, rest, values, noise=_FITTED):
                raise ComponentError(
                    f"{equations.name}: the bracket of {names[b]} and {names[a]} is no combination of "
                    f"{', '.join(names)}; give the generators that are missing"
                )
    momenta = equations.mechanism.free.frame @ equations.momenta
    components = {name: Quantity(equations, ca.dot(xi, momenta)) for name, xi in fields.items()}
    return MomentumMap(components, structure)


def _working_forces_text(equations: Equations, xi: ca.SX, values: Values) -> str:
    """Text on the forces beside those of L that do work along ξ, as the end of a sentence; empty if none does."""
    m = equations.mechanism
    rows = ca.vertcat(equations.constraints.matrix, ca.jacobian(m.contact_rates(), m.free.q_dot))
    names = [*_liaison_names(m), *(item.name for item in m.dry_frictions)]
    direction = m.free.frame.T @ xi
    moved = [
        name
        for name, row in zip(names, ca.vertsplit(rows), strict=True)
        if where_nonzero(equations, row @ direction, values)
    ]
    if moved:
        return f"moves {', '.join(moved)}, whose forces change"
    if where_nonzero(equations, ca.dot(direction, _given_forces(equations)), values):
        return "moves against friction, drives or loads, which change"
    return ""


def _given_forces(equations: Equations) -> ca.SX:
    """Friction, drives and loads on the free coordinates: applied forces without those of constraints and contacts."""
    m = equations.mechanism
    forces = equations.applied_forces[: m.free.q_dot.shape[0], 0]
    return at_zero(forces, ca.vertcat(m.multipliers, m.active.force, m.contact_forces))


def _liaison_names(m: Mechanism) -> list[str]:
    """Names of constraints and unilateral liaisons, in the order of their rows in the equations."""
    return [item.name for item in (*m.constraints, *m.non_holonomic, *m.rheonomic_constraints, *m.unilaterals)]


def _checked_components(owner: str, name: str, value: Any, size: int) -> tuple[Any, ...]:
    """Components of a vector field along a coordinate or an orientation; a ComponentError unless ``size`` of them."""
    parts = tuple(value) if isinstance(value, (tuple, list)) else (value,)
    if len(parts) != size:
        raise ComponentError(f"{owner}: the field gives {len(parts)} components for {name}; it must give {size}")
    return parts


@dataclass(frozen=True)
class Similarity:
    """Mechanical similarity: V(λ r) = λ^h V(r), so that r → λ r, t → λ^(1 - h/2) t takes motions to motions."""

    degree: float  # h of K eq. 53
    held: tuple[str, ...] = ()  # lengths and constraints whose forces have a virial of their own

    @property
    def time_exponent(self) -> float:
        """Exponent 1 - h/2: times scale as lengths to this power (K eq. 56)."""
        return 1 - self.degree / 2

    def time_ratio(self, length_ratio: ArrayLike) -> Any:
        """Ratio of times τ'/τ = (L'/L)^(1 - h/2) for a ratio of lengths (K eq. 57)."""
        return np.asarray(length_ratio, dtype=float) ** self.time_exponent

    def mean_energies(self, energy: float) -> tuple[float, float]:
        """Long-time means T̄ = h E/(h + 2) and V̄ = 2 E/(h + 2) of a bounded motion (K eq. 75) [J].

        :raises ComponentError: for h = -2, where the mean is not determined, and where forces hold lengths.
        """
        if self.held:
            raise ComponentError(
                f"mean_energies: the forces that hold {', '.join(self.held)} have a virial of their own, so that h "
                "does not tell the means; take those of a motion"
            )
        if self.degree == -2:
            raise ComponentError("mean_energies: degree = -2 has no mean energies (E = 0); use virial()")
        return self.degree * energy / (self.degree + 2), 2 * energy / (self.degree + 2)


def similarity(source: Source, **values: float) -> Similarity:
    """Degree h of homogeneity of the potential, V(λ r) = λ^h V(r) (K eq. 53), by Euler's Σ r·∂V/∂r = h V (eq. 73).

    All coordinates in metres are scaled, free and active; angles are not.  Constraints and gaps must scale, too.

    :param values: parameters, and coordinates that are held and therefore not scaled.
    :raises ComponentError: if T is not of degree 2 in the lengths, V vanishes or is not homogeneous, a constraint or a
        gap does not scale; for friction, drives and loads.
    """
    equations = equations_of(source)
    m, owner = equations.mechanism, equations.name
    if m.dry_frictions:
        require_no_contacts(equations, "similarity")
    require_conservative(equations, "similarity", values)
    names = [item.name for item in (*m.coordinates, *m.actives) if item.unit == "m" and item.name not in values]
    _require_homogeneous_energy(equations, names, values)
    rates = all_rates(equations)
    V, lengths = equations.potential_energy, stack(m.symbols[name] for name in names)
    degree = _homogeneity_degree(equations, V, lengths, values)
    if degree is None:
        raise ComponentError(
            f"{owner}: the potential is not homogeneous in {', '.join(names)}: it has a length of its own; "
            "set that parameter to 0, or measure coordinates from the centre of force"
        )
    if np.isnan(degree):
        raise ComponentError(f"{owner}: the potential is zero and sets no scale of time; give it one, e.g. a gravity")
    residuals = ca.vertcat(equations.constraints.residuals, *(getattr(m, item.name) for item in m.unilaterals))
    for name, own in zip(_liaison_names(m), ca.vertsplit(residuals), strict=True):
        if ca.depends_on(own, rates) or _homogeneity_degree(equations, own, lengths, values) is None:
            raise ComponentError(
                f"{owner}: {name} does not scale with {', '.join(names)} alone; set a length of its own to 0, or "
                "describe the mechanism without it"
            )
    moved = (item.name for item in m.actives if item.name in names and item.start != 0)
    return Similarity(degree, tuple(dict.fromkeys([*moved, *_liaison_names(m)])))


def _homogeneity_degree(equations: Equations, expression: ca.SX, lengths: ca.SX, values: Values) -> float | None:
    """Degree of homogeneity of an expression in the lengths; NaN if it is zero, None if it is not homogeneous.

    By Euler's Σ r·∂f/∂r = k f: k from numbers, near the start if f is not 0 there, then as an identity.
    """
    if not where_nonzero(equations, expression, values, constrained=False):
        return np.nan
    change = ca.jtimes(expression, lengths, lengths)
    changes, numbers = Quantity(equations, ca.vertcat(change, expression)).numbers(
        random_states(equations, values, wide=True)
    )
    state = next((k for k in np.argsort(-np.abs(numbers[:STATES])) if numbers[k]), np.argmax(np.abs(numbers)))
    degree = float(changes[state] / numbers[state]) if numbers[state] else 0.0
    rest = change - degree * expression
    return None if where_nonzero(equations, rest, values, noise=_FITTED, constrained=False) else degree


@dataclass(frozen=True)
class Virial:
    """Means over the time τ of a motion; 2 T̄ - virial = boundary holds for any τ (K 2.7, p·r in place of p·ṙ)."""

    kinetic: float  # T̄ [J]
    potential: float  # V̄ [J]
    virial: float  # mean of -Σ r·F, which is Σ r·∂V/∂r without friction, drives and loads [J]
    boundary: float  # (p·r at the end - p·r at the start)/τ [J]

    @property
    def residual(self) -> float:
        """2 T̄ - virial - boundary [J]: zero up to the error of samples and quadrature."""
        return 2 * self.kinetic - self.virial - self.boundary


def virial(source: Source, time: ArrayLike, motion: Values, **values: float) -> Virial:
    """Virial theorem over a finite time, 2 T̄ - mean(Σ r·∂V/∂r) = [Σ p·r]/τ (K eq. 71, 72 before the limit).

    r are the free coordinates in metres; angles beside them do not enter.  The means are integrals of a cubic spline:
    fourth order in the distance of the samples.

    :param time: instants [s], shape (n,), increasing.
    :param motion: samples by name, ``q`` and ``q_dot`` of each coordinate, internal states, forces and active
        coordinates if they are not constant; shape (n,).
    :param values: parameters where they differ from their defaults.
    :raises ComponentError: if T is not of degree 2 in the lengths, or for samples that do not fit.
    """
    from scipy.interpolate import make_interp_spline

    equations = equations_of(source)
    require_independent_coordinates(equations, "the virial")
    m = equations.mechanism
    names = [item.name for item in m.coordinates if item.unit == "m"]
    _require_homogeneous_energy(equations, names, values)
    rows = [k for k, item in enumerate(m.coordinates) if item.name in names]
    r, T, V = m.free.q[rows], equations.kinetic_energy, equations.potential_energy
    force = equations.momentum_rates[rows] - gradient(T, r)
    quantities = Quantity(equations, ca.vertcat(T, V, -ca.dot(r, force), ca.dot(equations.momenta[rows], r)))
    for name in map(str, ca.vertsplit(ca.vertcat(m.free.q, m.free.q_dot, m.internal))):
        if name not in motion:
            raise ComponentError(f"{equations.name}: the motion lacks {name}; give coordinates and rates")
    samples = quantities.evaluate(**dict(motion), **values)
    t = checked_times(equations, time, samples.shape[1:])
    tau = t[-1] - t[0]
    spline = make_interp_spline(t, samples[:3], k=min(3, t.size - 1), axis=1)
    kinetic, potential, mean = spline.integrate(t[0], t[-1]) / tau
    return Virial(float(kinetic), float(potential), float(mean), float((samples[3, -1] - samples[3, 0]) / tau))


def _require_homogeneous_energy(equations: Equations, names: list[str], values: Values) -> None:
    """Raise a ComponentError unless T is of degree 2 in the lengths and their rates, and L = T - V."""
    m, T = equations.mechanism, equations.kinetic_energy
    lengths_and_rates = stack(m.symbols[suffixed_name(name, end)] for name in names for end in ("", "_dot"))
    excess = ca.jtimes(T, lengths_and_rates, lengths_and_rates) - 2 * T if names else T
    if where_nonzero(equations, excess, values):
        lengths = ", ".join(names) or "(none)"
        raise ComponentError(
            f"{equations.name}: the kinetic energy is not of degree 2 in the lengths {lengths}; "
            "set the parameters that are lengths to 0, or use coordinates in metres"
        )
    magnetic = equations.lagrangian - T + equations.potential_energy
    if where_nonzero(equations, magnetic, values):
        raise ComponentError(f"{equations.name}: L is not T - V; forces that depend on velocities have no degree")
