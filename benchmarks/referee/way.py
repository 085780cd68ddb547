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
    :ivar steps: communication steps [s].
    """

    engine: str
    name: str
    page: str
    run: Callable[..., Run]
    settings: Sequence[Mapping[str, Any]] = ({},)
    steps: Sequence[float] = (2e-2, 1e-2, 5e-3, 2.5e-3)


class Places:
    """Where the joints of a task are in an engine's q and v.

    :param attitude: quaternion (w, x, y, z) from the coordinates of a ball joint.
    """

    def __init__(
        self,
        task: Task,
        places: Mapping[str, int],
        rates: Mapping[str, int],
        attitude: Callable[[NDArray], NDArray] = lambda q: q[:4].copy(),
    ) -> None:
        self.task, self.places, self.rates, self.attitude = task, places, rates, attitude
        self.moved = [places[name] for name in task.motions]
        self.rows = [rates[name] for name in task.motions]

    def start(self, q: NDArray, v: NDArray) -> None:
        """Set all joints."""
        for name, (place, rate) in self.task.start.items():
            q[self.places[name]], v[self.rates[name]] = place, rate
        if self.task.spin:
            v[self.rates["attitude"] :][:3] = self.task.spin
        self.move(q, v, 0.0)

    def move(self, q: NDArray, v: NDArray, t: float) -> None:
        """Set the prescribed joints."""
        q[self.moved], v[self.rows], _ = self.task.sigma(t)

    def read(self, q: NDArray) -> NDArray:
        """What is asked."""
        if self.task.spin:
            return self.attitude(q[self.places["attitude"] :])
        return q[[self.places[name] for name in self.task.asked]] + self.task.whole * q[self.moved[0]]


def march(
    task: Task,
    step: float,
    advance: Callable[[float], None],
    read: Callable[[], tuple[NDArray, NDArray | None]],
    jump: Callable[[float], NDArray | None] = lambda _: None,
) -> Run:
    """Advance from each instant by a step.

    :param read: places that are asked, and forces of the prescribed joints or None.
    :param jump: at an instant where σ̇ jumps; returns impulses.
    """
    begin = time.process_time()
    jumps = {round(t / step): t for t in task.jumps}
    steps = round(task.stop / step)
    places: list[NDArray] = []
    forces: list[NDArray | None] = []
    gained = np.zeros(steps + 1)  # by jumps

    def sample() -> None:
        place, force = read()
        places.append(place)
        forces.append(force)

    sample()
    after = {0: forces[0]}
    for k in range(1, steps + 1):
        advance((k - 1) * step)
        sample()
        if k in jumps and k < steps:
            impulses = jump(jumps[k])
            rate = sum(task.sigma(jumps[k], side)[1] for side in (-1.0, 1.0)) / 2
            gained[k + 1 :] += 0.0 if impulses is None else impulses @ rate
            after[k] = read()[1]
    return answered(task, step, time.process_time() - begin, (np.array(places), forces), (after, gained))


def answered(
    task: Task,
    step: float,
    seconds: float,
    said: tuple[NDArray, Sequence[NDArray | None]],
    jumps: tuple[Mapping[int, NDArray | None], NDArray | float] | None = None,
) -> Run:
    """From places and forces after each step; the work is Simpson's sum of the power between jumps.

    :param jumps: forces behind them, and the work that they have done till each step.
    """
    places, forces = said
    after, gained = jumps or ({0: forces[0]}, 0.0)
    rows = round(task.stop / INSTANTS / step) * np.arange(1, INSTANTS + 1)
    if task.force or forces[0] is None:  # impulses, which these loops do not sum
        return Run(Answer(places[rows], None, None), seconds)

    def power(k: int, side: float, force: Any) -> tuple[float, float]:
        _, rate, acceleration = task.sigma(k * step, side)
        own = np.array(force) - task.carrier * (acceleration[0] + task.weight) * np.eye(len(rate))[0]
        return own[0], own @ rate

    marks = [*sorted(after), len(forces) - 1]
    lambdas, powers = np.array([power(k, -1.0, force) for k, force in enumerate(forces)]).T
    work = np.zeros(len(forces))
    for a, b in pairwise(marks):
        first = power(a, 1.0, after[a])[1]
        work[a + 1 : b + 1] = work[a] + cumulative_simpson([first, *powers[a + 1 : b + 1]], dx=step)
    return Run(Answer(places[rows], lambdas[rows], (work + gained)[rows]), seconds)
