"""Functions of a model whose energy is accounted for: what came in through the ports, what friction took away."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from liaisons.mechanics.model import Variable

MEMORY = ("energy_start", "energy_booked")


@dataclass(frozen=True, eq=False)
class Vectors:
    """The vectors of :class:`Model`, all SX or all MX; the last two states are ``work`` and ``dissipated``."""

    t: Any
    y: Any
    u: Any
    k: Any


def functions(
    at: Vectors,
    *,
    initial: Any,
    rates: Any,
    energy: Any,
    outputs: Sequence[tuple[Variable, Any]],
    nominals: Any,
    landed: Any = None,
) -> dict[str, Any]:
    """Members of :class:`Model` by name: start, motion, outputs and the booking of impulses.

    :param at: the vectors that the expressions are written in.
    :param initial: state at the start, of (t, u, k).
    :param rates: rates of the states.
    :param energy: T + V.
    :param outputs: variables with their expressions; those of the balance are filled in here.
    :param nominals: sizes of the states.
    :param landed: state after the inputs have jumped, the last two states left out of account; None: as it was.
    """
    t, y, u, k = at.t, at.y, at.u, at.k
    memory = type(y).sym("m", len(MEMORY))
    energy_start, energy_booked = memory[0], memory[1]
    moving, work, dissipated = y[:-2], y[-2], y[-1]

    # When an operator makes σ̇ jump, p stays and the energy jumps with it: that much work came in as an impulse.
    impulse = energy - energy_booked
    energy_at_start = ca.substitute(energy, y, initial)
    landing = impulse if landed is None else ca.substitute(energy, y, landed) - energy_booked
    balance = {
        "work": work + impulse,
        "dissipated": dissipated,
        "energy_balance": energy - energy_start - (work + impulse) + dissipated,
    }
    z = [balance.get(variable.name, expression) for variable, expression in outputs]
    after = ca.vertcat(moving if landed is None else landed[:-2], work + landing, dissipated)
    return {
        "start": function("start", [t, u, k], initial, ca.vertcat(energy_at_start, energy_at_start)),
        "derivatives": function("derivatives", [t, y, u, k], rates),
        "outputs_function": function("outputs", [t, y, u, k, memory], ca.vertcat(*z)),
        "jump": function("jump", [t, y, u, k, memory], after),
        "remember": function("remember", [t, y, u, k, memory], ca.vertcat(energy_start, energy)),
        "project": None if landed is None else function("project", [t, y, u, k], landed),
        "nominals": function("nominals", [t, y, u, k], nominals),
    }


def function(name: str, arguments: Sequence[Any], *results: Any) -> ca.Function:
    """A function with dense results; scalar code without repeated sub-expressions."""
    dense: Any = [ca.densify(result) for result in results]
    if all(isinstance(result, ca.SX) for result in dense):
        dense = ca.cse(dense)
    return ca.Function(name, list(arguments), dense)
