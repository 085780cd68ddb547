"""Random systems in each coupling: the error that a run tells, beside the true one against the flattened system."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from liaisons import System, build, flatten, simulate
from liaisons.cosim import Coupling

Starts = dict[str, Any]

SYSTEMS, SEED, STOP = 200, 44, 1.0
COUPLINGS: tuple[Coupling, ...] = ("jacobi", "gauss-seidel", "implicit", "waveform")
LEAST = 1e-9
"""Errors below are those of the FMUs' solvers, of tolerance 1e-12, and of rounding in the estimate."""
TRUE_OVER_TOLD, TOLD_OVER_TRUE = 5.0, 10.0
"""What the sum of the errors of all steps keeps in a second of a motion that does not magnify them: each is that of
one step each, and sizes of errors are added that may cancel each other within a swing.
"""


def _driven(random: np.random.Generator) -> tuple[dict[str, tuple[str, Starts]], list[tuple[str, str]]]:
    motor = {
        "amplitude": random.uniform(0.02, 0.3),
        "angular_frequency": random.uniform(1, 8),
        "phase": random.uniform(0, 6),
    }
    swing = {"theta_0": random.uniform(-1, 1), "theta_dot_0": random.uniform(-1, 1), "length": random.uniform(0.5, 2)}
    return {"one": ("Sinusoid", motor), "two": ("Pendulum", swing)}, [("one.y", "two.pivot_x")]


def _stepped(random: np.random.Generator) -> tuple[dict[str, tuple[str, Starts]], list[tuple[str, str]]]:
    step = {"end_value": random.uniform(0.2, 2), "duration": random.uniform(1.5, 5)}
    return {"one": ("SmoothStep", step), "two": ("Pendulum", {"theta_0": 0.0})}, [("one.y", "two.pivot_x")]


def _coupled(random: np.random.Generator) -> tuple[dict[str, tuple[str, Starts]], list[tuple[str, str]]]:
    upper = {"mass": random.uniform(1, 3), "stiffness": random.uniform(5, 60), "x_0": random.uniform(-1, 1)}
    lower = {"mass": random.uniform(0.1, 0.6), "stiffness": random.uniform(1, 20), "x_0": random.uniform(-1, 1)}
    return {"one": ("Oscillator", upper), "two": ("Oscillator", lower)}, [("one.x", "two.support")]


KINDS = (_driven, _stepped, _coupled)
SEEN = {"theta", "theta_dot", "x", "x_dot"}


@pytest.mark.slow
@pytest.mark.parametrize("coupling", COUPLINGS)
def test_both_tails(coupling: Coupling, tmp_path_factory: pytest.TempPathFactory) -> None:
    folder, random = tmp_path_factory.getbasetemp() / "estimates", np.random.default_rng(SEED)
    ratios: list[float] = []
    for number in range(SYSTEMS):
        kind = KINDS[number % len(KINDS)]
        parts, links = kind(random)
        step = float(np.exp(random.uniform(np.log(0.002), np.log(0.02))))
        system = System("Whole")
        added = {}
        for name, (component, starts) in parts.items():
            if not (path := folder / f"{component}.fmu").exists():
                build(component, folder)
            added[name] = system.add(name, path, **starts)
        for source, target in links:
            (a, b), (c, d) = source.split("."), target.split(".")
            system.connect(added[a][b], added[c][d])
        whole = Path(folder / kind.__name__ / "Whole.fmu")
        if not whole.exists():
            flatten(system, whole.parent)
        values = {f"{name}.{key}": value for name, (_, own) in parts.items() for key, value in own.items()}
        truth = simulate(whole, stop_time=STOP, step_size=step, tolerance=1e-12, start_values=values)
        run = system.simulate(STOP, step, tolerance=1e-12, coupling=coupling)
        assert run.coupling_error is not None
        errors = []
        for name in run.names:
            if name.partition(".")[2] in SEEN:
                alike = [np.abs(run[n]).max() for n in run.names if run.units[n] == run.units[name]]
                errors.append(float(np.abs(run[name] - truth[name]).max() / max(alike)))
        true, told = max(errors), float(np.sum(run.coupling_error))
        ratios.append((true + LEAST) / (told + LEAST))
    low, high = min(ratios), max(ratios)
    sys.stdout.write(f"{coupling}: true over told up to {high:.2g}, told over true up to {1 / low:.2g}\n")
    assert high < TRUE_OVER_TOLD
    assert 1 / low < TOLD_OVER_TRUE
