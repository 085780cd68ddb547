"""Settings of environments, checked."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from numbers import Real
from typing import Any, TypeAlias, TypedDict, final

import casadi as ca
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import ArrayLike, NDArray

from liaisons.base.arguments import check_choice, check_positive, float_array, name_dictionary, name_list, shown
from liaisons.base.port_names import port_names
from liaisons.errors import InvalidValueError
from liaisons.typed_formulas import formula

Floats: TypeAlias = NDArray[np.float64]
Truths: TypeAlias = NDArray[np.bool_]
_RATE = re.compile(r"_(d{1,2})ot(?=\[|$)")
_DOT = re.compile(r"(?<=\w)\.(?=[A-Za-z_])")


class TaskOptions(TypedDict, total=False):
    """Those settings of a :class:`Task` that have a default."""

    stop: str
    stop_time: float
    randomize: Mapping[str, Sequence[float]]
    start_values: Mapping[str, ArrayLike]
    goal: Mapping[str, Any]
    render_mode: str | None


@final
@dataclass(frozen=True, eq=False)
class Task:
    """What is learned.

    Formulas, ``"1 - cos(theta)"``, are text, as of :func:`liaisons.plan`; they name outputs of the subject, what is
    acted on, and what is randomized.

    :param subject: as :func:`liaisons.start` takes it: name, file or class of a component, FMU, or system.
    :param observe: formulas.
    :param act: inputs, and rates or accelerations of active coordinates, by name, with their ranges; they are held for
        a step, and the coordinates follow exactly.
    :param reward: formula of a reward per second; a step earns ``step_size`` times its value in the middle.
    :param step_size: [s].
    :param stop: formula that ends an episode where it is positive at the end of a step.
    :param stop_time: truncates an episode [s].
    :param randomize: ranges of parameters and start values by name, drawn at each reset.
    :param start_values: parameters and start values by name.
    :param goal: further arguments of :func:`liaisons.plan` for the optimum.
    :param render_mode: ``"rgb_array"``, or None.
    """

    subject: Any
    observe: Sequence[str]
    act: Mapping[str, Sequence[float]]
    reward: str
    step_size: float
    stop: str = "0"
    stop_time: float = math.inf
    randomize: Mapping[str, Sequence[float]] = field(default_factory=dict)
    start_values: Mapping[str, ArrayLike] = field(default_factory=dict)
    goal: Mapping[str, Any] = field(default_factory=dict)
    render_mode: str | None = None

    def __post_init__(self) -> None:
        for label, names in (
            ("observe", name_list("observe", self.observe)),
            ("act", name_dictionary("act", self.act)),
        ):
            if not names:
                raise InvalidValueError(f"{label} = {shown(names)}: give one name at least")
        most = float(np.finfo(np.float32).max)  # numbers of Box
        for name, pair in (*self.act.items(), *name_dictionary("randomize", self.randomize).items()):
            ends = float_array(name, pair)
            if ends.shape != (2,) or not -most <= ends[0] < ends[1] <= most:
                words = f"give (low, high), low < high, as far as {most:.2g}"
                raise InvalidValueError(f"range of {name} = {shown(pair)}: {words}")
        check_positive("step_size", self.step_size)
        if not isinstance(self.stop_time, Real) or not self.stop_time > self.step_size:
            raise InvalidValueError(f"stop_time = {shown(self.stop_time)}: must be greater than step_size")
        for label in ("reward", "stop"):
            if not isinstance(text := getattr(self, label), str):
                raise InvalidValueError(f"{label} = {shown(text)}: give a formula as text")
        for label in ("start_values", "goal"):
            name_dictionary(label, getattr(self, label))
        check_choice("render_mode", self.render_mode or "rgb_array", ["rgb_array"])
        if len({port[0] for port in self.act_ports}) < len(self.act):
            raise InvalidValueError(f"act = {shown(self.act)}: a coordinate is moved twice; leave one out")

    @cached_property
    def act_ports(self) -> list[tuple[str, ...]]:
        """Inputs that each act sets: ``("x", "x_dot", "x_ddot")`` for an act on ``x_ddot``, itself for a force."""
        return [port_names(_RATE.sub("", name))[: 1 + len("".join(_RATE.findall(name)))] for name in self.act]

    @cached_property
    def action_space(self) -> Box:
        """Box of the ranges of all acts."""
        return Box(*np.transpose([*self.act.values()]).astype(np.float32))

    def checked_action(self, action: ArrayLike, *copies: int) -> Floats:
        """Values of the acts, shape (acts,); of a number of copies, (copies, acts).

        :raises InvalidValueError: for another shape, or a value outside its range in single precision.
        """
        values, space = float_array("action", action), self.action_space
        if values.shape != (shape := (*copies, *space.shape)):
            raise InvalidValueError(f"action has shape {values.shape}; give {shape}: {', '.join(self.act)}")
        if not ((space.low <= np.float32(values)) & (np.float32(values) <= space.high)).all():
            raise InvalidValueError(f"action = {shown(action)}: must be in the ranges {shown(dict(self.act))}")
        return values

    def advance_moved(self, values: Mapping[str, Any], duration: float) -> dict[str, Any]:
        """Values by name, in which coordinates and rates have moved for a duration [s] as held acts move them."""
        moved = dict(values)
        for port in self.act_ports:
            value, rate, acceleration = (*(values[name] for name in port), 0.0, 0.0)[:3]
            after = value + duration * (rate + duration / 2 * acceleration), rate + duration * acceleration
            moved |= zip(port[:-1], after, strict=False)
        return moved

    def measures(self, signals: Mapping[str, ca.SX]) -> ca.SX:
        """Observations, reward and stop, a column of expressions.

        :param signals: expressions of the variables by name.
        :raises FormulaError: for an error in a formula; with its position, and the nearest name.
        """
        symbols = {name.replace(".", "·"): expression for name, expression in signals.items()}
        texts = (*name_list("observe", self.observe), self.reward, self.stop)
        return ca.vertcat(*(formula(_DOT.sub("·", text), symbols) for text in texts))
