"""The motion of chains as a model: one loop over the links."""

from collections.abc import Iterable, Iterator

import casadi as ca

from liaisons import Chain
from liaisons.algebra import stack
from liaisons.base import units
from liaisons.chains import ChainLink, link_of
from liaisons.language import Variable
from liaisons_exchange.modelica_text.text import (
    MOTION,
    Section,
    component_clause,
    declaration,
    filled_lines,
    indented_lines,
    model_lines,
    number_literal,
    parameters,
    units_of,
)
from liaisons_pages.formulas import Notation

_ENDS = ("", "_dot", "_ddot")


def chain_motion_model(component: type[Chain]) -> list[str]:
    """Return lines of the model ``Motion`` of a chain.

    ``pi`` and ``phi`` are ∂L/∂ẇ and ∂L/∂w of the links beyond a joint w, with outer forces.
    """
    component.refuse_contacts("Modelica text of a chain", "import its FMU")
    m, axes = component(), component.joint.axes
    link, points, notation = link_of(m), [*m.point_components()], Notation.from_component(component)
    pi, phi, pi_dot = (stack(ca.SX.sym(f"{name}_{axis}") for axis in axes) for name in ("pi", "phi", "pi_dot"))
    beyond, names = ca.vertsplit(ca.vertcat(pi, phi, pi_dot)), [item.name for item in component.coordinates]
    Q, attached = (stack(ca.SX.sym(f"Q_{name}") for name in group) for group in (names, points))
    of_link = ca.vertcat(link.q, link.v, m.q_ddot, link.w, link.w_dot, m.w_ddot, link.bonded, Q, attached)
    indexed = {str(x): f"{x}[i]" for x in ca.vertsplit(of_link)}
    indexed |= {str(x): f"{x}[i + 1]" for x in beyond}
    loop, outside = Section(notation, indexed, "[i]"), Section(notation, {str(x): f"{x}[1]" for x in beyond})
    for row_names, column in _link_equations(m, link, (pi, phi, pi_dot), Q, attached):
        loop.add_rows(row_names, column)
    _add_base_equations(outside, m, pi_dot - phi)
    outside.statements += [f"{x}[n + 1] = 0;" for x in beyond]
    sums = [f"{name}_energy = sum({name});" for name in ("kinetic", "potential")]
    constants, initial = parameters(m, _start_literal, "[n]")
    bonded = "fill(1, n)" if m.base() is not None else "cat(1, {0}, ones(n - 1))"
    declarations = [
        f'parameter Integer n = {m.sizes["n"]} "{component.n.description}";',
        f'parameter Real bonded[n] = {bonded} "1: has a bond to the link before";',
        *constants,
        *_variable_declarations(m, loop, outside),
    ]
    equations = [
        *filled_lines(outside.statements),
        "for i in 1:n loop",
        *indented_lines(filled_lines(loop.statements)),
        "end for;",
        *filled_lines([*sums, "energy = kinetic_energy + potential_energy;"]),
    ]
    return model_lines(MOTION, declarations, equations, initial)


def _link_equations(
    m: Chain, link: ChainLink, beyond: tuple[ca.SX, ca.SX, ca.SX], Q: ca.SX, attached: ca.SX
) -> Iterator[tuple[Iterable[str], ca.SX]]:
    """Yield left-hand sides of the equations of the link i, and the columns that they are.

    :param beyond: π, φ and π̇ of the links beyond.
    :param Q: outer forces on its coordinates; ``attached``: those on its points.
    """
    v, w, w_dot, T, F = link.v, link.w, link.w_dot, link.kinetic, link.tip
    pi, phi, pi_dot = beyond
    L, F_q, F_w, F_dot = T - link.potential, ca.jacobian(F, link.q), ca.jacobian(F, w), link.rate(F)
    p_v, p_w = ca.jacobian(T, v).T, ca.jacobian(T, w_dot).T

    def generalised_force(x: ca.SX, x_dot: ca.SX) -> ca.SX:
        """Return the force along x: ∂L/∂x, outer forces, friction, and the forces of the links beyond."""
        applied = ca.jacobian(link.points, x).T @ attached - link.friction.forces_against(x_dot)
        return ca.jacobian(L, x).T + applied + ca.jacobian(F, x).T @ phi + ca.jacobian(F_dot, x).T @ pi

    def momentum_rate(p: ca.SX, slope: ca.SX) -> ca.SX:
        """Return the rate of a momentum p, with the momenta of the links beyond."""
        turning = ca.reshape(m.dot(ca.vec(ca.densify(slope))), *slope.shape)
        return m.dot(p) + turning.T @ pi + slope.T @ pi_dot

    axes, names = type(m).joint.axes, [item.name for item in type(m).coordinates]
    for form, names_of_form, column in (
        ("joint_{}[i + 1]", axes, F),
        ("joint_{}_dot[i + 1]", axes, F_dot),
        ("joint_{}_ddot[i + 1]", axes, m.dot(m.dot(F))),
        ("der({}[i])", names, v),
        ("p_{}[i]", names, p_v + F_q.T @ pi),
        ("pi_{}[i]", axes, p_w + F_w.T @ pi),
        ("der(p_{}[i])", names, Q + generalised_force(link.q, v)),
        ("phi_{}[i]", axes, generalised_force(w, w_dot)),
        ("der(p_{}[i])", names, momentum_rate(p_v, F_q)),
        ("pi_dot_{}[i]", axes, momentum_rate(p_w, F_w)),
        ("{}[i]", [*m.point_components()], link.points),
        ("{}[i]", ("kinetic", "potential"), ca.vertcat(T, link.potential)),
    ):
        yield map(form.format, names_of_form), column


def _add_base_equations(outside: Section, m: Chain, on_base: ca.SX) -> None:
    """Add the equations of the joint to the base, of its operators' forces and of parameters that are calculated.

    :param on_base: force of the chain on its first joint.
    """
    base = m.base()
    joint = ca.SX.zeros(len(type(m).joint.axes)) if base is None else m.joint_column(base)
    forces = ca.jacobian(joint, m.s).T @ on_base
    for end in _ENDS:
        outside.add_rows((f"joint_{axis}{end}[1]" for axis in type(m).joint.axes), joint)
        joint = m.dot(joint)
    outside.add_rows((f"{s.name}_force" for s in m.actives), forces)
    for item in m.calculated_parameters:
        outside.add(item.name, getattr(m, item.name))


def _variable_declarations(m: Chain, loop: Section, outside: Section) -> list[str]:
    """Return the declarations of variables: those of which there is one, then those of all links."""
    unit = _units_of_chain(m)
    texts = {item.name: item.description for item in (*m.coordinates, *m.actives)}
    declared_names = [p.name for p in m.parameters] + ["bonded"]

    def variable(name: str, size: str = "") -> str:
        longer = " + 1" * name.startswith(("joint_", "pi_", "phi_"))
        return declaration(name + size.replace("n", f"n{longer}"), unit.get(name, ""), texts.get(name, ""))

    of_links = [
        name
        for name in loop.variables_except(*declared_names)
        if name not in unit or f"{name}[" in str(loop.statements)
    ]
    single = [
        *outside.variables_except(*declared_names, *of_links),
        *(f"{s.name}{end}" for s in m.actives for end in _ENDS),
        *("kinetic_energy", "potential_energy", "energy"),
    ]
    return [
        *component_clause("Real", map(variable, dict.fromkeys(single))),
        *component_clause("Real", (variable(name, "[n]") for name in of_links)),
    ]


def _units_of_chain(m: Chain) -> dict[str, str]:
    """Return the units of variables by name."""
    unit = units_of(m) | dict.fromkeys(("kinetic", "potential"), "J")
    for axis, of in type(m).joint.unit_of.items():
        unit |= {
            f"joint_{axis}": of,
            f"joint_{axis}_dot": units.rate(of),
            f"joint_{axis}_ddot": units.rate(units.rate(of)),
        }
        unit |= {f"pi_{axis}": units.momentum(of), f"phi_{axis}": units.force(of), f"pi_dot_{axis}": units.force(of)}
    return unit


def _start_literal(v: Variable) -> str:
    """Return the literal of a start value; that of an array has n elements."""
    if v.dimension and isinstance(v.start, tuple):
        return f"cat(1, {number_literal(v.start)}, zeros(n - {len(v.start)}))"
    return f"fill({number_literal(v.starts[0])}, n)" if v.dimension else number_literal(v.starts[0])
