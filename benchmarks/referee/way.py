"""A way to move a joint: an engine, its documentation's page, and a grid of settings."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
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
    grid: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    steps: Sequence[float] = (2e-2, 1e-2, 5e-3, 2.5e-3)

    @property
    def settings(self) -> list[dict[str, Any]]:
        return [dict(zip(self.grid, values, strict=True)) for values in product(*self.grid.values())]


class Model(ABC):
    """A task in an engine at its start.

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

    @abstractmethod
    def state(self) -> tuple[NDArray, NDArray]:
        """q and v: what ``write`` takes, or views of the engine's own."""

    def write(self, q: NDArray, v: NDArray) -> None:
        """Into the views that ``state`` returns, unless it returns copies."""
        own = self.state()
        own[0][:], own[1][:] = q, v

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


class Stepped(Model):
    """Whose engine makes a step at a time."""

    @abstractmethod
    def advance(self, t: float) -> None:
        """By a step from t."""

    def march(
        self,
        before: Callable[[float], object] = lambda _: None,
        forces: Callable[[], NDArray | None] = lambda: None,
        jump: Callable[[float], NDArray | None] = lambda _: None,
    ) -> Run:
        """Steps, each after ``before``, which is what a way does."""

        def advance(t: float) -> None:
            before(t)
            self.advance(t)

        return march(self.task, self.step, advance, lambda: (self.read(self.state()[0]), forces()), jump)


def overwritten(model: Callable[..., Stepped]) -> Callable[..., Run]:
    """As most people do it: places and rates of the joints are set before each step; nobody reads a force."""

    def run(*arguments: Any, **setting: Any) -> Run:
        it = model(*arguments, **setting)
        return it.march(it.place)

    return run


def runge_kutta(rates: Callable[[float, NDArray], NDArray], t: float, y: NDArray, step: float) -> NDArray:
    """The states after a step of the rule of order 4."""
    slopes = [rates(t, y)]
    for part in (step / 2, step / 2, step):
        slopes.append(rates(t + part, y + part * slopes[-1]))
    return y + step / 6 * np.array([1.0, 2.0, 2.0, 1.0]) @ np.array(slopes)


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
    pieces, gained = [[read()]], [0.0]
    for k in range(1, round(task.stop / step) + 1):
        advance((k - 1) * step)
        pieces[-1].append(read())
        if k in jumps:
            impulses = jump(jumps[k])
            rates = sum(task.sigma(jumps[k], side)[1] for side in (-1.0, 1.0)) / 2
            gained.append(gained[-1] + (0.0 if impulses is None else impulses @ rates))
            pieces.append([read()])
    seconds = time.process_time() - begin
    return Run(answered(task, step, pieces, gained), seconds)


def answered(task: Task, step: float, pieces: Sequence[Sequence[Sample]], gained: Sequence[float] = (0.0,)) -> Answer:
    """From samples of each piece between jumps: behind its begin, then after each step.

    :param gained: work of the impulses before each piece; that in it is Simpson's sum of the power.
    """
    count = round(task.stop / INSTANTS / step)
    motion = np.array([place for piece in pieces for place, _ in piece[1:]])[count - 1 :: count]
    if task.force or pieces[0][0][1] is None:  # impulses, which these loops do not sum
        return Answer(motion, None, None)

    def power(k: int, side: float, force: NDArray) -> tuple[float, float]:
        _, rate, acceleration = task.sigma(k * step, side)
        own = force - task.carrier * (acceleration[0] + task.weight) * np.eye(len(rate))[0]
        return own[0], own @ rate

    lambdas, works, work = [], [], 0.0
    for piece, impulsive in zip(pieces, gained, strict=True):
        samples = [power(len(works) + k, -1.0 if k else 1.0, force) for k, (_, force) in enumerate(piece)]
        (_, *own), powers = zip(*samples, strict=True)
        sums = work + cumulative_simpson(powers, dx=step)
        lambdas += own
        works += [*(sums + impulsive)]
        work = sums[-1]
    return Answer(motion, *(np.array(found)[count - 1 :: count] for found in (lambdas, works)))
