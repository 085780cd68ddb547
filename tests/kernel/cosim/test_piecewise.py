"""Sources that are smooth in pieces only: what a run says of its error, against the equation of motion piece by piece.

A pendulum whose length, pivot or drive an operator prescribes; SciPy integrates its equation from break to break.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from making import FmuPaths, coupling_errors, exchange_only, wired
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import BPoly

from liaisons import Signal
from liaisons.base.knots import knots
from liaisons.cosim import Coupling, Result, simulate
from liaisons.errors import SimulationError

GRAVITY, END, THETA = 9.81, 1.0, 1.0
TOLD = 1e-4
STEPS = (0.2, 0.1, 0.05)
Triple = tuple[float, float, float]
Pieces = list[tuple[float, Callable[[float], Triple]]]
"""From when on [s], which smooth function of the time holds."""


@dataclass(frozen=True)
class Source:
    """A motion in pieces, and the FMU or function that makes it."""

    port: str
    pieces: Pieces
    fmu: str | None
    starts: dict[str, Any]

    @property
    def breaks(self) -> list[float]:
        return [begin for begin, _ in self.pieces[1:]]

    def function(self, t: float) -> Triple:
        return next(piece(t) for begin, piece in reversed(self.pieces) if t >= begin or begin == self.pieces[0][0])


def _of(orders: Sequence[Callable[[float], Any]]) -> Callable[[float], Triple]:
    return lambda t: (float(orders[0](t)), float(orders[1](t)), float(orders[2](t)))


def _polynomial(at: float, *coefficients: float) -> Callable[[float], Triple]:
    p = np.polynomial.Polynomial(coefficients)
    triple = _of((p, p.deriv(), p.deriv(2)))
    return lambda t: triple(t - at)


def _sine(offset: float, amplitude: float, omega: float, phase: float) -> Callable[[float], Triple]:
    def triple(t: float) -> Triple:
        s, c = amplitude * math.sin(omega * t + phase), amplitude * math.cos(omega * t + phase)
        return offset + s, omega * c, -(omega**2) * s

    return triple


def _ramp(random: np.random.Generator, port: str, offset: float, size: float) -> Source:
    begin, rate = random.uniform(0.02, 0.98), size * random.normal()
    pieces: Pieces = [(-1.0, _polynomial(0, offset)), (begin, _polynomial(begin, offset, rate))]
    return Source(port, pieces, "Ramp", {"offset": offset, "rate": rate, "start_time": begin})


def _table(random: np.random.Generator, port: str, offset: float, size: float) -> Source:
    """Quintics between knots, some of them doubled: jumps of the rate, of the acceleration, of a force's value."""
    count = int(random.integers(3, 6))
    times = np.concatenate([[0.0], np.sort(random.uniform(0.05, 0.95, count - 2)), [END]])
    if random.random() < 0.3:
        times = np.round(times, 1)
    times = np.unique(times)
    columns = [offset + 0.3 * size * random.normal(size=len(times)), size * random.normal(size=len(times)),
               4 * size * random.normal(size=len(times))]  # fmt: skip
    table = np.array([times, *columns])
    rows: list[NDArray[np.float64]] = []
    for k, row in enumerate(table.T):
        rows.append(row)
        if 0 < k < len(times) - 1 and random.random() < 0.7:
            other = row.copy()
            kind = int(random.integers(0, 4 if port == "theta_force" else 3))
            if kind == 0:
                other[3] += 4 * size
            elif kind == 1:
                other[2:] += size * random.normal(size=2)
            elif kind == 2:
                other[1] = np.nextafter(row[1], np.inf)
            else:
                other[1] += size
            rows.append(other)
    table = knots(*np.array(rows).T)
    pieces: Pieces = []
    for k in np.flatnonzero(np.diff(table[0]) > 0):
        p = BPoly.from_derivatives(table[0, k : k + 2], table[1:, k : k + 2].T)
        orders = p, p.derivative(), p.derivative(2)
        pieces.append((float(table[0, k]), _of(orders)))
    padded = np.pad(table, ((0, 0), (0, 100 - table.shape[1])), mode="edge")
    names = ("instant", "value", "rate", "acceleration")
    return Source(port, pieces, "PlannedMotion", dict(zip(names, padded, strict=True)))


def _rectified(random: np.random.Generator, port: str, offset: float, size: float) -> Source:
    """|sin|, whose rate jumps at every zero."""
    omega, phase = random.uniform(3, 25), random.uniform(0, 3)
    zeros = [(k * math.pi - phase) / omega for k in range(-2, 12)]
    pieces: Pieces = [(-1.0, _sine(offset, size * 0.3 * math.copysign(1, math.sin(phase)), omega, phase))]
    for zero in (zero for zero in zeros if 0 < zero < END):
        sign = math.copysign(1, math.sin(omega * (zero + 1e-3) + phase))
        pieces.append((zero, _sine(offset, size * 0.3 * sign, omega, phase)))
    return Source(port, pieces, None, {})


def _pasted(random: np.random.Generator, port: str, offset: float, size: float) -> Source:
    """Cubics, one after the other; value or rate jump from one to the next."""
    begins = [-1.0, *np.sort(random.uniform(0.02, 0.98, int(random.integers(1, 5))))]
    if random.random() < 0.3:
        begins = [float(begin) for begin in np.unique(np.round(begins, 1))]
    pieces: Pieces = []
    value = offset
    for k, begin in enumerate(begins):
        at = max(begin, 0.0)
        if k:
            value = pieces[-1][1](at)[0]
        if k and port == "theta_force" and random.random() < 0.5:
            value += size * random.normal()
        pieces.append((begin, _polynomial(at, value, *(size * random.normal(size=3) * (0.5, 1, 2)))))
    return Source(port, pieces, None, {})


def _smooth(random: np.random.Generator, port: str, offset: float, size: float) -> Source:
    omega, phase, amplitude = random.uniform(1, 12), random.uniform(0, 6), 0.3 * size
    starts = {"offset": offset, "amplitude": amplitude, "angular_frequency": omega, "phase": phase}
    return Source(port, [(-1.0, _sine(offset, amplitude, omega, phase))], "Sinusoid", starts)


KINDS = (_ramp, _table, _table, _rectified, _pasted, _pasted, _smooth)


def source(seed: int) -> Source:
    random = np.random.default_rng(seed)
    port = ("length", "pivot_x", "theta_force")[int(random.integers(3))]
    kind = KINDS[int(random.integers(len(KINDS)))]
    return kind(random, port, 2.0 if port == "length" else 0.0, {"length": 0.5, "pivot_x": 1.0}.get(port, 5.0))


@lru_cache
def truth(seed: int) -> NDArray[np.float64]:
    """Angle at 21 times: m l² θ'' + 2 m l l' θ' + m l (g sin θ + a cos θ) = Q, where m = 1 kg.

    State θ and p = l² θ' + l x' cos θ, which no jump of a rate changes.
    """
    of, times = source(seed), np.linspace(0, END, 21)

    def motion(t: float, piece: Callable[[float], Triple]) -> tuple[float, float, float]:
        value, rate, _ = piece(t)
        return (
            (value, 0.0, 0.0) if of.port == "length" else (2.0, rate, 0.0) if of.port == "pivot_x" else (2.0, 0, value)
        )

    def rates(t: float, y: NDArray[np.float64], piece: Callable[[float], Triple]) -> list[float]:
        length, v, Q = motion(t, piece)
        omega = (y[1] - length * v * math.cos(y[0])) / length**2
        return [omega, Q - length * (v * omega + GRAVITY) * math.sin(y[0])]

    begins = [0.0, *(t for t in of.breaks if 0 < t < END), END]
    pieces = [piece for begin, piece in of.pieces if begin < END]
    pieces = pieces[len(pieces) - len(begins) + 1 :]
    length, v, _ = motion(0.0, pieces[0])
    y, found = np.array([THETA, length * v * math.cos(THETA)]), []
    for (start, end), piece in zip(pairwise(begins), pieces, strict=True):
        inside = [t for t in times if start <= t < end]
        step = solve_ivp(rates, (start, end), y, "DOP853", [*inside, end], args=(piece,), rtol=1e-13, atol=1e-14)
        found += step.y[0, : len(inside)].tolist()
        y = step.y[:, -1]
    return np.array([*found, y[0]])


Way = Callable[[FmuPaths, Source, float], Result]
STARTS: dict[str, Any] = {"theta_0": THETA, "length": 2.0}


def _system(component: FmuPaths, of: Source, step: float, announced: bool, **options: Any) -> Result:
    swing = component("Pendulum"), {k: v for k, v in STARTS.items() if k != of.port}
    if of.fmu is not None:
        system = wired(f"motor.y -> swing.{of.port}", motor=(component(of.fmu), of.starts), swing=swing)
        return system.simulate(END, step, tolerance=1e-12, **options)
    inputs = {f"swing.{of.port}": _input(of, announced)}
    return wired(swing=swing).simulate(END, step, tolerance=1e-12, inputs=inputs, **options)


def _input(of: Source, announced: bool) -> Any:
    function = of.function if of.port != "theta_force" else lambda t: of.function(t)[0]
    return Signal(function, breaks=of.breaks) if announced else function


def _single(component: FmuPaths, of: Source, step: float, announced: bool) -> Result:
    starts = {k: v for k, v in STARTS.items() if k != of.port}
    inputs = {of.port: _input(of, announced)}
    return simulate(component("Pendulum"), stop_time=END, step_size=step, tolerance=1e-12, inputs=inputs, **starts)


WAYS = ("implicit", "waveform", "gauss-seidel", "jacobi", "single")


def judged(component: FmuPaths, seed: int, way: str, step: float) -> tuple[float, float]:
    """True error, and the sum of what the run says of its steps."""
    of, announced = source(seed), bool(seed % 2)
    options = {} if way == "single" else {"coupling": way}
    run = _single if way == "single" else _system
    result = run(component, of, step, announced, **options)
    angle = result["theta" if way == "single" else "swing.theta"]
    return float(np.max(np.abs(angle - truth(seed)[:: round(20 * step)]))), float(np.sum(coupling_errors(result)))


def _check(component: FmuPaths, caplog: pytest.LogCaptureFixture, seeds: Sequence[int], ways: Sequence[str]) -> None:
    for seed, way, step in product(seeds, ways, STEPS):
        caplog.clear()
        error, said = judged(component, seed, way, step)
        assert error < max(10 * said, 1e-9), (seed, way, step)  # below 1e-9 the solver's own error counts, too
        assert error < TOLD or caplog.records, (seed, way, step)


@pytest.mark.parametrize(("seed", "way"), [*zip((0, 3, 5, 8, 10), WAYS, strict=True)])
def test_errors_of_a_few_sources(component: FmuPaths, caplog: pytest.LogCaptureFixture, seed: int, way: str) -> None:
    _check(component, caplog, [seed], [way])


@pytest.mark.parametrize("way", ["implicit", "gauss-seidel"])
def test_tables_in_fmi3(component: FmuPaths, caplog: pytest.LogCaptureFixture, way: str) -> None:
    of = next(seed for seed in range(100) if source(seed).fmu == "PlannedMotion" and source(seed).breaks)
    _check(lambda name: component(f"fmi3/{name}"), caplog, [of], [way])


@pytest.mark.parametrize("kind", ["Ramp", "PlannedMotion", None])
def test_breaks_where_steps_are_adapted_or_halved(component: FmuPaths, kind: str | None) -> None:
    seed = next(seed for seed in range(1, 100, 2) if source(seed).fmu == kind and source(seed).breaks)
    of, exact = source(seed), truth(seed)
    for coupling in ("implicit", "gauss-seidel"):
        found = _system(component, of, 0.05, announced=True, coupling=coupling, error_tolerance=1e-7)
        steps = len(found.time)
        # each of the steps may be off by the tolerance, of which the solution grows by a few times
        assert abs(found["swing.theta"][-1] - exact[-1]) < 10 * 1e-7 * steps
        assert steps < 300  # a break costs a few steps, not hundreds that are taken back
    halved = _system(component, of, 0.05, announced=True, coupling="implicit", verify=True)
    error = np.abs(halved["swing.theta"] - exact)
    assert np.all(error <= 10 * halved.error("swing.theta") + 1e-9)  # and the solver's own error


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
def test_no_error_above_a_ten_thousandth_in_silence(
    component: FmuPaths, caplog: pytest.LogCaptureFixture, way: str
) -> None:
    _check(component, caplog, range(100, 140), [way])


def test_a_break_is_one_late_in_a_long_run_too(component: FmuPaths) -> None:
    """At t = 1e7 s, where the time is rounded to 2e-9 s: more than a step of 0.1 s needs before a break elsewhere."""

    def end(begin: float) -> float:
        at = begin + 0.505
        length = Signal(lambda t: (2 + 0.3 * abs(t - at), 0.3 * float(np.sign(t - at)), 0.0), breaks=[at])
        options: dict[str, Any] = {"start_time": begin, "stop_time": begin + 1, "step_size": 0.1, "tolerance": 1e-10}
        return simulate(component("Pendulum"), **options, inputs={"length": length}, theta_0=THETA)["theta"][-1]

    assert end(1e7) == pytest.approx(end(0.0), abs=1e-7)  # ten steps, each off by some roundings of the time


@pytest.mark.parametrize("kind", ["", "fmi3/"])
@pytest.mark.parametrize("case", [(3, "implicit"), (8, "waveform"), (0, "gauss-seidel"), (10, "single")])
def test_errors_of_a_few_sources_in_model_exchange(
    component: FmuPaths, caplog: pytest.LogCaptureFixture, tmp_path: Path, kind: str, case: tuple[int, str]
) -> None:
    """Where a break lies, the solver begins anew with the limits from the right."""
    only = exchange_only(component(f"{kind}Pendulum"), tmp_path)
    _check(lambda name: only if name == "Pendulum" else component(name), caplog, [case[0]], [case[1]])


def _from_break(*coefficients: float, before: float = 0.0) -> Signal:
    """A constant until 0.437 s, then a polynomial in the time since."""
    at = 0.437
    after = _polynomial(at, *coefficients)
    return Signal(lambda t: after(t) if t >= at else (before, 0.0, 0.0), breaks=[at])


@pytest.mark.parametrize("coupling", ["gauss-seidel", "jacobi", "implicit", "waveform"])
@pytest.mark.parametrize("source", ["function", "Ramp", "fmi3/Ramp"])
@pytest.mark.parametrize("ball", ["BouncingBall", "fmi3/BouncingBall"])
def test_a_ball_stays_behind_a_table_that_drops(
    component: FmuPaths, ball: str, source: str, coupling: Coupling
) -> None:
    """It falls freely, h = -1/2 g τ², however the rate jumps: a quintic across the break would throw it up before."""
    parts: dict[str, Any] = {"ball": (component(ball), {"height_0": 0.0, "bounce": 0.5})}
    links, inputs = list[str](), dict[str, Signal]()
    if source == "function":
        inputs["ball.table"] = _from_break(0.0, -1.0)
    else:
        parts["drop"] = component(source), {"rate": -1.0, "start_time": 0.437}
        links = ["drop.y -> ball.table"]
    run = wired(*links, **parts).simulate(0.5, 0.05, tolerance=1e-10, coupling=coupling, inputs=inputs)
    fallen = np.maximum(run.time - 0.437, 0)
    np.testing.assert_allclose(run["ball.height"], -GRAVITY / 2 * fallen**2, rtol=0, atol=1e-9)  # of tolerance 1e-10
    assert run["ball.gap_impacts"][-1] == 0


@pytest.mark.parametrize("mode", [None, 2])
@pytest.mark.parametrize("coupling", ["gauss-seidel", "implicit", "waveform"])
@pytest.mark.parametrize("announced", [True, False])
def test_a_ball_follows_a_steep_table_until_its_rate_jumps(
    component: FmuPaths, mode: int | None, coupling: Coupling, announced: bool
) -> None:
    """On a smooth motion it rests, of which steps see little, and leaves it with the rate before the jump."""
    at, omega, size = 0.437, 13.0, 0.05  # with accelerations down to -8.45 m/s²
    height, rate = size * math.sin(omega * at), size * omega * math.cos(omega * at)

    def table(t: float) -> Triple:
        smooth = _sine(0.0, size, omega, 0.0)(t)
        return smooth if t < at else (height + (rate - 1) * (t - at), rate - 1, 0.0)

    starts = {"height_0": 0.0, "height_dot_0": size * omega, "bounce": 0.5}
    starts |= {} if mode is None else {"input_reconstruction": mode}
    drive = Signal(table, breaks=[at]) if announced else Signal(table)
    system = wired(ball=(component("BouncingBall"), starts))
    run = system.simulate(0.5, 0.05, tolerance=1e-10, coupling=coupling, inputs={"ball.table": drive})
    after, follows = run.time - at, size * np.sin(omega * run.time)
    falls = height + rate * after - GRAVITY / 2 * after**2
    np.testing.assert_allclose(run["ball.height"], np.where(after < 0, follows, falls), rtol=0, atol=1e-9)
    assert run["ball.gap_impacts"][-1] == 0


@pytest.mark.parametrize("coupling", ["gauss-seidel", "jacobi", "implicit", "waveform"])
def test_a_ball_is_struck_by_a_table_that_rises(component: FmuPaths, coupling: Coupling) -> None:
    """By a rate that jumps to v it is thrown up with (1 + e) v, and not before."""
    system = wired(ball=(component("BouncingBall"), {"height_0": 0.0, "bounce": 0.5}))
    inputs = {"ball.table": _from_break(0.0, 1.0)}
    run = system.simulate(0.5, 0.05, tolerance=1e-10, coupling=coupling, inputs=inputs)
    flown = np.maximum(run.time - 0.437, 0)
    np.testing.assert_allclose(run["ball.height"], 1.5 * flown - GRAVITY / 2 * flown**2, rtol=0, atol=1e-12)
    assert run["ball.gap_impacts"][-1] == 1


@pytest.mark.parametrize("coupling", ["gauss-seidel", "jacobi", "implicit", "waveform"])
def test_a_table_does_not_jump_through_the_ball(component: FmuPaths, coupling: Coupling) -> None:
    system, jump = wired(ball=(component("BouncingBall"), {"height_0": 0.0})), _from_break(0.1)
    with pytest.raises(SimulationError, match=r"gap = -0\.1 at t = 0\.437: bodies overlap"):
        system.simulate(0.5, 0.05, coupling=coupling, inputs={"ball.table": jump})


def test_nothing_is_lost_by_friction_in_a_jump(component: FmuPaths) -> None:
    """A jump of 0.1 m in no time: the bob moves as without friction, which has no time to act."""
    swing, ends = (component("Pendulum"), {"theta_0": THETA, "theta_dot_0": 2.0, "friction": 0.3}), list[float]()
    for jump in (0.0, 0.1):
        inputs = {"swing.length": _from_break(1.0 + jump, before=1.0)}
        run = wired(swing=swing).simulate(0.437, 0.023, tolerance=1e-12, coupling="implicit", inputs=inputs)
        assert np.max(np.abs(run["swing.energy_balance"])) < 1e-9  # of energies of 10 J
        ends.append(float(run["swing.dissipated"][-1]))
    assert ends[1] == pytest.approx(ends[0], abs=1e-9)
