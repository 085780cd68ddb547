"""A chain: many equal links, each hung on the one before; described by one link, solved for all at linear cost."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from functools import cached_property
from typing import Any, ClassVar

import casadi as ca

from liaisons import units
from liaisons.errors import ComponentError
from liaisons.expressions.dimensions import Declared, check_units
from liaisons.language.component import Component, call, checked, components_of, declared, require_units, scalar
from liaisons.language.declarations import ActiveCoordinate, Calculated, Coordinate, Joint, Point, Size


class Chain(Component, abstract=True):
    """Mechanical chain of n equal links with active constraints at its base; abstract.

    A subclass describes one link.  Its coordinates are those of a link (in the FMU arrays of length n), ``self.joint``
    is the place where the link before ends, and the methods give the energies of one link.  The coordinates of the
    base, if it has one, are active.

    :raises ComponentError: when the subclass is defined, if a symbol is unknown, a name is given twice, or a free end
        is asked for where the kinetic energy needs a base.
    """

    n = Size(10, "number of links")
    joint = Joint("m", "x")

    coordinates: ClassVar[tuple[Coordinate, ...]] = ()
    actives: ClassVar[tuple[ActiveCoordinate, ...]] = ()
    points: ClassVar[tuple[Point, ...]] = ()
    calculated_parameters: ClassVar[tuple[Calculated, ...]] = ()

    def __init__(self, n: object = None) -> None:
        super().__init__()
        size = type(self).n
        self.sizes = {"n": size.checked(type(self).__name__, size.default if n is None else n)}
        for q in self.coordinates:
            if len(q.leading) > self.sizes["n"]:
                raise ComponentError(
                    f"{type(self).__name__}: n = {self.sizes['n']}: {q.name} starts with {len(q.leading)} values; "
                    "take a longer chain, or declare fewer"
                )
        names = [c.name for c in self.coordinates]
        self.q, self.q_dot, self.q_ddot = (self._symbols(f"{q}{end}" for q in names) for end in ("", "_dot", "_ddot"))
        names = [f"joint_{axis}" for axis in type(self).joint.axes]
        self.w, self.w_dot, self.w_ddot = (self._symbols(f"{w}{end}" for w in names) for end in ("", "_dot", "_ddot"))
        names = [c.name for c in self.actives]
        self.s, self.s_dot, self.s_ddot = (self._symbols(f"{s}{end}" for s in names) for end in ("", "_dot", "_ddot"))

    # ---- what a component defines -----------------------------------------------------------------------------

    @abstractmethod
    def tip(self) -> Mapping[str, ca.SX]:
        """Where the next link begins, by axis of the joint: an expression of coordinates and joint."""

    @abstractmethod
    def kinetic_energy(self) -> ca.SX:
        """T of one link, quadratic in the rates of its coordinates and of its joint."""

    def base(self) -> Mapping[str, ca.SX] | None:
        """Joint of the first link as expressions of active coordinates; None: the first link is a free end."""
        return None

    def potential_energy(self) -> ca.SX:
        """V of one link for itself; zero unless the component says otherwise."""
        return ca.SX(0)

    def bond_energy(self) -> ca.SX:
        """V of what joins a link to the one before or to the base; the first link of a free end has none."""
        return ca.SX(0)

    def friction_coefficient(self) -> ca.SX:
        """η of K eq. 64, Q = −η ∂T/∂q̇: the declared Friction, zero without one."""
        return self.declared_friction()

    def dissipation_function(self) -> ca.SX:
        """Rayleigh's D [W] of further friction of one link, Q = −∂D/∂q̇; zero unless the component says otherwise."""
        return ca.SX(0)

    def bond_dissipation(self) -> ca.SX:
        """D [W] of a damper between a link and the one before or the base; the first link of a free end has none."""
        return ca.SX(0)

    # ---- what it may use --------------------------------------------------------------------------------------

    def dot(self, expression: ca.SX) -> ca.SX:
        """Total time derivative of an expression of coordinates, joint and their rates."""
        where = ca.vertcat(self.q, self.w, self.s, self.q_dot, self.w_dot, self.s_dot)
        rates = ca.vertcat(self.q_dot, self.w_dot, self.s_dot, self.q_ddot, self.w_ddot, self.s_ddot)
        return ca.jtimes(ca.SX(expression), where, rates)

    def speed_squared(self, position: Mapping[str, ca.SX]) -> ca.SX:
        """|ṙ|² of a point of the link given by its Cartesian components."""
        return ca.SX(sum(self.dot(component) ** 2 for component in position.values()))

    # ---- what the package makes of it -------------------------------------------------------------------------

    @cached_property
    def point_components(self) -> dict[str, ca.SX]:
        """Components of all named points of a link, ``"bob_x"`` and so on."""
        return {
            f"{point.name}_{axis}": ca.SX(component)
            for point in self.points
            for axis, component in call(self, point.name).items()
        }

    @classmethod
    def variable_names(cls) -> list[str]:
        names = [p.name for p in (*cls.parameters, *cls.calculated_parameters)]
        for name in cls().point_components:
            names += [name, f"{name}_dot", f"{name}_ddot", f"{name}_load"]
        for q in (c.name for c in cls.coordinates):
            names += [f"{q}_0", f"{q}_dot_0", q, f"{q}_dot", f"{q}_ddot", f"p_{q}", f"p_{q}_dot"]
            names += [f"{q}_force", f"{q}_load"]
        for s in (c.name for c in cls.actives):
            names += [s, f"{s}_dot", f"{s}_ddot", f"{s}_force", f"{s}_power", f"{s}_mismatch"]
        names += ["kinetic_energy", "potential_energy", "energy", "work", "dissipated", "energy_balance"]
        return [*names, "power", "dissipation", "n"]

    @classmethod
    def _collect(cls) -> None:
        super()._collect()
        cls.coordinates = declared(cls, Coordinate)
        cls.actives = declared(cls, ActiveCoordinate)
        cls.points = declared(cls, Point)
        cls.calculated_parameters = declared(cls, Calculated)

    @classmethod
    def _check(cls) -> None:
        if not cls.coordinates:
            raise ComponentError(f"{cls.__name__}: declare at least one Coordinate of a link")
        require_units(cls)
        picture, places = cls(), cls.joint.unit_of
        parameters = {p.name: picture.symbols[p.name] for p in cls.parameters}
        link = parameters | _named(picture.q, picture.w)
        motion = link | _named(picture.q_dot, picture.w_dot)
        formulas: list[Declared] = []  # those that others are made of first

        def check(name: str, value: Any, symbols: dict[str, ca.SX], unit: str) -> None:
            formulas.extend(checked(cls, name, scalar(cls, name, value, symbols), unit))

        for item in cls.points:
            for axis, component in components_of(picture, item).items():
                check(f"{item.name}[{axis!r}]", component, link, item.unit)
        for axis, component in _by_axis(picture, "tip").items():
            check(f"tip[{axis!r}]", component, link, places[axis])
        if call(picture, "base") is not None:
            for axis, component in _by_axis(picture, "base").items():
                check(f"base[{axis!r}]", component, parameters | _named(picture.s), places[axis])
        known = {"kinetic_energy": (motion, "J"), "potential_energy": (link, "J"), "bond_energy": (link, "J")}
        known |= {"friction_coefficient": (parameters, "1/s")}
        known |= dict.fromkeys(("dissipation_function", "bond_dissipation"), (motion, "W"))
        known |= {item.name: (parameters, item.unit) for item in cls.calculated_parameters}
        for name, (symbols, unit) in known.items():
            check(name, call(picture, name), symbols, unit)
        check_units(_symbols_with_units(picture), formulas)
        _check_inertia(picture)


def _symbols_with_units(m: Chain) -> dict[str, tuple[ca.SX, str]]:
    """All symbols of a chain by name, with the units that they have in its formulas."""
    unit = {p.name: p.checked_unit for p in m.parameters}
    places = {f"joint_{axis}": own for axis, own in type(m).joint.unit_of.items()}
    for name, own in (places | {c.name: c.unit for c in (*m.coordinates, *m.actives)}).items():
        speed = units.rate(own)
        unit |= {name: own, f"{name}_dot": speed, f"{name}_ddot": units.rate(speed)}
    return {name: (symbol, unit[name]) for name, symbol in m.symbols.items()}


def _check_inertia(m: Chain) -> None:
    name, kinetic, tip = type(m).__name__, ca.SX(m.kinetic_energy()), column(m.tip())
    rates = ca.vertcat(m.q_dot, m.w_dot)
    if ca.depends_on(ca.hessian(kinetic, rates)[0], rates):
        raise ComponentError(f"{name}.kinetic_energy must be quadratic in the rates")
    if m.base() is None and ca.depends_on(ca.vertcat(kinetic, tip), ca.vertcat(m.w, m.w_dot)):
        raise ComponentError(f"{name}: tip and kinetic_energy need the joint, which a free end lacks; define base()")
    for item, q, q_dot in zip(m.coordinates, ca.vertsplit(m.q), ca.vertsplit(m.q_dot), strict=True):
        if not (ca.depends_on(kinetic, q_dot) or ca.depends_on(tip, q)):
            raise ComponentError(f"{name}: {item.name} moves no mass; let kinetic_energy depend on its rate")


def column(components: Mapping[str, ca.SX]) -> ca.SX:
    """Named components as a column, (d, 1)."""
    return ca.vertcat(*(ca.SX(component) for component in components.values()))


def _by_axis(picture: Chain, method: str) -> Mapping[str, ca.SX]:
    axes, given = type(picture).joint.axes, call(picture, method)
    if not isinstance(given, Mapping) or tuple(given) != axes:
        received = list(given) if isinstance(given, Mapping) else given
        raise ComponentError(f"{type(picture).__name__}.{method} returns {received}; it must have the axes {axes}")
    return given


def _named(*columns: ca.SX) -> dict[str, ca.SX]:
    return {str(symbol): symbol for column in columns for symbol in ca.vertsplit(column)}
