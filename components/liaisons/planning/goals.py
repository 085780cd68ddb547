"""Goals of plans, in the names of an FMU's variables."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Real
from pathlib import Path
from typing import Any, Literal, TypeAlias

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons.base.arguments import check_finite, name_dictionary, name_list, shown
from liaisons.base.port_names import port_names
from liaisons.errors import PlanError, suggestion
from liaisons.library import Target, component, fmu_path, has_size

Array: TypeAlias = NDArray[np.float64]
Expression: TypeAlias = "Callable[[Readings], Any] | str"
"""Of the mechanism's variables: ``lambda m: m.pivot_x_ddot**2``, or the same as text, ``"pivot_x_ddot**2"``."""
Value: TypeAlias = "float | tuple[float | None, float | None] | Sequence[float] | None"
"""A number; a range; four numbers for an orientation; None: free."""
Cost: TypeAlias = "Literal['motion', 'effort', 'time'] | Expression"
_SHORTEST = 1e-100
"""Shortest duration whose square is a number [s]."""
_LONGEST = 1e100
"""Longest duration whose square is a number [s]."""


@dataclass(frozen=True, eq=False)
class Goal:
    """The arguments of :func:`liaisons.plan`; for feedback, only a mechanism with its initial state."""

    component: Target
    moves: tuple[str, ...]
    duration: tuple[float, float]
    values: Mapping[str, float]
    start: Mapping[str, Value] | Expression
    end: Mapping[str, Value] | Expression = field(default_factory=dict)
    closed: tuple[str, ...] = ()
    minimize: Cost = "time"
    bounds: Mapping[str, tuple[float | None, float | None]] = field(default_factory=dict)
    phases: tuple[Mapping[str, Any], ...] = ()  # modes by contact, and durations

    @property
    def structure(self) -> dict[str, Any]:
        """Value of ``n``, the number of links or elements, by its name, if the component has it; else empty."""
        values = self.values
        return {"n": values["n"]} if "n" in values and has_size(component(self.component)) else {}

    @property
    def fmu(self) -> Path:
        """Path of the mechanism's FMU."""
        return fmu_path(self.component, **self.structure)

    @property
    def parameters(self) -> dict[str, float]:
        """Values of parameters and inputs that are no structure."""
        return {name: value for name, value in self.values.items() if name not in self.structure}


class Readings(Mapping[str, ca.SX]):
    """The variables of the mechanism by name, as its FMU has them: ``m.theta_dot``, ``m["theta[3]"]``."""

    def __init__(self, owner: str, signals: Mapping[str, ca.SX]) -> None:
        """Take the symbols of the variables by name; ``owner`` names the mechanism in errors."""
        self._owner, self._signals = owner, signals

    def __getitem__(self, name: str) -> ca.SX:
        if name in self._signals:
            return self._signals[name]
        elements = [value for element, value in self._signals.items() if element.startswith(f"{name}[")]
        if elements:
            return ca.vertcat(*elements)
        raise PlanError(f"{self._owner} has no variable {name!r}{suggestion(name, self._signals)}")

    def __getattr__(self, name: str) -> ca.SX:
        if name.startswith("__"):
            raise AttributeError(name)
        return self[name]

    def __iter__(self) -> Any:
        return iter(self._signals)

    def __len__(self) -> int:
        return len(self._signals)


def duration_range(value: Any, label: str = "duration") -> tuple[float, float]:
    """The least and the greatest duration [s], from one number or both.

    :raises PlanError: if the value is neither.
    """
    pair: Any = value if isinstance(value, (tuple, list)) and len(value) == 2 else (value, value)
    low, high = pair
    for seconds in pair:
        check_finite(label, seconds, PlanError)
    if not _SHORTEST < low <= high < _LONGEST:
        pairs = ", or (low, high)" * (label == "duration")
        raise PlanError(f"{label} = {shown(value)}: give seconds > 0, {_SHORTEST:g} to {_LONGEST:g}{pairs}")
    return float(low), float(high)


def motion_names(move: str) -> tuple[str, str, str]:
    """Names of σ, σ̇ and σ̈ of a moved coordinate."""
    return port_names(move)[:3]


def by_name(names: Iterable[str], values: Iterable[Any]) -> dict[str, Any]:
    """Dictionary from names to values; a ValueError unless there are as many of both."""
    return dict(zip(names, values, strict=True))


def move_names(mechanism: Target, moves: str | Sequence[str] | None) -> tuple[str, ...]:
    """Names of the moved coordinates; None stands for all active ones."""
    if moves is not None:
        return tuple(name_list("moves", moves, PlanError))
    return tuple(active.name for active in getattr(component(mechanism), "actives", ()))


def closed_names(closed: object, moves: Sequence[str]) -> tuple[str, ...]:
    """Names of the states that end as they start; True stands for all moved coordinates."""
    if closed is True:
        return tuple(moves)
    return () if closed in (False, None) else tuple(name_list("closed", closed, PlanError))


def checked_phases(phases: Any) -> tuple[Mapping[str, Any], ...]:
    """Phases, each a dictionary from contacts to modes; empty for None.

    :raises PlanError: for anything else.
    """
    if phases is None:
        return ()
    entries = [*phases] if isinstance(phases, (list, tuple)) else []
    if not entries or not all(isinstance(entry, Mapping) for entry in entries):
        raise PlanError(
            f'phases = {shown(phases)}: give a list of modes by contact, [{{"gap": "closed"}}, {{"gap": "open"}}]'
        )
    return tuple(dict(name_dictionary(f"phases[{k}]", entry, PlanError)) for k, entry in enumerate(entries))


def unit_quaternion(label: str, value: Any) -> Array:
    """A quaternion divided by its norm.

    :raises PlanError: unless the value is four numbers, not all 0.
    """
    try:
        quaternion = np.array(value, dtype=float)
    except (TypeError, ValueError):
        quaternion = np.zeros(0)
    if quaternion.shape != (4,) or not np.linalg.norm(quaternion) > 0:
        raise PlanError(f"{label} = {shown(value)}: give four numbers, not all 0, a quaternion (w, x, y, z)")
    return quaternion / np.linalg.norm(quaternion)


def is_expression(value: object) -> bool:
    """Whether a start or an end is a function or a formula, instead of values by name."""
    return callable(value) or isinstance(value, str)


def finite_number(label: str, value: Any) -> float:
    """The value as a float.

    :raises PlanError: if it is not one.
    """
    check_finite(label, value, PlanError)
    return float(value)


def values_by_element(label: str, values: object, variables: Sequence[str]) -> dict[str, Any]:
    """Values by the names of scalars, from names of scalars and of arrays.

    :raises PlanError: unless the values have names, and lists the lengths of their arrays.
    """
    by_element: dict[str, Any] = {}
    for name, value in name_dictionary(label, values, PlanError).items():
        scalars = [variable for variable in variables if variable.startswith(f"{name}[")]
        if not scalars:
            by_element[name] = value
            continue
        several = value if isinstance(value, (list, tuple, np.ndarray)) else [value] * len(scalars)
        if len(several) != len(scalars):
            raise PlanError(f"{label} of {name} has {len(several)} values; give {len(scalars)}")
        by_element |= by_name(scalars, several)
    return by_element


def value_range(owner: str, label: str, name: str, value: Any) -> tuple[float, float]:
    """Least and greatest value, from one number, or from two, of which None is infinite.

    :raises PlanError: if the value is neither, or the range is empty.
    """
    label = f"{owner}: {label} of {name} = {shown(value)}"
    value = value.tolist() if isinstance(value, np.ndarray) else value
    if isinstance(value, (tuple, list)):
        if len(value) != 2 or not all(x is None or (isinstance(x, Real) and not np.isnan(float(x))) for x in value):
            raise PlanError(f"{label}: give a number, or two, (low, high)")
        low, high = (-np.inf if value[0] is None else value[0]), (np.inf if value[1] is None else value[1])
    else:
        low = high = finite_number(f"{owner}: {name}", value)
    if not low <= high:
        raise PlanError(f"{label}: low must not exceed high")
    return float(low), float(high)
