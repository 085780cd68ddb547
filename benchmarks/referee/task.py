"""A task of the referee: a mechanism, the motions of its prescribed joints, what is asked, and its reference."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

Motion = Callable[..., tuple[Any, Any, Any]]
"""Of a time: σ, σ̇, σ̈; takes extended precision, too."""
GRAVITY = 9.81  # [m/s2]
INSTANTS = 40
NEAR = 1e-12  # [s], from a jump
LOST = 1e3  # relative error


@dataclass(frozen=True)
class Answer:
    """What is asked at instants: motion (n, k), force of the first prescribed joint (n,), work of all of them (n,).

    Where an engine cannot say a thing, it is None.
    """

    motion: NDArray
    force: NDArray | None
    work: NDArray | None

    def errors(self, reference: Answer) -> list[float | None]:
        """Of motion, force and work, relative to the largest value of the reference; infinite where it is lost."""
        pairs = ((self.motion, reference.motion), (self.force, reference.force), (self.work, reference.work))
        return [None if a is None or b is None else _relative(a, b) for a, b in pairs]


def _relative(a: NDArray, b: NDArray) -> float:
    error = float(np.max(np.abs(a - b)) / np.max(np.abs(b)))
    return error if error < LOST else math.inf


@dataclass(frozen=True)
class Task:
    """Place of joints, force and work of the operator at ``INSTANTS`` instants up to ``stop``.

    Joints of the file in MJCF and variables of our component have the same names.

    :ivar motions: prescribed joint -> motion; ``jumps`` are instants at which σ̇ jumps [s].
    :ivar start: other joint -> place and rate at the start, 0 where it is not named; ``spin`` is that of a ball joint.
    :ivar asked: joints whose places are asked, of ``signals`` in ours; ``whole``: their sum with the prescribed one.
    :ivar checks: what the reference is held against: words -> relative difference.
    :ivar force: signal of ours; that of the first prescribed joint by default.
    :ivar carrier: mass of the first prescribed body, whose part of the force is left out [kg]; ``weight`` is the
        acceleration of gravity along it [m/s2].
    :ivar constraint: what acts besides joints, if anything.
    :ivar lagrange: the equations of motion by SymPy, if they are.
    """

    name: str
    stop: float
    motions: Mapping[str, Motion]
    asked: Sequence[str]
    answer: Callable[[NDArray], Answer]
    checks: Callable[[], Mapping[str, float]]
    component: str
    start: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    spin: Sequence[float] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    signals: Sequence[str] = ()
    force: str = ""
    jumps: tuple[float, ...] = ()
    carrier: float = 0.0
    weight: float = 0.0
    whole: bool = False
    constraint: str = ""
    lagrange: Any = None

    @property
    def times(self) -> NDArray:
        return self.stop * np.arange(1, INSTANTS + 1) / INSTANTS

    def sigma(self, t: float, side: float = 1.0) -> NDArray:
        """σ, σ̇, σ̈ (3, joints), at a jump those after it, or before it (-1)."""
        if any(abs(t - jump) < NEAR for jump in self.jumps):
            t += side * 2 * NEAR
        return np.array([motion(t) for motion in self.motions.values()], dtype=float).T

    def text(self, ending: str) -> str:
        """The mechanism as a file in MJCF (xml) or Modelica (mo)."""
        path = Path(__file__).parent / "tasks" / f"{self.name.lower().replace(' ', '_').replace('-', '_')}.{ending}"
        return path.read_text(encoding="utf-8")

    def mjcf(self, more: str = "") -> str:
        return self.text("xml").replace("</mujoco>", f"{more}</mujoco>")

    @property
    def springs(self) -> dict[str, float]:
        """Joint -> stiffness."""
        joints = ET.fromstring(self.mjcf()).iter("joint")
        return {joint.attrib["name"]: float(k) for joint in joints if (k := joint.get("stiffness"))}


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
