"""Energy accounting of a model: work done through the ports, energy dissipated by friction."""

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca

from liaisons.language import Layout

MEMORY = ("energy_start", "energy_booked")
"""Memory of every model; the mismatch of each prescribed coordinate, which an FMU finds, follows."""

BOOKED = {"jump": ("y", -2, "work"), "remember": ("m", 1, "energy")}
"""Functions that return an argument with one number replaced by an output, unless jumps of inputs move states:
its letter, the row of the number, and the output."""


def memory_names(layout: Layout) -> tuple[str, ...]:
    """Names of the numbers in the memory of a model."""
    return (*MEMORY, *(v.name for v in layout.outputs if v.variability == "discrete"))


def with_energy_accounting(
    vectors: Mapping[str, Any],
    layout: Layout,
    *,
    initial: Any,
    rates: Any,
    energy: Any,
    outputs: Sequence[Any],
    nominals: Any,
    landed: Any = None,
    energy_at_start: Any = None,
) -> dict[str, Any]:
    """Results of functions of a model, with work, dissipated energy and the energy balance filled in, by name.

    :param vectors: symbols by letter, all SX or all MX; y ends in ``work`` and ``dissipated``.
    :param initial: state at the start, of (t, u, k).
    :param rates: rates of the states.
    :param energy: T + V.
    :param outputs: one expression an output; those of the energy balance and the mismatches are replaced.
    :param nominals: sizes of the states.
    :param landed: state after the inputs have jumped; its last two entries are ignored; None: unchanged.
    :param energy_at_start: T + V of (t, u, k); None: ``energy`` at the initial state.
    :returns: by the names of the members of Model; None for one that is not needed.
    """
    y, memory, remembered = vectors["y"], vectors["m"], memory_names(layout)
    energy_start, energy_booked, mismatches = memory[0], memory[1], memory[len(MEMORY) :]
    moving, work, dissipated = y[:-2], y[-2], y[-1]
    if energy_at_start is None:
        energy_at_start = ca.substitute(energy, y, initial)

    # When an operator makes σ̇ jump, p is continuous; the jump of the energy is the work of an impulse.
    jumps = bool(layout.active) or landed is not None or "impact_loss" in remembered
    booked_next, impulse = (energy, energy - energy_booked) if jumps else (energy_booked, 0 * energy_booked)
    landing = impulse if landed is None else ca.substitute(energy, y, landed) - energy_booked
    balance = energy - energy_start - (work + impulse) + dissipated
    if "impact_loss" in remembered:
        balance += memory[remembered.index("impact_loss")]
    booked = dict(zip(remembered[len(MEMORY) :], ca.vertsplit(mismatches), strict=True))
    booked |= {"work": work + impulse, "dissipated": dissipated, "energy_balance": balance}
    z = [booked.get(variable.name, value) for variable, value in zip(layout.outputs, outputs, strict=True)]
    after = ca.vertcat(moving if landed is None else landed[:-2], work + landing, dissipated)
    return {
        "start": (initial, ca.vertcat(energy_at_start, energy_at_start, *[0] * mismatches.shape[0])),
        "derivatives": rates,
        "outputs_function": ca.vertcat(*z),
        "jump": after,
        "remember": ca.vertcat(energy_start, booked_next, mismatches),
        "project": landed,
        "nominals": nominals,
    }
