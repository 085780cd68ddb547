"""What contacts cannot do is refused in one line with their names and the instant, and the state is kept."""

from __future__ import annotations

import math
import re
from collections.abc import Callable

import bodies
import pytest
from driver import DISCARD, ERROR, MODEL_EXCHANGE, Instance, reals

from liaisons import Mechanism
from liaisons.models import BouncingBall


@pytest.fixture
def version() -> str:
    """What is refused is the same in both."""
    return "fmi2"


def start(library, body: type[Mechanism], version: str, **values: float) -> Instance:
    return library(body, version).start(**values)


def rough_rod(angle: float, **values: float) -> dict[str, float]:
    """Start values of a rod whose left tip slides to the left on the floor."""
    return {"angle_0": angle, "z_0": math.sin(angle), "x_dot_0": -2.0, **values}


def until_refused(
    instance: Instance, size: float, inputs: Callable[[float], dict[str, float]] | None = None
) -> tuple[int, int, str]:
    """Status, number and message of the first step that is refused and leaves no trace; inputs by time."""
    for k in range(100):
        instance.set(inputs(k * size) if inputs else {})
        before = instance.serialize()
        if status := instance.step(k * size, size, None):
            assert status in (DISCARD, ERROR)
            assert instance.serialize() == before
            (text,) = instance.messages
            instance.messages.clear()
            return status, k, text
    raise AssertionError("no step is refused")


# ---- at the start -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("body", "values", "message"),
    [
        (BouncingBall, {"height_0": -1e-3}, "gap = -0.001 at t = 0: bodies overlap; start with a gap >= 0"),
        (BouncingBall, {"height_0": -2e-9}, "gap = -2e-09 at t = 0: bodies overlap; start with a gap >= 0"),
        (BouncingBall, {"height_0": 0.0, "table": 0.5}, "gap = -0.5 at t = 0: bodies overlap; start with a gap >= 0"),
        (
            BouncingBall,
            {"height_0": 1e12 + 1, "table": 1e12},  # 8000 times the distance of two numbers there, and not followed
            (
                "gap = 1 at t = 0 is too small beside positions of 2e+12: start with 0 or more than 200, or measure "
                "positions from near the contact"
            ),
        ),
        (BouncingBall, {"bounce": 1.1}, "bounce = 1.1 at t = 0: it must be in [0, 1]"),
        (BouncingBall, {"bounce": -0.1}, "bounce = -0.1 at t = 0: it must be in [0, 1]"),
        (bodies.Flat, {"x_0": 0.0, "x_dot_0": 0.0}, "cube at t = 0: it moves no mass (effective mass inf)"),
        (
            bodies.Rod,
            rough_rod(1.0, grip=3.0, drag=3.0),
            "left at t = 0: no force keeps them apart and in their bounds (Painlevé)",
        ),
        (
            bodies.Block,
            {"grip": 0.05, "drag": 0.1},
            "slip at t = 0: its static bound 0.05 must be at least the sliding one, 0.1, and that >= 0",
        ),
        (
            bodies.Press,
            {"height_0": 0.0, "press": 0.0, "press_dot": -1.0},
            "floor_gap, press_gap at t = 0: they contradict each other, or what pushes leaves no way out",
        ),
    ],
)
def test_start_is_refused(library, version, body, values, message) -> None:
    """And another one is taken."""
    instance = library(body, version).initializing(**values)
    instance.refuse(f"{message}; set another value and initialize again", "ExitInitializationMode")
    defaults = {
        "grip": 2.0,
        "table": 0.0,
        "press": 1.0,
        "press_dot": 0.0,
        "bounce": 0.5,
        "height_0": 0.5,
    }
    instance.set({name: defaults.get(name, 1.0) for name in values} | ({"z_0": 2.0} if body is bodies.Rod else {}))
    instance.exit_initialization()
    instance.step(0.0, 0.01)


@pytest.mark.parametrize("below", [0.0, 1e-12, 9e-10])
def test_rounding_is_closed(library, version, below) -> None:
    instance = start(library, BouncingBall, version, height_0=-below)
    assert instance["gap"] == 0
    instance.step(0.0, 1.0)
    assert instance["gap"] == 0
    assert instance["gap_force"] == pytest.approx(9.81, rel=1e-12)
    # It was lifted by so much.
    assert instance["energy_balance"] == pytest.approx(0.0, abs=1.01 * 9.81 * below)


def test_closed_and_approaching_is_an_impact_at_once(library, version) -> None:
    instance = start(library, BouncingBall, version, height_0=0.0, height_dot_0=-2.0, bounce=0.5, mass=3.0)
    assert instance.get_integer("gap_impacts") == 1
    assert instance.get("gap_dot", "gap_impulse", "impact_loss", "energy_balance") == pytest.approx(
        [1.0, 3.0 * 3.0, 3.0 / 2 * (2.0**2 - 1.0), 0.0], abs=1e-15
    )


# ---- on the way -------------------------------------------------------------------------------------------------


def pressed(t: float, speed: float = 1.0) -> dict[str, float]:
    """A press that comes down."""
    return {"press": 1 - speed * t, "press_dot": -speed}


@pytest.mark.parametrize(
    ("body", "values", "inputs", "message"),
    [
        (
            bodies.Press,
            {"bounce": 0.0},
            pressed,
            r"floor_gap, press_gap at t = 1: they contradict each other, or what pushes leaves no way out",
        ),
        (
            bodies.Press,
            {"height_0": 0.0},
            pressed,
            r"floor_gap, press_gap at t = 1: they contradict each other, or what pushes leaves no way out",
        ),
        (  # it bounces ever faster between them
            bodies.Press,
            {"bounce": 0.5},
            pressed,
            r"floor_gap, press_gap at t = 1: more than 1000 impacts at one instant",
        ),
        (
            BouncingBall,
            {},
            lambda t: {"table": 2.0 if t > 0.25 else 0.0},
            r"gap = -1\.4\d* at t = 0\.3: bodies overlap; a prescribed coordinate must not jump through a body",
        ),
    ],
)
def test_step_is_refused(library, version, body, values, inputs, message) -> None:  # noqa: PLR0917
    """It is taken back whole, also after impacts inside it; the next one is not misled by it."""
    instance = start(library, body, version, **values)
    status, k, text = until_refused(instance, 0.1, inputs)
    assert re.fullmatch(rf"{message}; the step from t = [\d.]+ is taken back", text)
    if status == DISCARD:
        instance.step(k * 0.1, 1e-3)
        assert instance.messages == []


def test_press_that_stops_in_time(library, version) -> None:
    instance = start(library, bodies.Press, version, bounce=0.9)
    for k in range(99):
        t = 0.01 * k
        instance.set(press=1 - t, press_dot=-1.0)
        instance.step(t, 0.01)
    instance.set(press=0.01, press_dot=0.0)
    for k in range(99, 300):
        instance.step(0.01 * k, 0.01)
        assert instance["press_gap"] >= -1e-12
        assert instance["floor_gap"] >= -1e-12
    assert abs(instance["energy_balance"]) <= 1e-9 * (instance["energy"] + instance["impact_loss"])


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_numbers_that_are_none(library, version, value) -> None:
    """At an impact, too."""
    instance = start(library, BouncingBall, version, height_0=0.0, height_dot_0=-1.0)
    before = instance.serialize()
    assert instance.set({"table": value}, None) == DISCARD
    assert instance.messages == [f"table = {value}: set a finite number; it stays 0"]
    assert instance.serialize() == before


def test_motion_into_a_paradox_is_refused(library, version) -> None:
    """A rod lands on its rough tip and turns, until the force that would hold the tip has no bound."""
    values = rough_rod(0.9) | {"z_0": math.sin(0.9) + 1e-4, "x_dot_0": -10.0, "grip": 1.4, "drag": 1.4, "bounce": 0.0}
    _, _, text = until_refused(start(library, bodies.Rod, version, **values), 0.01)
    assert re.match(r"left must have one force while slip slides \(Painlevé\); at t = 0\.0360\d* it does not", text)


def test_steps_of_fixed_size_are_refused(library, version) -> None:
    for body, name in ((BouncingBall, "gap"), (bodies.Block, "slip")):
        instance = library(body, version).initializing()
        instance.set_integer("symplectic_steps", 0)
        instance.set_integer("symplectic_steps", 3, ERROR)
        assert instance.messages == [f"symplectic_steps = 3: steps of fixed size do not end at events of {name}; set 0"]
        assert instance.get_integer("symplectic_steps") == 0
        instance.exit_initialization()


def test_importer_that_steps_over_an_event_is_told(library, version) -> None:
    """In model exchange: a ball that is found deep in the table."""
    instance = library(BouncingBall, version).running(MODEL_EXCHANGE)
    count = library(BouncingBall, version).count("height", "p_height", "work", "dissipated")
    y = instance.vector("GetContinuousStates", count)
    y[0] = -0.5
    instance.do("SetTime", 0.5)
    instance.do("SetContinuousStates", reals(y), len(y))
    instance.do("EnterEventMode")
    with pytest.raises(AssertionError, match=r"gap = -0\.5 at t = 0\.5: bodies overlap; an event was stepped"):
        instance.update()
