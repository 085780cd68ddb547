"""From a chain of n links to the Model that an FMU back end takes."""

from __future__ import annotations

import inspect
from functools import cache

import casadi as ca

from liaisons.mechanics import variables
from liaisons.mechanics.bookkeeping import MEMORY, Vectors, function, functions
from liaisons.mechanics.chains.chain import Chain, column, link_of
from liaisons.mechanics.chains.motion import Base, Motion, inertias, momenta, motion
from liaisons.mechanics.chains.sweeps import Columns
from liaisons.mechanics.model import ActiveInput, Dimension, Model, Variable
from liaisons.mechanics.printing import closed_form, of_chain


@cache
def assemble(component: type[Chain], n: int) -> Model:
    """Lay the chain of n links out as variables and functions (DESIGN: names in an FMU).

    :param component: a subclass of Chain.
    :param n: how many links, at least ``component.n.minimum``.
    """
    m = component(n)
    link, dimension = link_of(m), Dimension("n", n, component.n.description)
    parameters, inputs = _parameters(component, dimension), _inputs(m, dimension)
    f = len(component.coordinates)

    # The vectors of Model, and what their parts are called.
    t = ca.MX.sym("t")
    y = ca.MX.sym("y", 2 * f * n + 2)
    u, k = (ca.MX.sym(name, sum(v.count for v in found)) for name, found in (("u", inputs), ("k", parameters)))
    given, values = _by_name(parameters, k), _by_name(inputs, u)
    shared = ((m.parameter_column, k[: len(component.parameters)]),) if component.parameters else ()
    s, s_dot, s_ddot = (_gather(values, [f"{s.name}{end}" for s in m.actives]) for end in ("", "_dot", "_ddot"))
    base, slope = _base(m, shared, s, s_dot, s_ddot)
    q, p = (ca.reshape(y[i * f * n : (i + 1) * f * n], n, f).T for i in (0, 1))
    names = [q.name for q in component.coordinates]
    drives = _rows(values, [f"{q}_force" for q in names]) - _rows(values, [f"{q}_load" for q in names])
    loads = _rows(values, [f"{name}_load" for name in m.point_components])
    bonded = ca.horzcat(0 if m.base() is None else 1, ca.MX.ones(1, n - 1))
    chain = Columns(n, ((link.bonded, bonded),), shared)

    moving = motion(link, base, chain & [(link.q, q), (link.p, p), (link.drive, drives), (link.loads, loads)])
    q_0, v_0 = (_rows(given, [f"{q}{end}_0" for q in names]) for end in ("", "_dot"))
    p_0 = momenta(link, base, chain & [(link.q, q_0), (link.v, v_0)])

    forces = slope.T @ moving.base_force  # λ of the operator (M eq. 27)
    eta = _shared(link.eta, shared)
    power = ca.dot(forces, s_dot) + moving.power
    dissipation = 2 * eta * moving.kinetic_energy
    outputs = [
        *_of_coordinates(component, dimension, q, p, moving),
        *(row for i, s in enumerate(m.actives) for row in variables.of_active(s, forces[i], s_dot[i])),
        *_of_points(m, dimension, moving),
        *variables.of_energies(moving.kinetic_energy, moving.potential_energy, power, dissipation),
        *(variables.of_calculated(c, _shared(getattr(m, c.name), shared)) for c in component.calculated_parameters),
    ]
    rates = ca.vertcat(_column(moving.rates), _column(moving.momentum_rates), power, dissipation)
    return Model(
        name=component.__name__,
        description=component.summary(),
        documentation=inspect.getdoc(component) or component.__name__,
        parameters=parameters,
        inputs=inputs,
        outputs=tuple(variable for variable, _ in outputs),
        states=variables.moving(*names, *(f"p_{q}" for q in names)),
        memory=MEMORY,
        **functions(
            Vectors(t, y, u, k),
            initial=ca.vertcat(_column(q_0), _column(p_0), 0, 0),
            rates=rates,
            energy=moving.kinetic_energy + moving.potential_energy,
            outputs=[(variable, _column(expression)) for variable, expression in outputs],
            nominals=_nominals(component, inertias(link, base, chain & [(link.q, q)])),
        ),
        conditions=function("conditions", [t, y, u, k], ca.MX(0, 1)),
        condition_texts=(),
        events=function("events", [k], ca.MX(0, 1)),
        active=tuple(ActiveInput(s.name, f"{s.name}_dot", f"{s.name}_ddot") for s in component.actives),
        ports=_ports(m),
        experiment=component.experiment,
        equations=of_chain(m),
        closed_form=closed_form(component),
        dimensions=(dimension,),
    )


def _parameters(component: type[Chain], dimension: Dimension) -> tuple[Variable, ...]:
    starts = (variable for q in component.coordinates for variable in variables.start_of(q, dimension))
    return (*variables.declared_parameters(component), *starts)


def _inputs(m: Chain, dimension: Dimension) -> tuple[Variable, ...]:
    unit = _point_units(m)
    return (
        *(variable for s in m.actives for variable in variables.triple(s)),
        *(variable for q in m.coordinates for variable in variables.forces_on(q, dimension)),
        *(variables.load_at(name, unit[name], dimension) for name in m.point_components),
    )


def _of_coordinates(
    component: type[Chain], dimension: Dimension, q: ca.MX, p: ca.MX, moving: Motion
) -> list[variables.Row]:
    matrices = (q, moving.rates, moving.accelerations, p, moving.momentum_rates)
    return [
        row
        for i, item in enumerate(component.coordinates)
        for row in variables.of_coordinate(item, *(matrix[i, :] for matrix in matrices), dimension=dimension)
    ]


def _of_points(m: Chain, dimension: Dimension, moving: Motion) -> list[variables.Row]:
    matrices = (moving.points, moving.point_rates, moving.point_accelerations)
    places = {point.name: point for point in m.points}
    return [
        row
        for i, name in enumerate(m.point_components)
        for row in variables.of_point(
            name, places[name.rpartition("_")[0]], *(matrix[i, :] for matrix in matrices), dimension=dimension
        )
    ]


def _ports(m: Chain) -> tuple[variables.Port, ...]:
    return (
        *(variables.port(q.name, q.unit, "free") for q in m.coordinates),
        *(variables.port(s.name, s.unit, "active") for s in m.actives),
        *(variables.port(name, unit, "point") for name, unit in _point_units(m).items()),
    )


def _point_units(m: Chain) -> dict[str, str]:
    unit = {point.name: point.unit for point in m.points}
    return {name: unit[name.rpartition("_")[0]] for name in m.point_components}


def _base(m: Chain, shared: tuple, s: ca.MX, s_dot: ca.MX, s_ddot: ca.MX) -> tuple[Base, ca.MX]:
    """Motion of the first joint w = B(s), and B_s, (d, a)."""
    d, components = len(type(m).joint.axes), m.base()
    if components is None:
        return Base(*(ca.MX(d, 1) for _ in range(3))), ca.MX(d, 0)
    place = column(components)
    velocity = m.dot(place)
    symbols = [m.s, m.s_dot, m.s_ddot, *(symbol for symbol, _ in shared)]
    motion_of = ca.Function("base", symbols, [place, velocity, m.dot(velocity), ca.jacobian(place, m.s)])
    w, w_dot, w_ddot, slope = motion_of.call([s, s_dot, s_ddot, *(numbers for _, numbers in shared)])
    return Base(w, w_dot, w_ddot), slope


def _nominals(component: type[Chain], inertia: ca.MX) -> ca.MX:
    """Sizes of the states: of q as declared, of p and of the energies what that size a second amounts to."""
    sizes = ca.repmat(ca.MX(ca.DM([q.nominal for q in component.coordinates])), 1, inertia.shape[1])
    energy = ca.sum1(_column(inertia * sizes**2)) / 2
    return ca.vertcat(_column(sizes), _column(inertia * sizes), energy, energy)


def _shared(expression: ca.SX, shared: tuple) -> ca.MX:
    """An expression of the parameters alone."""
    value = ca.Function("shared", [symbol for symbol, _ in shared], [ca.densify(ca.SX(expression))])
    return value.call([ca.MX(numbers) for _, numbers in shared])[0]


def _by_name(found: tuple[Variable, ...], vector: ca.MX) -> dict[str, ca.MX]:
    """Pieces of a vector, (count, 1) each, by the names of the variables that they belong to."""
    ends = [0]
    for variable in found:
        ends.append(ends[-1] + variable.count)
    pieces = ca.vertsplit(vector, ends) if found else []
    return {variable.name: piece for variable, piece in zip(found, pieces, strict=True)}


def _gather(values: dict[str, ca.MX], names: list[str]) -> ca.MX:
    return ca.vertcat(*(values[name] for name in names)) if names else ca.MX(0, 1)


def _rows(values: dict[str, ca.MX], names: list[str]) -> ca.MX:
    """Arrays as rows of a matrix, one column a link."""
    return ca.vertcat(*(values[name].T for name in names)) if names else ca.MX(0, 1)


def _column(matrix: ca.MX) -> ca.MX:
    """Rows of a matrix one after the other, as a column."""
    whole = ca.MX(matrix)
    return ca.MX.zeros(whole.numel(), 1) if whole.nnz() == 0 else ca.vec(whole.T)
