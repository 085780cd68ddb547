"""Units through expressions: what cannot be right is refused with the term, what is unknown is let pass."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import pytest

from liaisons import Chain
from liaisons.errors import ComponentError
from liaisons.language import (
    Coordinate,
    Input,
    InternalState,
    Joint,
    Mechanism,
    Operator,
    Parameter,
    assertion,
    calculated,
    constraint,
    non_holonomic,
    output,
    point,
    rheonomic_constraint,
    unchecked,
)
from liaisons.mechanics import assemble


class Bead(Mechanism, abstract=True):
    """A bead in the plane, the starting point of every case below."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    gravity = Parameter(9.81, "m/s2", "gravitational acceleration")
    stiffness = Parameter(2.0, "N/m", "stiffness")
    scale = Parameter(1.0, "m", "a length", above=0)
    exponent = Parameter(2.0, "1", "an exponent")
    empirical = Parameter(1.0, "kg", "of a fit", unchecked="its exponent was fitted")
    z = Coordinate("m", "height", start=0.5)
    x = Coordinate("m", "distance", start=0.5)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * (self.dot(self.z) ** 2 + self.dot(self.x) ** 2)


Formula = Callable[[Any], Any]


def bead(potential: Formula) -> type[Bead]:
    return type("Falling", (Bead,), {"potential_energy": potential, "__module__": __name__})


WRONG: list[tuple[Formula, str]] = [
    (
        lambda m: m.mass * m.z,
        r"Falling\.potential_energy: mass\*z is kg\.m where J is expected: a factor of m/s2 is missing",
    ),
    (
        lambda m: m.mass * m.gravity * m.z - m.stiffness * m.x / 2 + m.stiffness * m.z**2,
        r"the term stiffness\*x/2 is N where J is expected: a factor of m is missing",
    ),
    (lambda m: m.mass * m.gravity * (m.z + m.mass), r"in z \+ mass, z is m but mass is kg; they must have one unit"),
    (
        lambda m: m.mass * m.gravity * (m.z - 0.35),
        r"in z - 0\.35, z is m but 0\.35 is a pure number; they must have one unit; 0\.35 counts as a pure number",
    ),
    (lambda m: m.mass * m.gravity * m.scale * ca.sin(m.z), r"sin\(z\) takes a pure number or an angle, but z is m"),
    (lambda m: ca.exp(m.x * m.z), r"exp\(x\*z\) takes a pure number .* is m2"),
    (lambda m: m.mass * m.gravity * ca.sqrt(m.z), r"sqrt\(z\) is kg\.m\(3/2\)/s2 where J .* of m\(1/2\)"),
    (lambda m: m.stiffness * m.z**1.5, r"stiffness\*z\^1\.5 is kg\.m\(3/2\)/s2 where J"),
    (lambda m: m.stiffness * m.z**m.exponent, "under an exponent .* z is m"),
    (lambda m: m.stiffness * m.z**2 * (m.x / m.z) ** m.z, "an exponent must .* but z is m"),
    (lambda m: ca.atan2(m.z, m.mass), r"in atan2\(z, mass\), z is m but mass is kg"),
    (lambda m: ca.fmax(m.stiffness * m.z**2, m.mass), r"in fmax\(.*, stiffness\*z\^2 is J but mass is kg"),
    (lambda m: ca.if_else(m.z > m.mass, m.stiffness * m.z**2, 0), r"in \(mass < z\), mass is kg but z is m"),
    (
        lambda m: m.stiffness * m.z**2 * (m.z == m.mass),
        r"in \(.* == .*\), (z is m but mass is kg|mass is kg but z is m)",
    ),
    (
        lambda m: m.stiffness * m.z**2 * (m.z != m.mass),
        r"in \(.* != .*\), (z is m but mass is kg|mass is kg but z is m)",
    ),
    (
        lambda m: ca.if_else(m.z > 0, m.stiffness * m.z**2, m.stiffness * m.x),
        r"the term if_else\(not\(\(0 < z\)\), stiffness\*x\) is N where J is expected",
    ),
    (lambda m: m.mass * float(m.z), "nan is in it: .* ca.sin"),
]

RIGHT: list[Formula] = [
    lambda m: 2 * m.mass * m.gravity * m.z / 3,
    lambda m: m.stiffness / 2 * ca.fmax(m.z, 0) ** 2 + 0,
    lambda m: m.stiffness * m.z**4 / (m.z**2 + (m.z**2 == 0)),
    lambda m: ca.if_else(m.z > 0, m.stiffness * m.z**2, 0) + ca.if_else(m.x > m.z, m.stiffness, 0) * m.x**2,
    lambda m: m.stiffness * m.z**2 + (m.z != m.x) + (m.z < m.x) + ca.logic_not(m.z <= m.x),
    lambda m: m.stiffness * m.scale**2 * (m.z / m.scale) ** m.exponent * ca.exp(-m.x / m.scale),
    lambda m: m.mass * m.gravity * ca.sqrt(m.z**2 + m.x**2),
    lambda m: m.mass * m.gravity * ca.hypot(m.z, m.x) * ca.sin(ca.atan2(m.z, m.x)),
    lambda m: m.mass * m.gravity * (m.x * m.z**2) ** (1 / 3),
    lambda m: m.stiffness * m.scale**3 / m.x,
    lambda m: m.stiffness * ca.sign(m.z) * m.z**2 + m.stiffness * ca.copysign(m.z, m.mass) * ca.fabs(m.x),
    lambda m: m.empirical * m.z**1.7 + m.mass * m.gravity * m.z,
]


@pytest.mark.parametrize(("potential", "words"), WRONG)
def test_what_cannot_be_an_energy_is_refused_with_the_term(potential: Formula, words: str) -> None:
    with pytest.raises(ComponentError, match=words) as refused:
        bead(potential)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("potential", RIGHT)
def test_what_is_right_or_unknown_passes(potential: Formula) -> None:
    assert assemble(bead(potential)).name == "Falling"


DECLARED: dict[str, tuple[Any, str]] = {
    "speed": (output("m", "its speed")(lambda m: m.dot(m.z)), r"Falling\.speed: z_dot is m/s where m is expected"),
    "place": (point("m", "where it is")(lambda m: {"z": m.z**2}), r"Falling\.place\['z'\]: z\^2 is m2 where m is"),
    "weight": (calculated("N", "its weight")(lambda m: m.mass), r"Falling\.weight: mass is kg where N is expected"),
    "wire": (constraint("m", "on a wire")(lambda m: m.z**2), r"Falling\.wire: z\^2 is m2 where m is expected"),
    "edge": (non_holonomic("m", "of a skate")(lambda m: m.dot(m.x)), r"Falling\.edge: x_dot is m/s where m is"),
    "pulled": (
        rheonomic_constraint("m", "a rope", start=0.25)(lambda m: m.z**2),
        r"Falling\.pulled: z\^2 is m2 where m",
    ),
    "up": (assertion("z must stay > 0")(lambda m: m.z + m.mass), r"Falling\.up: in z \+ mass, z is m but"),
    "push": (output("N", "p")(lambda m: m.momentum(m.z)), r"Falling\.push: p_z is kg\.m/s where N is expected"),
    "friction_coefficient": (lambda m: m.mass, r"Falling\.friction_coefficient: mass is kg where 1/s is expected"),
    "dissipation_function": (lambda m: m.mass, r"Falling\.dissipation_function: mass is kg where W is expected"),
    "lagrangian": (lambda m: m.kinetic_energy() - m.mass * m.z, r"Falling\.lagrangian: the term mass\*z is kg\.m"),
}


@pytest.mark.parametrize("name", DECLARED)
def test_every_declaration_has_the_unit_of_its_expression(name: str) -> None:
    declaration, words = DECLARED[name]
    with pytest.raises(ComponentError, match=words):
        type("Falling", (Bead,), {name: declaration, "__module__": __name__})


def test_kinetic_energy_and_internal_rates() -> None:
    with pytest.raises(ComponentError, match=r"Massless\.kinetic_energy: z_dot\^2 is m2/s2 where J"):

        class Massless(Bead):
            def kinetic_energy(self) -> ca.SX:
                return self.dot(self.z) ** 2

    with pytest.raises(ComponentError, match=r"Hot\.internal_rates\['xi'\]: mass is kg where 1/s2 is expected"):

        class Hot(Bead):
            xi = InternalState("1/s", "friction")

            def internal_rates(self) -> dict[str, ca.SX]:
                return {"xi": self.mass}


def test_unchecked_says_why() -> None:
    class Fitted(Bead):
        """From a table."""

        @unchecked("a fit, in SI units")
        def potential_energy(self) -> ca.SX:
            return 3.2 * self.z**1.7

        @output("m", "from the same table", unchecked="a fit")
        def reading(self) -> ca.SX:
            return self.z**1.7

    assert Fitted.reading.unchecked == "a fit"
    for reason in (True, "", None):
        with pytest.raises(ComponentError, match="say why"):
            unchecked(reason)  # pyright: ignore[reportArgumentType]
    with pytest.raises(ComponentError, match="say why"):
        Parameter(1.0, "kg", "mass", unchecked=True)  # pyright: ignore[reportArgumentType]


class Row(Chain, abstract=True):
    """Links that turn, each carrying the place and the angle of the next."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    length = Parameter(1.0, "m", "length of a link", above=0)
    stiffness = Parameter(1.0, "N.m", "of a joint")
    angle = Coordinate("rad", "angle")
    joint = Joint("m", "x", phi="rad")

    def base(self) -> dict[str, ca.SX]:
        return {"x": ca.SX(0), "phi": ca.SX(0)}

    def tip(self) -> dict[str, ca.SX]:
        phi = self.joint["phi"] + self.angle
        return {"x": self.joint["x"] + self.length * ca.sin(phi), "phi": phi}

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.length**2 * self.dot(self.tip()["phi"]) ** 2


@pytest.mark.parametrize(
    ("name", "method", "words"),
    [
        ("bond_energy", lambda m: m.angle**2, r"Links\.bond_energy: angle\^2 is a pure number where J is expected"),
        ("potential_energy", lambda m: m.stiffness * m.joint["x"], r"Links\.potential_energy: .* is kg\.m3/s2 where J"),
        ("tip", lambda m: {"x": m.angle, "phi": m.angle}, r"Links\.tip\['x'\]: angle is a pure number where m"),
        ("base", lambda m: {"x": m.length, "phi": m.length}, r"Links\.base\['phi'\]: length is m where rad is"),
        ("bond_dissipation", lambda m: m.stiffness, r"Links\.bond_dissipation: stiffness is J where W is expected"),
        ("end", point("m", "end")(lambda m: {"x": m.angle}), r"Links\.end\['x'\]: angle is a pure number where m"),
    ],
)
def test_links_of_a_chain(name: str, method: Any, words: str) -> None:
    type("Links", (Row,), {"__module__": __name__})  # as it stands it is right
    with pytest.raises(ComponentError, match=words):
        type("Links", (Row,), {name: method, "__module__": __name__})


def test_operators_know_time_and_take_any_unit() -> None:
    class Wave(Operator):
        """A wave of any unit."""

        amplitude = Parameter(1.0, "", "amplitude")
        period = Parameter(1.0, "s", "period", above=0)
        measured = Input("rad", "what it sees")

        def signal(self, t: ca.SX) -> ca.SX:
            return self.amplitude * ca.sin(2 * ca.pi * t / self.period)

    assert assemble(Wave).name == "Wave"
    with pytest.raises(ComponentError, match=r"Wrong\.signal: sin\(t\) takes a pure number or an angle, but t is s"):

        class Wrong(Wave):
            """The sine of seconds."""

            def signal(self, t: ca.SX) -> ca.SX:
                return self.amplitude * ca.sin(t)

    with pytest.raises(ComponentError, match=r"Early\.events\[0\]: measured is a pure number where s is expected"):

        class Early(Wave):
            """An instant that is an angle."""

            def events(self) -> list[ca.SX]:
                return [self.measured]


def test_long_terms_are_cut() -> None:
    long = lambda m: sum((m.z * m.x / m.scale) ** k * m.scale ** (1 - k) for k in range(1, 30))  # noqa: E731
    with pytest.raises(ComponentError) as refused:
        bead(lambda m: m.mass * (long(m) * 2 + 3.5 * m.scale))
    assert len(str(refused.value)) < 250
    assert "..." in str(refused.value)
