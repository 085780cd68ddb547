"""Contact, impact, stick and slip: closed forms by every interface of the FMUs, and what an impact costs.

    python benchmarks/contacts.py [--quick]

An event costs the difference to the same communication steps without any, divided by their number.  Errors of closed
forms are the largest at the communication points, in SI units, with all solvers at 1e-13; the FMU counts impacts, the
importer events.  In model exchange the least bounces are of the size of the importer's tolerance, and by them the
instant of rest is off.  WebAssembly runs in wasmtime.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from ctypes import c_double, c_long, c_uint, c_void_p
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from _measure import Row, command, interleaved
from contact_forms import GRAVITY, Case, cases, interfaces
from native_code import component_library, doubles, open_component

from liaisons.errors import BuildError
from liaisons.fmu import build
from liaisons.mechanics import assemble
from liaisons.models import BouncingBall, DryOscillator

ASKED = "<= 20"
STEPS = 20_000  # that are timed
EVENT = "An event inside a communication step, called from C"
BESIDE = "A ball that bounces six times in 3 s, e = 0.8, called from C"
REFUSAL = "the Python back end takes no unilateral liaisons and no dry friction"


class Bench:
    """The sources of a component's FMU and by_hand/bouncing_ball.c, compiled together."""

    def __init__(self, component: type[Any], folder: Path) -> None:
        self._model = assemble(component).flat()
        folder.mkdir()
        library = self._library = component_library(self._model, folder, "bouncing_ball.c")
        pointer, real, reals = c_void_p, c_double, doubles([0.0] * 4)
        library.component_driven.argtypes = [pointer, c_uint, real, real, c_long]
        library.component_advance.argtypes = [pointer, real, c_long]
        library.ball_by_hand.argtypes = [type(reals), real, real, c_long]
        library.component_driven.restype = library.ball_by_hand.restype = real
        self.states = reals

    def seconds(self, size: float, steps: int, tolerance: float = 1e-8, **values: float) -> float:
        """Of so many steps from the start; the best of a few, as other work on the machine comes and goes.

        With ``belt_dot`` the belt is set before each step.
        """
        settable, library = (*self._model.parameters, *self._model.inputs), self._library
        starts = doubles(values.get(v.name, v.starts[0]) for v in settable)
        times = []
        for _ in range(3):
            library.begin(starts, self.states, doubles([0.0] * 4))
            instance = open_component(library, tolerance)
            if "belt_dot" in values:
                belt = 1 + [v.name for v in settable].index("belt")
                times.append(library.component_driven(instance, belt, values["belt_dot"], size, steps))
            else:
                times.append(library.component_advance(instance, size, steps))
            library.component_states(instance, self.states)
            library.component_close(instance)
        if min(times) < 0:
            raise RuntimeError(f"a step of {size} s with {values} is refused")
        return min(times)

    def seconds_by_hand(self, size: float, steps: int) -> float:
        """Of ``ball_by_hand`` from 1 m at rest, e = 0.8."""
        self.states[:2] = 1.0, 0.0
        return self._library.ball_by_hand(self.states, 0.8, size, steps)


def costs(folder: Path, rounds: int) -> list[Row]:
    ball, oscillator = Bench(BouncingBall, folder / "ball"), Bench(DryOscillator, folder / "oscillator")
    rows = []

    def add(
        case: str, eventful: Callable[[], float], plain: Callable[[], float], events: float, yardstick: str
    ) -> None:
        times = interleaved({"eventful": eventful, "plain": plain}, rounds)
        steps = [1e9 * t / STEPS for t in times["plain"]]
        each = [1e9 * (a - b) / events for a, b in zip(times["eventful"], times["plain"], strict=True)]
        rows.append(Row.of(EVENT, case, each, "ns", beside=steps, yardstick=yardstick, asked=ASKED))

    for size, flight in ((1e-3, 1.37), (1e-2, 1.37), (1e-2, 5.37), (1e-1, 0.537)):  # in steps
        speed = GRAVITY * flight * size / 2
        bounces = partial(ball.seconds, size, STEPS, height_0=0.0, height_dot_0=speed, bounce=1.0)
        flies = partial(ball.seconds, size, STEPS, height_dot_0=GRAVITY * size * STEPS)
        bounces()
        height, momentum, *_ = ball.states
        _check(height * GRAVITY + momentum**2 / 2, speed**2 / 2)
        case = f"impact of a ball, every {flight} steps of {size:g} s"
        add(case, bounces, flies, STEPS / flight, "a step of its flight")
    size, belt, friction = 2e-2, 0.2, {"stiffness": 1e3, "mu_static": 0.2, "mu_sliding": 0.1}
    start = {"x_0": 0.0, "x_dot_0": belt, **friction}
    period = sum(DryOscillator.stick_slip(belt_dot=belt, **friction))
    turns = partial(oscillator.seconds, size, STEPS, belt_dot=belt, **start)
    slides = partial(oscillator.seconds, size, STEPS, belt_dot=5.0, **start)
    turns()
    _check(oscillator.states[0], DryOscillator.exact(np.array([STEPS * size]), belt_dot=belt, **start)["x"][0])
    case = f"DryOscillator sticks or slips, every {period / 2 / size:.3g} steps of {size:g} s"
    add(case, turns, slides, 2 * STEPS * size / period, "a step of sliding")
    runs = {
        "flies": partial(ball.seconds, 1e-2, STEPS, height_dot_0=GRAVITY * 1e-2 * STEPS),
        "rests": partial(ball.seconds, 1e-2, STEPS, height_0=0.0),
    }
    flight, rest = ([1e9 * t / STEPS for t in times] for times in interleaved(runs, rounds).values())
    return [*rows, Row.of("A ball at rest", "step of 0.01 s", rest, "ns", beside=flight, yardstick="of its flight")]


def _check(found: float, expected: float) -> None:
    """That there were the events that are timed."""
    if not abs(found - expected) <= 1e-6 * abs(expected):
        raise RuntimeError(f"{found} instead of {expected}: this is not the motion to be timed")


def beside_by_hand(folder: Path, rounds: int) -> list[Row]:
    ball, exact = Bench(BouncingBall, folder / "beside"), BouncingBall.exact(np.array([3.0]))["height"][0]
    yardstick = "C by hand, Euler steps of 1 ms"
    runs = {
        yardstick: partial(ball.seconds_by_hand, 1e-3, 3000),
        "C by hand, Euler steps of 1 µs": partial(ball.seconds_by_hand, 1e-6, 3_000_000),
    }
    for size in (1e-2, 0.1, 3.0):
        name = f"FMU, tolerance 1e-12, communication steps of {size:g} s"
        runs[name] = partial(ball.seconds, size, round(3 / size), 1e-12)
    errors = {}
    for name, run in runs.items():
        run()
        errors[name] = f"error of the height {abs(ball.states[0] - exact):.0e} m"
    times = {name: [1e6 * t for t in each] for name, each in interleaved(runs, rounds).items()}
    rows = []
    for name, each in times.items():
        against = {} if name == yardstick else {"beside": times[yardstick], "yardstick": yardstick}
        rows.append(Row.of(BESIDE, name, each, "µs", remark=errors[name], **against))
    return rows


def forms(folder: Path, chosen: list[Case]) -> list[Row]:
    """Tables by interface."""
    rows, refused = [], 0
    for i, case in enumerate(chosen):
        model = case.model(f"Case{i}")
        for interface, (asked, run) in interfaces(model, case, folder / f"{i}").items():
            found = run()
            counts = f"impacts: {found.impacts}" + ("" if found.events is None else f", events: {found.events}")
            for form, error in case.forms.items():
                largest = float(np.max(np.abs(error(found.time, found.values))))
                of = f"{case.component.__name__}: {form}"
                rows.append(Row(f"Closed forms: {interface}", of, largest, "", asked=asked, remark=counts))
        try:
            build(model, folder / f"{i}" / "python", backend="python")
        except BuildError as error:
            refused += f"{REFUSAL} (" in str(error)
    rows.sort(key=lambda row: row.topic)
    models = len(chosen)
    case, unit = f"refused by name: {REFUSAL}", f"of {models} models"
    return [*rows, Row("Closed forms: Python back end", case, refused, unit, asked=f">= {models}")]


def measure(quick: bool, plots: Path) -> list[Row]:  # noqa: ARG001 - no diagram
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        folder, rounds = Path(name), 3 if quick else 15
        rows = [*costs(folder, rounds), *beside_by_hand(folder, rounds)]
        return [*rows, *forms(folder, cases()[:: 4 if quick else 1])]


if __name__ == "__main__":
    command(measure)
