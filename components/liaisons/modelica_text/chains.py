"""The motion of chains as a class: one loop over the links."""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca

from liaisons import units
from liaisons.expressions.algebra import gradient
from liaisons.formulas import Notation
from liaisons.language import Chain
from liaisons.mechanics import assemble
from liaisons.mechanics.chains.sweeps import link_of
from liaisons.modelica_text.text import Section, bounds, declared, filled, indented, named, number, quoted


def chain_motion(component: type[Chain]) -> list[str]:
    """Lines of the model ``Motion``.

    Of the links beyond a joint are its momentum ``pi``, ∂L/∂ẇ, and ``phi``, ∂L/∂w and the forces from outside.
    """
    return _ChainMotion(component).lines()


class _ChainMotion:
    def __init__(self, component: type[Chain]) -> None:
        self.m = m = component()
        self.model, self.link = assemble(component), link_of(m)
        self.axes = [str(w).removeprefix("joint_") for w in ca.vertsplit(m.w)]
        self.points = list(m.point_components())
        self.unit_of = {v.name: v.unit for v in self.model.variables} | {
            f"joint_{axis}": unit for axis, unit in component.joint.unit_of.items()
        }
        beyond = [
            f"{name}_{axis}{end}" for name, end in (("pi", ""), ("phi", ""), ("pi", "_dot")) for axis in self.axes
        ]
        self.pi, self.phi, self.pi_dot = ca.vertsplit(
            ca.vertcat(*map(ca.SX.sym, beyond)), [0, *(len(self.axes) * k for k in (1, 2, 3))]
        )
        inner = [*m.symbols, "bonded", *(f"Q_{name}" for name in (*(q.name for q in m.coordinates), *self.points))]
        inner = [name for name in inner if name not in {p.name for p in component.parameters}]
        loop = {name: f"{name}[i]" for name in inner} | {name: f"{name}[i + 1]" for name in beyond}
        self.loop = Section(Notation.from_model(self.model), loop, "[i]")

    def lines(self) -> list[str]:
        inside = [*self._links()]
        first = Section(
            self.loop.notation, {str(x): f"{x}[1]" for x in ca.vertsplit(ca.vertcat(self.pi_dot, self.phi))}
        )
        self._base(first)
        ends = [
            f"{name}_{axis}{end}[n + 1] = 0;"
            for name, end in (("pi", ""), ("phi", ""), ("pi", "_dot"))
            for axis in self.axes
        ]
        initial = [f"{q.name}{end} = {q.name}{end}_0;" for q in self.m.coordinates for end in ("", "_dot")]
        outside = ["kinetic_energy = sum(kinetic);", "potential_energy = sum(potential);"]
        outside += ["energy = kinetic_energy + potential_energy;"]
        return [
            'partial model Motion "Equations of motion"',
            *indented([*self._declarations(), *self.loop.declared]),
            "initial equation",
            *indented(filled(initial)),
            "equation",
            *indented(filled([*first.lines, *ends])),
            "  for i in 1:n loop",
            *indented(indented(filled(inside))),
            "  end for;",
            *indented(filled(outside)),
            "end Motion;",
        ]

    def _declarations(self) -> Iterator[str]:
        m, unit = self.m, self.unit_of
        yield from declared(f"n = {m.sizes['n']} {quoted(type(m).n.description)}", head="parameter Integer")
        for p in m.parameters:
            value = f"{named(p.name, p.unit, **bounds(p.variable('parameter', 'fixed')))} = {number(p.start)}"
            yield from declared(f"{value} {quoted(p.description)}", head="parameter Real")
        for q in m.coordinates:
            rest = f"fill({number(q.start)}, n)"
            if q.leading:
                rest = f"cat(1, {{{', '.join(map(number, q.leading))}}}, zeros(n - {len(q.leading)}))"
            rate = named(f"{q.name}_dot_0", unit[f"{q.name}_dot"], size="[n]")
            starts = f"{named(f'{q.name}_0', q.unit, size='[n]')} = {rest}", f"{rate} = fill({number(q.start_rate)}, n)"
            yield from declared(starts[0], f'{starts[1]} "at the start"', head="parameter Real")
        bonded = "fill(1, n)" if m.base() is not None else "cat(1, {0}, ones(n - 1))"
        yield from declared(
            f'bonded[n] = {bonded} "whether a link has a bond to the one before"', head="parameter Real"
        )
        for s in m.actives:
            names = (f"{s.name}_dot", f"{s.name}_ddot", f"{s.name}_force")
            yield from declared(named(s.name, s.unit, s.description), *(named(name, unit[name]) for name in names))
        for q in m.coordinates:
            own = named(q.name, q.unit, q.description, "[n]", start=f"{q.name}_0")
            yield from declared(own, *(named(name, unit[name], size="[n]") for name in self._of(q.name)))
        outer = [(f"Q_{q.name}", unit[f"{q.name}_force"]) for q in m.coordinates]
        outer += [(f"Q_{name}", unit[f"{name}_load"]) for name in self.points]
        points = (named(name, unit[name], size="[n]") for name in self.points)
        yield from declared(*(named(name, of, size="[n]") for name, of in outer), *points)
        for axis in self.axes:
            of = unit[f"joint_{axis}"]
            ends = ("", of), ("_dot", units.rate(of)), ("_ddot", units.rate(units.rate(of)))
            yield from declared(*(named(f"joint_{axis}{end}", u, size="[n + 1]") for end, u in ends))
            beyond = (
                (f"pi_{axis}", units.momentum(of)),
                (f"pi_{axis}_dot", units.force(of)),
                (f"phi_{axis}", units.force(of)),
            )
            yield from declared(*(named(name, u, size="[n + 1]") for name, u in beyond))
        yield from declared(*(named(name, "J", size="[n]") for name in ("kinetic", "potential")))
        yield from declared(*(named(name, "J") for name in ("kinetic_energy", "potential_energy", "energy")))

    def _of(self, name: str) -> tuple[str, str, str]:
        return f"{name}_dot", f"{name}_ddot", f"p_{name}"

    def _base(self, section: Section) -> None:
        """Joint of the first link, and the forces of the operator."""
        m, position = self.m, self.m.base()
        column = ca.SX.zeros(len(self.axes)) if position is None else m.joint_column(position)
        slope = ca.jacobian(column, m.s)
        for end in ("", "_dot", "_ddot"):
            for axis, value in zip(self.axes, ca.vertsplit(column), strict=True):
                section.add(f"joint_{axis}{end}[1]", value)
            column = m.dot(column)
        for s, force in zip(m.actives, ca.vertsplit(slope.T @ (self.pi_dot - self.phi)), strict=True):
            section.add(f"{s.name}_force", force)

    def _links(self) -> list[str]:
        """Statements of one link i."""
        m, link, section = self.m, self.link, self.loop
        q, v, w, w_dot, T, V, F = link.q, link.v, link.w, link.w_dot, link.kinetic, link.potential, link.tip
        outer = ca.vertcat(*(ca.SX.sym(f"Q_{item.name}") for item in m.coordinates))
        attached = ca.vertcat(*(-ca.SX.sym(f"Q_{name}") for name in self.points), ca.SX(0, 1))
        F_q, F_w, F_dot = ca.jacobian(F, q), ca.jacobian(F, w), link.rate(F)
        virtual_q, virtual_w = (ca.jacobian(link.points, x).T @ attached for x in (q, w))
        p_v, p_w = gradient(T, v), gradient(T, w_dot)
        rub, rub_w = link.friction.against(v), link.friction.against(w_dot)
        names = [item.name for item in m.coordinates]

        def rows(form: str, of: list[str], column: ca.SX) -> None:
            for name, row in zip(of, ca.vertsplit(column), strict=True):
                section.add(form.format(name), row)

        rows("joint_{}[i + 1]", self.axes, F)
        rows("joint_{}_dot[i + 1]", self.axes, F_dot)
        rows("joint_{}_ddot[i + 1]", self.axes, m.dot(m.dot(F)))
        section.lines += [f"der({name}[i]) = {name}_dot[i];" for name in names]
        rows("p_{}[i]", names, p_v + F_q.T @ self.pi)
        rows("pi_{}[i]", self.axes, p_w + F_w.T @ self.pi)
        force = gradient(T - V, q) + outer - virtual_q - rub + F_q.T @ self.phi + ca.jacobian(F_dot, q).T @ self.pi
        rows("der(p_{}[i])", names, force)
        slope = gradient(T - V, w) - virtual_w - rub_w + F_w.T @ self.phi + ca.jacobian(F_dot, w).T @ self.pi
        rows("phi_{}[i]", self.axes, slope)
        rows("der(p_{}[i])", names, m.dot(p_v) + _rate(m, F_q).T @ self.pi + F_q.T @ self.pi_dot)
        rows("pi_{}_dot[i]", self.axes, m.dot(p_w) + _rate(m, F_w).T @ self.pi + F_w.T @ self.pi_dot)
        rows("{}[i]", self.points, link.points)
        rows("{}[i]", ["kinetic", "potential"], ca.vertcat(T, V))
        return section.lines


def _rate(m: Chain, matrix: ca.SX) -> ca.SX:
    """Its time derivative."""
    return ca.reshape(m.dot(ca.vec(ca.densify(matrix))), *matrix.shape)
