"""Energy of a pendulum in long runs, and the cost of a step: the symplectic solver of the native FMU beside others.

    python benchmarks/energy_drift.py [--rounds 9] [--output benchmarks/results]

Steps of 10 ms from 1 rad at rest.  All are called from C; rounds are interleaved, times are processor times; the table
has medians, and the spread of the ratios over the rounds.  "two states" are angle and rate, with a right-hand side of
one sine; "as the FMU" has length, pivot and forces as inputs, and work and loss as states.  A drift would show in the
mean of many runs: rounding errors alone let the energy walk at random, by the square root of the number of steps.
"""

from __future__ import annotations

import argparse
import ctypes
import math
import statistics
import tempfile
from collections.abc import Callable
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from native_code import component_library, doubles, open_component

from liaisons.models import Pendulum

STEP = 0.01  # [s]
AMPLITUDE = 1.0  # [rad]
GRAVITY = 9.81  # [m/s2]; mass 1 kg, length 1 m
TOLERANCE = 1e-10  # of the error-controlled solver
STARTS = np.linspace(0.5, 2.5, 16)  # [rad], of the mean

Advance = Callable[[int], tuple[float, float]]
"""Goes on by so many steps of 10 ms; returns seconds and the energy."""


class Bench:
    """The FMU's sources and the hand-written steps, compiled together."""

    def __init__(self, folder: Path) -> None:
        self._model = Pendulum.model().flat()
        self._library = component_library(self._model, folder, "rates.c", "pendulum_steps.c")
        for name in ("runge_kutta_of_two", "gauss_of_two", "runge_kutta_of_four"):
            getattr(self._library, name).restype = ctypes.c_double

    def _begin(self, amplitude: float) -> ctypes.Array[ctypes.c_double]:
        settable = (*self._model.parameters, *self._model.inputs)
        values = doubles([amplitude if v.name == "theta_0" else v.starts[0] for v in settable])
        y, sizes = doubles([0.0] * 4), doubles([0.0] * 4)
        self._library.begin(values, y, sizes)
        self._library.begin_by_hand(values, len(self._model.parameters), len(self._model.inputs))
        return y

    def by_hand(self, name: str) -> Advance:
        """A function of pendulum_steps.c."""
        y = self._begin(AMPLITUDE)
        function = getattr(self._library, name)

        def advance(n: int) -> tuple[float, float]:
            return function(y, ctypes.c_double(STEP), ctypes.c_long(n)), _energy(y)

        return advance

    def fmu(self, together: int, *, symplectic: bool, amplitude: float = AMPLITUDE) -> Advance:
        """The FMU; so many steps of 10 ms make up a communication step."""
        y = self._begin(amplitude)
        instance = open_component(self._library, TOLERANCE, symplectic_steps=together if symplectic else 0)
        size = ctypes.c_double(STEP * together)

        def advance(n: int) -> tuple[float, float]:
            seconds = self._library.component_advance(instance, size, ctypes.c_long(n // together))
            self._library.component_states(instance, y)
            return seconds, _energy(y)

        return advance


def _energy(y: ctypes.Array[ctypes.c_double]) -> float:
    return y[1] ** 2 / 2 - GRAVITY * math.cos(y[0])


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--rounds", type=int, default=9)
    options.add_argument("--output", type=Path, default=Path(__file__).parent / "results")
    arguments = options.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(Path(folder))
        text = "\n\n".join([_costs(bench, arguments.rounds), _drifts(bench, arguments.output), _mean(bench)])
    (arguments.output / "energy_drift.md").write_text(f"{text}\n")
    print(text)


def _costs(bench: Bench, rounds: int, steps: int = 5000) -> str:
    two, four = "Runge-Kutta by hand, two states", "Runge-Kutta by hand, as the FMU"
    rows: dict[str, tuple[Advance, str]] = {
        two: (bench.by_hand("runge_kutta_of_two"), two),
        "symplectic solver of the FMU, two states": (bench.by_hand("gauss_of_two"), two),
        four: (bench.by_hand("runge_kutta_of_four"), four),
        "FMU, symplectic, communication steps of 10 ms": (bench.fmu(1, symplectic=True), four),
        "FMU, symplectic, communication steps of 1 s": (bench.fmu(100, symplectic=True), four),
        f"FMU, tolerance {TOLERANCE:g}, communication steps of 10 ms": (bench.fmu(1, symplectic=False), four),
        f"FMU, tolerance {TOLERANCE:g}, communication steps of 1 s": (bench.fmu(100, symplectic=False), four),
    }
    # The best of a few in each round: what else runs on the machine slows some methods down more than others.
    times = [
        {name: min(advance(steps)[0] for _ in range(5)) / steps for name, (advance, _) in rows.items()}
        for _ in range(rounds)
    ]
    lines = ["| cost of 10 ms | ns | × Runge-Kutta of the same states |", "|---|---|---|"]
    for name, (_, yardstick) in rows.items():
        ratios = [t[name] / t[yardstick] for t in times]
        median = statistics.median(t[name] for t in times)
        ratio = f"{statistics.median(ratios):.2f} ({min(ratios):.2f} .. {max(ratios):.2f})"
        lines.append(f"| {name} | {1e9 * median:.0f} | {ratio} |")
    return "\n".join(lines)


def _drifts(bench: Bench, output: Path) -> str:
    runs = {
        "Runge-Kutta by hand": bench.by_hand("runge_kutta_of_two"),
        f"FMU, tolerance {TOLERANCE:g}": bench.fmu(100, symplectic=False),
        "FMU, symplectic": bench.fmu(100, symplectic=True),
    }
    powers = (4, 5, 6, 7)
    lines = [f"| largest energy error [J] up to | {' | '.join(f'1e{p} steps' for p in powers)} |", "|---" * 5 + "|"]
    start = -GRAVITY * math.cos(AMPLITUDE)
    steps = 2000 * (1 + np.arange(10 ** powers[-1] // 2000))
    for name, advance in runs.items():
        errors = np.array([abs(advance(2000)[1] - start) for _ in steps])
        worst = np.maximum.accumulate(errors)
        lines.append(f"| {name} | {' | '.join(f'{worst[10**p // 2000 - 1]:.1e}' for p in powers)} |")
        plt.loglog(steps, worst, label=name)
    plt.loglog(steps, 2e-16 * np.sqrt(steps), "k:", label="∝ √steps")
    plt.gca().set(xlabel="steps of 10 ms", ylabel="largest energy error so far [J]", title="Pendulum from 1 rad")
    plt.legend()
    plt.savefig(output / "energy_drift.png", dpi=150)
    return "\n".join(lines)


def _mean(bench: Bench, steps: int = 1_000_000) -> str:
    ends = np.array([bench.fmu(100, symplectic=True, amplitude=a)(steps)[1] + GRAVITY * math.cos(a) for a in STARTS])
    error = ends.std(ddof=1) / math.sqrt(ends.size)
    return (
        f"FMU, symplectic, {steps:.0e} steps from {ends.size} amplitudes between {STARTS[0]:g} and {STARTS[-1]:g} rad: "
        f"energy error {ends.mean():.1e} ± {error:.0e} J in the mean, {abs(ends).max():.1e} J at most."
    )


if __name__ == "__main__":
    main()
