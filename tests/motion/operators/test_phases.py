"""Plans with phases of contacts: optima against the calculus of variations, replays by the FMUs' own contact logic."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize

from liaisons import Plan, hold, observe, plan
from liaisons.errors import PlanError
from liaisons.language import (
    ActiveCoordinate,
    Coordinate,
    Gravity,
    Mechanism,
    Parameter,
    Size,
    dry_friction,
    unilateral,
)

from .conftest import verified

GRAVITY = 9.81
STROKE: dict[str, Any] = {
    "start": {"height": 0.0},
    "end": {"height": 0.5, "height_dot": 0, "table": 0, "table_dot": 0},
    "duration": (0.1, 3),
    "minimize": "table_ddot**2",
    "phases": [{"gap": "closed", "duration": 0.25}, {"gap": "open"}],
}
"""A table throws a ball half a metre high and is back where it was when the ball is at its highest."""


def cubic(begin: tuple[float, float], end: tuple[float, float], T: float) -> float:
    """Least ∫ s̈² dt from one position and velocity to another: that of Hermite's cubic, whose s̈ is linear in t."""
    d, (v, w) = end[0] - begin[0], (begin[1], end[1])
    return 12 * d**2 / T**3 - 12 * d * (v + w) / T**2 + 4 * (v**2 + v * w + w**2) / T


def least(cost: Callable[..., float], *first: float) -> float:
    """Least value of a function of some numbers."""
    options = {"xatol": 1e-10, "fatol": 1e-13, "maxiter": 10_000, "maxfev": 10_000}
    x = np.array(first)
    for _ in range(2):
        x = minimize(lambda x: cost(*x), x, method="Nelder-Mead", options=options).x
    return float(cost(*x))


def end_error(motion: Plan) -> float:
    """Largest miss of the end by the FMUs."""
    run, end = motion.replay(), motion.goal.end
    assert isinstance(end, dict)
    return max(abs(run[name][-1] - value) for name, value in end.items())


@pytest.fixture(scope="module")
def stroke() -> Plan:
    return plan("BouncingBall", tries=1, **STROKE)


def test_a_ball_is_lifted_by_one_stroke_of_least_effort(stroke: Plan) -> None:
    """Thrown with the speed v from h - v²/2g, it flies for v/g, in which the table comes back."""

    def cost(v: float) -> float:
        release = (0.5 - v**2 / (2 * GRAVITY), v)
        return cubic((0, 0), release, 0.25) + cubic(release, (0, 0), v / GRAVITY)

    assert stroke.cost == pytest.approx(least(cost, 2.5), rel=1e-12)
    assert "contacts change modes at the planned instants" in verified(stroke)
    assert end_error(stroke) < 1e-11
    assert stroke.sigma(stroke.switches)["table_ddot"] < -GRAVITY < stroke.sigma(stroke.switches - 1e-9)["table_ddot"]


def test_a_plan_with_phases_is_read_again(stroke: Plan, tmp_path: Path) -> None:
    stroke.save(tmp_path / "plan.json")
    again = Plan.load(tmp_path / "plan.json")
    assert again.goal.phases == stroke.goal.phases
    assert np.array_equal(again.sigma(0.1)["table"], stroke.sigma(0.1)["table"])
    assert plan("BouncingBall", guess=again, **STROKE).cost == pytest.approx(stroke.cost, rel=1e-12)


def test_a_plan_is_neither_copied_nor_pickled(stroke: Plan) -> None:
    with pytest.raises(PlanError, match=r"^<Plan of BouncingBall: .*> is neither copied nor pickled; save\(path\)"):
        pickle.dumps(stroke)


def test_a_mode_that_is_named_again_changes_nothing(stroke: Plan) -> None:
    closed = [{"gap": "closed", "duration": T} for T in (0.1, 0.15)]
    goal: dict[str, Any] = {**STROKE, "phases": [*closed, {"gap": "open"}]}
    again = plan("BouncingBall", tries=1, **goal)
    assert again.cost == pytest.approx(stroke.cost, rel=1e-12)
    assert again.switches == pytest.approx([0.1, 0.25], rel=1e-12)


@pytest.mark.parametrize("room", [hold, lambda motion: observe(motion, "height", {"height": 0.01})])
def test_a_plan_with_phases_is_neither_held_nor_observed(room: Callable[[Plan], Any], stroke: Plan) -> None:
    with pytest.raises(PlanError, match="takes no plan with phases, between which contacts change modes"):
        room(stroke)


def test_a_ball_is_kept_bouncing_by_a_table_that_comes_back() -> None:
    """It meets the table at z with the speed s, s² = 2g (1 - z), and leaves with it: the table has s(1 - e)/(1 + e)."""
    motion = plan(
        "BouncingBall",
        end={"height": 1.0, "height_dot": 0, "table": 0, "table_dot": 0},
        duration=(0.1, 3),
        minimize="table_ddot**2",
        phases=[{"gap": "open"}, {"gap": "open"}],
        tries=1,
    )

    def cost(z: float) -> float:
        s = np.sqrt(2 * GRAVITY * (1 - z))
        impact = (z, s * 0.2 / 1.8)
        return cubic((0, 0), impact, s / GRAVITY) + cubic(impact, (0, 0), s / GRAVITY)

    assert motion.cost == pytest.approx(least(cost, 0.01), rel=1e-12)
    run = motion.replay()
    assert end_error(motion) < 1e-11
    assert (run["gap_impacts"] == (run.time > motion.switches[0] * (1 + 1e-12))).all()


@pytest.mark.parametrize(("sign", "mode"), [(1, "forward"), (-1, "backward")])
def test_a_block_moves_by_stick_and_slip_alone(sign: int, mode: str) -> None:
    """A plate carries it to x with the speed v and comes back, while it slides on for v²/2μg."""
    friction = 0.3
    motion = plan(
        "DryOscillator",
        "belt",
        start={"x": 0.0},
        end={"x": sign * 0.1, "x_dot": 0, "belt": 0, "belt_dot": 0},
        duration=2.0,
        minimize="belt_ddot**2",
        phases=[{"slip": "sticks"}, {"slip": mode}],
        tries=1,
        stiffness=0.0,
        mu_static=friction,
        mu_sliding=friction,
    )

    def cost(v: float) -> float:
        T, release = v / (friction * GRAVITY), (0.1 - v**2 / (2 * friction * GRAVITY), v)
        return cubic((0, 0), release, 2 - T) + cubic(release, (0, 0), T)

    assert motion.cost == pytest.approx(least(cost, 1.0), rel=1e-12)
    assert end_error(motion) < 1e-11
    run = motion.replay()
    inside = run.time[1:-1]
    assert (run["slip_sticks"][1:-1] == (inside <= motion.switches[0] * (1 + 1e-12))).all()


def test_a_rope_goes_slack_and_taut() -> None:
    """A load is thrown up on its rope, which is slack for 0.6 s, and tugs without restitution."""
    motion = plan(
        "StringPendulum",
        "pivot_z",
        start={"x": 0.0, "z": -1.0},
        end={"z": -1.0, "pivot_z": 0, "pivot_z_dot": 0},
        duration=2.0,
        minimize="pivot_z_ddot**2",
        phases=[{"slack": "closed"}, {"slack": "open", "duration": 0.6}, {"slack": "closed"}],
        tries=1,
    )

    def cost(T: float, z: float, v: float, w: float) -> float:
        tug = (z + v * 0.6 - GRAVITY * 0.18, w)
        return cubic((0, 0), (z, v), T) + cubic((z, v), tug, 0.6) + cubic(tug, (0, 0), 1.4 - T)

    assert motion.cost == pytest.approx(least(cost, 0.8, 0.9, 2.3, -1.7), rel=1e-11)
    assert end_error(motion) < 1e-11
    run = motion.replay()
    slack = (run.time > motion.switches[0] * (1 + 1e-12)) & (run.time <= motion.switches[1] * (1 + 1e-12))
    assert (run["slack_closed"] == ~slack).all()
    assert run["impact_loss"][-1] > 1


@pytest.mark.slow
def test_a_ball_is_caught_at_rest() -> None:
    """With restitution it closes only where it arrives at the table's speed, so that nothing is lost."""
    goal: dict[str, Any] = {"end": {"table": 0, "table_dot": 0}, "duration": 0.6, "minimize": "table_ddot**2"}
    motion = plan("BouncingBall", phases=[{"gap": "open"}, {"gap": "closed"}], tries=4, **goal)

    def cost(T: float) -> float:
        catch = (1 - GRAVITY * T**2 / 2, -GRAVITY * T)
        return cubic((0, 0), catch, T) + cubic(catch, (0, 0), 0.6 - T)

    assert motion.cost == pytest.approx(least(cost, 0.38), rel=1e-11)
    verified(motion)
    assert abs(motion.replay()["impact_loss"][-1]) < 1e-12


FEET = (-1.0, 1.0, 0.2)


class Tray(Mechanism):
    """Tray in a plane on a table, on feet of which three or more are redundant; it stays where it lands."""

    feet = Size(3, "number of feet")
    mass, inertia = Parameter(1.0, "kg", "mass", above=0), Parameter(0.5, "kg.m2", "moment of inertia", above=0)
    bounce = Parameter(0.8, "1", "coefficient of restitution", minimum=0, maximum=1)
    along = Parameter(FEET, "m", "positions of the feet", size="feet")
    gravity = Gravity()
    height, tilt = Coordinate("m", "height of the centre"), Coordinate("rad", "angle with the horizontal")
    table = ActiveCoordinate("m", "height of the table")

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.height) ** 2 + self.inertia / 2 * self.dot(self.tilt) ** 2

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.height

    @unilateral("m", "heights of the feet above the table", restitution="bounce", size="feet")
    def gap(self) -> ca.SX:
        return self.height + self.along * ca.sin(self.tilt) - self.table


class Stool(Tray):
    """The same on two feet, which are not redundant."""

    feet = Size(2, "number of feet")


def on_all_feet(kind: type[Tray], *phases: dict[str, Any]) -> list[dict[str, Any]]:
    """Phases in which all feet have the mode of ``gap``."""
    names = [f"gap[{i}]" for i in range(1, kind.feet.default + 1)]
    return [{**{n: e for n, e in one.items() if n != "gap"}, **dict.fromkeys(names, one["gap"])} for one in phases]


@pytest.mark.parametrize("kind", [Stool, Tray])
def test_a_tray_on_redundant_feet_is_lifted_by_the_same_stroke_as_a_ball(kind: type[Tray], stroke: Plan) -> None:
    """Its forces by least norm add up to the ball's, and vanish at the same instant."""
    start = {"height": 0.0, "tilt": 0.0}
    goal: dict[str, Any] = STROKE | {"start": start, "phases": on_all_feet(kind, *STROKE["phases"])}
    motion = plan(kind, "table", tries=1, **goal)
    assert motion.cost == pytest.approx(stroke.cost, rel=1e-11)
    assert motion.duration == pytest.approx(stroke.duration, rel=1e-9)
    assert end_error(motion) < 1e-11
    run, count = motion.replay(), kind.feet.default
    closed = run.time < 0.24
    assert closed.sum() > 2
    forces = np.array([run[f"gap_force[{i}]"] for i in range(1, count + 1)])
    shares = np.linalg.pinv(np.vstack([np.ones(count), FEET[:count]]))[:, 0]
    pressing = GRAVITY + run["height_ddot"]
    np.testing.assert_allclose(forces[:, closed], np.outer(shares, pressing[closed]), rtol=1e-9)
    assert not forces[:, run.time > 0.26].any()


@pytest.mark.slow
@pytest.mark.parametrize("kind", [Stool, Tray])
def test_a_tray_on_redundant_feet_is_caught_as_a_ball_is(kind: type[Tray]) -> None:
    """Where it arrives at the table's speed, or sticks to it without restitution."""
    goal: dict[str, Any] = {
        "end": {"table": 0, "table_dot": 0},
        "duration": 0.6,
        "minimize": "table_ddot**2",
        "bounce": 0.8,
    }
    phases = [{"gap": "open"}, {"gap": "closed"}]
    ball = plan("BouncingBall", phases=phases, tries=4, start={"height": 1.0}, **goal)
    tray = plan(kind, phases=on_all_feet(kind, *phases), tries=4, start={"height": 1.0, "tilt": 0.0}, **goal)
    assert tray.cost == pytest.approx(ball.cost, rel=1e-10)
    verified(tray)
    assert abs(tray.replay()["impact_loss"][-1]) < 1e-12


class Parcel(Mechanism):
    """Parcel above a belt, which rubs with its weight; without restitution, so that it stays where it falls."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    gravity = Gravity()
    rubbing = Parameter(0.4, "1", "coefficient of friction", minimum=0)
    x = Coordinate("m", "horizontal position of the parcel")
    z = Coordinate("m", "height of the parcel", start=0.2)
    belt = ActiveCoordinate("m", "position of the belt")

    @unilateral("m", "distance of parcel and belt")
    def gap(self) -> ca.SX:
        return self.z

    @dry_friction("m/s", "sliding of the parcel on the belt", static="rubbing", sliding="rubbing", normal="gap")
    def slip(self) -> ca.SX:
        return self.dot(self.x) - self.dot(self.belt)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * (self.dot(self.x) ** 2 + self.dot(self.z) ** 2)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.z


@pytest.mark.slow
def test_a_parcel_that_lands_on_a_slow_belt_stays_on_it() -> None:
    """0.5 m/s are less than μ√(2 g h), so that the impact's impulse makes it stick."""
    motion = plan(
        Parcel,
        start={"belt_dot": 0.5},
        end={"x": 0.3, "belt_dot": 0},
        duration=1.5,
        minimize="belt_ddot**2",
        phases=[{"gap": "open"}, {"gap": "closed", "slip": "sticks"}],
        tries=1,
    )
    verified(motion)

    def cost(w: float) -> float:
        fall = float(np.sqrt(0.4 / GRAVITY))
        return (w - 0.5) ** 2 / fall + cubic((0, w), (0.3, 0), 1.5 - fall)

    assert motion.cost == pytest.approx(least(cost, 0.4), rel=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["backward", "forward"])
def test_a_parcel_rubs_at_the_impact(mode: str) -> None:
    """It falls for √(2 · 0.2/g): the impulse m u, u² = 0.4 g, rubs by μ m u, then μ g accelerates it."""
    sign = 1 if mode == "backward" else -1
    motion = plan(
        Parcel,
        start={"belt_dot": sign * 2.0},
        end={"x": sign * 0.8, "belt_dot": 0},
        duration=1.5,
        minimize="belt_ddot**2",
        phases=[{"gap": "open"}, {"gap": "closed", "slip": mode}, {"slip": "sticks"}],
        tries=1,
    )
    verified(motion)
    fall, run = np.sqrt(0.4 / GRAVITY), motion.replay()
    assert motion.switches[0] == pytest.approx(fall, rel=1e-10)
    after = np.searchsorted(run.time, motion.switches[0] + 1e-9)
    speed = 0.4 * GRAVITY * (fall + run.time[after] - motion.switches[0])
    assert run["x_dot"][after] == pytest.approx(sign * speed, rel=1e-8)


class Edge(Parcel):
    """Parcel whose distance has no derivative where it lies on the belt."""

    size = Parameter(1.0, "m", "scale of the distance", above=0)

    @unilateral("m", "distance of parcel and belt")
    def gap(self) -> ca.SX:
        return ca.sqrt(self.z * self.size)


def refused(**changes: Any) -> str:
    """Message of a stroke with other arguments."""
    with pytest.raises(PlanError) as caught:
        plan(changes.pop("mechanism", "BouncingBall"), tries=1, **STROKE | changes)
    assert "\n" not in str(caught.value)
    return str(caught.value)


PARCEL = {"mechanism": Parcel, "start": {}, "end": {"belt_dot": 0}, "minimize": "belt_ddot**2"}
"""A goal of the parcel."""


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"phases": None}, "no unilateral liaisons and no dry friction (gap); say with phases=[...]"),
        ({"phases": []}, "phases = []: give a list of modes by contact"),
        ({"phases": {"gap": "open"}}, "phases = {'gap': 'open'}: give a list of modes by contact"),
        ({"phases": [{"gap": "shut"}]}, "phases[0]: gap = 'shut': give 'closed' or 'open'"),
        ({"phases": [{"gap": "sticks"}]}, "phases[0]: gap = 'sticks': give 'closed' or 'open'"),
        ({"phases": [{"gap": "closed"}, {"gab": "open"}]}, "phases[1] has no contact 'gab'; did you mean 'gap'?"),
        ({"phases": [{"duration": 0.2}]}, "phases[0]: gap = None: give 'closed' or 'open'"),
        ({"phases": [{"gap": "closed"}, {}]}, "phases[1] names no contact; name one with its mode in this phase"),
        ({"phases": [{"gap": "open", "duration": -1}]}, "phases[0]: duration = -1: give seconds > 0"),
        ({"phases": [{"gap": "closed", "duration": (4, 5)}, {"gap": "open"}]}, "phases last 4 s to 8 s, and duration"),
        ({"start": {}}, "start: phases make gap = 1 there, not 0"),
        ({"phases": [{"gap": "open"}, {"gap": "closed"}]}, "end: phases make table = 0.5 there, not 0"),
        ({"start": {"height": -1}, "phases": [{"gap": "open"}]}, "start: phases make gap = -1 there, not in (0, inf)"),
        ({"end": {"height": -1, "table": 0}}, "BouncingBall: end: phases make gap = -1 there, not in (0, inf)"),
        (
            {"mechanism": "DryOscillator", "start": {"x_dot": 1}, "end": {"x": 2}, "phases": [{"slip": "backward"}]}
            | {"minimize": "belt_ddot**2"},
            "DryOscillator: start: phases make slip = 1 there, not in (-inf, 0)",
        ),
        ({"loops": 2, "closed": True}, "loops = 2: a motion with phases is planned as one; leave loops out"),
        ({"mechanism": "Swing", "start": {}, "end": {}}, "Swing has no unilateral liaison and no dry friction"),
        (
            PARCEL | {"phases": [{"gap": "open", "slip": "forward"}]},
            "phases[0]: slip = 'forward', but gap is open; leave slip out",
        ),
        (
            PARCEL | {"mechanism": Edge, "start": {"z": 0}, "phases": [{"gap": "open"}]},
            "Edge: start: gap has no derivative there; move it",
        ),
        (PARCEL | {"phases": [{"gap": "open"}, {"gap": "closed"}]}, "phases[1]: slip = None: give 'sticks' or"),
        (PARCEL | {"phases": [{"gap": "open"}, {"gap": "open"}]}, "Parcel: gap bounces where slip rubs; let it close"),
    ],
)
def test_what_phases_cannot_be_is_refused_in_one_line(changes: dict[str, Any], text: str) -> None:
    assert text in refused(**changes)


def test_a_phase_that_the_best_motion_does_not_have_is_named() -> None:
    """Without a time for the stroke, the table carries the ball up as slowly as it may."""
    stroke = {"end": {"height": 0.5, "height_dot": 0}, "phases": [{"gap": "closed"}, {"gap": "open"}]}
    text = refused(duration=(0.1, 1), intervals=6, **stroke)
    assert "phases[1] vanishes: the best motion has none; leave it out, or give its duration" in text


def test_what_cannot_be_reached_names_the_bound() -> None:
    """The table is too slow to throw the ball so high."""
    text = refused(bounds={"table_ddot": (-30, 5)}, intervals=6)
    assert "no motion was found from 1 starts, nearest height = 0.2" in text
    assert "active: table_ddot = 5, table_ddot = -30" in text
