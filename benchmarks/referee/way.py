"""A way to move a joint: an engine, its documentation's page, and a grid of settings."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_simpson

from referee.task import INSTANTS, Answer, Task


class CannotError(Exception):
    """What an engine, or this way to use it, cannot do; the reason."""


@dataclass(frozen=True)
class Run:
    answer: Answer
    seconds: float


@dataclass(frozen=True)
class Way:
    """How ``engine`` is told to move a joint.

    :ivar page: of the engine's documentation.
    :ivar run: task, step and a setting -> answer.
    :ivar settings: the grid; the best counts at each step.
    """

    engine: str
    name: str
    page: str
    run: Callable[..., Run]
    settings: Sequence[Mapping[str, Any]] = ({},)


Read = Callable[[], tuple[NDArray, NDArray | None]]
"""Places that are asked, and forces of the prescribed joints or None."""


def march(
    task: Task,
    step: float,
    advance: Callable[[float], None],
    read: Read,
    jump: Callable[[float], NDArray | None] = lambda _: None,
) -> Run:
    """Advance from each instant by a step; the work is Simpson's sum of the power between jumps.

    :param jump: at an instant where σ̇ jumps; returns impulses.
    """
    begin = time.process_time()
    count = round(task.stop / INSTANTS / step)
    steps = INSTANTS * count
    jumps = {round(t / step): t for t in task.jumps}
    places, forces = [], []
    powers: list[list[float]] = [[]]
    works = [0.0]
    marks = [0]

    def sample(k: int, side: float) -> None:
        place, force = read()
        if task.force:  # impulses, which these loops do not sum
            force = None
        if force is not None:
            force[0] -= task.carrier * (task.sigma(k * step, side)[2][0] + task.weight)
            powers[-1].append(float(force @ task.sigma(k * step, side)[1]))
        if side < 0 and k % count == 0:
            places.append(place)
            forces.append(force)

    sample(0, 1.0)
    for k in range(1, steps + 1):
        advance((k - 1) * step)
        sample(k, -1.0)
        if k in jumps and k < steps:
            impulses = jump(jumps[k])
            rate = sum(task.sigma(jumps[k], side)[1] for side in (-1.0, 1.0)) / 2
            works.append(0.0 if impulses is None else float(impulses @ rate))
            marks.append(k)
            powers.append([])
            sample(k, 1.0)
    seconds = time.process_time() - begin
    motion = np.array(places)
    if forces[0] is None:
        return Run(Answer(motion, None, None), seconds)
    work, total = np.zeros(steps + 1), 0.0
    for (a, b), power, extra in zip(pairwise([*marks, steps]), powers, works, strict=True):
        total += extra
        work[a + 1 : b + 1] = total + cumulative_simpson(power, dx=step)
        total = work[b]
    return Run(Answer(motion, np.array(forces)[:, 0], work[count::count]), seconds)
