"""A way to move a joint: an engine, its documentation's page, and a grid of settings."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_simpson

from referee.task import INSTANTS, Answer, Motion, Task

Run = tuple[Answer, float]
"""The answer, and the processor time of the steps [s]."""
Sample = tuple[NDArray, NDArray | None]
"""Places that are asked, and forces of the prescribed joints or None."""


class CannotError(Exception):
    """What an engine, or this way to use it, cannot do; the reason."""


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


class Model:
    """A task in an engine at its start, where ``q`` and ``v`` are views of the engine's own places and rates.

    An engine without such views has ``write``; one that makes a step at a time has ``advance``.

    :param names: joints, which begin at ``places`` of q and at ``rates`` of v.
    """

    q: NDArray
    v: NDArray
    side = 1.0  # of a jump

    def __init__(self, task: Task, step: float, names: Sequence[str], *firsts: Iterable[int]) -> None:
        self.task, self.step = task, step
        self.places, self.rates = (dict(zip(names, found, strict=True)) for found in firsts)
        self.moved, self.asked = ([self.places[name] for name in which] for which in (task.motions, task.asked))
        self.rows = [self.rates[name] for name in task.motions]
        q, v = self.q, self.v
        for name, (place, rate) in task.start.items():
            q[self.places[name]], v[self.rates[name]] = place, rate
        if task.spin:
            v[self.rates["attitude"] :][:3] = task.spin
        self.write(q, v)
        self.place(0.0)

    def write(self, q: NDArray, v: NDArray) -> None:
        """Take q and v over, which may be copies."""

    def attitude(self, q: NDArray) -> NDArray:
        """Quaternion (w, x, y, z) from the coordinates of a ball joint."""
        return q[:4].copy()

    def place(self, t: float) -> None:
        """Set the prescribed joints to σ and σ̇."""
        q, v = self.q, self.v
        q[self.moved], v[self.rows], _ = self.task.sigma(t)
        self.write(q, v)

    @property
    def motions(self) -> dict[str, Motion]:
        """Those of the joints; at a jump, on one ``side`` of it."""
        return {n: lambda t, k=k: self.task.sigma(t, self.side)[:, k] for k, n in enumerate(self.task.motions)}

    def read(self, q: NDArray) -> NDArray:
        """What is asked."""
        if self.task.spin:
            return self.attitude(q[self.asked[0] :])
        return q[self.asked] + self.task.whole * q[self.moved[0]]

    def advance(self, t: float) -> None:
        """By a step from t."""
        raise NotImplementedError

    def march(
        self,
        before: Callable[[float], object] = lambda _: None,
        forces: Callable[[], NDArray | None] = lambda: None,
        jump: Callable[[float], NDArray | float] = lambda _: 0.0,
    ) -> Run:
        """Steps, each after ``before``, which is what a way does.

        :param jump: at an instant where σ̇ jumps; returns impulses, if there are any.
        """
        begin = time.process_time()
        jumps = {round(t / self.step): t for t in self.task.jumps}
        pieces, gains = [[(self.read(self.q), forces())]], [0.0]
        for k in range(round(self.task.stop / self.step)):
            before(k * self.step)
            self.advance(k * self.step)
            pieces[-1].append((self.read(self.q), forces()))
            if t := jumps.get(k + 1):
                rates = sum(self.task.sigma(t, side)[1] for side in (-1.0, 1.0)) / 2
                gains.append(np.sum(jump(t) * rates))
                pieces.append([(self.read(self.q), forces())])
        seconds = time.process_time() - begin
        return answered(self.task, self.step, pieces, gains), seconds

    @classmethod
    def overwritten(cls, *arguments: Any, **setting: Any) -> Run:
        """As most people do it: places and rates of the joints are set before each step; nobody reads a force."""
        it = cls(*arguments, **setting)
        return it.march(it.place)


def runge_kutta(rates: Callable[[float, NDArray], NDArray], t: float, y: NDArray, step: float) -> NDArray:
    """The states after a step of the rule of order 4."""
    slopes = [rates(t, y)]
    for part in (step / 2, step / 2, step):
        slopes.append(rates(t + part, y + part * slopes[-1]))
    first, second, third, last = slopes
    return y + step / 6 * (first + 2 * second + 2 * third + last)


def answered(task: Task, step: float, pieces: Sequence[Sequence[Sample]], gains: Sequence[float] = (0.0,)) -> Answer:
    """From samples of each piece between jumps: behind its begin, then after each step.

    :param gains: work of the impulses before each piece; that in it is Simpson's sum of the power.
    """
    count = round(task.stop / INSTANTS / step)
    asked = slice(count - 1, None, count)
    motion = np.array([place for piece in pieces for place, _ in piece[1:]])[asked]
    if task.force or pieces[0][0][1] is None:  # impulses, which these loops do not sum
        return Answer(motion, None, None)
    lambdas, works = [], [0.0]
    for piece, gain in zip(pieces, gains, strict=True):
        forces = np.array([force for _, force in piece])
        sides = [1.0] + [-1.0] * (len(piece) - 1)
        moved = [task.sigma((len(lambdas) + k) * step, side) for k, side in enumerate(sides)]
        _, rates, accelerations = np.swapaxes(moved, 0, 1)
        forces[:, 0] -= task.carrier * (accelerations[:, 0] + task.weight)
        lambdas += [*forces[1:, 0]]
        works += [*(works[-1] + gain + cumulative_simpson(np.sum(forces * rates, axis=1), dx=step))]
    return Answer(motion, np.array(lambdas)[asked], np.array(works[1:])[asked])
