"""Energy of a pendulum in long runs, and the cost of a step: the symplectic solver of the native FMU beside others.

    python benchmarks/energy_drift.py [--quick]

Steps of 10 ms from 1 rad at rest.  All are called from C; rounds are interleaved, times are processor times; the table
has medians, and the spread of the ratios over the rounds.  "two states" are angle and rate, with a right-hand side of
one sine; "as the FMU" has length, pivot and forces as inputs, and work and loss as states.  A drift shows in how errors
grow with ten times as many steps: rounding alone lets the energy walk at random, by the square root of their number.
"""

from __future__ import annotations

import ctypes
import math
import tempfile
from collections.abc import Callable
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from _measure import Row, command, interleaved
from native_code import component_library, doubles, open_component

from liaisons.mechanics import assemble
from liaisons.models import Pendulum

STEP = 0.01  # [s]
AMPLITUDE = 1.0  # [rad]
GRAVITY = 9.81  # [m/s2]; mass 1 kg, length 1 m
TOLERANCE = 1e-10  # of the error-controlled solver
SYMPLECTIC = "FMU, symplectic"
ASKED = "<= 6"  # times the cost of Runge-Kutta
NO_DRIFT = "<= 0.75"  # half-way from a random walk to a drift
STARTS = np.linspace(0.5, 2.5, 16)  # [rad], of the growth

Advance = Callable[[int], tuple[float, float]]
"""Goes on by so many steps of 10 ms; returns seconds and the energy."""


class Bench:
    """The FMU's sources and the hand-written steps, compiled together."""

    def __init__(self, folder: Path) -> None:
        self._model = assemble(Pendulum).flat()
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


def measure(quick: bool, plots: Path) -> list[Row]:
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(Path(folder))
        return [
            *_costs(bench, 2 if quick else 9),
            *_drifts(bench, (4, 5) if quick else (4, 5, 6, 7), plots),
            *_growth(bench, 10_000 if quick else 1_000_000),
        ]


def _costs(bench: Bench, rounds: int, steps: int = 5000) -> list[Row]:
    two, four = "Runge-Kutta by hand, two states", "Runge-Kutta by hand, as the FMU"
    runs: dict[str, tuple[Advance, str, str]] = {
        two: (bench.by_hand("runge_kutta_of_two"), "", ""),
        "symplectic solver of the FMU, two states": (bench.by_hand("gauss_of_two"), two, ASKED),
        four: (bench.by_hand("runge_kutta_of_four"), "", ""),
        "FMU, symplectic, communication steps of 10 ms": (bench.fmu(1, symplectic=True), four, ASKED),
        "FMU, symplectic, communication steps of 1 s": (bench.fmu(100, symplectic=True), four, ASKED),
        f"FMU, tolerance {TOLERANCE:g}, communication steps of 10 ms": (bench.fmu(1, symplectic=False), four, ""),
        f"FMU, tolerance {TOLERANCE:g}, communication steps of 1 s": (bench.fmu(100, symplectic=False), four, ""),
    }

    def nanoseconds(advance: Advance) -> float:
        # The best of a few in each round: what else runs on the machine slows some methods down more than others.
        return 1e9 * min(advance(steps)[0] for _ in range(5)) / steps

    times = interleaved({name: lambda a=advance: nanoseconds(a) for name, (advance, _, _) in runs.items()}, rounds)
    return [
        Row.of("Cost of 10 ms", name, times[name], "ns", yardstick=yardstick, beside=times.get(yardstick), asked=asked)
        for name, (_, yardstick, asked) in runs.items()
    ]


def _drifts(bench: Bench, powers: tuple[int, ...], plots: Path) -> list[Row]:
    runs = {
        "Runge-Kutta by hand": bench.by_hand("runge_kutta_of_two"),
        f"FMU, tolerance {TOLERANCE:g}": bench.fmu(100, symplectic=False),
        SYMPLECTIC: bench.fmu(100, symplectic=True),
    }
    start = -GRAVITY * math.cos(AMPLITUDE)
    steps = 2000 * (1 + np.arange(10 ** powers[-1] // 2000))
    rows = []
    _, ax = plt.subplots(figsize=(7, 4.5), layout="constrained")
    for name, advance in runs.items():
        worst = np.maximum.accumulate([abs(advance(2000)[1] - start) for _ in steps])
        ax.loglog(steps, worst, label=name)
        for power in powers:
            error = float(worst[10**power // 2000 - 1])
            asked = "<= 1e-11" if name == SYMPLECTIC and power == 6 else ""
            rows.append(Row("Largest energy error from 1 rad", f"{name}, 1e{power} steps", error, "J", asked=asked))
    ax.loglog(steps, 2e-16 * np.sqrt(steps), "k:", label="∝ √steps")
    ax.set(xlabel="steps of 10 ms", ylabel="largest energy error so far [J]", title="Pendulum from 1 rad")
    ax.legend()
    plt.savefig(plots / "energy_drift.png", dpi=100)
    plt.close()
    return rows


def _growth(bench: Bench, steps: int) -> list[Row]:
    """Energy errors of many amplitudes after so many steps, and after ten times as many."""
    errors = []
    for amplitude in STARTS:
        advance = bench.fmu(100, symplectic=True, amplitude=amplitude)
        start = -GRAVITY * math.cos(amplitude)
        errors.append([advance(n)[1] - start for n in (steps, 9 * steps)])
    largest = np.max(np.abs(errors), axis=0)
    before, after = np.sqrt(np.mean(np.square(errors), axis=0))
    topic = f"{SYMPLECTIC}, {STARTS.size} amplitudes from {STARTS[0]:g} to {STARTS[-1]:g} rad"
    return [
        Row(topic, f"largest energy error after {steps:.0e} steps", float(largest[0]), "J", asked="<= 1e-11"),
        Row(topic, f"largest energy error after {10 * steps:.0e} steps", float(largest[1]), "J"),
        Row(
            topic,
            "root mean square, exponent of its growth",
            math.log10(after / before),
            "",
            asked=NO_DRIFT,
            remark="0.5: random walk, 1: drift",
        ),
    ]


if __name__ == "__main__":
    command(measure)
