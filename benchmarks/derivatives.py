"""Derivatives of a motion beside the motion alone, over the same steps.

    python benchmarks/derivatives.py [--quick]

Whole calls of :class:`liaisons.derivatives.DifferentiableMotion` whose steps are frozen, in processor time: forward by
three values, and the gradient of a number backwards by one hundred start values of a chain, by the side of a run that
calculates no derivatives.  Outputs are the coordinates and momenta at 200 times.  The compiler is not part of it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from _measure import Row, command, interleaved

from liaisons.derivatives import DifferentiableMotion, motion_of
from liaisons.mechanics import assemble
from liaisons.models import PendulumChain

LINKS = 50
FORWARD = {
    "pendulum": ("Pendulum", ["theta_0", "gravity", "length"], 20.0),
    "double pendulum": ("DoublePendulum", ["theta_1_0", "mass_1", "length_2"], 20.0),
    "spatial cat": ("SpatialCat", ["mass", "inertia_axial", "joint_distance"], 20.0),
}
ALONE = "the same steps alone"


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
    return [*rows, _row("Backwards", title, chain, back, rounds=rounds, asked="<= 5")]


def _frozen(motion: object) -> DifferentiableMotion:
    assert isinstance(motion, DifferentiableMotion)
    return motion.frozen(motion.values)


def _row(
    topic: str, title: str, motion: DifferentiableMotion, derivatives: Callable[[], object], *, rounds: int, asked: str
) -> Row:
    def timed(work: Callable[[], object]) -> float:
        begin = time.process_time()
        work()
        return 1e3 * (time.process_time() - begin)

    runs = {"both": partial(timed, derivatives), "alone": partial(timed, partial(motion, motion.values))}
    both, alone = interleaved(runs, rounds).values()
    return Row.of(topic, title, both, "ms", yardstick=ALONE, beside=alone, asked=asked)


if __name__ == "__main__":
    command(measure)
