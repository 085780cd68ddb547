"""SwingPump: three filters behind a switch, and a swing that it pumps."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from liaisons.cosim import System
from liaisons.errors import ComponentError
from liaisons.language import Input, InternalState, Operator, Parameter
from liaisons.models import Pendulum, SwingPump

RATE, LOW, HIGH = 30.0, 0.95, 1.05


def test_closed_loop_pumps_the_swing_and_its_work_is_the_energy_gained(fmu) -> None:
    system = System("closed loop")
    swing = system.add("swing", fmu(Pendulum, "native"), theta_0=0.1, length=HIGH)
    pump = system.add("pump", fmu(SwingPump, "native"))
    system.connect(swing["theta"], pump["theta"])
    system.connect(swing["theta_dot"], pump["theta_dot"])
    system.connect(pump["y"], swing["length"])
    result = system.simulate(10.0, 0.01, tolerance=1e-8)
    amplitude = np.max(np.abs(result["swing.theta"][-250:]))  # over the last 2.5 s, more than a period
    # An instantaneous pump would give (1.05/0.95)³ a half swing, 9 of them: 0.1 · 1.35^(9/2) = 0.39; filters take time.
    assert 0.2 < amplitude < 0.39
    scale = np.max(np.abs(result["swing.energy"]))
    assert np.max(np.abs(result["swing.energy_balance"])) < 10 * 1e-8 * scale * 10.0
    assert result["pump.y"].min() > LOW
    assert result["pump.y"].max() <= HIGH


def test_an_operator_whose_signal_jumps_with_an_input_is_refused() -> None:
    with pytest.raises(ComponentError, match=r"Hasty: y_dot jumps with an input; pass the input through three"):

        class Hasty(Operator):
            angle = Input("rad", "angle")
            x = InternalState("rad", "follows the angle")
            rate = Parameter(1.0, "1/s", "how fast")

            def signal(self, t: ca.SX) -> ca.SX:  # noqa: ARG002 - the signature of the base class
                return self.x

            def internal_rates(self) -> dict[str, ca.SX]:
                return {"x": self.rate * (self.angle - self.x)}
