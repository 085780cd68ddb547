"""A component that is declared wrongly is refused by name when its class is defined."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from liaisons.errors import ComponentError
from liaisons.language import ActiveCoordinate, Coordinate, Experiment, Mechanism, Operator, Parameter, output, point
from liaisons.mechanics import assemble
from liaisons.project import ProjectError, load_module


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


# ---- words for what is easily done wrong -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("kinetic_enery", "kinetic_energy"),
        ("potental_energy", "potential_energy"),
        ("kineticEnergy", "kinetic_energy"),
        ("dissipation_funtion", "dissipation_function"),
        ("lagrangien", "lagrangian"),
    ],
)
def test_misspelt_method_names_the_nearest_one(name: str, meant: str) -> None:
    with pytest.raises(ComponentError, match=f"Typo.{name}: nothing calls this method; did you mean '{meant}'"):
        type("Typo", (_Bead,), {name: lambda m: m.mass, "__module__": __name__})


def test_helpers_with_similar_names_are_left_alone() -> None:
    class Helped(_Bead):
        """Bead whose energy is put together from others'."""

        stiffness = Parameter(1.0, "N/m", "stiffness")

        def potential_energies(self) -> list[ca.SX]:
            return [self.stiffness / 2 * self.x**2, ca.SX(0)]

        def potential_energy(self) -> ca.SX:
            return ca.SX(sum(self.potential_energies()))

        def kinetic_energy_of_rotation(self) -> ca.SX:
            return ca.SX(0)

    assert assemble(Helped).name == "Helped"


def test_missing_method_is_named() -> None:
    with pytest.raises(ComponentError, match=r"Still defines no kinetic_energy\(\), which every Mechanism has to"):

        class Still(Mechanism):
            x = Coordinate("m", "position")

    with pytest.raises(ComponentError, match=r"Forgetful\.kinetic_energy returns nothing"):

        class Forgetful(_Bead):
            def kinetic_energy(self) -> ca.SX:  # pyright: ignore[reportReturnType]
                self.mass  # noqa: B018


LOOSE: dict[str, Any] = {item.__name__: item for item in (Parameter, Coordinate, ActiveCoordinate, Experiment, output)}
"""As who writes without a type checker has them."""


@pytest.mark.parametrize(
    ("declare", "words"),
    [
        (
            lambda: LOOSE["Parameter"](1.0, "mass of the bob"),
            r"Parameter: the unit is missing beside 'mass of the bob'",
        ),
        (
            lambda: LOOSE["Coordinate"]("height"),
            r"Coordinate: the unit is missing beside 'height'; write for",
        ),
        (lambda: LOOSE["Coordinate"]("m"), r"Coordinate: missing a required argument: 'description'"),
        (lambda: LOOSE["ActiveCoordinate"]("m", "length", begin=1.0), "ActiveCoordinate: got an unexpected .* 'begin'"),
        (lambda: LOOSE["output"]("its speed"), "output: the unit is missing beside 'its speed'"),
        (lambda: LOOSE["output"](lambda m: m.x), "output: missing a required argument: 'description'"),
        (lambda: LOOSE["Coordinate"]("m", "height", start="0.5"), "'height': '0.5' is text; write a number"),
        (lambda: LOOSE["Parameter"](1.0, "m", "height", above="0"), "'height': '0' is text; write a number"),
        (lambda: LOOSE["Experiment"](stop_time=-1), "Experiment: stop_time = -1: it must be a number > 0"),
        (lambda: LOOSE["Experiment"](step_size=0), "Experiment: step_size = 0: it must be a number > 0"),
        (lambda: LOOSE["Experiment"](tolerance=math.nan), "Experiment: tolerance = nan: it must be a number > 0"),
        (lambda: LOOSE["Experiment"](stop_time="10"), "Experiment: stop_time = '10': it must be a number > 0"),
    ],
)
def test_declaration_that_lacks_something(declare: Callable[[], Any], words: str) -> None:
    with pytest.raises(ComponentError, match=words):
        declare()


def test_only_operators_have_no_unit() -> None:
    with pytest.raises(ComponentError, match=r"Bare\.length has no unit; that of a pure number is '1'"):

        class Bare(_Bead):
            length = Parameter(1.0, "", "length")


def test_mass_that_is_zero_and_singular_start_are_told_apart() -> None:
    with pytest.raises(ComponentError, match=r"no mass moves with x_dot while mass = 0 kg; let its default be > 0"):

        class Weightless(_Bead):
            mass = Parameter(0.0, "kg", "mass")

    with pytest.raises(ComponentError, match=r"no mass moves with phi_dot at x = 0 m, where the start lies on a sing"):

        class Turning(_Bead):
            phi = Coordinate("rad", "angle")

            def kinetic_energy(self) -> ca.SX:
                return self.mass / 2 * (self.dot(self.x) ** 2 + self.x**2 * self.dot(self.phi) ** 2)

    with pytest.raises(ComponentError, match=r"mass matrix .* is not positive definite while upper = 0 kg"):

        class Coupled(_Bead):
            upper = Parameter(0.0, "kg", "mass of what moves alone")
            y = Coordinate("m", "another position")

            def kinetic_energy(self) -> ca.SX:
                both = (self.dot(self.x) + self.dot(self.y)) ** 2
                return self.mass / 2 * both + self.upper / 2 * self.dot(self.y) ** 2


class Bob(_Bead, abstract=True):
    """A bead with a point and a constant."""

    stiffness = Parameter(1.0, "N/m", "stiffness")

    @point("m", "the bob")
    def bob(self) -> dict[str, ca.SX]:
        return {"x": self.x, "z": 2 * self.x}


@pytest.mark.parametrize(
    ("square", "words"),
    [
        (lambda m: m.bob["q"] ** 2, r"Odd\.bob has no component 'q'; known: x, z"),
        (lambda m: m.x**2 if m.x > 0 else m.x, r"Odd\.potential_energy: 'if', .* use ca\.if_else"),
        (lambda m: max(m.x, 0) ** 2, r"Odd\.potential_energy: .* max\(\) .* ca\.fmax"),
        (
            lambda m: m.x**2 * np.cos(m.x / m.x),
            r"Odd\.potential_energy: a function of numpy is given a symbol; .* ca\.",
        ),
        (lambda m: np.sum(np.array([m.x, m.x]) * np.sign(m.x)), "a function of numpy is given a symbol"),
        (lambda m: m.x**2 * math.cos(m.x), r"Odd\.potential_energy: nan is in it: .* use ca\.sin"),
    ],
)
def test_python_that_knows_no_symbols(square: Callable[[Any], Any], words: str) -> None:
    with pytest.raises(ComponentError, match=words) as refused:
        type("Odd", (Bob,), {"potential_energy": lambda m: m.stiffness * square(m), "__module__": __name__})
    assert "\n" not in str(refused.value)


def test_numbers_of_numpy_are_numbers() -> None:
    class Scaled(Bob):
        """Factors and exponents out of numpy."""

        def potential_energy(self) -> ca.SX:
            return np.sqrt(2.0) * self.stiffness * self.x ** np.float64(2) * np.array([1.0, 3.0])[1]

    assert assemble(Scaled).name == "Scaled"


def test_errors_have_the_line_of_the_method(tmp_path: Path) -> None:
    path = tmp_path / "odd.py"
    path.write_text(
        "from liaisons import Coordinate, Mechanism, Parameter\n"
        "class Odd(Mechanism):\n"
        "    mass = Parameter(1.0, 'kg', 'mass', above=0)\n"
        "    x = Coordinate('m', 'position')\n"
        "    def kinetic_energy(self):\n"
        "        if self.x > 0:\n"
        "            return self.mass\n"
        "        return self.mass / 2 * self.dot(self.x) ** 2\n"
    )
    with pytest.raises(ProjectError, match=r"odd\.py:6: Odd\.kinetic_energy: 'if', "):
        load_module(path)


def test_a_symbol_is_a_letter() -> None:
    with pytest.raises(ComponentError, match=r"symbol = 3: write the letter as text"):
        Parameter(1.0, "kg", "mass", symbol=3)  # type: ignore[arg-type]
    assert Parameter(1.0, "kg", "mass", symbol="m_1").variable("parameter", "fixed").symbol == "m_1"
