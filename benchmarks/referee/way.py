"""A way to move a joint: an engine, its documentation's page, and a grid of settings."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_simpson

from referee.task import INSTANTS, Answer, Task

Sample = tuple[NDArray, NDArray | None]
"""Places that are asked, and forces of the prescribed joints or None."""


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
    :ivar grid: values of each setting; the best combination counts at each step.
    :ivar steps: communication steps [s].
    """

    engine: str
    name: str
    page: str
    run: Callable[..., Run]
    grid: Mapping[str, Sequence[Any]] | None = None
    steps: Sequence[float] = (2e-2, 1e-2, 5e-3, 2.5e-3)

    @property
    def settings(self) -> list[dict[str, Any]]:
        grid = self.grid or {}
        return [dict(zip(grid, values, strict=True)) for values in product(*grid.values())]


class Model:
    """A task in an engine at its start.

    An engine's file says how ``state`` is read, ``write`` sets it and ``advance`` makes a step.

    :param names: joints, which begin at ``places`` of the engine's q and at ``rates`` of its v.
    """

    def __init__(self, task: Task, step: float, names: Sequence[str], *firsts: Iterable[int]) -> None:
        self.task, self.step = task, step
        self.places, self.rates = (dict(zip(names, found, strict=True)) for found in firsts)
        self.moved, self.asked = ([self.places[name] for name in which] for which in (task.motions, task.asked))
        self.rows = [self.rates[name] for name in task.motions]
        q, v = self.state()
        for name, (place, rate) in task.start.items():
            q[self.places[name]], v[self.rates[name]] = place, rate
        if task.spin:
            v[self.rates["attitude"] :][:3] = task.spin
        self.write(q, v)
        self.place(0.0)

    def state(self) -> tuple[NDArray, NDArray]:
        """q and v: what ``write`` takes, or views of the engine's own."""
        raise NotImplementedError

    def write(self, q: NDArray, v: NDArray) -> None: ...

    def advance(self, t: float) -> None:
        """By a step from t."""
        raise NotImplementedError

    def attitude(self, q: NDArray) -> NDArray:
        """Quaternion (w, x, y, z) from the coordinates of a ball joint."""
        return q[:4].copy()

    def place(self, t: float) -> None:
        """Set the prescribed joints to σ and σ̇."""
        q, v = self.state()
        q[self.moved], v[self.rows], _ = self.task.sigma(t)
        self.write(q, v)

    def read(self, q: NDArray) -> NDArray:
        """What is asked."""
        if self.task.spin:
            return self.attitude(q[self.asked[0] :])
        return q[self.asked] + self.task.whole * q[self.moved[0]]

    def march(
        self,
        before: Callable[[float], object],
        forces: Callable[[], NDArray | None] = lambda: None,
        jump: Callable[[float], NDArray | None] = lambda _: None,
    ) -> Run:
        """Steps, each after ``before``, which is what a way does."""

        def advance(t: float) -> None:
            before(t)
            self.advance(t)

        return march(self.task, self.step, advance, lambda: (self.read(self.state()[0]), forces()), jump)


def overwritten(model: Callable[..., Model]) -> Callable[..., Run]:
    """As most people do it: places and rates of the joints are set before each step; nobody reads a force."""

    def run(*arguments: Any, **setting: Any) -> Run:
        it = model(*arguments, **setting)
        return it.march(it.place)

    return run


def march(
    task: Task,
    step: float,
    advance: Callable[[float], None],
    read: Callable[[], Sample],
    jump: Callable[[float], NDArray | None] = lambda _: None,
) -> Run:
    """Advance from each instant by a step.

    :param jump: at an instant where σ̇ jumps; returns impulses.
    """
    begin = time.process_time()
    jumps = {round(t / step): t for t in task.jumps}
    steps = round(task.stop / step)
    samples = [read()]
    after, gained = {0: samples[0][1]}, np.zeros(steps + 1)
    for k in range(1, steps + 1):
        advance((k - 1) * step)
        samples.append(read())
        if k in jumps and k < steps:
            if (impulses := jump(jumps[k])) is not None:
                gained[k + 1 :] += impulses @ (sum(task.sigma(jumps[k], side)[1] for side in (-1.0, 1.0)) / 2)
            after[k] = read()[1]
    seconds = time.process_time() - begin
    return Run(answered(task, step, samples, after, gained), seconds)


def answered(
    task: Task,
    step: float,
    samples: Sequence[Sample],
    after: Mapping[int, NDArray | None] | None = None,
    gained: NDArray | float = 0.0,
) -> Answer:
    """From samples after each step; the work is Simpson's sum of the power between jumps.

    :param after: forces behind the start and behind jumps, whose work ``gained`` has.
    """
    places, forces = zip(*samples, strict=True)
    rows = round(task.stop / INSTANTS / step) * np.arange(1, INSTANTS + 1)
    motion = np.array(places)[rows]
    if task.force or forces[0] is None:  # impulses, which these loops do not sum
        return Answer(motion, None, None)

    def power(k: int, side: float, force: Any) -> tuple[float, float]:
        _, rate, acceleration = task.sigma(k * step, side)
        own = np.array(force) - task.carrier * (acceleration[0] + task.weight) * np.eye(len(rate))[0]
        return own[0], own @ rate

    after = after or {0: forces[0]}
    lambdas, powers = np.array([power(k, -1.0, force) for k, force in enumerate(forces)]).T
    work = np.zeros(len(forces))
    for a, b in pairwise([*after, len(forces) - 1]):
        first = power(a, 1.0, after[a])[1]
        work[a + 1 : b + 1] = work[a] + cumulative_simpson([first, *powers[a + 1 : b + 1]], dx=step)
    return Answer(motion, lambdas[rows], (work + gained)[rows])
