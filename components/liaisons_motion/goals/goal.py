"""Goals of plans and of feedback, in the names of an FMU's variables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, Self, TypeAlias

import casadi as ca

from liaisons import fmu_path
from liaisons.base.arguments import check_finite, name_dictionary, name_list, shown
from liaisons.errors import PlanError, suggestion
from liaisons.language import Size
from liaisons.library import Target, component

Expression: TypeAlias = "Callable[[Readings], Any] | str"
"""Of the mechanism's variables: ``lambda m: m.pivot_x_ddot**2``, or the same as text, ``"pivot_x_ddot**2"``."""
Value: TypeAlias = "float | tuple[float | None, float | None] | Sequence[float] | None"
"""A number; a range; four numbers for an orientation; None: free."""
Place: TypeAlias = "Mapping[str, Value] | Expression"
"""Values by names, or what has to vanish."""
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
    start: Place
    end: Place = field(default_factory=dict)
    closed: tuple[str, ...] = ()
    minimize: Cost = "time"
    bounds: Mapping[str, tuple[float | None, float | None]] = field(default_factory=dict)
    phases: tuple[Mapping[str, Any], ...] = ()  # modes by contact, and durations
    controls: tuple[str, ...] = ()  # inputs that are no active coordinates: forces

    @classmethod
    def checked(
        cls,
        component: Target,
        *,
        moves: str | Sequence[str] | None,
        duration: float | tuple[float, float],
        closed: bool | str | Sequence[str] | None = False,
        phases: Sequence[Mapping[str, Any]] | None = None,
        bounds: Mapping[str, Any] | None = None,
        controls: str | Sequence[str] | None = None,
        minimize: Cost | None = None,
        **further: Any,
    ) -> Self:
        """A goal from arguments as the user gives them.

        :param moves: None: all active coordinates; none of them beside controls.
        :param minimize: None: motion; effort where only forces act.
        :param duration: one number, or the least and the greatest one [s].
        :param closed: True stands for all moved coordinates.
        :param further: fields as they are.
        :raises PlanError: for arguments that are none of these.
        """
        forces = () if controls is None else tuple(name_list("controls", controls, PlanError))
        names = () if forces and moves is None else _move_names(component, moves)
        seconds = duration_range(duration)
        return cls(
            component,
            names,
            seconds,
            closed=_closed_names(closed, names),
            bounds=name_dictionary("bounds", bounds or {}, PlanError),
            phases=_checked_phases(phases),
            controls=forces,
            minimize=("motion" if names else "effort") if minimize is None else minimize,
            **further,
        )

    @property
    def driven(self) -> tuple[str, ...]:
        """Names of all inputs that operators feed: moved coordinates, then forces."""
        return (*self.moves, *self.controls)

    @staticmethod
    def is_expression(value: object) -> bool:
        """Whether a start or an end is a function or a formula, instead of values by name."""
        return callable(value) or isinstance(value, str)

    @property
    def structure(self) -> dict[str, Any]:
        """Value of ``n``, the number of links or elements, by its name, if the component has it; else empty."""
        if "n" not in self.values or not isinstance(getattr(component(self.component), "n", None), Size):
            return {}
        return {"n": self.values["n"]}

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


def _move_names(mechanism: Target, moves: str | Sequence[str] | None) -> tuple[str, ...]:
    """Names of the moved coordinates; None stands for all active ones."""
    if moves is not None:
        return tuple(name_list("moves", moves, PlanError))
    return tuple(active.name for active in getattr(component(mechanism), "actives", ()))


def _closed_names(closed: object, moves: Sequence[str]) -> tuple[str, ...]:
    """Names of the states that end as they start; True stands for all moved coordinates."""
    if closed is True:
        return tuple(moves)
    return () if closed in (False, None) else tuple(name_list("closed", closed, PlanError))


def _checked_phases(phases: Any) -> tuple[Mapping[str, Any], ...]:
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
