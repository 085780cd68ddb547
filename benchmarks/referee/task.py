"""A task of the referee: a mechanism, the motions of its prescribed joints, what is asked, and its reference."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Motion = Callable[[Any], tuple[Any, Any, Any]]
"""Of a time: σ, σ̇, σ̈; takes extended precision, too."""
GRAVITY = 9.81  # [m/s2]
INSTANTS = 40
NEAR = 1e-12  # [s], from a jump
LOST = 1e3  # relative error


class Answer(NamedTuple):
    """What is asked at instants: motion (n, k), force of the first prescribed joint (n,), work of all of them (n,).

    Where an engine cannot say a thing, it is None.
    """

    motion: NDArray
    force: NDArray | None
    work: NDArray | None

    def errors(self, reference: Answer) -> list[float | None]:
        """Of motion, force and work, relative to the largest value of the reference; infinite where it is lost."""
        return [_error(*both) for both in zip(self, reference, strict=True)]


def _error(said: NDArray | None, exact: NDArray) -> float | None:
    if said is None:
        return None
    error = abs(said - exact).max() / abs(exact).max()
    return error if error < LOST else math.inf


@dataclass(frozen=True)
class Task:
    """Place of joints, force and work of the operator at ``INSTANTS`` instants up to ``stop``.

    Joints of the file in MJCF and variables of our component have the same names.

    :ivar motions: prescribed joint -> motion; ``jumps`` are instants at which σ̇ jumps [s].
    :ivar asked: joints whose places are asked, of ``signals`` in ours; ``whole``: their sum with the prescribed one.
    :ivar reference: of instants: the answer, and what it was compared with: words -> relative difference.
    :ivar start: other joint -> place and rate at the start, 0 where it is not named; ``spin`` is that of a ball joint.
    :ivar force: signal of ours; that of the first prescribed joint by default.
    :ivar carrier: mass of the first prescribed body, whose part of the force is left out [kg]; ``weight`` is the
        acceleration of gravity along it [m/s2].
    :ivar springs: joint -> stiffness, as in the file.
    :ivar constraint: what acts besides joints, if anything.
    :ivar dynamics: derives a function of σ, σ̇, σ̈, then of q and q̇, by numpy or math: accelerations, forces, energy.
    :ivar file: in MJCF, unless it is in the folder of tasks.
    """

    name: str
    stop: float
    motions: Mapping[str, Motion]
    asked: Sequence[str]
    component: str
    reference: Callable[[NDArray], tuple[Answer, Mapping[str, float]]] | None = None
    start: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    spin: Sequence[float] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    signals: Sequence[str] = ()
    force: str = ""
    jumps: tuple[float, ...] = ()
    carrier: float = 0.0
    weight: float = 0.0
    whole: bool = False
    springs: Mapping[str, float] = field(default_factory=dict)
    constraint: str = ""
    dynamics: Callable[..., Callable[..., Any]] | None = None
    file: Path | None = None

    @property
    def times(self) -> NDArray:
        return self.stop * np.arange(1, INSTANTS + 1) / INSTANTS

    def sigma(self, t: float, side: float = 1.0) -> NDArray:
        """σ, σ̇, σ̈ (3, joints), at a jump those after it, or before it (-1)."""
        if any(abs(t - jump) < NEAR for jump in self.jumps):
            t += side * 2 * NEAR
        return np.array([motion(t) for motion in self.motions.values()]).T

    def path(self, ending: str) -> Path:
        """The mechanism as a file in MJCF (xml) or Modelica (mo)."""
        stem = re.sub(r"\W", "_", self.name.lower())
        return self.file or Path(__file__).parent / "tasks" / f"{stem}.{ending}"

    def mjcf(self, more: str = "") -> str:
        return self.path("xml").read_text(encoding="utf-8").replace("</mujoco>", f"{more}</mujoco>")


def sinusoid(offset: float, amplitude: float, frequency: float, phase: float = 0.0) -> Motion:
    """offset + amplitude sin(frequency t + phase)."""

    def motion(t: Any) -> tuple[Any, Any, Any]:
        sine, cosine = np.sin(frequency * t + phase), np.cos(frequency * t + phase)
        return offset + amplitude * sine, amplitude * frequency * cosine, -amplitude * frequency**2 * sine

    return motion
