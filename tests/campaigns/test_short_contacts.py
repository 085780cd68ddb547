"""Random balls on fast tables, in communication steps that are long beside a contact: nothing is missed without a word.

A ball falls onto a table that an operator or a spring moves several times within a step.  The flattened system must not
depend on its step; two FMUs may be off by what they say, or warn.  Balls that a table just touches in flight, or just
does not, are compared with parabola and sine.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from liaisons import System, build, flatten, simulate
from liaisons.errors import SimulationError

CONTACTS, SEED, STOP, FINE = 100, 45, 0.6, 0.001
TOUCHES, FLIGHT, NEAR = 200, 0.4, (-9, -2)
"""Balls in flight, for that long [s], and exponents of how far [m] the table comes above or stays below them."""
TOUCHED = 1e-7  # m off the parabola; the least bounce leads a hundred times as far
SAME, RIGHT = 1e-7, 1e-6
"""Differences of heights [m]: of the flattened system by its step, magnified by impacts; what is right of two FMUs."""


def _between(random: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def _table(random: np.random.Generator, kind: str) -> dict[str, float]:
    amplitude, omega, phase = random.uniform(0.01, 0.1), _between(random, 10, 80), random.uniform(0, 6.28)
    if kind == "Sinusoid":
        return {"amplitude": amplitude, "angular_frequency": omega, "phase": phase}
    mass, start = _between(random, 0.3, 20), amplitude * np.array([np.cos(phase), -omega * np.sin(phase)])
    return {"mass": mass, "stiffness": mass * omega**2, "x_0": float(start[0]), "x_dot_0": float(start[1])}


def _ball(random: np.random.Generator) -> dict[str, float]:
    bounce = float(random.choice([0.0, random.uniform(0, 1)]))
    return {"height_0": random.uniform(0.15, 0.5), "height_dot_0": random.uniform(-1, 1), "bounce": bounce}


@pytest.mark.slow
def test_no_contact_is_missed_without_a_word(tmp_path: Path) -> None:
    random = np.random.default_rng(SEED)
    silent, refused, warned = list[Any](), list[str](), 0
    for name in ("Sinusoid", "Oscillator", "BouncingBall"):
        build(name, tmp_path)
    for number in range(CONTACTS):
        kind, port = (("Sinusoid", "y"), ("Oscillator", "x"))[number % 2]
        table, ball, step = _table(random, kind), _ball(random), FINE * random.integers(10, 100)
        system = System("Touch")
        below = system.add("table", tmp_path / f"{kind}.fmu", start_values=table)
        above = system.add("ball", tmp_path / "BouncingBall.fmu", start_values=ball)
        system.connect(below[port], above["table"])
        whole = tmp_path / kind / "Touch.fmu"
        if not whole.exists():
            flatten(system, whole.parent)
        starts = {f"{name}.{key}": v for name, own in (("table", table), ("ball", ball)) for key, v in own.items()}
        settings: dict[str, Any] = {"times": np.append(np.arange(0, STOP, step), STOP), "tolerance": 1e-10}
        truth, coarse = (
            simulate(whole, start_values=starts, **{**settings, "times": times})
            for times in (np.union1d(settings["times"], np.arange(0, STOP, FINE)), settings["times"])
        )
        height = truth["ball.height"][np.searchsorted(truth.time, settings["times"])]
        assert np.abs(coarse["ball.height"] - height).max() < SAME, (number, table, ball)
        try:
            run = system.simulate(**settings)
        except SimulationError as error:
            refused.append(str(error))
            continue
        difference = float(np.abs(run["ball.height"] - height).max())
        assert run.coupling_error is not None
        told = float(np.nansum(run.coupling_error))
        warned += bool(run.warnings)
        if difference > max(RIGHT, 3 * told) and not run.warnings:
            silent.append((number, difference, told))
    sys.stdout.write(f"{CONTACTS} contacts: {len(silent)} silent, {len(refused)} refused, {warned} warned of\n")
    assert silent == []
    assert refused == []
    assert warned < CONTACTS


@pytest.mark.slow
def test_no_touch_in_flight_is_missed(tmp_path: Path) -> None:
    """Whether the ball of a parabola meets a sine: the run has seen an impact where it does, and none where not."""
    random, t = np.random.default_rng(SEED + 1), np.linspace(0, FLIGHT, 40001)
    unsaid, said, right, needless, made = list[Any](), 0, 0, 0, 0
    for name in ("Sinusoid", "Oscillator", "BouncingBall"):
        build(name, tmp_path)
    while made < TOUCHES:
        amplitude, omega, phase = random.uniform(0.005, 0.05), _between(random, 10, 80), random.uniform(0, 6.28)
        rate, bounce = random.uniform(0.5, 3), random.uniform(0, 1)

        def distance(t: np.ndarray, amplitude=amplitude, omega=omega, phase=phase, rate=rate) -> np.ndarray:
            return rate * t - 9.81 / 2 * t**2 - amplitude * np.sin(omega * t + phase)

        nearest = int(distance(t).argmin())
        if not 400 < nearest < len(t) - 400:  # of the flight's ends alone nothing is short
            continue
        least = float(distance(np.linspace(t[nearest - 1], t[nearest + 1], 2001)).min())
        depth = 10 ** random.uniform(*NEAR) * random.choice([-1, 1])
        if float(distance(t[:1])[0]) <= least + depth:  # bodies would overlap at the start
            continue
        made += 1
        system, step = System("Touch"), FINE * random.integers(5, 80)
        kind, port, mass = (("Sinusoid", "y", 0), ("Oscillator", "x", 1e3))[made % 2]
        table = {"amplitude": amplitude, "angular_frequency": omega, "phase": phase}
        if mass:
            table = {"x_0": amplitude * np.sin(phase), "x_dot_0": amplitude * omega * np.cos(phase)}
            table |= {"mass": mass, "stiffness": mass * omega**2}
        ball = {"height_0": -least - depth, "height_dot_0": rate, "bounce": bounce}
        below = system.add("table", tmp_path / f"{kind}.fmu", start_values=table)
        above = system.add("ball", tmp_path / "BouncingBall.fmu", start_values=ball)
        system.connect(below[port], above["table"])
        run = system.simulate(times=np.append(np.arange(0, FLIGHT - 1e-9, step), FLIGHT), tolerance=1e-10)
        named = any("a contact may be missed" in warning for warning in run.warnings)
        flight = ball["height_0"] + rate * run.time - 9.81 / 2 * run.time**2
        if (np.abs(run["ball.height"] - flight).max() > TOUCHED) == (depth > 0):
            right, needless = right + 1, needless + named
        elif run.warnings:
            said += 1
        else:
            unsaid.append((made, kind, omega * step, depth))
    sys.stdout.write(f"{TOUCHES} touches: {len(unsaid)} wrong unsaid, {said} said; {needless} of {right} right said\n")
    assert unsaid == []
    assert said == 0
    assert needless == 0
