"""Model of a chain of n links: its sweeps as vectors and functions."""

from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import Any

import casadi as ca

from liaisons.algebra import stack
from liaisons.chains.chain import Chain
from liaisons.chains.contacts import link_contact_numbers
from liaisons.chains.loops import ChainLoops
from liaisons.chains.pictures import chain_picture
from liaisons.chains.printing import of_chain
from liaisons.chains.row_functions import row_function
from liaisons.chains.rows import RowProgram, Step, Sum, Vector, carry, renamed_steps, row_program, substituted
from liaisons.chains.sweeps import (
    Base,
    ChainLink,
    LinkMotion,
    link_motion,
    link_of,
    mass_matrix_diagonal,
    momenta,
)
from liaisons.contacts import contacts_of
from liaisons.language import Variable
from liaisons.mechanics import (
    MEMORY,
    SIGNATURES,
    Model,
    contact_functions,
    contact_outputs,
    declared_fields,
    mechanical_outputs,
    memory_names,
    model_functions,
    with_energy_accounting,
)


def model_of(component: type[Chain], n: object) -> Model:
    """Model of a chain of n links, as declared by default."""
    return chain_model(component, component(n).sizes["n"])


@cache
def chain_model(component: type[Chain], n: int) -> Model:
    """Model of a chain of n links, laid out as variables and functions; names: docs/reference/fmu.md.

    :param component: a subclass of Chain.
    :param n: how many links, at least 2.
    """
    m = component(n)
    layout = m.layout()
    symbols = {v.name: m.symbols.get(v.name, ca.SX.sym(v.name)) for v in (*layout.parameters, *layout.inputs)}
    link, base = link_of(m, symbols), _base(m)
    vectors, shapes = _vectors(m, link, symbols), _shapes(m, link)
    moving = link_motion(link, base)
    more, numbers = link_contact_numbers(m, link, base, moving)
    steps = [carry(link.bonded, ca.SX(m.base() is not None), ca.SX(1)), more[0], *moving.steps, *more[1:]]
    energy = moving.kinetic_energy + moving.potential_energy
    to_start, initial, energy_at_start = _start_steps(link, base, symbols, steps, energy)
    to_sizes, nominals = _nominal_states(component, link)
    rates, outputs = _rates_and_outputs(m, link, base, moving, numbers)
    results = with_energy_accounting(
        vectors,
        layout,
        initial=initial,
        rates=rates,
        energy=energy,
        outputs=outputs,
        nominals=nominals,
        energy_at_start=energy_at_start,
    )
    drawable = symbols | {q.name: m.symbols[q.name] for q in m.coordinates} | m.point_components()
    rows = {letter: Vector(x, shapes[letter]) for letter, x in vectors.items()}
    drawing, draw = chain_picture(m, drawable, {letter: rows[letter] for letter in "tyuk"})
    steps += [*to_start, *to_sizes]
    programs = _row_programs(rows, results, steps, shapes, n)
    columns = {name: row_program(name, n, [*rows.values()], steps, [column]) for name, column in numbers.items()}
    return Model(
        **declared_fields(m),
        **(_unrolled_functions(m, rows, programs, columns) if contacts_of(m) else _loop_functions(m, programs)),
        equations=of_chain(m),
        picture=drawing.document,
        drawn=drawing.variables,
        draw=draw,
    )


def _vectors(m: Chain, link: ChainLink, symbols: Mapping[str, ca.SX]) -> dict[str, ca.SX]:
    """Vectors of the model's functions by letter, with one symbol for a number, or for the numbers of all links."""
    layout = m.layout()
    y = ca.vertcat(link.q, link.p, ca.SX.sym("work"), ca.SX.sym("dissipated"))
    u, k = (stack(symbols[v.name] for v in group) for group in (layout.inputs, layout.parameters))
    vectors = {"t": ca.SX.sym("t"), "y": y, "u": u, "k": k, "m": ca.SX.sym("m", len(memory_names(layout)))}
    return vectors | ({"x": m.contact_forces} if contacts_of(m) else {})


def _shapes(m: Chain, link: ChainLink) -> dict[str, tuple[bool, ...]]:
    """Whether each number of the vectors is one a link, by the letter of the vector."""
    layout = m.layout()
    discrete = (v for v in layout.outputs if v.variability == "discrete")
    return {
        "t": (False,),
        "y": (True,) * (2 * link.q.shape[0]) + (False, False),
        "u": _is_per_link(layout.inputs),
        "k": _is_per_link(layout.parameters),
        "m": (False,) * len(MEMORY) + _is_per_link(discrete),
        "z": _is_per_link(layout.outputs),
        "x": tuple(not item.last for item in m.contact_formulas),
    }


def _rates_and_outputs(
    m: Chain, link: ChainLink, base: Base, moving: LinkMotion, numbers: Mapping[str, Vector]
) -> tuple[ca.SX, list[ca.SX]]:
    """Rates of the states, and outputs in their order, with 0 for the energy balance."""
    forces = base.slope.T @ moving.base_force  # λ of the operator (M eq. 27)
    power = ca.dot(forces, m.s_dot) + moving.power
    rates = ca.vertcat(moving.rates, moving.momentum_rates, power, moving.dissipation)
    read = _outputs(m, link, moving, forces, rates)
    read |= contact_outputs(m, numbers["gap"].entries, numbers["v"].entries)
    return rates, [read.get(v.name, ca.SX(0)) for v in m.layout().outputs]


def _loop_functions(m: Chain, programs: Mapping[str, RowProgram]) -> dict[str, Any]:
    """Functions of a chain without contacts, as loops along its links: arguments of Model."""
    functions: dict[str, Any] = {name: row_function(program) for name, program in programs.items()}
    whole = {letter: ca.MX.sym(letter, functions["jump"].numel_in(i)) for i, letter in enumerate("tyukm")}
    functions |= model_functions(whole, {"conditions": ca.MX(0, 1), "events": ca.MX(0, 1)})
    loops = ChainLoops(tuple(programs.values()))
    return functions | {"loops": loops, "condition_texts": (), "memory": memory_names(m.layout())}


def _unrolled_functions(
    m: Chain, rows: Mapping[str, Vector], programs: Mapping[str, RowProgram], numbers: Mapping[str, RowProgram]
) -> dict[str, Any]:
    """Functions of a chain in the modes of its contacts, link by link: arguments of Model.

    Contacts at all links act on each other, so that there is no loop along the links.

    :param numbers: programs of the columns by which modes are chosen, which take all vectors.
    """
    layout, n = m.layout().flat(), m.sizes["n"]
    vectors = {letter: ca.SX.sym(letter, row.offsets(n)[-1]) for letter, row in rows.items()}

    def values(program: RowProgram, letters: Iterable[str]) -> list[ca.SX]:
        return row_function(program).call([vectors[letter] for letter in letters])

    results: dict[str, Any] = {"events": ca.SX(0, 1), "conditions": ca.SX(0, 1)}
    for name, program in programs.items():
        returned = values(program, SIGNATURES[name].arguments + "x")
        results[name] = tuple(returned) if len(returned) > 1 else returned[0]
    columns = {name: values(program, rows)[0] for name, program in numbers.items()}
    return contact_functions(
        contacts_of(m),
        vectors=vectors,
        forced=results,
        numbers=columns,
        layout=layout,
        memory=memory_names(layout),
        condition_texts=(),
    )


def _outputs(m: Chain, link: ChainLink, moving: LinkMotion, forces: ca.SX, rates: ca.SX) -> dict[str, ca.SX]:
    """Expressions of the output variables of a chain by name, without those of the energy balance."""
    columns = (moving.points, moving.point_rates, moving.point_accelerations)
    outputs = mechanical_outputs(
        m,
        m.layout(),
        rates,
        forces=(forces, m.s_dot),
        points={name: [column[i] for column in columns] for i, name in enumerate(m.point_components())},
        energies=(moving.kinetic_energy, moving.potential_energy),
    )
    for i, q in enumerate(m.coordinates):
        outputs |= {f"{q.name}_ddot": moving.accelerations[i], f"p_{q.name}": link.p[i]}
    return outputs


def _row_programs(
    vectors: Mapping[str, Vector],
    results: Mapping[str, Any],
    steps: Sequence[Step],
    shapes: Mapping[str, tuple[bool, ...]],
    n: int,
) -> dict[str, RowProgram]:
    """Row programs of the functions of a model from their results, by name."""
    programs: dict[str, RowProgram] = {}
    for name, value in results.items():
        if value is None:
            continue
        columns = value if isinstance(value, tuple) else (value,)
        signature = SIGNATURES[name]
        returned = [Vector(ca.densify(x), shapes[z]) for x, z in zip(columns, signature.results, strict=True)]
        taken = [vectors[letter] for letter in signature.arguments + "x" * ("x" in vectors)]
        programs[name] = row_program(name.removesuffix("_function"), n, taken, steps, returned)
    return programs


def _base(m: Chain) -> Base:
    """Joint of the first link, w = B(s), with its motion."""
    components = m.base()
    if components is None:
        zero = ca.SX.zeros(m.w.shape[0])
        return Base(zero, zero, zero, ca.SX(zero.shape[0], 0))
    position = m.joint_column(components)
    velocity = m.dot(position)
    return Base(position, velocity, m.dot(velocity), ca.jacobian(position, m.s))


def _start_steps(
    link: ChainLink, base: Base, symbols: Mapping[str, ca.SX], steps: Sequence[Step], energy: ca.SX
) -> tuple[list[Step], ca.SX, ca.SX]:
    """Steps that the states and the energy at the start need; column of the states; energy."""
    q_0, v_0 = (stack(symbols[f"{q}{end}"] for q in ca.vertsplit(link.q)) for end in ("_0", "_dot_0"))

    def with_values(pairs: list[tuple[ca.SX, ca.SX]], steps: Sequence[Step], result: ca.SX) -> tuple[list[Step], ca.SX]:
        steps, result = renamed_steps(steps, result)
        return [step.rewritten(lambda x: substituted(x, pairs)) for step in steps], substituted(result, pairs)

    before, p_0 = with_values([(link.q, q_0), (link.v, v_0)], *momenta(link, base))
    after, energy_0 = with_values([(link.q, q_0), (link.p, p_0)], steps, energy)
    return [*before, *after], ca.vertcat(q_0, p_0, 0, 0), energy_0


def _nominal_states(component: type[Chain], link: ChainLink) -> tuple[list[Step], ca.SX]:
    """Nominal values of the states, and the steps that they need: of q as declared, of p and energies at such rates."""
    sizes, energy = ca.SX(ca.DM([q.nominal for q in component.coordinates])), ca.SX.sym("energy")
    steps, inertia = mass_matrix_diagonal(link)
    return [*steps, Sum(energy, ca.dot(inertia, sizes**2) / 2)], ca.vertcat(sizes, inertia * sizes, energy, energy)


def _is_per_link(group: Iterable[Variable]) -> tuple[bool, ...]:
    """Whether each variable is an array with an element a link."""
    return tuple(variable.dimension is not None for variable in group)
