"""Derivatives of a motion beside the motion alone, over the same steps.

    python benchmarks/derivatives.py [--quick]

Whole calls of :class:`liaisons_motion.derivatives.DifferentiableMotion` whose steps are frozen, in processor time:
forward by
three values, and the gradient of a number backwards by one hundred start values of a chain, by the side of a run that
calculates no derivatives.  Outputs are the coordinates and momenta at 200 times.  The compiler is not part of it.

An event of a contact costs the difference to a motion over the same times without any, divided by their number.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from _measure import Row, command, interleaved

from liaisons.mechanics import assemble
from liaisons.models import PendulumChain
from liaisons_motion.derivatives import DifferentiableMotion, motion_of

LINKS = 50
FORWARD = {
    "pendulum": ("Pendulum", ["theta_0", "gravity", "length"], 20.0),
    "double pendulum": ("DoublePendulum", ["theta_1_0", "mass_1", "length_2"], 20.0),
    "spatial cat": ("SpatialCat", ["mass", "inertia_axial", "joint_distance"], 20.0),
}
ALONE = "the same steps alone"
EVENTS: dict[str, tuple[str, str, dict[str, float], dict[str, float]]] = {
    "impact of a ball": (
        "BouncingBall",
        "gap_impacts",
        {"bounce": 1.0, "height_0": 0.1},
        {"bounce": 1.0, "height_dot_0": 200.0},
    ),
    "oscillator sticks or slips": (
        "DryOscillator",
        "slip_sticks",
        {"mu_static": 0.3, "mu_sliding": 0.2, "belt_dot": 0.2, "x_0": 0.0, "x_dot_0": 0.2},
        {"mu_static": 0.3, "mu_sliding": 0.2, "belt_dot": 5.0, "x_0": 0.0, "x_dot_0": 0.2},
    ),
}
"""Component, what tells its events, and values with which there are events, and with which there are none."""
ASKED = {"run": "<= 30", "forward by two values": "<= 100", "backwards": "<= 100"}


def measure(quick: bool, plots: Path) -> list[Row]:  # noqa: ARG001 - no diagram
    rounds, links = (5, 10) if quick else (41, LINKS)
    rows = []
    for title, (component, by, stop) in FORWARD.items():
        motion = _frozen(motion_of(component, by, np.linspace(0, stop, 201)))
        topic = "Forward by three values"
        rows.append(_row(topic, title, motion, partial(motion.forward, motion.values), rounds=rounds, asked="<= 4"))
    starts = {"theta_0": np.linspace(0.2, 0.6, links)}
    times = np.linspace(0, 2.0, 201)
    by = ["theta_0", "theta_dot_0"]
    chain = _frozen(motion_of(assemble(PendulumChain, links), by, times, start_values=starts, tolerance=1e-8))
    back = partial(chain.adjoint, chain.values, lambda signals: 2 * signals)
    title = f"chain of {links} by {2 * links} start values"
    rows.append(_row("Backwards", title, chain, back, rounds=rounds, asked="<= 5"))
    return [*rows, *(row for title in EVENTS for row in _event_rows(title, rounds))]


def _frozen(motion: object) -> DifferentiableMotion:
    assert isinstance(motion, DifferentiableMotion)
    return motion.frozen(motion.values)


def _row(
    topic: str, title: str, motion: DifferentiableMotion, derivatives: Callable[[], object], *, rounds: int, asked: str
) -> Row:
    runs = {
        "both": partial(_milliseconds, derivatives),
        "alone": partial(_milliseconds, partial(motion, motion.values)),
    }
    both, alone = interleaved(runs, rounds).values()
    return Row.of(topic, title, both, "ms", yardstick=ALONE, beside=alone, asked=asked)


def _event_rows(title: str, rounds: int) -> list[Row]:
    """What an event costs: in a run, and with derivatives."""
    component, counter, eventful, plain = EVENTS[title]
    times, runs, events = np.linspace(0, 30, 3001), dict[str, Callable[[], float]](), 0
    for kind, values in (("eventful", eventful), ("plain", plain)):
        motion = motion_of(component, list(values)[:2], times, record=counter, start_values=values)
        assert motion.has_contacts
        works = (motion, motion.forward, partial(motion.adjoint, weights=np.ones((len(motion.signals), len(times)))))
        for work, call in zip(ASKED, works, strict=True):
            runs[f"{kind} {work}"] = partial(_milliseconds, partial(call, motion.values))
        if kind == "eventful":
            events = int(np.abs(np.diff(motion(motion.values))).sum())
    spent, rows = interleaved(runs, rounds), []
    for work, asked in ASKED.items():
        pairs = zip(spent[f"eventful {work}"], spent[f"plain {work}"], strict=True)
        step = 1e3 * float(np.median(spent[f"plain {work}"])) / (len(times) - 1)
        remark = f"{events} events; a step without one: {step:.2g} µs"
        costs = [1e3 * (a - b) / events for a, b in pairs]
        rows.append(Row.of("An event of a contact", f"{title}: {work}", costs, "µs", asked=asked, remark=remark))
    return rows


def _milliseconds(work: Callable[[], object]) -> float:
    """Processor time of a call [ms]."""
    begin = time.process_time()
    work()
    return 1e3 * (time.process_time() - begin)


if __name__ == "__main__":
    command(measure)
