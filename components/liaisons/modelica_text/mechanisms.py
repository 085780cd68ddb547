"""The motion of mechanisms as a class."""

from __future__ import annotations

from collections.abc import Iterator

import casadi as ca

from liaisons import units
from liaisons.formulas import Notation
from liaisons.formulas.writing import LONGEST
from liaisons.language import Mechanism
from liaisons.mechanics import assemble, derive
from liaisons.mechanics.constraints import STABILISATION
from liaisons.mechanics.printing import of_mechanism
from liaisons.modelica_text.text import Section, bounds, declared, filled, indented, named, number, quoted

_OPERATOR = "forces of the operator"
_OUTSIDE = "forces from outside"
_ENERGIES = ("kinetic_energy", "potential_energy", "energy")
_BODY = "p_omega_"  # what momenta in the body frame begin with


def motion(component: type[Mechanism]) -> list[str]:
    """Lines of the model ``Motion``: q, s, their rates and accelerations, and forces Q from outside as unknowns."""
    return _Motion(component).lines()


class _Motion:
    def __init__(self, component: type[Mechanism]) -> None:
        self.model, self.equations = assemble(component), derive(component)
        self.m = self.equations.mechanism
        self.section = Section(Notation.from_model(self.model))
        self.unit_of = {v.name: v.unit for v in self.model.variables}
        e = self.equations
        self.laws = of_mechanism(e)
        self.inside = ca.vertcat(e.drives, e.loads, e.point_loads)
        applied = [ca.SX.sym(f"Q_{q.name}") for q in self.m.coordinates]
        attached = [-ca.SX.sym(f"Q_{name}") for name in e.points]
        self.outside = ca.vertcat(*applied, *[0] * len(applied), *attached)

    def lines(self) -> list[str]:
        section, e = self.section, self.equations
        asserted = [*self._assertions()]
        self._momenta()
        self._motion()
        self._constraints()
        self._rows("forces")
        self._rows("points")
        said = [
            item
            for item in (*self.m.outputs, *self.m.calculated_parameters)
            if section.add(item.name, self._outer(ca.SX(getattr(self.m, item.name))), LONGEST)
        ]
        section.add("kinetic_energy", self._outer(e.kinetic_energy))
        section.add("potential_energy", self._outer(e.potential_energy))
        section.lines.append("energy = kinetic_energy + potential_energy;")
        further = [line for item in said for line in declared(named(item.name, item.unit, item.description))]
        return [
            'partial model Motion "Equations of motion"',
            *indented([*self._declarations(), *further, *section.declared]),
            "initial equation",
            *indented(filled(self._initial())),
            "equation",
            *indented(filled([*asserted, *section.lines])),
            "end Motion;",
        ]

    # ---- declarations ----------------------------------------------------------------------------------------

    def _declarations(self) -> Iterator[str]:
        m, unit = self.m, self.unit_of
        starts = []
        for v in m.layout().parameters:
            value = f"{named(v.name, v.unit, **bounds(v))} = {number(v.starts[0])}"
            if v.name in self.m.symbols:
                yield from declared(f"{value} {quoted(v.description)}", head="parameter Real")
            else:
                starts.append(value)
        yield from declared(*starts[:-1], *(f'{last} "at the start"' for last in starts[-1:]), head="parameter Real")
        for s in m.actives:
            limits = {} if s.strict else bounds(s.variable("input", "continuous"))
            yield from declared(named(s.name, s.unit, s.description, **limits), *self._rates(s.name))
        forces = [f"{s.name}_force" for s in m.actives]
        yield from declared(*(named(name, unit[name], _OPERATOR * (name == forces[-1])) for name in forces))
        for q, momentum in zip(m.coordinates, self._momentum_variables(), strict=True):
            own = named(q.name, q.unit, q.description, start=f"{q.name}_0")
            yield from declared(own, *self._rates(q.name), momentum)
        for o in m.orientations:
            yield from declared(
                *(named(name, "1", o.description * (not i), start=f"{name}_0") for i, name in enumerate(o.quaternion))
            )
            yield from declared(*(named(name, "rad/s") for name in o.rates))
            yield from declared(*(named(f"{name}_dot", "rad/s2") for name in o.rates))
            yield from declared(*(named(f"{_BODY}{axis}", "kg.m2/s") for axis in "xyz"))
            yield from declared(*(named(name, "kg.m2/s") for name in o.momenta))
        for state in m.internal_states:
            yield from declared(named(state.name, state.unit, state.description))
        for item in (*m.constraints, *m.non_holonomic):
            yield from declared(named(f"lambda_{item.name}", unit[f"lambda_{item.name}"], item.description))
        for item in (*m.constraints, *m.rheonomic_constraints):
            rate = named(f"{item.name}_residual_dot", units.rate(item.unit))
            yield from declared(named(f"{item.name}_residual", item.unit), rate)
        for item in m.non_holonomic:
            yield from declared(named(f"{item.name}_residual", item.unit))
        points = list(self.equations.points)
        outer = [named(f"Q_{name}", unit[f"{name}_load"]) for name in (*(q.name for q in m.coordinates), *points)]
        yield from declared(*outer[:-1], *(f"{last} {quoted(_OUTSIDE)}" for last in outer[-1:]))
        yield from declared(*(named(name, unit[name]) for name in (*points, *_ENERGIES)))

    def _momentum_variables(self) -> Iterator[str]:
        """Momenta; under constraints with a guess, from which a tool solves for the multipliers."""
        m, p = self.m, ca.vertsplit(self.equations.momenta)
        rates = [*m.coordinates] if m.constraints or m.non_holonomic else []
        pairs = [
            (self.m.symbols[f"{q.name}{end}"], ca.SX.sym(f"{q.name}{end}_0")) for q in rates for end in ("", "_dot")
        ]
        for q, momentum in zip(m.coordinates, p, strict=False):
            at_start = ca.substitute([momentum], *map(list, zip(*pairs, strict=True)))[0] if pairs else None
            guess = {} if at_start is None else {"start": self.section.written(at_start) or "0"}
            yield named(f"p_{q.name}", units.momentum(q.unit), **guess)

    def _rates(self, name: str) -> tuple[str, str]:
        return named(f"{name}_dot", self.unit_of[f"{name}_dot"]), named(f"{name}_ddot", self.unit_of[f"{name}_ddot"])

    # ---- equations -------------------------------------------------------------------------------------------

    def _initial(self) -> list[str]:
        m = self.m
        names = [name for q in m.coordinates for name in (q.name, f"{q.name}_dot")]
        for o in m.orientations:
            names += [*o.quaternion, *(o.rates if o.start == "rate" else o.momenta)]
        return [f"{name} = {name}_0;" for name in (*names, *(state.name for state in m.internal_states))]

    def _assertions(self) -> Iterator[str]:
        m = self.m
        for item in (*m.parameters, *m.actives, *m.coordinates):
            for sign, bound in ((">", item.minimum), ("<", item.maximum)):
                if item.strict and bound is not None:
                    limit = f"{item.name} {sign} {number(bound)}"
                    yield f"assert({limit}, {quoted(f'{limit} {item.unit} is needed')});"
        for item in m.assertions:
            if distance := self.section.written(ca.SX(getattr(m, item.name)), LONGEST):
                yield f"assert({distance} > 0, {quoted(item.description)});"
            else:
                self.section.unsaid.append(item.name)

    def _outer(self, expression: ca.SX) -> ca.SX:
        """The expression with forces from outside in the place of drives and loads."""
        return ca.substitute(ca.SX(expression), self.inside, self.outside)

    def _rows(self, section: str) -> None:
        for equation in self.laws:
            if equation.section == section:
                self.section.add(equation.left, self._outer(equation.right))

    def _momenta(self) -> None:
        m, momenta = self.m, ca.vertsplit(self.equations.momenta)
        count = len(m.coordinates)
        for q, momentum in zip(m.coordinates, momenta, strict=False):
            self.section.add(f"p_{q.name}", momentum)
        for o in m.orientations:
            in_body = ca.vertcat(*(ca.SX.sym(f"{_BODY}{axis}") for axis in "xyz"))
            for symbol, momentum in zip(ca.vertsplit(in_body), momenta[count:], strict=True):
                self.section.add(str(symbol), momentum)
            turned = getattr(m, o.name).matrix @ in_body
            for name, momentum in zip(o.momenta, ca.vertsplit(turned), strict=True):
                self.section.add(name, momentum)

    def _motion(self) -> None:
        """Rates of the states, then the accelerations that go with them."""
        m, section = self.m, self.section
        section.lines += [f"der({q.name}) = {q.name}_dot;" for q in m.coordinates]
        quaternions = {f"{name}_dot" for o in m.orientations for name in o.quaternion}
        forces = {}
        for equation in self.laws:
            if (equation.section == "velocities" and equation.left in quaternions) or equation.section == "internal":
                section.add(f"der({equation.left.removesuffix('_dot')})", equation.right)
            if equation.section == "motion":
                name = equation.left.removesuffix("_dot")
                forces[name] = self._outer(equation.right)
                section.add(f"der({name})", forces[name])
        count = len(m.coordinates)
        rates = ca.vertsplit(m.dot(self.equations.momenta))
        for q, rate in zip(m.coordinates, rates, strict=False):
            section.add(f"der(p_{q.name})", rate)
        for o in m.orientations:  # Euler's equations: ṗ = p × ω + Rᵀ Ḣ in the body frame
            attitude = getattr(m, o.name)
            in_body = ca.vertcat(*(ca.SX.sym(f"{_BODY}{axis}") for axis in "xyz"))
            torque = attitude.matrix.T @ ca.vertcat(*(forces[name] for name in o.momenta))
            balance = ca.cross(in_body, attitude.rate) + torque
            for rate, right in zip(rates[count:], ca.vertsplit(balance), strict=True):
                left = section.written(rate)
                assert left is not None
                section.add(left, right)

    def _constraints(self) -> None:
        """Residuals, and that they decay as STABILISATION says."""
        m, section, constraints = self.m, self.section, self.equations.constraints
        for i, item in enumerate((*m.constraints, *m.non_holonomic, *m.rheonomic_constraints)):
            name = f"{item.name}_residual"
            section.add(name, constraints.residuals[i])
            decay = f"-{number(STABILISATION)}*{name}"
            if i in constraints.holonomic:
                section.add(f"{name}_dot", constraints.rate_residuals[i])
                decay = f"-{number(2 * STABILISATION)}*{name}_dot - {number(STABILISATION**2)}*{name}"
            section.add(decay, m.dot(constraints.rate_residuals[i]))
