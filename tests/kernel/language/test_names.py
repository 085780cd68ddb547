"""No declaration is called as a variable that its FMU has of something else."""

from collections.abc import Callable
from functools import partial
from itertools import cycle
from typing import Any
from xml.etree import ElementTree

import casadi as ca
import pytest

from liaisons.errors import ComponentError
from liaisons.fmu import model_description
from liaisons.language import (
    ActiveCoordinate,
    Chain,
    Coordinate,
    DiscreteOutput,
    Input,
    InternalState,
    Joint,
    Mechanism,
    Operator,
    Orientation,
    Parameter,
    Sampled,
    Size,
    calculated,
    constraint,
    dry_friction,
    non_holonomic,
    output,
    point,
    rheonomic_constraint,
    unilateral,
)
from liaisons.linkages import Body, Linkage, Prismatic, Revolute, Universal, ground
from liaisons.mechanics import assemble


class _Sledge(Mechanism, abstract=True):
    """Everything that a mechanism may declare."""

    n = Size(2, "number of beads")
    mass = Parameter(1.0, "kg", "mass", above=0)
    grip = Parameter(3.0, "N", "what holds it", minimum=0)
    x = Coordinate("m", "position")
    y = Coordinate("m", "height")
    row = Coordinate("m", "places", size="n")
    belt = ActiveCoordinate("m", "way of the belt")
    heat = InternalState("1", "temperature")
    turned = Orientation("attitude")
    gap = unilateral("m", "distance")(lambda m: m.x + 3)
    slip = dry_friction("m/s", "sliding", static="grip")(lambda m: m.dot(m.x))
    bob = point("m", "the bob")(lambda m: {"x": m.x, "z": m.y})
    rod = constraint("m", "the rod")(lambda m: m.x - m.y)
    pull = rheonomic_constraint("m", "the rope", start=0.0)(lambda m: m.x + m.y)

    def kinetic_energy(self) -> ca.SX:
        rates = ca.vertcat(self.dot(self.x), self.dot(self.y), self.dot(self.row), self.dot(self.belt))
        return self.mass / 2 * ca.sumsqr(rates) + ca.sumsqr(self.turned.rate) / 2 * self.mass

    def internal_rates(self) -> dict[str, ca.SX]:
        return {"heat": ca.SX(0)}


class _Bare(_Sledge, abstract=True):
    """The same, with its units unchecked."""

    def _check(self) -> None: ...


class Whole(_Bare):
    """A sledge."""


KINDS: dict[str, Callable[[], Any]] = {
    "free": lambda: Coordinate("m", "of my own"),
    "array": lambda: Coordinate("m", "of my own", size="n"),
    "active": lambda: ActiveCoordinate("m", "of my own"),
    "parameter": lambda: Parameter(1.0, "m", "of my own"),
    "output": lambda: output("m", "of my own")(lambda m: 5 * m.x),
    "calculated": lambda: calculated("kg", "of my own")(lambda m: 5 * m.mass),
    "point": lambda: point("m", "of my own")(lambda m: {"x": m.x}),
    "constraint": lambda: constraint("m", "of my own")(lambda m: m.x),
    "non_holonomic": lambda: non_holonomic("m/s", "of my own")(lambda m: m.dot(m.x)),
    "rheonomic": lambda: rheonomic_constraint("m", "of my own", start=0.0)(lambda m: m.x),
    "unilateral": lambda: unilateral("m", "of my own")(lambda m: m.x),
    "dry friction": lambda: dry_friction("m/s", "of my own", static="grip")(lambda m: m.dot(m.x)),
    "orientation": lambda: Orientation("of my own", prefix="mine_"),
    "internal state": lambda: InternalState("m", "of my own"),
    "size": lambda: Size(3, "of my own"),
}


def given_names() -> list[str]:
    """Names that the FMUs of the sledge have, and that it does not declare."""
    names: set[str] = set()
    for fmi in ("2", "3"):
        root = ElementTree.fromstring(model_description(assemble(Whole), fmi, guid="{0}"))
        names |= {item.get("name", "").partition("[")[0] for item in root.find("ModelVariables") or ()}
    return sorted(names - {*vars(Whole), *vars(_Sledge)})


@pytest.mark.variants(core=0)
def test_whatever_an_fmu_gives_is_no_name() -> None:
    """Each name with two kinds of declarations in turn, those of the account with all of them."""
    given = given_names()
    assert {"x_dot", "p_row", "q_w", "gap_closed", "bob_x_load", "lambda_rod", "slip_sticks"} <= set(given)
    turns = cycle(KINDS)
    accounts = {"energy", "work", "dissipated", "energy_balance", "impact_loss", "power", "time"}
    assert accounts <= {*given, "time"}
    for name in given:
        for kind in KINDS if name in accounts else (next(turns), next(turns)):
            with pytest.raises(ComponentError, match=rf"\b{name}\b.*choose another") as caught:
                type("Odd", (_Bare,), {name: KINDS[kind](), "__module__": __name__})
            assert "\n" not in str(caught.value), (name, kind)


@pytest.mark.parametrize(
    ("declared", "words"),
    [
        ({"x_dot": KINDS["free"]()}, "x_dot is the rate of x: choose another name"),
        ({"energy": KINDS["output"]()}, "energy is the energy T \\+ V: choose another name"),
        ({"gap_closed": KINDS["point"]()}, "gap_closed says whether gap rests at 0: choose another name"),
        ({"row_dot": KINDS["array"]()}, "row_dot is the rate of row"),
        ({"row_force": KINDS["parameter"]()}, "row_force is the generalised force"),
        # Neither is declared: both points would make the port bob_x_x.
        ({"bob_x": KINDS["point"](), "bob": point("m", "b")(lambda m: {"x_x": m.x})}, "rename the parameter"),
    ],
)
def test_the_sentence_says_what_has_the_name(declared: dict[str, Any], words: str) -> None:
    with pytest.raises(ComponentError, match=words):
        type("Odd", (_Bare,), declared | {"__module__": __name__})


def test_impact_loss_is_kept_free_without_contacts() -> None:
    with pytest.raises(ComponentError, match="impact_loss is the energy lost by impacts"):

        class Bead(Mechanism):
            """A bead."""

            impact_loss = Coordinate("m", "place")

            def kinetic_energy(self) -> ca.SX:
                return ca.SX(1) * self.dot(self.impact_loss) ** 2


def test_symbols_of_a_chains_joint_are_its_own() -> None:
    with pytest.raises(ComponentError, match="joint_x says where a link meets the one before"):

        class Row(Chain):
            """A row of masses."""

            joint = Joint("m", "x")
            joint_x = Parameter(1.0, "kg", "mass")
            x = Coordinate("m", "place")

            def tip(self) -> dict[str, ca.SX]:
                return {"x": self.x}

            def kinetic_energy(self) -> ca.SX:
                return self.joint_x / 2 * self.dot(self.x) ** 2


@pytest.mark.parametrize("name", ["y_ddot", "s_dot", "t", "time", "coupling_error"])
def test_an_operators_own_names(name: str) -> None:
    members = {"s": InternalState("m", "filter"), name: Parameter(1.0, "m", "mine"), "__module__": __name__}
    methods = {"signal": lambda m, _: m.s, "internal_rates": lambda _: {"s": ca.SX(0)}}
    with pytest.raises(ComponentError, match=rf"called '{name}'.*choose another name"):
        type("Odd", (Operator,), members | methods)


@pytest.mark.parametrize(
    ("names", "kinds", "words"),
    [
        (("energy", "j"), (Revolute, Revolute), "energy is the energy T"),
        (("j", "j_dot"), (Revolute, Revolute), "j_dot is the rate of j"),
        (("p_j", "j"), (Prismatic, Revolute), "p_j is the momentum"),
        (("j_x", "j"), (Revolute, Universal), "declares j_x, as j_x does"),
        (("j", "j_x"), (Universal, Revolute), "declares j_x, as Revolute does"),
        (
            ("j", "j_force"),
            (partial(Revolute, prescribed=True), Revolute),
            "j_force is the generalised force of the op",
        ),
        (
            ("j", "k_offset_1_residual", "k"),  # of the joint that closes a loop
            (partial(Revolute, axis="y"),) * 3,
            "k_offset_1_residual says what is not kept",
        ),
    ],
)
def test_joints_of_linkages(names: tuple[str, ...], kinds: tuple[Any, ...], words: str) -> None:
    a, b = Body(1.0, 1.0, (0, 0, 1)), Body(1.0, 1.0, (0, 0, 1))
    ends = ((ground, a), (a, b), (ground, b))
    joints = {name: kind(*two, at=(0, 0, 1)) for name, kind, two in zip(names, kinds, ends, strict=False)}
    if len(joints) == 3:
        joints["k"].at = (0, 0, 2)
    with pytest.raises(ComponentError, match=words):
        type("Odd", (Linkage,), {"a": a, "b": b, **joints, "__module__": __name__})


def test_a_declaration_of_the_base_class_stays_of_its_kind() -> None:
    """The period of a sampled component is no output of it, gravity no joint of a linkage; another parameter is."""
    a = Body(1.0, 1.0, (0, 0, 1))
    with pytest.raises(ComponentError, match=r"Odd\.gravity: the base class has a Parameter of this name; cho"):
        type("Odd", (Linkage,), {"a": a, "gravity": Revolute(ground, a), "__module__": __name__})
    members = {"x": Input("m", "place"), "update": lambda m: {"period": m.x}, "__module__": __name__}
    with pytest.raises(ComponentError, match=r"Odd\.period: the base class has a Parameter of this name"):
        type("Odd", (Sampled,), members | {"period": DiscreteOutput("s", "mine")})
    on_the_moon = {"a": a, "gravity": Parameter(1.62, "m/s2", "of the moon"), "j": Revolute(ground, a, axis="y")}
    assert type("Moon", (Linkage,), on_the_moon | {"__module__": __name__}).gravity.start == 1.62
