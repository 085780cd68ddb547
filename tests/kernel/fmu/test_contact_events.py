"""Impacts in event mode: of co-simulation in FMI 3.0, and of model exchange."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from itertools import count

import numpy as np
import pytest
from driver import DISCARD, MODEL_EXCHANGE, OK, SIGNATURES, Instance, Library, reals
from numpy.typing import NDArray

from liaisons.models import BallRow, BouncingBall, DryOscillator

WITH_EVENTS = {"events": True, "early": True}
KNOWN = ("height", "height_dot", "impact_loss")
READ = (*KNOWN, "gap_impulse", "energy_balance")
RESTS = BouncingBall.rests_at()
COUNTED = int(np.log(1e-6) / np.log(0.8**2)) + 1
"""Impacts after a fall from more than a millionth of the first, which is from 1 m onto a table at 0."""


@pytest.fixture(scope="module")
def ball3(library) -> Library:
    return library(BouncingBall, "fmi3")


@pytest.fixture(scope="module", params=["fmi2", "fmi3"])
def ball(request, library) -> Library:
    return library(BouncingBall, request.param)


def exact(time: float) -> list[float]:
    """What is known then."""
    values = BouncingBall.exact(np.array([time]))
    return [values[name][0] for name in KNOWN]


def impacts(until: float) -> list[float]:
    """Instants √(2h/g) (1 + 2e + 2e² + ...)."""
    flights = (2 * 0.8**k for k in count(1))
    instants = [np.sqrt(2 / 9.81)]
    while instants[-1] <= until:
        instants.append(instants[-1] + next(flights) * instants[0])
    return instants[:-1]


# ---- co-simulation -----------------------------------------------------------------------------------------------


def handled(instance: Instance, size: float, steps: int, discrete: Callable[[], float] = float) -> list[float]:
    """So many steps, events handled where they are; returns their instants.  What is discrete changes there only."""
    instance.update()
    instance.do("EnterStepMode")
    instants = []
    for k in range(steps):
        time, end = k * size, (k + 1) * size
        while True:
            before, step = discrete(), instance.advance(time, end - time)
            assert (step.status, discrete()) == (OK, before)
            if step.event:
                instance.do("EnterEventMode")
                instance.update()
                instance.do("EnterStepMode")
                instants.append(step.time)
            if not step.early:
                break
            time = step.time
    return instants


@pytest.mark.parametrize("size", [0.01, 0.1, 1.0, 3.0])
def test_importer_gets_every_impact(ball3, size) -> None:
    """At its instant; and the motion is that of one who handles none."""
    instance, alone = ball3.start(options=WITH_EVENTS), ball3.start()
    np.testing.assert_allclose(handled(instance, size, round(3.0 / size)), impacts(3.0), rtol=0, atol=1e-12)
    alone.follow(size, round(3.0 / size))
    np.testing.assert_allclose(instance.get(*READ), alone.get(*READ), rtol=0, atol=1e-11)
    np.testing.assert_allclose(instance.get(*KNOWN), exact(3.0), rtol=0, atol=1e-11)


@pytest.mark.parametrize("parts", [1, 2, 3, 7, 10, 13])
def test_impacts_at_communication_points_are_events(ball3, parts) -> None:
    """An elastic ball, in steps of a part of its time to fall: what is discrete never changes inside a step."""
    instance, size = ball3.start(options=WITH_EVENTS, tolerance=1e-12, bounce=1.0), np.sqrt(2 / 9.81) / parts
    instants = handled(instance, size, 12 * parts - 1, lambda: instance.get_integer("gap_impacts"))
    assert len(instants) == instance.get_integer("gap_impacts") >= 5


@pytest.mark.parametrize("parts", [1, 2, 7])
def test_reversals_at_communication_points_are_events(library, parts) -> None:
    """Of what rubs, at rest for an instant after each half swing; five of them until it sticks."""
    instance, size = library(DryOscillator, "fmi3").start(options=WITH_EVENTS), np.pi / np.sqrt(10.0) / parts
    instants = handled(instance, size, 8 * parts, lambda: instance["slip_direction"])
    assert (len(instants), instance["slip_direction"]) == (5, 0)


def test_impacts_one_after_the_other_in_one_step(library) -> None:
    """Equal elastic balls swap their rates: at 0.9 s the first two, at 0.9 + 0.09/1.9 s the others, at 1 s again."""
    instance = library(BallRow).start(x_0=[0.0, 1.0, 2.0], x_dot_0=[1.0, 0.0, -0.9])
    instance.step(0.0, 2.0)
    assert instance.get("x", "x_dot") == pytest.approx(np.array([0.0, 1.0, 2.2, -0.9, 0.0, 1.0]), abs=1e-12)


@pytest.mark.parametrize("jump", [-5e-4, 5e-4])
def test_ball_at_rest_goes_with_a_table_that_jumps_a_little(ball, jump: float) -> None:
    """By less than a thousandth of its size; the work is that of its weight."""
    instance = ball.start(height_0=0.0)
    instance.step(0.0, 0.1)
    instance.set(table=jump)
    instance.step(0.1, 0.1)
    assert instance["height"] == pytest.approx(jump, abs=1e-15)
    assert instance["work"] == pytest.approx(9.81 * jump, rel=1e-12)
    assert instance["energy_balance"] == pytest.approx(0.0, abs=1e-15)


def test_rate_before_and_after_event_mode(ball3) -> None:
    instance = ball3.start(options=WITH_EVENTS)
    instance.update()
    instance.do("EnterStepMode")
    step = instance.advance(0.0, 1.0)
    assert (step.event, step.early) == (True, True)
    before, losses = instance["gap_dot"], instance["impact_loss"]
    assert before == pytest.approx(-np.sqrt(2 * 9.81), rel=1e-12)
    assert losses == 0
    instance.do("EnterEventMode")
    assert instance.update().states_changed
    assert instance["gap_dot"] == pytest.approx(-0.8 * before, rel=1e-12)
    assert instance["impact_loss"] == pytest.approx(9.81 * (1 - 0.8**2), rel=1e-12)
    assert instance.update() == (False, None)


def test_few_events_until_rest(ball3) -> None:
    """Bounces that are too low to be followed end where all of them would: at an event, which closes the gap."""
    instance = ball3.start(options=WITH_EVENTS)
    instants = handled(instance, 1.0, 5)
    assert len(instants) < 80
    assert instants[-1] == instance["gap_rests_from"]
    assert instance["gap_rests_from"] == pytest.approx(RESTS, abs=1e-11)
    assert instance.get("height", "height_dot").tolist() == [0.0, 0.0]
    assert instance["gap_force"] == pytest.approx(9.81, rel=1e-14)
    alone = ball3.start()
    alone.follow(1.0, 5)
    assert instance.get_integer("gap_impacts") == alone.get_integer("gap_impacts") == COUNTED
    for table in (instance, alone):  # it feels all of what the ball does, whose momentum is 0 at both ends
        assert table["table_impulse"] == pytest.approx(table["gap_impulse"], rel=1e-14)


# ---- model exchange ----------------------------------------------------------------------------------------------


class Integrator:
    """Importer of model exchange: midpoint rule, which is exact for a ball that flies."""

    def __init__(self, library: Library) -> None:
        self.instance = library.start(MODEL_EXCHANGE)
        self.time, self.instants = 0.0, list[float]()
        self.states = len(library.description.derivatives)
        self.event()
        self.instants.clear()

    def event(self) -> None:
        """From event mode on."""
        instance = self.instance
        event = instance.update()
        self.y = instance.vector("GetContinuousStates", self.states)
        instance.do("EnterContinuousTimeMode")
        self.next = event.next_time if event.next_time is not None else np.inf
        self.instants.append(self.time)

    def rates(self, size: float, y: NDArray) -> NDArray:
        """Derivatives that much later, in these states; the instance stays there."""
        self.instance.do("SetTime", self.time + size)
        self.instance.do("SetContinuousStates", reals(y), len(y))
        return self.instance.vector("GetContinuousStateDerivatives", len(y))

    def at(self, size: float) -> float:
        """The event indicator that much later; the instance stays there."""
        middle = self.y + size / 2 * self.rates(0.0, self.y)
        self.reached = self.y + size * self.rates(size / 2, middle)
        self.rates(size, self.reached)
        return float(self.instance.vector("GetEventIndicators", 1)[0])

    def run(self, stop: float, size: float, *, locates: bool) -> None:
        """Steps of a size; one in which the indicator crosses 0 is cut there, or left as it is."""
        while self.time < stop - 1e-12:
            step = min(size, stop - self.time, self.next - self.time)
            before = self.at(0.0)
            crossed = self.at(step) < 0 <= before
            if crossed and locates:
                low = 0.0
                while (middle := (low + step) / 2) not in {low, step}:
                    low, step = (low, middle) if self.at(middle) < 0 else (middle, step)
                self.at(step)
            self.time, self.y = self.time + step, self.reached
            event, end = self.instance.flags(1), self.instance.flags(1)
            self.instance.do("CompletedIntegratorStep", True, event, end)
            assert (bool(event[0]), bool(end[0])) == (crossed, False)  # who looks at no indicators is told here
            if crossed or self.time >= self.next:
                self.instance.do("EnterEventMode")
                self.event()


def test_crossings_that_are_located(ball) -> None:
    importer = Integrator(ball)
    importer.run(3.0, 0.05, locates=True)
    np.testing.assert_allclose(importer.instants, impacts(3.0), rtol=0, atol=1e-12)
    np.testing.assert_allclose(importer.instance.get(*KNOWN), exact(3.0), rtol=0, atol=1e-12)


@pytest.mark.parametrize("size", [1e-3, 1e-2])
def test_crossings_that_are_passed(ball, size) -> None:
    """An importer with fixed steps finds the ball below the table; what that does is of second order."""
    importer = Integrator(ball)
    importer.run(2.0, size, locates=False)
    assert len(importer.instants) == len(impacts(2.0))
    np.testing.assert_allclose(importer.instance.get(*KNOWN), exact(2.0), rtol=0, atol=200 * size**2)


def test_rest_is_announced(ball) -> None:
    """The event that sums the last bounces announces the one at which they end."""
    importer = Integrator(ball)
    importer.run(4.0637, 0.05, locates=True)
    importer.run(5.0, 0.05, locates=True)
    assert importer.instants[-1] == pytest.approx(RESTS, abs=1e-11)
    assert importer.instance["gap_rests_from"] == importer.instants[-1]
    assert importer.instance["height"] == 0.0
    assert importer.instance.get_integer("gap_impacts") == COUNTED
    assert importer.instance["gap_force"] == pytest.approx(9.81, rel=1e-14)


@pytest.mark.parametrize("version", ["fmi2", "fmi3"])
def test_modes_that_change_are_announced_where_no_state_jumps(library, version: str) -> None:
    """At the end of a half swing what slid back slides forth, or sticks: only its acceleration jumps."""
    for x, direction in ((-0.5, 1.0), (-0.05, 0.0)):
        instance = library(DryOscillator, version).running(x_dot_0=-1.0)
        instance.do("SetContinuousStates", reals([x, 0.0, 0.0, 0.0]), 4)
        instance.do("EnterEventMode")
        assert instance["slip_direction"] == -1.0
        assert instance.update().states_changed
        assert instance.get("x", "x_dot", "slip_direction").tolist() == [x, 0.0, direction]
        assert not instance.update().states_changed


@pytest.mark.parametrize("drift", [-1e-6, 1e-6])
def test_errors_of_an_importer_are_no_impacts(ball: Library, drift: float) -> None:
    """What is closed is put back, and the importer is told; a table that is pushed at the same event hits the ball."""
    instance = ball.running(height_0=0.0)
    instance.do("SetContinuousStates", reals([drift, drift, 0.0, 0.0]), 4)
    instance.do("EnterEventMode")
    assert instance.update().states_changed
    assert instance.get("height", "height_dot", "gap_impulse", "impact_loss").tolist() == [0.0] * 4
    assert instance["gap_force"] == 9.81
    instance.do("EnterContinuousTimeMode")
    instance.do("SetContinuousStates", reals([drift, drift, 0.0, 0.0]), 4)
    instance.do("EnterEventMode")
    instance.set(table_dot=0.5)
    instance.update()
    assert instance.get("height_dot", "gap_impulse") == pytest.approx([0.9, 0.9], rel=1e-14)
    assert not instance.update().states_changed


@pytest.mark.parametrize("acceleration", [-2.0, 0.0, 2.0])
def test_an_impact_on_a_moving_table_is_found_late(ball: Library, acceleration: float) -> None:
    """By 10 ms, after which it is right to the square of that; e = 0.8; the ball falls from 1 m onto 0.5 m."""
    instance = ball.start(MODEL_EXCHANGE, table=0.5, table_dot=0.1, table_ddot=acceleration)
    instance.go_on()
    t = np.roots([(9.81 + acceleration) / 2, 0.1, -0.5]).max()  # 1 - g t²/2 = 0.5 + 0.1 t + a t²/2
    falls, rises = -9.81 * t, 0.1 + acceleration * t
    leaves = rises - 0.8 * (falls - rises)
    end = t + 0.01  # when it is told
    states = instance.vector("GetContinuousStates", 4)
    states[:2] = 1 - 9.81 * end**2 / 2, -9.81 * end
    instance.do("SetTime", end)
    table = 0.5 + 0.1 * end + acceleration * end**2 / 2
    instance.set(table=table, table_dot=0.1 + acceleration * end, table_ddot=acceleration)
    instance.do("SetContinuousStates", (ctypes.c_double * 4)(*states), 4)
    assert instance["gap_indicator"] < 0
    instance.do("EnterEventMode")
    instance.go_on()
    assert instance["gap_impulse"] == pytest.approx(leaves - falls, abs=5e-3)
    assert instance["height_dot"] == pytest.approx(leaves - 9.81 * 0.01, abs=5e-3)
    assert instance["height"] == pytest.approx(1 - 9.81 * t**2 / 2 + leaves * 0.01 - 9.81 / 2 * 0.01**2, abs=1e-3)


def test_an_event_that_is_discarded_leaves_the_state(ball) -> None:
    """The energy at this momentum is no number."""
    instance = ball.running(MODEL_EXCHANGE)
    states = [1e200] * ball.states
    instance.do("SetContinuousStates", reals(states), len(states))
    instance.do("EnterEventMode")
    before = instance.serialize()
    update = "NewDiscreteStates" if ball.fmi == "2" else "UpdateDiscreteStates"
    results = [ctypes.cast(ctypes.create_string_buffer(64), kind) for kind in SIGNATURES[ball.fmi][update]]
    assert instance.call(update, *results) == DISCARD
    assert instance.serialize() == before
