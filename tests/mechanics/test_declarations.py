"""A component that is declared wrongly is refused by name when its class is defined."""

import casadi as ca
import pytest

from liaisons.errors import ComponentError
from liaisons.mechanics import ActiveCoordinate, Coordinate, Mechanism, Operator, Parameter, output, point


class _Bead(Mechanism, abstract=True):
    """A free bead, the starting point of every case below."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    x = Coordinate("m", "position")

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.x) ** 2


def test_class_gives_declarations_and_instance_gives_symbols() -> None:
    class Bead(_Bead):
        """Bead."""

    assert Bead.mass.unit == "kg"
    assert Bead.x.start == 0.0
    assert str(Bead().mass) == "mass"
    with pytest.raises(ComponentError, match=r"Bead\.mass is a symbol and cannot be assigned"):
        Bead().mass = 2.0  # pyright: ignore[reportAttributeAccessIssue]


def test_unknown_symbol_names_the_nearest_one() -> None:
    with pytest.raises(ComponentError, match=r"Typo: unknown symbol self\.mas; did you mean 'mass'\?"):

        class Typo(_Bead):
            def potential_energy(self) -> ca.SX:
                return self.mas * self.x


def test_foreign_symbol_is_named() -> None:
    with pytest.raises(ComponentError, match=r"Foreign\.potential_energy contains the unknown symbol 'stiffness'"):

        class Foreign(_Bead):
            def potential_energy(self) -> ca.SX:
                return ca.SX.sym("stiffness") * self.x**2 / 2


def test_foreign_symbol_with_a_known_name_is_still_foreign() -> None:
    with pytest.raises(ComponentError, match=r"Twin\.potential_energy contains the unknown symbol 'x'"):

        class Twin(_Bead):
            def potential_energy(self) -> ca.SX:
                return ca.SX.sym("x") ** 2


def test_rates_in_the_potential_energy_are_refused() -> None:
    with pytest.raises(ComponentError, match=r"potential_energy contains the unknown symbol 'x_dot'"):

        class Rate(_Bead):
            def potential_energy(self) -> ca.SX:
                return self.dot(self.x) ** 2


@pytest.mark.parametrize(
    ("unit", "message"),
    [("kilogram", "unit 'kilogram' is not understood at 'kilogram'"), ("kg/m/s", "not understood"), (3, "unit 3")],
)
def test_unit_that_is_not_understood(unit: str, message: str) -> None:
    with pytest.raises(ComponentError, match=message):
        Parameter(1.0, unit, "mass")


def test_missing_unit_and_description() -> None:
    with pytest.raises(ComponentError, match=r"Parameter: missing a required argument: 'unit'; write for example"):
        Parameter(1.0)  # pyright: ignore[reportCallIssue]
    with pytest.raises(ComponentError, match="say in the description what it is"):
        Parameter(1.0, "kg", "")


def test_wrong_size_gives_the_shape() -> None:
    with pytest.raises(ComponentError, match=r"Wide\.kinetic_energy has shape \(2, 1\); return a scalar"):

        class Wide(_Bead):
            def kinetic_energy(self) -> ca.SX:
                return ca.vertcat(self.dot(self.x), 1)


def test_something_that_is_no_expression() -> None:
    with pytest.raises(ComponentError, match=r"Text\.potential_energy returns 'mgz'"):

        class Text(_Bead):
            def potential_energy(self) -> ca.SX:
                return "mgz"  # pyright: ignore[reportReturnType]


def test_an_exception_in_a_method_carries_the_method_name() -> None:
    with pytest.raises(ComponentError, match=r"Crash\.potential_energy: ZeroDivisionError"):

        class Crash(_Bead):
            def potential_energy(self) -> ca.SX:
                return self.x * (1 / 0)


def test_coordinate_without_kinetic_energy() -> None:
    with pytest.raises(ComponentError, match=r"Massless: mass matrix is singular .* no kinetic energy belongs to y"):

        class Massless(_Bead):
            y = Coordinate("m", "position of nothing")


def test_dependent_coordinates_make_the_mass_matrix_singular() -> None:
    with pytest.raises(ComponentError, match=r"Rigid: mass matrix .* is not positive definite"):

        class Rigid(_Bead):
            y = Coordinate("m", "moves together with x")

            def kinetic_energy(self) -> ca.SX:
                return self.mass / 2 * (self.dot(self.x) + self.dot(self.y)) ** 2


def test_kinetic_energy_that_is_not_quadratic() -> None:
    with pytest.raises(ComponentError, match="must be quadratic in the rates"):

        class Relativistic(_Bead):
            light = Parameter(299792458.0, "m/s", "speed of light")

            def kinetic_energy(self) -> ca.SX:
                return -self.mass * self.light**2 * ca.sqrt(1 - (self.dot(self.x) / self.light) ** 2)


def test_kinetic_energy_that_is_not_zero_at_rest() -> None:
    with pytest.raises(ComponentError, match=r"must be quadratic in the rates; .*belongs to lagrangian"):

        class OnABelt(_Bead):
            belt = Parameter(1.0, "m/s", "speed of the belt")

            def kinetic_energy(self) -> ca.SX:
                return self.mass / 2 * (self.dot(self.x) + self.belt) ** 2


def test_singular_start() -> None:
    with pytest.raises(ComponentError, match=r"Polar: the kinetic energy is not finite at the start .*x = 0"):

        class Polar(_Bead):
            scale = Parameter(1.0, "m", "a length")

            def kinetic_energy(self) -> ca.SX:
                return self.mass / 2 * self.dot(self.x) ** 2 * self.scale / self.x


def test_mechanism_without_free_coordinate() -> None:
    with pytest.raises(ComponentError, match="declare at least one Coordinate"):

        class Frozen(Mechanism):
            s = ActiveCoordinate("m", "driven")

            def kinetic_energy(self) -> ca.SX:
                return self.dot(self.s) ** 2


def test_clash_with_a_systematic_variable() -> None:
    with pytest.raises(ComponentError, match="two variables would be called 'x_load'"):

        class Clash(_Bead):
            x_load = Parameter(1.0, "N", "load")


def test_clash_with_the_base_class() -> None:
    with pytest.raises(ComponentError, match=r"Taken\.momentum: the name is taken by the base class"):

        class Taken(_Bead):
            momentum = Parameter(1.0, "N", "momentum")  # pyright: ignore[reportAssignmentType]


def test_default_outside_its_own_domain() -> None:
    with pytest.raises(ComponentError, match=r"Outside\.height: default -1 m is outside .* must be > 0"):

        class Outside(_Bead):
            height = Parameter(-1.0, "m", "height", above=0)


def test_contradictory_bounds() -> None:
    with pytest.raises(ComponentError, match="either the excluded bound"):
        Parameter(1.0, "m", "height", above=0, minimum=0)


def test_non_finite_default() -> None:
    with pytest.raises(ComponentError, match="nan is not finite"):
        Parameter(float("nan"), "m", "height")


def test_point_must_return_components() -> None:
    with pytest.raises(ComponentError, match=r"Vector\.bob: return the components"):

        class Vector(_Bead):
            @point("m", "the bob")  # pyright: ignore[reportArgumentType]
            def bob(self) -> ca.SX:
                return ca.vertcat(self.x, 0)


def test_momentum_of_something_that_is_no_free_coordinate() -> None:
    with pytest.raises(ComponentError, match=r"Wrong: momentum\(\) takes one of its coordinates or constraints: x"):

        class Wrong(_Bead):
            @output("kg.m/s", "momentum")
            def p(self) -> ca.SX:
                return self.momentum(self.mass)


def test_operator_with_unknown_symbol() -> None:
    with pytest.raises(ComponentError, match=r"unknown symbol self\.amplitud; did you mean 'amplitude'\?"):

        class Wave(Operator):
            amplitude = Parameter(1.0, "", "amplitude")

            def signal(self, t: ca.SX) -> ca.SX:
                return self.amplitud * ca.sin(t)
