"""``from_control``: a linear system of python-control as a sampled component."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from types import new_class
from typing import Any

import casadi as ca
import numpy as np
from scipy.signal import cont2discrete

from liaisons.base.arguments import check_positive, name_dictionary, shown
from liaisons.base.array_names import by_name
from liaisons.errors import PlanError, suggestion
from liaisons.language import DiscreteOutput, DiscreteState, Input, Parameter, Sampled

_INDEX = re.compile(r"\[(\d+)\]")
"""Index in a name that python-control has given, ``x[0]``, which becomes ``x_0``."""


def from_control(
    system: Any, name: str, *, period: float | None = None, units: Mapping[str, str] | None = None
) -> type[Sampled]:
    """Return a sampled component of a ``StateSpace`` of python-control, with its names.

    ::

        lead = control.ss(control.tf([3, 1], [0.1, 1]), inputs="angle", outputs="torque")
        system.add("controller", from_control(lead, "Lead", period=0.01, units={"angle": "rad", "torque": "N.m"}))

    At a sample y = C x + D u, held until the next one, and x becomes A x + B u.  The inverse of ``to_control``.

    :param system: discrete in time, or continuous with a period, over which inputs are held.
    :param name: of the class and its FMU.
    :param period: sampling period [s]; that of the system unless given.
    :param units: by state, input or output; ``"1"`` unless given.
    :raises PlanError: for what is no state space, names that are no identifiers, another period than its own, or none.
    """
    try:
        matrices = [np.asarray(getattr(system, part), dtype=float) for part in "ABCD"]
        kinds = ("state", "input", "output")
        labels = {kind: [_INDEX.sub(r"_\1", label) for label in getattr(system, f"{kind}_labels")] for kind in kinds}
        own = system.dt
    except (AttributeError, TypeError, ValueError):
        raise PlanError(f"from_control: system = {shown(system)}: give a StateSpace of python-control") from None
    known = [label for group in labels.values() for label in group]
    for label in (name, *known):
        if not isinstance(label, str) or not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", label):
            raise PlanError(f"from_control: {shown(label)} is no identifier; name states, inputs, outputs in letters")
    units = name_dictionary("units", units or {}, PlanError)
    for label in units:
        if label not in known:
            raise PlanError(f"from_control: units of {label!r}: no such name{suggestion(label, known)}")
    matrices, period = _sampled_matrices(name, matrices, own, period)
    A, B, C, D = map(ca.DM, matrices)
    body: dict[str, Any] = {"period": Parameter(period, "s", "sampling period", minimum=period, maximum=period)}

    def declare(kind: Any, names: Iterable[str]) -> None:
        for label in names:
            unit = units.get(label, "1")
            words = label.replace("_", " ")
            body[label] = kind(unit, words) if kind is Input else kind(unit, words, unchecked="matrices have units")

    declare(Input, labels["input"])
    declare(DiscreteState, labels["state"])
    declare(DiscreteOutput, labels["output"])

    def update(component: Any) -> dict[str, ca.SX]:
        x, u = (ca.vertcat(*(component.symbols[label] for label in labels[kind])) for kind in ("state", "input"))
        after = ca.vertcat(A @ x + B @ u, C @ x + D @ u)
        return by_name([*labels["state"], *labels["output"]], ca.vertsplit(ca.densify(after)))

    body |= {"__doc__": f"Linear system {name}, from python-control.", "__module__": __name__, "update": update}
    return new_class(name, (Sampled,), exec_body=lambda space: space.update(body))


def _sampled_matrices(name: str, matrices: list[Any], own_period: Any, period: float | None) -> tuple[list[Any], float]:
    """Matrices A, B, C, D of a system over its sampling period, and that period [s].

    :param own_period: of python-control: 0 or None of a continuous system, True where it is not said.
    """
    if period is not None:
        check_positive("from_control: period", period, PlanError)
    if own_period and own_period is not True:
        if period is not None and period != own_period:
            words = f"period = {period:g} s, but that of the system is {own_period:g} s; resample it"
            raise PlanError(f"from_control: {words}")
        return matrices, float(own_period)
    if period is None:
        raise PlanError(f"from_control: {name} has no period: give period=...")
    sampled: Any = matrices if own_period else cont2discrete(tuple(matrices), period)
    return [*sampled[:4]], period
