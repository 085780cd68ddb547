"""Closed forms of contacts against event by event integration: 40 digits where there are roots to find."""

from __future__ import annotations

from itertools import combinations
from types import SimpleNamespace
from typing import Any

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from liaisons.closed_forms import Values
from liaisons.errors import ValidityError
from liaisons_catalogue.solutions import ball_row, bead_on_sphere, bouncing_ball, dry_oscillator, string_pendulum


class At(SimpleNamespace):
    array, require = Values.array, Values.require


def ball(**values: float) -> Any:
    return At(
        **{"mass": 1.0, "bounce": 0.8, "gravity": 9.81, "height_0": 1.0, "height_dot_0": 0.0, "table": 0.0} | values
    )


def bead(**values: float) -> Any:
    return At(**{"mass": 1.0, "radius": 1.0, "gravity": 9.81, "x_0": np.sin(0.1), "z_0": np.cos(0.1)} | values)


def bob(**values: float) -> Any:
    start = {"x_0": 0.0, "z_0": -1.0, "x_dot_0": 0.0, "z_dot_0": 0.0, "length": 1.0, "pivot_x": 0.0, "pivot_z": 0.0}
    return At(**start | {"mass": 1.0, "gravity": 9.81} | values)


def oscillator(**values: float) -> Any:
    start = {"x_0": 1.0, "x_dot_0": 0.0, "support": 0.0, "belt_dot": 0.0, "x_force": 0.0}
    return At(**start | {"mass": 1.0, "stiffness": 1.0, "gravity": 9.81, "mu_static": 0.1, "mu_sliding": 0.1} | values)


def row(mass: tuple[float, ...] = (1.0, 1.0, 1.0), speed: float = 1.0, bounce: float = 1.0) -> Any:
    return At(mass=np.array(mass), x_dot_0=np.array([speed] + [0.0] * (len(mass) - 1)), bounce=bounce)


# ---- the ball ------------------------------------------------------------------------------------------------------

DROPS = [{}, {"bounce": 0.5, "height_0": 3.0, "table": 0.7, "height_dot_0": -2.0}, {"bounce": 0.0}, {"bounce": 1.0}]


@pytest.mark.parametrize("start", DROPS)
def test_ball_on_a_table_at_rest_event_by_event(start: dict[str, float]) -> None:
    at = ball(mass=2.0, **start)
    with mp.workdps(40):
        g, e, table = mp.mpf(at.gravity), mp.mpf(at.bounce), mp.mpf(at.table)
        t, z, v, lost = mp.mpf(0), mp.mpf(at.height_0), mp.mpf(at.height_dot_0), mp.mpf(0)
        times, expected = [], []
        for _ in range(60):
            flight = max(mp.polyroots([-g / 2, v, z - table], maxsteps=200, extraprec=200), key=mp.re).real
            for share in (mp.mpf("0.25"), mp.mpf("0.75")):
                since = share * flight
                times.append(float(t + since))
                expected.append([float(x) for x in (z + v * since - g * since**2 / 2, v - g * since, lost)])
            t, z, before = t + flight, table, v - g * flight
            v = -e * before
            lost += mp.mpf(at.mass) / 2 * (before**2 - v**2)
            if v < 1e-3:
                break
    motion = bouncing_ball.exact(np.array(times), at=at)
    for name, values in zip(("height", "height_dot", "impact_loss"), np.transpose(expected), strict=True):
        # Instants of up to 60 s are rounded, at speeds of up to 8 m/s.
        np.testing.assert_allclose(motion[name], values, rtol=0, atol=2e-13 * max(1.0, times[-1]), err_msg=name)
    if at.bounce < 1:
        rest = bouncing_ball.rests_at(at=at)
        assert float(t) <= rest < float(t) + 1e-3  # below 1e-3 m/s the bounces last 2e-4 / (1 - e) s more
        after = bouncing_ball.exact(np.array([rest, rest + 1e6]), at=at)
        assert np.all(after["height"] == at.table)
        assert np.all(after["gap_force"] == 2 * 9.81)


def test_ball_dropped_from_rest_rests_at_the_instant_of_the_textbooks() -> None:
    assert bouncing_ball.rests_at(at=ball()) == pytest.approx(np.sqrt(2 / 9.81) * 1.8 / 0.2, rel=1e-15)


def next_impact(t: Any, v: Any, e: Any, gravity: Any, amplitude: Any) -> tuple[Any, Any]:
    """Of a ball that leaves the table sin(t) amplitude at t with velocity v, about a period later."""
    start = amplitude * mp.sin(t)
    end = mp.findroot(
        lambda s: start + v * (s - t) - gravity * (s - t) ** 2 / 2 - amplitude * mp.sin(s), t + 2 * v / gravity
    )
    return end, (1 + e) * amplitude * mp.cos(end) - e * (v - gravity * (end - t))


@pytest.mark.parametrize("bounce", [0.2, 0.8])
def test_period_one_and_its_limits_are_those_of_the_map_of_impacts(bounce: float) -> None:
    """ω = g = 1, so that Γ is the amplitude; multipliers of the map by differences with 40 digits."""
    at = ball(bounce=bounce, gravity=1.0)
    low, high = bouncing_ball.period_one_range(at=at)

    def multipliers(ratio: float) -> list[float]:
        phase, speed = bouncing_ball.period_one(at=at, amplitude=ratio, angular_frequency=1.0)
        with mp.workdps(40):
            e = mp.mpf(bounce)
            phase, speed = mp.acos(mp.pi * (1 - e) / (1 + e) / ratio), mp.pi + 0 * mp.mpf(speed)
            end, after = next_impact(phase, speed, e, 1, mp.mpf(ratio))
            assert abs(end - phase - 2 * mp.pi) < 1e-30
            assert abs(after - speed) < 1e-30
            h = mp.mpf("1e-12")
            columns = []
            for dt, dv in ((h, 0), (0, h)):
                ahead, behind = (next_impact(phase + s * dt, speed + s * dv, e, 1, mp.mpf(ratio)) for s in (1, -1))
                columns.append([(a - b) / (2 * h) for a, b in zip(ahead, behind, strict=True)])
            return [mp.re(z) for z in mp.eig(mp.matrix(columns).T, left=False, right=False)]

    phase, speed = bouncing_ball.period_one(at=at, amplitude=1.3 * low, angular_frequency=1.0)
    assert np.cos(phase) == pytest.approx(1 / 1.3, rel=1e-14)
    assert speed == pytest.approx(np.pi, rel=1e-14)
    assert float(max(multipliers(low * (1 + 1e-8)))) == pytest.approx(1.0, abs=1e-2)
    assert float(min(multipliers(high))) == pytest.approx(-1.0, abs=1e-12)
    for ratio in (low + 0.1 * (high - low), high - 1e-3):
        assert all(abs(z) < 1 for z in multipliers(ratio))
    assert float(min(multipliers(high + 1e-3))) < -1
    with pytest.raises(ValidityError, match="throws no ball"):
        bouncing_ball.period_one(at=at, amplitude=0.99 * low, angular_frequency=1.0)


def test_ball_at_rest_leaves_a_shaken_table_where_it_would_be_pulled() -> None:
    leaves = bouncing_ball.leaves_at(at=ball(), amplitude=0.3, angular_frequency=7.0)
    assert 0.3 * 49 * np.sin(7 * leaves) == pytest.approx(9.81, rel=1e-14)
    assert bouncing_ball.leaves_at(at=ball(), amplitude=0.2, angular_frequency=7.0) == np.inf


# ---- bead and string -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("theta", [0.1, 1e-3, -0.8, 1.5])
def test_bead_leaves_the_sphere_where_its_force_ends(theta: float) -> None:
    at = bead(radius=1.3, mass=2.0, x_0=1.3 * np.sin(theta), z_0=1.3 * np.cos(theta))
    angle, instant = bead_on_sphere.leaves(at=at)
    with mp.workdps(40):
        start, ratio = mp.mpf(np.arctan2(at.x_0, at.z_0)), 2 * mp.mpf(9.81) / mp.mpf(1.3)
        end = mp.acos(2 * mp.cos(start) / 3)
        # θ = θ_0 + s² takes away the root at the start.
        time: Any = mp.quad(
            lambda s: 2 * s / mp.sqrt(ratio * 2 * mp.sin(abs(start) + s**2 / 2) * mp.sin(s**2 / 2)),
            mp.linspace(0, mp.sqrt(end - abs(start)), 5),
        )
    assert np.cos(angle) == pytest.approx(2 / 3 * np.cos(theta), rel=1e-15)
    assert instant == pytest.approx(float(time), rel=1e-13)
    motion = bead_on_sphere.exact(np.array([0.0, instant * (1 - 1e-9), instant, instant + 0.5]), at=at)
    assert motion["gap_force"][1] == pytest.approx(0.0, abs=1e-6)
    assert motion["x"][0] == pytest.approx(at.x_0, rel=1e-14)
    assert np.hypot(motion["x"], motion["z"])[2] == pytest.approx(1.3, rel=1e-14)
    energy = (motion["x_dot"] ** 2 + motion["z_dot"] ** 2) / 2 + 9.81 * motion["z"]
    np.testing.assert_allclose(energy, 9.81 * at.z_0, rtol=1e-14)
    assert np.hypot(motion["x"], motion["z"])[3] > 1.3  # it does not fall back onto the sphere


@pytest.mark.parametrize(("speed", "sense"), [(6.0, 1), (6.6, -1), (4.6, 1), (6.8, 1)])
def test_string_against_an_integration_of_each_phase(speed: float, sense: int) -> None:
    """Newton's law in x and z, with the force that keeps the distance while it pulls; 2gl = 19.6, 5gl = 49."""
    at = bob(x_dot_0=sense * speed)
    y, t, end, taut, lost = np.array([0.0, -1.0, sense * speed, 0.0]), 0.0, 6.0, True, 0.0

    def pull(y: Any) -> Any:
        return (y[2] ** 2 + y[3] ** 2 - 9.81 * y[1]) / (y[0] ** 2 + y[1] ** 2)

    def flight(y: Any) -> Any:
        return y[0] ** 2 + y[1] ** 2 - 1

    heights, times, states, losses = [], [], [], []
    while t < end:
        event: Any = (lambda _, y: pull(y)) if taut else (lambda s, y, t=t: flight(y) if s > t + 1e-3 else -1.0)
        event.terminal, event.direction = True, -1 if taut else 1
        factor = 1.0 if taut else 0.0
        part = solve_ivp(
            lambda _, y, factor=factor: [y[2], y[3], -factor * pull(y) * y[0], -factor * pull(y) * y[1] - 9.81],
            (t, end), y, "DOP853", events=event, rtol=1e-13, atol=1e-13,
        )  # fmt: skip
        times += [*part.t[1:-1]]
        states += [*part.y.T[1:-1]]
        losses += [lost] * (part.t.size - 2)
        t, y = part.t[-1], part.y[:, -1].copy()
        if t < end and taut:
            heights.append(y[1])
        elif t < end:
            radial = y[:2] @ y[2:] / (y[:2] @ y[:2])
            lost += radial**2 * (y[:2] @ y[:2]) / 2
            y[2:] -= radial * y[:2]
        taut = not taut
    assert heights
    assert string_pendulum.slack_height(speed, at=at) == pytest.approx(heights[0], abs=1e-10)
    motion = string_pendulum.exact(np.array(times), at=at)
    for name, values in zip(("x", "z", "x_dot", "z_dot"), np.transpose(states), strict=True):
        # The integrations and their events at 1e-13, amplified a hundred times in three swings.
        np.testing.assert_allclose(motion[name], values, rtol=0, atol=2e-10, err_msg=name)
    np.testing.assert_allclose(motion["impact_loss"], losses, rtol=0, atol=2e-10)


def test_a_longer_string_moves_by_similarity() -> None:
    """Lengths and energies times 4, times and speeds times 2, about another pivot."""
    t = np.linspace(0, 3, 100)
    start = {"length": 4.0, "pivot_x": 0.25, "pivot_z": 0.5, "x_0": 0.25, "z_0": -3.5, "x_dot_0": 12.0}
    one, other = string_pendulum.exact(t, at=bob(x_dot_0=6.0)), string_pendulum.exact(2 * t, at=bob(**start))
    assert one["impact_loss"][0] == 0 < one["impact_loss"][50]  # a tug, and swings after it
    for name, scale, shift in (
        ("x", 4, 0.25), ("z", 4, 0.5), ("x_dot", 2, 0), ("z_dot", 2, 0), ("slack_force", 1, 0), ("impact_loss", 4, 0)
    ):  # fmt: skip
        # Roundings of start and phases, amplified a hundred times in each of the swings.
        np.testing.assert_allclose(other[name], scale * one[name] + shift, rtol=0, atol=1e-10, err_msg=name)


def test_string_that_would_push_is_refused() -> None:
    with pytest.raises(ValidityError, match="start where it pulls"):
        string_pendulum.exact(np.array([1.0]), at=bob(z_0=1.0))
    with pytest.raises(ValidityError, match="stays taut"):
        string_pendulum.slack_height(4.0, at=bob())


# ---- dry friction --------------------------------------------------------------------------------------------------

RUBBING = {
    "decay": {"mu_static": 0.013, "mu_sliding": 0.01, "mass": 2.0, "stiffness": 5.0, "support": 0.3},
    "thrown": {"x_0": 0.0, "x_dot_0": -2.0, "mu_static": 0.05, "mu_sliding": 0.03},
    "stick-slip": {"belt_dot": 0.2, "mu_static": 0.05, "mu_sliding": 0.02, "x_0": 0.1, "x_dot_0": 0.2},
    "belt backwards": {"belt_dot": -0.3, "mu_static": 0.05, "mu_sliding": 0.02, "x_0": 1.0},
    "belt too fast": {"belt_dot": 5.0, "mu_static": 0.05, "mu_sliding": 0.02, "x_0": 1.0},
}


@pytest.mark.parametrize("case", RUBBING)
def test_dry_oscillator_event_by_event(case: str) -> None:
    """Roots of the relative velocity are bracketed and found with 40 digits."""
    at = oscillator(**RUBBING[case])
    times, expected = [], []
    with mp.workdps(40):
        omega = mp.sqrt(mp.mpf(at.stiffness) / at.mass)
        static, sliding = (mp.mpf(mu) * at.gravity / omega**2 for mu in (at.mu_static, at.mu_sliding))
        start: Any = mp.mpf(0), mp.mpf(at.x_0) - at.support, mp.mpf(at.x_dot_0)
        (t, x, v), belt = start, mp.mpf(at.belt_dot)
        sense = int(mp.sign(v - belt))

        def note(t: Any, x: Any, v: Any) -> None:
            times.append(float(t))
            expected.append([float(x) + at.support, float(v)])

        while t < 30:
            if sense == 0 and abs(x) <= static * (1 + mp.mpf("1e-30")):
                span = (mp.sign(belt) * static - x) / belt if belt else mp.mpf(30)
                for share in (0.25, 0.75):
                    note(t + share * span, x + belt * share * span, belt)
                t, x, v, sense = t + span, x + belt * span, belt, -int(mp.sign(belt))
                continue
            sense = sense or -int(mp.sign(x))
            centre = -sense * sliding

            def rate_after(s: Any, state: Any = (x - centre, v)) -> Any:
                return state[1] * mp.cos(omega * s) - state[0] * omega * mp.sin(omega * s)

            grid = [mp.mpf(i) / 50 / omega for i in range(1, 2000)]
            crossing: Any = next((s for s in grid if (rate_after(s) - belt) * sense < 0), None)
            span = grid[-1] if crossing is None else mp.findroot(
                lambda s: rate_after(s) - belt, (crossing - mp.mpf("0.02") / omega, crossing), solver="anderson"
            )  # fmt: skip
            for share in (0.25, 0.75):
                s = share * span
                note(t + s, centre + (x - centre) * mp.cos(omega * s) + v / omega * mp.sin(omega * s), rate_after(s))
            x = centre + (x - centre) * mp.cos(omega * span) + v / omega * mp.sin(omega * span)
            t, v, sense = t + span, belt, 0
    motion = dry_oscillator.exact(np.array(times), at=at)
    np.testing.assert_allclose(np.transpose([motion["x"], motion["x_dot"]]), expected, rtol=0, atol=1e-12)
    assert np.all(np.abs(motion["slip_force"]) <= at.mu_static * at.mass * at.gravity * (1 + 1e-12))


def test_turning_points_are_those_of_the_motion() -> None:
    at = oscillator(**RUBBING["decay"])
    instants, elongations = dry_oscillator.turning_points(at=at)
    assert len(instants) == 10  # from 0.7 m by 0.07848 m nine times into the band of 0.05101 m
    motion = dry_oscillator.exact(instants, at=at)
    np.testing.assert_allclose(motion["x"] - at.support, elongations, rtol=0, atol=1e-14)
    np.testing.assert_allclose(motion["x_dot"], 0, rtol=0, atol=1e-14)


def test_stick_slip_repeats_after_its_period() -> None:
    at = oscillator(**RUBBING["stick-slip"])
    times = np.linspace(0, 10, 50)
    period = sum(dry_oscillator.stick_slip(at=at))
    first, next_one = (dry_oscillator.exact(times + 10 + shift, at=at) for shift in (0.0, period))
    np.testing.assert_allclose(first["x"], next_one["x"], rtol=0, atol=1e-13)
    sticks = dry_oscillator.exact(np.linspace(10, 10 + period, 100_001), at=at)["x_dot"] == 0.2
    assert np.mean(sticks) * period == pytest.approx(dry_oscillator.stick_slip(at=at)[0], abs=2e-5 * period)


@pytest.mark.parametrize("share", [0.3, -0.8])
def test_drift_of_a_shaken_block_is_the_limit_of_fast_shaking(share: float) -> None:
    """Steady motion by roots of its velocity over a period; the error falls with (μg/Aω²)²."""
    errors = []
    for omega in (30.0, 60.0):
        at = oscillator(stiffness=0.0, x_force=share * 0.981)
        expected = dry_oscillator.drift(at=at, amplitude=1.0 / omega, angular_frequency=omega)

        def after(v: float, omega: float = omega) -> float:
            # Phase φ: dv/dφ = (f - μg sign(v - cos φ))/ω, belt velocity cos φ; linear between crossings.
            phase = 0.0
            while phase < 2 * np.pi - 1e-12:
                sign = np.sign(v - np.cos(phase + 1e-9))
                slope = (share - sign) * 0.981 / omega
                grid = phase + np.linspace(1e-6, 2 * np.pi - phase, 4000)
                gaps = v + slope * (grid - phase) - np.cos(grid)
                over = np.flatnonzero(gaps * sign < 0)
                end = 2 * np.pi
                if over.size:
                    low, high = grid[max(over[0] - 1, 0)], grid[over[0]]
                    for _ in range(50):
                        middle = (low + high) / 2
                        low, high = (
                            (low, middle)
                            if (v + slope * (middle - phase) - np.cos(middle)) * sign < 0
                            else (middle, high)
                        )
                    end = high
                v, phase = v + slope * (end - phase), end
            return v

        v = expected
        for _ in range(int(30 * omega)):
            v = after(v)
        errors.append(abs(v - expected))
    assert errors[1] < 0.7 * errors[0] < 0.1


# ---- balls in a row ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("bounce", [1.0, 0.6, 0.0])
@pytest.mark.parametrize("masses", [(1.0, 1.0, 1.0), (2.0, 1.0, 3.0), (0.1, 5.0, 0.3), (1.0, 2.0, 0.5, 4.0)])
def test_moreaus_rule_is_the_complementarity_problem(bounce: float, masses: tuple[float, ...]) -> None:
    at, n = row(masses, 2.0, bounce), len(masses)
    C = np.diff(np.eye(n), axis=0)
    G = C @ np.diag(1 / np.array(masses)) @ C.T
    wanted = np.array([bounce * 2.0, *np.zeros(n - 2)])
    solutions = []
    for active in (list(chosen) for k in range(n) for chosen in combinations(range(n - 1), k)):
        impulse = np.zeros(n - 1)
        before = C @ at.x_dot_0
        impulse[active] = np.linalg.solve(G[np.ix_(active, active)], (wanted - before)[active])
        after = before + G @ impulse
        if np.all(impulse >= 0) and np.all(after >= wanted - 1e-12):
            solutions.append(at.x_dot_0 + C.T @ impulse / masses)
    assert len(solutions) == 1
    np.testing.assert_allclose(ball_row.moreau(at=at), solutions[0], rtol=0, atol=1e-14)


def test_rows_of_equal_balls_are_those_of_the_textbooks() -> None:
    np.testing.assert_allclose(ball_row.moreau(at=row()), [-1 / 3, 2 / 3, 2 / 3], rtol=0, atol=1e-15)
    np.testing.assert_allclose(ball_row.sequence(at=row()), [[1, 0, 0], [0, 1, 0], [0, 0, 1]], rtol=0, atol=1e-15)


@pytest.mark.parametrize("bounce", [1.0, 0.6, 0.0])
def test_a_sequence_keeps_momentum_and_ends_when_nothing_approaches(bounce: float) -> None:
    at = row((3.0, 0.5, 2.0), bounce=bounce)
    rates = ball_row.sequence(at=at)
    masses = np.array([3.0, 0.5, 2.0])
    np.testing.assert_allclose(rates @ masses, 3.0, rtol=1e-12)
    energies = (rates**2 @ masses) / 2
    assert np.all(np.diff(energies) <= 1e-12)
    if bounce == 1:
        np.testing.assert_allclose(energies, 1.5, rtol=1e-12)
    assert np.all(np.diff(rates[-1]) >= -1e-12)
    assert len(rates) > 3
    with pytest.raises(ValidityError, match="must move together"):
        ball_row.moreau(at=At(mass=np.ones(3), x_dot_0=np.array([1.0, 0.0, 1.0]), bounce=1.0))
    with pytest.raises(ValidityError, match="of more than three"):
        ball_row.sequence(at=row((1.0,) * 4))
