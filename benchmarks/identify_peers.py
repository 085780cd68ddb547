"""Lengths, friction, a mass and first angles from noisy ones: `identify` beside what a user would do otherwise.

    python benchmarks/identify_peers.py [--quick]

Each file in ``identifiers/`` is what a user writes who has nothing but the package.  FMPy is given the FMU, whose steps
SciPy's ``least_squares`` differentiates by differences of 1e-5, since their errors are 1e-8; "prepared" gives it the
extracted folder and the model description, too.  CasADi is given the equations, derived by hand.  All begin with the
same start values and have to find the same minimum: the remark says by how many standard errors they differ from ours.
Times are processor times of all that is done after importing.  Our steps are compiled, and kept, when names are unknown
for the first time: that call's time, by the clock and in an empty cache, is a row of its own.
"""

from __future__ import annotations

import importlib
import os
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from _measure import HERE, Row, command, interleaved

from liaisons import identify
from liaisons.fmu import build
from liaisons.language import Mechanism
from liaisons.mechanics import assemble
from liaisons.models import DoublePendulum, Pendulum

FOLDER = HERE / "identifiers"
NOISE = 0.01  # rad
OURS, LOOP, PREPARED, BY_HAND = "identify", "least_squares, simulate_fmu", "the same, prepared", "CasADi by hand"


@dataclass(frozen=True)
class Problem:
    """What is measured at 20 points a second, and where all begin."""

    name: str
    files: str
    component: type[Mechanism]
    signals: tuple[str, ...]
    stop: float
    truth: dict[str, float]
    start: dict[str, float]


PROBLEMS = (
    Problem(
        "pendulum, 3 values, 10 s",
        "pendulum",
        Pendulum,
        ("theta",),
        10.0,
        {"length": 1.1, "friction": 0.05, "theta_0": 2.0},
        {"length": 1.0, "friction": 0.02, "theta_0": 2.05},
    ),
    Problem(
        "double pendulum, 5 values, 10 s",
        "double_pendulum",
        DoublePendulum,
        ("theta_1", "theta_2"),
        10.0,
        {"length_1": 1.1, "length_2": 0.9, "mass_2": 0.8, "theta_1_0": 0.5, "theta_2_0": 0.7},
        {"length_1": 1.05, "length_2": 0.95, "mass_2": 1.0, "theta_1_0": 0.55, "theta_2_0": 0.65},
    ),
)


def measure(quick: bool, plots: Path) -> list[Row]:  # noqa: ARG001 - no diagram
    sys.path.insert(0, str(FOLDER))
    return [row for problem in PROBLEMS for row in _rows(problem, 3 if quick else 15)]


def _rows(problem: Problem, rounds: int) -> list[Row]:
    reached: dict[str, dict[str, float]] = {}
    with tempfile.TemporaryDirectory() as name:
        fmu = str(build(assemble(problem.component), Path(name), backend="native"))
        times, angles = _measured(problem, fmu)
        folder = fmpy.extract(fmu, str(Path(name) / "extracted"))
        prepared = {"fmu": folder, "model_description": fmpy.read_model_description(fmu)}
        tools: dict[str, tuple[str, dict[str, Any]]] = {
            OURS: ("liaisons", {}),
            LOOP: ("fmpy", {"fmu": fmu}),
            PREPARED: ("fmpy", prepared),
            BY_HAND: ("casadi", {}),
        }
        runs: dict[str, Callable[[], float]] = {}
        for title, (tool, more) in tools.items():
            solve = importlib.import_module(f"{problem.files}_{tool}").solve
            solve = partial(solve, times, np.squeeze(angles), problem.start, NOISE, **more)
            runs[title] = partial(_seconds, title, solve, reached)
        os.environ["XDG_CACHE_HOME"] = name
        begin = time.perf_counter()
        runs[OURS]()
        first = time.perf_counter() - begin
        seconds = interleaved(runs, rounds)
    rows = [
        Row.of(problem.name, OURS, seconds[OURS], "s", remark=f"{_lines(problem, 'liaisons')} lines"),
        Row.of(problem.name, f"{OURS}, the first call", [first], "s"),
    ]
    errors = _standard_errors(problem, times, angles)
    for title in (LOOP, PREPARED, BY_HAND):
        apart = max(abs(reached[title][name] - reached[OURS][name]) / errors[name] for name in problem.start)
        remark = f"{apart:.0e} standard errors apart, {_lines(problem, tools[title][0])} lines"
        more = {"yardstick": OURS, "beside": seconds[OURS], "asked": ">= 10" if title == LOOP else ""}
        rows.append(Row.of(problem.name, title, seconds[title], "s", remark=remark, **more))
    return rows


def _measured(problem: Problem, fmu: str) -> tuple[np.ndarray, np.ndarray]:
    """Times and noisy signals, a row each."""
    exact = fmpy.simulate_fmu(
        fmu,
        stop_time=problem.stop,
        output_interval=0.05,
        start_values=problem.truth,
        output=problem.signals,
    )
    signals = np.array([exact[name] for name in problem.signals])
    return exact["time"], signals + NOISE * np.random.default_rng(0).standard_normal(signals.shape)


def _standard_errors(problem: Problem, times: np.ndarray, angles: np.ndarray) -> dict[str, float]:
    data = {"time": times, **dict(zip(problem.signals, angles, strict=True))}
    noise = dict.fromkeys(problem.signals, NOISE)
    fit = identify(problem.component, data, unknown=[*problem.start], noise=noise, start_values=problem.start)
    return dict(zip(fit.values, np.sqrt(np.diag(fit.covariance)), strict=True))


def _seconds(title: str, solve: Callable[[], dict[str, float]], reached: dict[str, dict[str, float]]) -> float:
    begin = time.process_time()
    reached[title] = solve()
    return time.process_time() - begin


def _lines(problem: Problem, tool: str) -> int:
    """Lines of code; docstrings take whole lines there."""
    text = (FOLDER / f"{problem.files}_{tool}.py").read_text(encoding="utf-8")
    lines = map(str.strip, text.splitlines())
    return sum(bool(line) and not line.startswith('"""') for line in lines)


if __name__ == "__main__":
    command(measure)
