"""Settings of environments, checked, and what they read of a mechanism."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeAlias, final

import casadi as ca
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import ArrayLike, NDArray

from liaisons.base.arguments import chosen, finite, listed, named, numbers, positive, shown
from liaisons.base.port_names import port_names
from liaisons.errors import InvalidValueError
from liaisons.expressions import program
from liaisons.expressions.formulas import formula

Floats: TypeAlias = NDArray[np.float64]
Range: TypeAlias = "tuple[float, float]"
Expression: TypeAlias = "Callable[[Signals], Any] | str"
"""Of the subject's variables: ``"1 - cos(theta)"``, or a function of :class:`Signals`, ``lambda s: -abs(s.theta)``."""
BALANCE = "energy_balance"
_NAME = re.compile(r"[A-Za-z_][\w.]*(\[[\d,]+\])?")
_RATE = re.compile(r"_(d?)dot(?=\[|$)")
_ROUNDING = 1e-6
"""By how much an action may leave its range, relative to its width: learners calculate in single precision."""


@final
class Signals(Mapping[str, Any]):
    """Values of variables at the end of a step, ``s.theta`` or ``s["theta[3]"]``; of several environments, arrays."""

    def __init__(self, read: Callable[[str], Any], own: Mapping[str, Any]) -> None:
        """Take the function that reads a value by name, and values that it need not read."""
        self._read, self._values = read, dict(own)

    def __getitem__(self, name: str) -> Any:
        if name not in self._values:
            self._values[name] = self._read(name)
        return self._values[name]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return self[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)


class _Symbols(dict[str, ca.SX]):
    """Symbols, each made when it is first asked for."""

    def __contains__(self, name: object) -> bool:
        return True

    def __missing__(self, name: str) -> ca.SX:
        return self.setdefault(name, ca.SX.sym(name))


def evaluator(expression: Expression) -> tuple[Callable[[Mapping[str, Any]], Any], list[str]]:
    """Function of signals that evaluates an expression, and the names that it reads, if it is text.

    :raises FormulaError: for an error in the text.
    """
    if callable(expression):
        return expression, []
    if _NAME.fullmatch(expression):
        return lambda signals: signals[expression], [expression]
    symbols = _Symbols()
    value = formula(expression, symbols)
    names, column = [*symbols], ca.vertcat(*symbols.values())
    several = program([column], [value])
    buffer, evaluate_one = ca.Function("one", [column], [ca.densify(value)]).buffer()
    argument, result = np.empty(len(names)), np.empty(1)
    buffer.set_arg(0, memoryview(argument))
    buffer.set_res(0, memoryview(result))

    def evaluate(signals: Mapping[str, Any], _: object = buffer) -> Any:
        """The value of the formula; CasADi's buffer must live as long."""
        values = [signals[name] for name in names]
        if any(isinstance(one, np.ndarray) for one in values):
            return several.evaluate([values])[0][0]
        argument[:] = values
        evaluate_one()
        return float(result[0])

    return evaluate, names


@final
@dataclass(frozen=True, eq=False)
class Task:
    """What is learned.

    :param subject: as :func:`liaisons.start` takes it: name, file or class of a component, FMU, or system.
    :param observe: variables, and formulas of these, ``"cos(theta)"``.
    :param act: inputs, and rates or accelerations of active coordinates, by name, with their ranges; they are held for
        a step, and the coordinates follow exactly.
    :param reward: per second, at the end of a step; a step earns ``step_size`` times as much.
    :param step_size: [s].
    :param stop: ends an episode where it is positive, or true.
    :param stop_time: truncates an episode [s]; None: it does not.
    :param randomize: ranges of parameters and start values by name, drawn at each reset.
    :param start_values: parameters and start values by name.
    :param goal: further arguments of :func:`liaisons.plan` for the optimum.
    :param render_mode: ``"rgb_array"``, or None.
    """

    subject: Any
    observe: Sequence[str]
    act: Mapping[str, Range]
    reward: Expression
    step_size: float
    stop: Expression | None = None
    stop_time: float | None = None
    randomize: Mapping[str, Range] = field(default_factory=dict)
    start_values: Mapping[str, ArrayLike] = field(default_factory=dict)
    goal: Mapping[str, Any] = field(default_factory=dict)
    render_mode: str | None = None

    def __post_init__(self) -> None:
        if not listed("observe", self.observe) or not named("act", self.act):
            raise InvalidValueError(f"observe = {shown(self.observe)}, act = {shown(self.act)}: give a name at least")
        for label, ranges in (("act", self.act), ("randomize", named("randomize", self.randomize))):
            for name, pair in ranges.items():
                _require_range(f"{label}: {name}", pair)
        positive("step_size", self.step_size)
        if self.stop_time is not None:
            positive("stop_time", self.stop_time)
        if self.render_mode is not None:
            chosen("render_mode", self.render_mode, ("rgb_array",))
        named("start_values", self.start_values)
        moved = [base for base, order in self.acts if order]
        if twice := {base for base in moved if moved.count(base) > 1 or base in self.act}:
            raise InvalidValueError(f"act: {min(twice)} is moved twice; leave one out")

    @cached_property
    def acts(self) -> list[tuple[str, int]]:
        """Of each act the input, or the coordinate that it moves, and how often it is integrated for this."""
        orders = (0 if match is None else 1 + len(match[1]) for match in map(_RATE.search, self.act))
        return [(_RATE.sub("", name) if order else name, order) for name, order in zip(self.act, orders, strict=True)]

    @cached_property
    def action_space(self) -> Box:
        """Ranges of the acts."""
        low, high = np.transpose([*self.act.values()])
        return Box(low, high, dtype=np.float64)

    def jump_error(self, name: str) -> InvalidValueError:
        """The error about an act on the value of an active coordinate."""
        _, rate, acceleration, *_ = port_names(name)
        return InvalidValueError(f"act: {name} would jump; act on {rate} or {acceleration}")

    def checked_action(self, action: ArrayLike, *shape: int) -> Floats:
        """Values of the acts, clipped to their ranges.

        :param shape: before that of a single action.
        :raises InvalidValueError: for another shape, or a value outside its range.
        """
        values, space = numbers("action", action), self.action_space
        if values.shape != (expected := (*shape, *space.shape)):
            raise InvalidValueError(f"action has shape {values.shape}; give {expected}: {', '.join(self.act)}")
        clipped = np.minimum(np.maximum(values, space.low), space.high)
        if not (np.abs(clipped - values) <= _ROUNDING * (space.high - space.low)).all():
            raise InvalidValueError(f"action = {shown(action)}: must be in the ranges {shown(dict(self.act))}")
        return clipped


def advanced(acts: Sequence[tuple[str, int]], values: Floats, state: dict[str, Any], size: float) -> dict[str, Any]:
    """Inputs of a step; afterwards σ and σ̇ in ``state`` are those at its end.

    :param values: of the acts, (acts, ...).
    :param state: σ and σ̇ by the names of the variables.
    """
    inputs: dict[str, Any] = {}
    for (base, order), act in zip(acts, values, strict=True):
        value, rate, acceleration = port_names(base)[:3]
        if not order:
            inputs[base] = act
            continue
        if order == 1:
            state[rate] = act
        second = act if order > 1 else 0.0 * act
        inputs |= {value: state[value], rate: state[rate], acceleration: second}
        state[value], state[rate] = state[value] + size * (state[rate] + size / 2 * second), state[rate] + size * second
    return inputs


def _require_range(label: str, pair: Any) -> None:
    """Raise an error unless these are two finite numbers, the smaller one first."""
    if not isinstance(pair, (tuple, list)) or len(pair) != 2:
        raise InvalidValueError(f"{label} = {shown(pair)}: give (low, high)")
    for number in pair:
        finite(label, number)
    if not pair[0] < pair[1]:
        raise InvalidValueError(f"{label} = {shown(pair)}: the range is empty; give low < high")
