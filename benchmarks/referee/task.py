"""A task of the referee: a mechanism, the motions of its prescribed joints, what is asked, and its reference."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Motion = Callable[[Any], tuple[Any, Any, Any]]
"""Of a time: σ, σ̇, σ̈; takes extended precision, too."""
Rates = Callable[[Any, Sequence[Any]], list[Any]]
GRAVITY = 9.81  # [m/s2]
INSTANTS = 40
NEAR = 1e-12  # [s], from a jump


@dataclass(frozen=True)
class Answer:
    """What is asked at instants: motion (n, k), force of the first prescribed joint (n,), work of all of them (n,).

    Where an engine cannot say a thing, it is None.
    """

    motion: NDArray
    force: NDArray | None
    work: NDArray | None

    def errors(self, reference: Answer) -> tuple[float, float, float]:
        """Of motion, force and work, relative to the largest value of the reference; nan where there is none."""
        pairs = zip(
            (self.motion, self.force, self.work), (reference.motion, reference.force, reference.work), strict=True
        )
        return tuple(  # type: ignore[return-value] - three
            np.nan if a is None or b is None else float(np.max(np.abs(a - b)) / np.max(np.abs(b))) for a, b in pairs
        )


@dataclass(frozen=True)
class Task:
    """Place of joints, force and work of the operator at ``INSTANTS`` instants up to ``stop``.

    :ivar bodies: ``worldbody`` in MJCF, ``more`` what else it needs.
    :ivar motions: prescribed joint -> motion; ``jumps`` are instants at which σ̇ jumps [s].
    :ivar start: other joint -> place and rate at the start, 0 where it is not named.
    :ivar asked: sums of joints whose places are asked.
    :ivar component: ours, with ``start_values``, the port of each prescribed joint, and its signals.
    :ivar checks: what the reference is held against: words -> relative difference.
    """

    name: str
    stop: float
    bodies: str
    motions: Mapping[str, Motion]
    asked: Sequence[tuple[str, ...]]
    answer: Callable[[NDArray], Answer]
    checks: Callable[[], Mapping[str, float]]
    component: str
    ports: Mapping[str, str]
    signals: Sequence[str]
    start: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    start_values: Mapping[str, float] = field(default_factory=dict)
    force: str = ""  # signal; that of the first port by default
    jumps: tuple[float, ...] = ()
    more: str = ""
    carrier: float = 0.0  # mass of the first prescribed body, whose part of the force is left out [kg]
    weight: float = 0.0  # acceleration of gravity along it [m/s2]
    springs: Mapping[str, float] = field(default_factory=dict)
    constraint: str = ""  # what acts on the prescribed joints in the engines, if anything

    @property
    def times(self) -> NDArray:
        return self.stop * np.arange(1, INSTANTS + 1) / INSTANTS

    def sigma(self, t: float, side: float = 1.0) -> NDArray:
        """σ, σ̇, σ̈ (3, joints), at a jump those after it, or before it (-1)."""
        if any(abs(t - jump) < NEAR for jump in self.jumps):
            t += side * 2 * NEAR
        return np.array([motion(t) for motion in self.motions.values()], dtype=float).T

    def mjcf(self, step: float, integrator: str = "Euler", more: str = "") -> str:
        """The mechanism as an MJCF file."""
        return (
            f'<mujoco model="task"><compiler angle="radian" inertiafromgeom="false"/><option timestep="{step}" '
            f'integrator="{integrator}" gravity="0 0 -{GRAVITY}" tolerance="1e-14" iterations="200"/>'
            f"<worldbody>{self.bodies}</worldbody>{self.more}{more}</mujoco>"
        )


def sin(x: Any) -> Any:
    return np.sin(x) if isinstance(x, np.longdouble) else math.sin(x)


def cos(x: Any) -> Any:
    return np.cos(x) if isinstance(x, np.longdouble) else math.cos(x)


def sinusoid(offset: float, amplitude: float, frequency: float, phase: float = 0.0) -> Motion:
    """offset + amplitude sin(frequency t + phase)."""

    def motion(t: Any) -> tuple[Any, Any, Any]:
        sine, cosine = sin(frequency * t + phase), cos(frequency * t + phase)
        return offset + amplitude * sine, amplitude * frequency * cosine, -amplitude * frequency**2 * sine

    return motion


# ---- references by integration -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Equations:
    """Equations of motion by hand: integrated by Dormand and Prince's rule of order 8 (SciPy), and by extrapolation.

    :ivar rates: of the states, of which the last is the work of the operator.
    :ivar start: of the states.
    :ivar energy: of instant and states.
    :ivar jumps: instants, and what is added to the work there.
    :ivar since: instant -> the rates that hold from there to the next jump.
    """

    rates: Rates
    start: Sequence[float]
    energy: Callable[[Any, Sequence[Any]], Any]
    jumps: Sequence[tuple[float, float]] = ()
    since: Callable[[float], Rates] | None = None

    def _pieces(self, stop: float) -> list[tuple[float, float, float, Rates]]:
        """Begin, end, rates and the work that is added at the end."""
        ends = [*(jump for jump in self.jumps if jump[0] < stop), (stop, 0.0)]
        begins = [0.0, *(end for end, _ in ends[:-1])]
        return [
            (a, b, work, self.since(a) if self.since else self.rates) for a, (b, work) in zip(begins, ends, strict=True)
        ]

    def states(self, times: NDArray) -> NDArray:
        """At instants, (states, times); at a jump those before it."""
        y, columns = np.array(self.start, dtype=float), []
        for begin, end, work, rates in self._pieces(float(times[-1])):
            inside = times[(times > begin + NEAR) & (times <= end + NEAR)]
            points = np.unique(np.minimum([*inside, end], end))
            run = solve_ivp(rates, (begin, end), y, "DOP853", t_eval=points, rtol=3e-14, atol=1e-15, max_step=0.004)
            columns += [column for t, column in zip(points, run.y.T, strict=True) if np.any(np.abs(inside - t) < NEAR)]
            y = run.y[:, -1].copy()
            y[-1] += work
        return np.array(columns).T

    def checks(self, stop: float) -> dict[str, float]:
        """The other method, and the energy account, relative to size."""
        end, y = self.states(np.array([stop]))[:, 0], np.array(self.start, dtype=np.longdouble)
        for begin, until, work, rates in self._pieces(stop):
            count = math.ceil((until - begin) / 0.02)
            for k in range(count):
                size = np.longdouble(until - begin) / count
                y = _extrapolated(rates, begin + k * size, y, size)
            y[-1] += work
        account = self.energy(stop, end) - self.energy(0.0, self.start) - end[-1]
        return {
            "extrapolation": float(np.max(np.abs(end - y) / np.maximum(np.abs(y), 1))),
            "energy account": float(abs(account) / max(1.0, abs(end[-1]))),
        }


def _extrapolated(rates: Rates, begin: Any, y: NDArray, size: Any) -> NDArray:
    """A step of Gragg, Bulirsch and Stoer of order 14, in extended precision."""
    counts, table = range(2, 16, 2), []
    for row, n in enumerate(counts):
        h = size / n
        before, now = y, y + h * np.array(rates(begin, y))
        for k in range(1, n):
            before, now = now, before + 2 * h * np.array(rates(begin + k * h, now))
        line = [(before + now + h * np.array(rates(begin + size, now))) / 2]
        for k in range(row):
            line.append(line[k] + (line[k] - table[row - 1][k]) / ((n / counts[row - 1 - k]) ** 2 - 1))
        table.append(line)
    return table[-1][-1]


def integrated(equations: Equations, motion: Sequence[int], force: Callable[[float, NDArray], float]) -> Any:
    """The answer by ``states``: the states that are asked, and λ of instant and states."""

    def answer(times: NDArray) -> Answer:
        y = equations.states(times)
        return Answer(
            y[list(motion)].T, np.array([force(t, column) for t, column in zip(times, y.T, strict=True)]), y[-1]
        )

    return answer
