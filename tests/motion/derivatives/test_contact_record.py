"""What the core of an FMU writes down of its contacts: against closed forms, and as the header declares it."""

from __future__ import annotations

import re
from importlib import resources
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from liaisons.errors import SimulationError
from liaisons.mechanics import assemble
from liaisons.models import BouncingBall, DryOscillator
from liaisons_motion.derivatives.contacts import Kind
from liaisons_motion.ensembles import Members

Record = tuple[NDArray[Any], NDArray[Any]]
BALL = {"height_0": 1.0, "bounce": 0.8}
FALL = np.sqrt(2 / 9.81)
"""Instant of the first impact [s]; each flight behind lasts 2 FALL 0.8^n."""


def recorded(component: Any, values: dict[str, float], ends: list[float], **inputs: Any) -> list[Record]:
    member = Members(assemble(component).flat(), 1)
    return member.record(values, inputs, np.array(ends), time=0.0, tolerance=1e-13)


def test_kinds_are_those_of_the_header() -> None:
    header = (resources.files("liaisons.fmu") / "runtime" / "contact_record.h").read_text("utf-8")
    names = re.search(r"enum \{ (SETTLED.*) \}", header)
    assert names is not None
    assert names[1].split(", ") == [kind.name for kind in Kind if kind >= 0]


def test_impacts_of_a_ball() -> None:
    """At FALL and 2.6 FALL it is thrown back at 0.8 and 0.64 of the rate at which it came first."""
    (first_events, first), (events, acts) = recorded(BouncingBall, BALL, [1.0, 1.5])
    assert first_events["kind"].tolist() == [
        Kind.SETTLED,
        Kind.SETTLED,
        Kind.STRUCK,
        Kind.SETTLED,
    ]  # start, step, event
    assert first_events["which"].tolist() == [-1, -1, -1, 0]
    np.testing.assert_allclose(first_events["time"], [0, 0, FALL, FALL], rtol=1e-12)
    np.testing.assert_allclose(first["impulse"][2], 1.8 * 9.81 * FALL, rtol=1e-12)
    assert (first["mode"][2], first["approaches"][2], first["counts"][2]) == (1, 1, 1)
    assert first["mode"][3] == 0  # it is in the air again
    assert events["kind"].tolist() == [Kind.SETTLED, Kind.STRUCK, Kind.SETTLED]
    assert events["which"].tolist() == [-1, -1, 0]
    np.testing.assert_allclose(events["time"], [1.0, 2.6 * FALL, 2.6 * FALL], rtol=1e-12)
    np.testing.assert_allclose(acts["impulse"][1], 0.8 * 1.8 * 9.81 * FALL, rtol=1e-12)


def test_a_ball_comes_to_rest_when_its_bounces_would_have_ended() -> None:
    ((events, acts),) = recorded(BouncingBall, BALL, [6.0])
    (stop,) = np.flatnonzero(events["kind"] == Kind.CAME_TO_REST)
    assert acts["mode"][stop] == 1
    last = np.flatnonzero(events["kind"] == Kind.SETTLED)[-1]
    assert acts["mode"][last] == 1
    np.testing.assert_allclose(acts["rests_from"][last], FALL * 9, rtol=1e-9)  # (1 + e)/(1 - e)
    assert events["time"][stop] < 9 * FALL
    assert acts["counts"].sum() == pytest.approx(np.ceil(np.log(1e-6) / np.log(0.64)), abs=1)


def test_more_records_than_there_is_room_for_at_first() -> None:
    ((events, acts),) = recorded(BouncingBall, {"height_0": 1e-3, "bounce": 1.0}, [20.0])
    fall = np.sqrt(2e-3 / 9.81)
    struck = events["kind"] == Kind.STRUCK
    assert len(events) > 1000
    np.testing.assert_allclose(events["time"][struck], fall * np.arange(1, 2 * struck.sum(), 2), rtol=1e-9)
    assert acts["counts"][struck].all()


def test_friction_that_sticks_and_slips() -> None:
    """On a belt at 0.2 m/s it sticks until the spring pulls with 0.3 of its weight."""
    values = {"mu_static": 0.3, "mu_sliding": 0.2, "belt_dot": 0.2, "x_0": 0.0, "x_dot_0": 0.2}
    ((events, acts),) = recorded(DryOscillator, values, [10.0])
    kinds, modes = events["kind"].tolist(), acts["mode"][:, 0]
    ends = (events["kind"] == Kind.SETTLED) & (events["which"] == 0)
    assert kinds[0] == Kind.WEAK_RATE  # it begins at the rate of the belt
    assert set(kinds[1:]) == {Kind.SETTLED}
    assert modes[1] == 0
    assert modes[ends][:5].tolist() == [-1, 0, -1, 0, -1]
    np.testing.assert_allclose(events["time"][ends][0], 0.3 * 0.981 / 0.2, rtol=1e-12)


def test_numbers_that_are_0_by_chance() -> None:
    """On the table at the start: its gap and its rate are 0, and so would others not be."""
    ((events, acts),) = recorded(BouncingBall, {"height_0": 0.0, "bounce": 0.5}, [0.1])
    kinds = events["kind"].tolist()
    assert kinds[:3] == [Kind.WEAK_GAP, Kind.WEAK_RATE, Kind.SETTLED]
    assert events["scale"][:2].min() > 0
    assert kinds[3:] == [Kind.SETTLED]  # then it rests
    assert acts["mode"][2] == acts["mode"][3] == 1


def test_inputs_follow_their_polynomials() -> None:
    """A table that rises as t^5 meets a ball without weight at t = 1."""
    powers = np.array([0.0, 0, 0, 0, 0, 120])
    inputs = {name: np.pad(powers[n:], (0, n))[None] for n, name in enumerate(("table", "table_dot", "table_ddot"))}
    ((events, acts),) = recorded(BouncingBall, {"height_0": 1.0, "bounce": 0.0, "gravity": 0.0}, [1.05], **inputs)
    (struck,) = np.flatnonzero(events["kind"] == Kind.STRUCK)
    np.testing.assert_allclose(events["time"][struck], 1, rtol=1e-12)
    np.testing.assert_allclose(acts["impulse"][struck], 5, rtol=1e-11)


def test_a_motion_that_ends_says_why() -> None:
    with pytest.raises(SimulationError, match=r"gap = -0\.5 at t = 0: bodies overlap; start with a gap >= 0"):
        recorded(BouncingBall, {"height_0": -0.5}, [1.0])
