"""From a chain of n links to the Model that an FMU back end takes."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import casadi as ca

from liaisons.expressions.algebra import stack
from liaisons.expressions.row_graphs import graph
from liaisons.expressions.rows import RowProgram, Step, Sum, Vector, carry, renamed, row_program, substituted
from liaisons.language import names
from liaisons.language.chain import Chain, column
from liaisons.language.variables import Dimension, Port, Variable
from liaisons.mechanics.bookkeeping import MEMORY, Vectors, definitions
from liaisons.mechanics.chains.link import ChainLink, link_of
from liaisons.mechanics.chains.sweeps import Base, Motion, inertias, momenta, motion
from liaisons.mechanics.model import ActiveInput, Model
from liaisons.mechanics.printing import checked_against, of_chain
from liaisons.mechanics.variables import moving_states

_VECTORS = {
    "start": ("tuk", "ym"),
    "derivatives": ("tyuk", "y"),
    "outputs_function": ("tyukm", "z"),
    "jump": ("tyukm", "y"),
    "remember": ("tyukm", "m"),
    "nominals": ("tyuk", "y"),
}
"""Which vectors of Model the functions take, and which they return."""


@cache
def chain_model(component: type[Chain], n: int) -> Model:
    """Lay the chain of n links out as variables and functions (DESIGN: names in an FMU).

    :param component: a subclass of Chain.
    :param n: how many links, at least ``component.n.minimum``.
    """
    m = component(n)
    dimension = Dimension("n", n, component.n.description)
    parameters, inputs = _parameters(component, dimension), _inputs(m, dimension)
    given = {v.name: m.symbols.get(v.name, ca.SX.sym(v.name)) for v in (*parameters, *inputs)}
    link = _driven(link_of(m), m, given)

    # The vectors of Model, with one symbol for a number, or for the numbers of all links.
    t, work, dissipated = (ca.SX.sym(name) for name in ("t", "work", "dissipated"))
    y = ca.vertcat(link.q, link.p, work, dissipated)
    u, k = (stack(given[v.name] for v in group) for group in (inputs, parameters))

    base, slope = _base(m)
    moving = motion(link, base)
    steps = [carry(link.bonded, ca.SX(m.base() is not None), ca.SX(1)), *moving.steps]
    energy = moving.kinetic_energy + moving.potential_energy
    to_start, initial, energy_at_start = _start(link, base, given, steps, energy)
    to_sizes, nominals = _nominals(component, link)

    forces = slope.T @ moving.base_force  # λ of the operator (M eq. 27)
    power = ca.dot(forces, m.s_dot) + moving.power
    dissipation = moving.dissipation
    outputs = [
        *_of_coordinates(dimension, link, m, moving),
        *(row for i, s in enumerate(m.actives) for row in names.of_active(s, forces[i], m.s_dot[i])),
        *_of_points(m, dimension, moving),
        *names.of_energies(moving.kinetic_energy, moving.potential_energy, power, dissipation),
        *(names.of_calculated(c, ca.SX(getattr(m, c.name))) for c in component.calculated_parameters),
    ]
    mismatches = names.mismatches(m.actives)
    found = definitions(
        Vectors(t, y, u, k),
        initial=ca.vertcat(initial, 0, 0),
        rates=ca.vertcat(moving.rates, moving.momentum_rates, power, dissipation),
        energy=energy,
        outputs=outputs,
        nominals=nominals,
        energy_at_start=energy_at_start,
        mismatches=mismatches,
    )
    shapes = {
        "t": (False,),
        "y": (True,) * (2 * link.q.shape[0]) + (False, False),
        "u": _shape(inputs),
        "k": _shape(parameters),
        "m": (False,) * (len(MEMORY) + len(mismatches)),
        "z": _shape(variable for variable, _ in outputs),
    }
    programs = _programs(found, [*steps, *to_start, *to_sizes], shapes, n)
    functions: dict[str, Any] = {name: graph(of) for name, of in programs.items()}
    at = [ca.MX.sym(name, functions["derivatives"].numel_in(i)) for i, name in enumerate("tyuk")]
    return Model(
        name=component.__name__,
        module=component.__module__,
        description=component.summary(),
        documentation=inspect.getdoc(component) or component.__name__,
        parameters=parameters,
        inputs=inputs,
        outputs=tuple(variable for variable, _ in outputs),
        states=moving_states(*(q.name for q in m.coordinates), *(f"p_{q.name}" for q in m.coordinates)),
        memory=(*MEMORY, *mismatches),
        **functions,
        programs=tuple(programs.values()),
        conditions=ca.Function("conditions", at, [ca.MX(0, 1)]),
        condition_texts=(),
        events=ca.Function("events", at[3:], [ca.MX(0, 1)]),
        active=tuple(ActiveInput(s.name, f"{s.name}_dot", f"{s.name}_ddot") for s in component.actives),
        ports=_ports(m),
        experiment=component.experiment,
        equations=of_chain(m),
        closed_form=checked_against(component),
        dimensions=(dimension,),
    )


def _programs(
    found: Mapping[str, Any], steps: Sequence[Step], shapes: Mapping[str, tuple[bool, ...]], n: int
) -> dict[str, RowProgram]:
    return {
        name: row_program(
            name.removesuffix("_function"),
            n,
            [Vector(x, shapes[vector]) for x, vector in zip(found[name][0], taken, strict=True)],
            steps,
            [Vector(ca.densify(x), shapes[vector]) for x, vector in zip(found[name][1:], returned, strict=True)],
        )
        for name, (taken, returned) in _VECTORS.items()
    }


def _parameters(component: type[Chain], dimension: Dimension) -> tuple[Variable, ...]:
    starts = (variable for q in component.coordinates for variable in names.start_of(q, dimension))
    return (*names.declared_parameters(component), *starts)


def _inputs(m: Chain, dimension: Dimension) -> tuple[Variable, ...]:
    unit = _point_units(m)
    return (
        *(variable for s in m.actives for variable in names.triple(s)),
        *(variable for q in m.coordinates for variable in names.forces_on(q, dimension)),
        *(names.load_at(name, unit[name], dimension) for name in m.point_components),
    )


def _of_coordinates(dimension: Dimension, link: ChainLink, m: Chain, moving: Motion) -> list[names.Row]:
    columns = (link.q, moving.rates, moving.accelerations, link.p, moving.momentum_rates)
    return [
        row
        for i, item in enumerate(m.coordinates)
        for row in names.of_coordinate(item, *(column[i] for column in columns), dimension=dimension)
    ]


def _of_points(m: Chain, dimension: Dimension, moving: Motion) -> list[names.Row]:
    columns = (moving.points, moving.point_rates, moving.point_accelerations)
    places = {point.name: point for point in m.points}
    return [
        row
        for i, name in enumerate(m.point_components)
        for row in names.of_point(
            name, places[name.rpartition("_")[0]], *(column[i] for column in columns), dimension=dimension
        )
    ]


def _ports(m: Chain) -> tuple[Port, ...]:
    return (
        *(names.port(q.name, q.unit, "free") for q in m.coordinates),
        *(names.port(s.name, s.unit, "active") for s in m.actives),
        *(names.port(name, unit, "point") for name, unit in _point_units(m).items()),
    )


def _point_units(m: Chain) -> dict[str, str]:
    unit = {point.name: point.unit for point in m.points}
    return {name: unit[name.rpartition("_")[0]] for name in m.point_components}


def _driven(link: ChainLink, m: Chain, given: Mapping[str, ca.SX]) -> ChainLink:
    """The link with the forces and loads that are given to it as inputs."""
    forces, loads = (stack(given[f"{q.name}{end}"] for q in m.coordinates) for end in ("_force", "_load"))
    return replace(link, drive=forces - loads, loads=stack(given[f"{name}_load"] for name in m.point_components))


def _base(m: Chain) -> tuple[Base, ca.SX]:
    """Motion of the first joint w = B(s), and B_s, (d, a)."""
    components = m.base()
    if components is None:
        d = m.w.shape[0]
        return Base(*(ca.SX.zeros(d) for _ in range(3))), ca.SX(d, 0)
    place = column(components)
    velocity = m.dot(place)
    return Base(place, velocity, m.dot(velocity)), ca.jacobian(place, m.s)


def _start(
    link: ChainLink, base: Base, given: Mapping[str, ca.SX], steps: Sequence[Step], energy: ca.SX
) -> tuple[list[Step], ca.SX, ca.SX]:
    """(steps, q and p, energy) at the start."""
    q_0, v_0 = (stack(given[f"{q}{end}"] for q in ca.vertsplit(link.q)) for end in ("_0", "_dot_0"))
    before, p_0 = renamed(*momenta(link, base))
    at_start = [(link.q, q_0), (link.v, v_0)]
    before, p_0 = [step.rewritten(lambda x: substituted(x, at_start)) for step in before], substituted(p_0, at_start)
    after, energy_0 = renamed(steps, energy)
    at_start = [(link.q, q_0), (link.p, p_0)]
    after = [step.rewritten(lambda x: substituted(x, at_start)) for step in after]
    return [*before, *after], ca.vertcat(q_0, p_0), energy_0


def _nominals(component: type[Chain], link: ChainLink) -> tuple[list[Step], ca.SX]:
    """Sizes of the states: of q as declared, of p and of the energies what that size a second amounts to."""
    sizes, energy = ca.SX(ca.DM([q.nominal for q in component.coordinates])), ca.SX.sym("energy")
    steps, inertia = inertias(link)
    return [*steps, Sum(energy, ca.dot(inertia, sizes**2) / 2)], ca.vertcat(sizes, inertia * sizes, energy, energy)


def _shape(group: Iterable[Variable]) -> tuple[bool, ...]:
    return tuple(variable.dimension is not None for variable in group)
