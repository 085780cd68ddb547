"""Random pairs of FMUs with dry friction between them: nothing is off without a word.

A dry oscillator lies on an oscillator, or on another dry oscillator, which lies on the ground.  Each pair is held
against its flattened system, and that, for some of them, against equations of two masses that are written here.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from liaisons import Result, System, build, flatten, simulate
from liaisons.cosim import Coupling
from liaisons.errors import SimulationError

Starts = dict[str, float]

BY_HAND = 20
STOP, STEP, TOLERANCE = 1.0, 0.01, 1e-10
RIGHT = 1e-5
"""Difference, relative to the largest way, that counts as none: a release that is 1e-4 of a step late, at 5 m/s²."""


def _between(random: np.random.Generator, low: float, high: float) -> float:
    """A random number whose logarithm is uniform."""
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def _moved(random: np.random.Generator) -> Starts:
    start = {"x_0": random.uniform(-0.1, 0.1), "x_dot_0": random.uniform(-0.5, 0.5)}
    damping = float(random.choice([0.0, random.uniform(0, 2)]))
    return {"mass": _between(random, 0.2, 5), "stiffness": _between(random, 10, 200), "damping": damping, **start}


def _dry(random: np.random.Generator) -> Starts:
    sliding = random.uniform(0.02, 0.5)
    return {
        "mass": _between(random, 0.2, 5),
        "stiffness": float(random.choice([0.0, _between(random, 1, 100)])),
        "mu_sliding": sliding,
        "mu_static": sliding * random.uniform(1, 2),
        "x_0": random.uniform(-0.1, 0.1),
        "x_dot_0": float(random.choice([0.0, random.uniform(-0.5, 0.5)])),
    }


def _pair(folder: Path, lower: tuple[str, Starts], upper: Starts) -> System:
    system = System("Pair")
    below = system.add("lower", folder / f"{lower[0]}.fmu", start_values=lower[1])
    above = system.add("upper", folder / "DryOscillator.fmu", start_values=upper)
    system.connect(below["x"], above["belt"])
    return system


def _slide(lower: Starts, upper: Starts, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ways of an oscillator and of a dry one on it, by their equations, from event to event; shape (2, times)."""
    g, m, K, M, k = 9.81, lower["mass"], lower["stiffness"], upper["mass"], upper["stiffness"]
    c = m * lower["damping"]
    sliding, static = (upper[f"mu_{kind}"] * M * g for kind in ("sliding", "static"))

    def held(y: NDArray[np.float64]) -> float:
        """Friction force on the upper mass with which both have one acceleration."""
        return M * (-K * y[0] - c * y[1] - k * y[2]) / (m + M) + k * y[2]

    def chosen(y: NDArray[np.float64]) -> float:
        return 0.0 if abs(held(y)) <= static else -float(np.sign(held(y)))

    y = np.array([lower["x_0"], lower["x_dot_0"], upper["x_0"], upper["x_dot_0"]])
    direction: float = float(np.sign(y[3] - y[1])) or chosen(y)
    t, ways = float(times[0]), np.empty((2, len(times)))
    while t < times[-1]:

        def rates(_: float, y: NDArray[np.float64], direction: float = direction) -> list[float]:
            force = held(y) if direction == 0 else -direction * sliding
            return [y[1], (-K * y[0] - c * y[1] - force) / m, y[3], (force - k * y[2]) / M]

        def ends(_: float, y: NDArray[np.float64], direction: float = direction) -> float:
            return static - abs(held(y)) if direction == 0 else direction * (y[3] - y[1]) + 1e-13

        ends.terminal, ends.direction = True, -1  # type: ignore[attr-defined] - as solve_ivp has it
        tight: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-14, "max_step": 0.01}
        run: Any = solve_ivp(rates, (t, times[-1]), y, "DOP853", events=ends, dense_output=True, **tight)
        here = (times >= t) & (times <= run.t[-1])
        ways[:, here] = run.sol(times[here])[[0, 2]]
        t, y = float(run.t[-1]), run.y[:, -1]
        if run.status == 1:
            released = -float(np.sign(held(y))) if direction == 0 else chosen(y)
            y[3] = y[1]
            direction = released
    return ways


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("dry_pairs")
    for name in ("Oscillator", "DryOscillator"):
        build(name, path)
    return path


@pytest.fixture(scope="module")
def flattened(folder: Path) -> Callable[[str, System], Path]:
    """The flattened pair, which is built once for each kind of the lower one."""

    def path(kind: str, system: System) -> Path:
        there = folder / kind / "Pair.fmu"
        return there if there.exists() else flatten(system, folder / kind)

    return path


def _difference(run: Result, others: tuple[NDArray[np.float64], ...]) -> float:
    names = ("lower.x", "upper.x")
    return max(
        float(np.abs(run[name] - other).max() / np.abs(other).max()) for name, other in zip(names, others, strict=True)
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "pairs", "coupling"), [(43, 200, "implicit"), (45, 60, "implicit"), (45, 60, "waveform")]
)
def test_nothing_is_off_without_a_word(
    folder: Path, flattened: Callable[[str, System], Path], seed: int, pairs: int, coupling: Coupling
) -> None:
    """Waveform coupling takes what is lighter than its mover, which is half of them, and refuses the others."""
    random = np.random.default_rng(seed)
    silent, refused, warned, worst, by_hand = list[Any](), list[str](), list[Any](), 0.0, 0
    for number in range(pairs):
        kind = ("Oscillator", "DryOscillator")[number % 2]
        lower, upper = (_moved if kind == "Oscillator" else _dry)(random), _dry(random)
        system = _pair(folder, (kind, lower), upper)
        starts = {f"{name}.{key}": v for name, own in (("lower", lower), ("upper", upper)) for key, v in own.items()}
        settings: dict[str, Any] = {"stop_time": STOP, "step_size": STEP, "tolerance": TOLERANCE}
        whole = simulate(flattened(kind, system), start_values=starts, **settings)
        ways = whole["lower.x"], whole["upper.x"]
        if kind == "Oscillator" and by_hand < BY_HAND:
            by_hand += 1
            assert _difference(whole, tuple(_slide(lower, upper, whole.time))) < 1e-8, (lower, upper)
        try:
            run = system.simulate(coupling=coupling, **settings)
        except SimulationError as error:
            refused.append(str(error))
            continue
        assert run.coupling_error is not None
        difference, claimed = _difference(run, ways), float(np.nansum(run.coupling_error))
        worst = max(worst, difference)
        if run.warnings:
            warned.append((number, difference, run.warnings))
        elif difference > max(RIGHT, 3 * claimed):
            silent.append((number, difference, claimed))
    counts = {"silent": len(silent), "refused": len(refused), "warned of": len(warned), "worst": worst}
    sys.stdout.write(f"{pairs} pairs, {coupling}: {counts}\n")
    assert silent == []
    assert all("must be lighter than what moves it" in text for text in refused)
    assert len(refused) <= (pairs / 2 if coupling == "waveform" else 0)
    needless = [one for one in warned if one[1] <= RIGHT]
    assert all("energy account" in text for *_, texts in needless for text in texts)  # of a pair at rest, 1e-33 J
    assert len(needless) <= pairs / 50
