"""A chain of equal links, described by one link and solved at linear cost."""

from abc import abstractmethod
from collections.abc import Mapping

import casadi as ca

from liaisons.algebra import hessian, stack
from liaisons.base import units
from liaisons.errors import ComponentError
from liaisons.language import (
    ActiveCoordinate,
    ContactFormula,
    Coordinate,
    Declaration,
    Dimension,
    Formulas,
    Joint,
    MechanicalComponent,
    Parameter,
    Size,
    calculated,
    call,
    declarations_of,
    point,
)

_OF_CHAINS = (Parameter, Coordinate, ActiveCoordinate, Size, Joint, point, calculated, ContactFormula)


class Chain(MechanicalComponent, abstract=True):
    """Mechanical chain of n equal links with active constraints at its base; abstract.

    A subclass describes one link.  Its coordinates are those of a link (in the FMU arrays of length n), ``self.joint``
    is the end of the previous link, and the methods return the energies of one link.  The base, if there is one, has
    active coordinates.

    :raises ComponentError: when the subclass is defined, for an unknown symbol, a duplicate name, or a free end where
        the kinetic energy needs a base.
    """

    n = Size(10, "number of links")
    joint = Joint("m", "x")

    def __init__(self, n: object = None) -> None:
        super().__init__()
        owner, size = type(self).__name__, type(self).n
        links = size.checked(owner, size.default if n is None else n)
        self.sizes = {"n": links}
        self.dimension = Dimension("n", links, size.description)
        self.number = ca.SX.sym("number")  # of the link, from 1; for its picture
        for q in self.coordinates:
            if len(q.leading) > links:
                raise ComponentError(
                    f"{owner}: n = {links}: {q.name} starts with {len(q.leading)} values; "
                    "take a longer chain, or declare fewer"
                )
        free, active = [q.name for q in self.coordinates], [s.name for s in self.actives]
        joint = [f"joint_{axis}" for axis in type(self).joint.axes]
        (self.q, self.q_dot, self.q_ddot), (self.w, self.w_dot, self.w_ddot), (self.s, self.s_dot, self.s_ddot) = (
            [self._add_symbols(f"{name}{end}" for name in names) for end in ("", "_dot", "_ddot")]
            for names in (free, joint, active)
        )
        self.contact_forces = self._add_symbols(f"{item.name}_force" for item in self.contact_formulas)

    # ---- defined by components -----------------------------------------------------------------------------

    @abstractmethod
    def tip(self) -> Mapping[str, ca.SX]:
        """Joint of the next link by axis, from the coordinates and the joint of this link."""

    def base(self) -> Mapping[str, ca.SX] | None:
        """Joint of the first link by axis, from active coordinates; None for a free end."""
        return None

    def bond_energy(self) -> ca.SX:
        """Potential energy of the bond between a link and the one before or the base; none at a free end."""
        return ca.SX(0)

    def bond_dissipation(self) -> ca.SX:
        """Dissipation function [W] of the bond between a link and the one before or the base; none at a free end."""
        return ca.SX(0)

    # ---- for use in methods --------------------------------------------------------------------------------------

    def dot(self, expression: ca.SX) -> ca.SX:
        """Total time derivative of an expression of coordinates, joint and rates."""
        where = ca.vertcat(self.q, self.w, self.s, self.q_dot, self.w_dot, self.s_dot)
        rates = ca.vertcat(self.q_dot, self.w_dot, self.s_dot, self.q_ddot, self.w_ddot, self.s_ddot)
        return ca.jtimes(ca.SX(expression), where, rates)

    # ---- derived -------------------------------------------------------------------------

    def claimed_names(self) -> list[tuple[str, str]]:
        joint = type(self).joint
        symbols = (f"joint_{axis}{end}" for axis in joint.axes for end in ("", "_dot", "_ddot"))
        return [*super().claimed_names(), *((name, joint.description) for name in symbols)]

    def joint_column(self, components: Mapping[str, ca.SX]) -> ca.SX:
        """Column (d, 1) of a tip or base, in the order of the axes."""
        return stack(ca.SX(components[axis]) for axis in type(self).joint.axes)

    def _check(self) -> None:
        for item in declarations_of(type(self), Declaration):
            if item.size:
                item.refuse(
                    f"size = {item.size!r}: a Chain describes one link; what each has is an array of length n already"
                )
            if not isinstance(item, _OF_CHAINS):
                item.refuse(f"a Chain has no {type(item).__name__}; write a Mechanism")
        parameters, axes = self._symbols_by_name(self.parameter_column), type(self).joint.unit_of
        link = parameters | self._symbols_by_name(self.q, self.w)
        motion = link | self._symbols_by_name(self.q_dot, self.w_dot)
        formulas = Formulas(self)
        self._check_points(formulas, link)
        formulas.check_mapping("tip", link, axes)
        if call(self, "base") is not None:
            formulas.check_mapping("base", parameters | self._symbols_by_name(self.s), axes)
        for name in ("kinetic_energy", "potential_energy", "bond_energy"):
            formulas(name, motion if name == "kinetic_energy" else link, "J")
        formulas("friction_coefficient", parameters, "1/s")
        for name in ("dissipation_function", "bond_dissipation"):
            formulas(name, motion, "W")
        self.check_contacts(formulas, link, motion, (self.q, self.q_dot))
        for item in self.calculated_parameters:
            formulas(item.name, parameters, item.unit)
        joint = {f"joint_{axis}": unit for axis, unit in axes.items()}
        joint |= {f"{name}_dot": units.rate(unit) for name, unit in joint.items()}
        formulas.check_units(self.layout().variables, self.symbols, **joint)
        self._check_inertia()

    def _check_inertia(self) -> None:
        name, kinetic, tip = type(self).__name__, ca.SX(self.kinetic_energy()), self.joint_column(self.tip())
        rates = ca.vertcat(self.q_dot, self.w_dot)
        if ca.depends_on(hessian(kinetic, rates), rates):
            raise ComponentError(f"{name}.kinetic_energy must be quadratic in the rates")
        joint = ca.vertcat(self.w, self.w_dot)
        needs = {"tip and kinetic_energy need": ca.vertcat(kinetic, tip)}
        needs |= {f"{c.name} needs": self.expression_of(c) for c in self.contact_formulas}
        for text, expression in needs.items() if self.base() is None else ():
            if ca.depends_on(expression, joint):
                raise ComponentError(f"{name}: {text} the joint, which a free end lacks; define base()")
        for item, q, q_dot in zip(self.coordinates, ca.vertsplit(self.q), ca.vertsplit(self.q_dot), strict=True):
            if not (ca.depends_on(kinetic, q_dot) or ca.depends_on(tip, q)):
                raise ComponentError(f"{name}: {item.name} moves no mass; let kinetic_energy depend on its rate")
