"""A component that is declared wrongly is refused by name when its class is defined."""

import math
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest

import liaisons
from liaisons.base.project import load_module
from liaisons.errors import ComponentError, ProjectError
from liaisons.language import (
    ActiveCoordinate,
    Box,
    Coordinate,
    DiscreteState,
    Experiment,
    Input,
    Mechanism,
    Operator,
    Parameter,
    SampledStates,
    dry_friction,
    output,
    point,
    unilateral,
)
from liaisons.mechanics import assemble


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


def test_a_rate_has_a_name_of_its_own() -> None:
    class Bead(_Bead):
        """Bead."""

    bead: Any = Bead()
    assert ca.is_equal(bead.x_dot, bead.dot(bead.x))
    assert ca.is_equal(bead.x_ddot, bead.dot(bead.x_dot))


def square(rate: Any) -> Callable[[Any], ca.SX]:
    """A kinetic energy: half the mass times the square of a rate."""
    return lambda m: m.mass / 2 * rate(m) ** 2


REFUSED: list[tuple[dict[str, Any], str]] = [
    ({"potential_energy": lambda m: m.x_ddot}, r"potential_energy contains the unknown symbol 'x_ddot'"),
    ({"potential_energy": lambda m: m.mass_dot}, r"unknown symbol self\.mass_dot"),
    ({"potential_energy": lambda m: m.mas * m.x}, r"Odd: unknown symbol self\.mas; did you mean 'mass'\?"),
    (
        {"potential_energy": lambda m: ca.SX.sym("stiffness") * m.x**2 / 2},
        r"Odd\.potential_energy contains the unknown symbol 'stiffness'",
    ),
    ({"potential_energy": lambda _: ca.SX.sym("x") ** 2}, r"Odd\.potential_energy contains the unknown symbol 'x'"),
    ({"potential_energy": lambda m: m.dot(m.x) ** 2}, r"potential_energy contains the unknown symbol 'x_dot'"),
    (
        {"kinetic_energy": lambda m: ca.vertcat(m.dot(m.x), 1)},
        r"Odd\.kinetic_energy has shape \(2, 1\); return a scalar",
    ),
    ({"potential_energy": lambda _: "mgz"}, r"Odd\.potential_energy returns 'mgz'"),
    ({"kinetic_energy": lambda _: None}, r"Odd\.kinetic_energy returns nothing"),
    (
        {"potential_energy": lambda m: m.x * (1 / 0)},
        r"potential_energy: ZeroDiv.* \(test_declarations\.py, line \d+\)",
    ),
    ({"y": Coordinate("m", "position of nothing")}, r"Odd: mass matrix is singular .* no kinetic energy belongs to y"),
    (
        {"y": Coordinate("m", "moves together with x"), "kinetic_energy": square(lambda m: m.dot(m.x) + m.dot(m.y))},
        r"Odd: mass matrix .* is not positive definite",
    ),
    (
        {
            "light": Parameter(299792458.0, "m/s", "speed of light"),
            "kinetic_energy": lambda m: -m.mass * m.light**2 * ca.sqrt(1 - (m.dot(m.x) / m.light) ** 2),
        },
        "must be quadratic in the rates",
    ),
    (
        {"belt": Parameter(1.0, "m/s", "speed of the belt"), "kinetic_energy": square(lambda m: m.dot(m.x) + m.belt)},
        r"must be quadratic in the rates; .*belongs to lagrangian",
    ),
    (
        {
            "scale": Parameter(1.0, "m", "a length"),
            "kinetic_energy": lambda m: m.mass / 2 * m.dot(m.x) ** 2 * m.scale / m.x,
        },
        r"Odd: the kinetic energy is not finite at the start .*x = 0",
    ),
    ({"mass": Parameter(0.0, "kg", "mass")}, r"no mass moves with x_dot while mass = 0 kg; let its default be > 0"),
    (
        {
            "phi": Coordinate("rad", "angle"),
            "kinetic_energy": lambda m: m.mass / 2 * (m.dot(m.x) ** 2 + m.x**2 * m.dot(m.phi) ** 2),
        },
        r"no mass moves with phi_dot at x = 0 m, where the start lies on a sing",
    ),
    (
        {
            "upper": Parameter(0.0, "kg", "mass of what moves alone"),
            "y": Coordinate("m", "another position"),
            "kinetic_energy": lambda m: square(lambda m: m.dot(m.x) + m.dot(m.y))(m) + m.upper / 2 * m.dot(m.y) ** 2,
        },
        r"mass matrix .* is not positive definite while upper = 0 kg",
    ),
    (
        {"x_load": Parameter(1.0, "N", "what it carries")},
        r"two variables would be called 'x_load': 'what it carries' and 'generalised force that this mechanism exerts",
    ),
    ({"time": Parameter(1.0, "s", "duration")}, "called 'time': 'which every FMU has' and 'duration'"),
    (
        {"picture": lambda m: [Box({"x": m.x}, size=(1, 1, 1))]},  # pyright: ignore[reportCallIssue]
        r"Odd\.picture: TypeError: .*missing .*'axes' \(test_declarations\.py, line \d+\)",
    ),
    (
        {"picture": lambda m: [Box({"x": m.x}, ca.SX([1, 0, 0]), (1, 1, 1))]},
        r"Odd\.picture: .*rotation matrix \(3, 3\), e\.g\. turned\('y', self\.theta\)",
    ),
    ({"picture": lambda m: m.x}, r"Odd\.picture returns SX\(x\); return a list of Rod"),
    ({"momentum": Parameter(1.0, "N", "momentum")}, r"Odd\.momentum: the name is taken by the base class"),
    ({"height": Parameter(-1.0, "m", "height", above=0)}, r"Odd\.height: default -1 m is outside .* must be > 0"),
    ({"length": Parameter(1.0, "", "length")}, r"Odd\.length: its unit is missing; that of a pure number is '1'"),
    (
        {"bob": point("m", "the bob")(lambda m: ca.vertcat(m.x, 0))},  # pyright: ignore[reportArgumentType]
        r"Odd\.bob: return the components",
    ),
    (
        {"p": output("kg.m/s", "momentum")(lambda m: m.momentum(m.mass))},
        r"Odd: momentum\(\) takes one of its coordinates or constraints: x",
    ),
]


@pytest.mark.parametrize(("namespace", "words"), REFUSED)
def test_what_is_wrong_is_refused_by_name(namespace: dict[str, Any], words: str) -> None:
    with pytest.raises(ComponentError, match=words):
        type("Odd", (_Bead,), namespace | {"__module__": __name__})


class _Sledge(_Bead, abstract=True):
    """A bead that may rub on a belt, and run against a wall."""

    bounce = Parameter(0.5, "1", "coefficient of restitution", minimum=0, maximum=1)
    grip = Parameter(3.0, "N", "what holds it", minimum=0)
    rough = Parameter(0.5, "1", "coefficient of friction", minimum=0)
    belt = ActiveCoordinate("m", "way of the belt")


def gap(formula: Callable[[Any], Any] = lambda m: m.x - m.belt, unit: str = "m", **options: Any) -> dict[str, Any]:
    """A unilateral liaison of that name."""
    return {"gap": unilateral(unit, "distance", **options)(formula)}


def slip(static: Any = "grip", formula: Any = lambda m: m.dot(m.x - m.belt), **options: Any) -> dict[str, Any]:
    """Dry friction of that name."""
    return {"slip": dry_friction("m/s", "sliding", static=static, **options)(formula)}


@pytest.mark.parametrize(
    ("namespace", "words"),
    [
        (gap(lambda m: m.belt), r"gap: depends on no free coordinate \(x\), so that nothing upholds it$"),
        (gap(lambda _: 1.0), r"gap: depends on no free coordinate \(x\), so that nothing upholds it$"),
        (gap(lambda m: m.x > 0, "1"), r"gap: depends on no free coordinate \(x\), so that nothing upholds it$"),
        (gap(lambda m: ca.vertcat(m.x, m.belt)), r"gap has shape \(2, 1\); return a scalar, \(1, 1\)$"),
        (gap(lambda m: m.dot(m.x), "m/s"), r"gap contains the unknown symbol 'x_dot'; known: .*belt, .*, x$"),
        (gap(unit="rad"), r"gap: .*is m where rad is expected"),
        (
            gap(restitution="bounse"),
            r"gap: has the restitution 'bounse': let it be a Parameter in \[0, 1\]: minimum=0, ma",
        ),
        (
            gap(restitution=0.5),
            r"gap: has the restitution 0\.5: let it be a Parameter in \[0, 1\]: minimum=0, maximum=1$",
        ),
        (gap(restitution="mass"), r"gap: has the restitution 'mass': let it be a Parameter in \[0, 1\]"),
        (
            gap(restitution="e") | {"e": Parameter(0.5, "m", "restitution", minimum=0, maximum=1)},
            r"gap: has the restitution 'e' in m: let its unit be '1'$",
        ),
        (
            gap() | {"push": output("N", "of the wall")(lambda m: m.contact_force("gup"))},
            r": contact_force\('gup'\) takes one of its unilateral liaisons or dry frictions: gap$",
        ),
        (gap() | {"gap_force": Parameter(1.0, "N", "force")}, r": two variables would be called 'gap_force': "),
        (slip("grib"), r"slip: is bounded by 'grib', which is neither a parameter nor a method; did you mean 'grip'"),
        (
            slip(3.0),
            r"slip: is bounded by 3\.0, which is neither a parameter nor a method; known: bounce, grip, mass, rough$",
        ),
        (slip(None), r"slip: is bounded by None, which is neither a parameter nor a method; known: "),
        (slip(sliding="grib"), r"slip: is bounded by 'grib', which is neither a parameter nor a method; did you mean"),
        (slip("rough"), r"Odd\.rough: rough is a pure number where N is expected"),
        (gap() | slip(normal="gap"), r"Odd\.grip: grip is N where 1 is expected"),
        (
            slip("rough", normal="gup"),
            r"slip: takes the force of normal = 'gup': name a unilateral liaison: there is none$",
        ),
        (gap() | slip("rough", normal=1), r"slip: takes the force of normal = 1: name a unilateral liaison: gap$"),
        (
            slip("drag") | {"drag": Parameter(1.0, "N", "friction")},
            r"slip: is bounded by 'drag', which may be negative: let it have minimum=0$",
        ),
        (
            slip("drag") | {"drag": lambda m: -2 * m.grip},
            r"slip: is bounded by 'drag', which is -6 for the default parameters; let it be >= 0$",
        ),
        (
            slip(sliding="drag") | {"drag": lambda m: 2 * m.grip},
            r"slip: has static = 'grip' of 3, but sliding = 'drag' is 6: let static be no less$",
        ),
        (
            slip(formula=lambda m: m.dot(m.belt)),
            r"slip: depends on no rate of a free coordinate \(x\): take self\.dot\(\)",
        ),
        (slip(formula=lambda m: m.dot(m.x) ** 2), r"slip: must be linear in the rates"),
    ],
)
def test_contacts_are_refused_by_name(namespace: dict[str, Any], words: str) -> None:
    with pytest.raises(ComponentError, match=words) as error:
        type("Odd", (_Sledge,), namespace | {"__module__": __name__})
    assert str(error.value).startswith("Odd")
    assert "\n" not in str(error.value)


def test_an_active_coordinate_may_move_nothing() -> None:
    """Its operator feels no force."""

    class Alone(_Sledge):
        """A bead, and a belt that it does not touch."""

    assert liaisons.derive(Alone).evaluate("operator_forces") == 0.0


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


LOOSE: Any = SimpleNamespace(
    **{item.__name__: item for item in (Parameter, Coordinate, ActiveCoordinate, Experiment, output)}
)
"""As who writes without a type checker has them."""
NOTHING = {"kinetic_energy": lambda _: ca.SX(0)}
WAVE = {"amplitude": Parameter(1.0, "", "amplitude"), "signal": lambda m, t: m.amplitud * ca.sin(t)}


@pytest.mark.parametrize(
    ("declare", "words"),
    [
        (lambda: LOOSE.Parameter(1.0, "mass of the bob"), r"Parameter: the unit is missing beside 'mass of the bob'"),
        (lambda: LOOSE.Parameter(1.0), r"Parameter: missing a required argument: 'unit'; write for example"),
        (lambda: LOOSE.Parameter(1.0, "kg", ""), "say in the description what it is"),
        (lambda: LOOSE.Parameter(1.0, "kilogram", "mass"), "unit 'kilogram' is not understood at 'kilogram'"),
        (lambda: LOOSE.Parameter(1.0, "kg/m/s", "mass"), "not understood"),
        (lambda: LOOSE.Parameter(1.0, 3, "mass"), "unit 3"),
        (lambda: LOOSE.Parameter(1.0, "m", "height", above=0, minimum=0), "either the excluded bound"),
        (lambda: LOOSE.Parameter(math.nan, "m", "height"), "'height' = nan: must be a finite number"),
        (lambda: LOOSE.Parameter(1.0, "m", "height", above="0"), "'height' = '0': must be a finite number"),
        (lambda: LOOSE.Parameter(1.0, "kg", "mass", symbol=3), r"symbol = 3: write the letter as text"),
        (lambda: LOOSE.Coordinate("height"), r"Coordinate: the unit is missing beside 'height'; write for"),
        (lambda: LOOSE.Coordinate("m"), r"Coordinate: missing a required argument: 'description'"),
        (lambda: LOOSE.Coordinate("m", "height", start="0.5"), "'height' = '0.5': must be a finite number"),
        (lambda: LOOSE.ActiveCoordinate("m", "length", begin=1.0), "ActiveCoordinate: got an unexpected .* 'begin'"),
        (lambda: LOOSE.output("its speed"), "output: the unit is missing beside 'its speed'"),
        (lambda: LOOSE.output(lambda m: m.x), "output: missing a required argument: 'description'"),
        (lambda: LOOSE.Experiment(stop_time=-1), "Experiment: stop_time = -1: must be > 0"),
        (lambda: LOOSE.Experiment(step_size=0), "Experiment: step_size = 0: must be > 0"),
        (lambda: LOOSE.Experiment(tolerance=math.nan), "Experiment: tolerance = nan: must be a finite number"),
        (lambda: LOOSE.Experiment(stop_time="10"), "Experiment: stop_time = '10': must be a finite number"),
        (lambda: type("Frozen", (Mechanism,), NOTHING), "declare at least one Coordinate"),
        (
            lambda: type("Still", (Mechanism,), {"x": Coordinate("m", "position")}),
            r"Still defines no kinetic_energy\(\), which every Mechanism has to",
        ),
        (lambda: type("Wave", (Operator,), WAVE), r"unknown symbol self\.amplitud; did you mean 'amplitude'\?"),
    ],
)
def test_declaration_that_lacks_something(declare: Callable[[], Any], words: str) -> None:
    with pytest.raises(ComponentError, match=words):
        declare()


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


def test_a_symbol_is_the_letter_of_a_variable() -> None:
    assert Parameter(1.0, "kg", "mass", symbol="m_1").variable("parameter", "fixed").symbol == "m_1"


def test_units_of_samples_of_an_operator_are_checked_unless_it_says_why_not() -> None:
    class Held(Operator, SampledStates, abstract=True):
        """A number of its own unit from a length."""

        reading = Input("m", "what is read")

        def signal(self, t: ca.SX) -> ca.SX:  # noqa: ARG002 - the same at all times
            return self.period

        def update(self) -> dict[str, ca.SX]:
            return {"last": self.reading}

    with pytest.raises(ComponentError, match=r"update\['last'\]: reading is m where s is expected"):
        type("Checked", (Held,), {"last": DiscreteState("s", "a number")})
    law = DiscreteState("s", "a number", unchecked="an empirical law")
    assert assemble(type("Empirical", (Held,), {"last": law})).memory == ("last_before", "last", "last_sample")
