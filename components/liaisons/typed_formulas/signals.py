"""Signals that formulas describe."""

from __future__ import annotations

from liaisons.cosim import Signal
from liaisons.typed_formulas.time_functions import pulse_instants, time_function


def formula_signal(text: str, /, start_time: float = 0.0, stop_time: float = 0.0) -> Signal:
    """Function of time that a formula describes, with its first and second derivatives.

    ``simulate("Pendulum", inputs={"length": formula_signal("1 + 0.1*sin(5*t)")})``

    :param text: a formula of the time ``t`` [s].
    :param start_time: start of the time in which short pulses, ``exp(-(t - 1)**2/0.001)``, are looked for [s]: a run
        has communication points in them.
    :param stop_time: its end [s].
    :raises FormulaError: if it is not a formula; names the place, and the nearest name.
    """
    return Signal(time_function(text), pulse_instants(text, start_time, stop_time))
