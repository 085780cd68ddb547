"""Systems of our own components, against references that no FMU takes part in."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable

import numpy as np
import pytest
from making import FmuPaths, wired
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from liaisons.cosim import Result

Array = NDArray[np.float64]

GRAVITY = 9.81


def _solved(right_hand_side: Callable[[float, Array], list[float]], start: list[float], times: Array) -> Array:
    """Reference to about 1e-12: shape (states, times)."""
    span = (times[0], times[-1])
    return solve_ivp(right_hand_side, span, start, method="DOP853", rtol=1e-13, atol=1e-13, t_eval=times).y


def _pumped(component: FmuPaths, mode: int, step: float) -> Result:
    """A pendulum of length 1 + 0.1 sin 2t for 10 s, fed by a Sinusoid."""
    motor = component("Sinusoid"), {"offset": 1.0, "amplitude": 0.1, "angular_frequency": 2.0}
    swing = component("Pendulum"), {"theta_0": 0.5, "input_reconstruction": mode}
    return wired("motor.y -> swing.length", motor=motor, swing=swing).simulate(10.0, step, tolerance=1e-13)


def _pumped_error(result: Result) -> float:
    def motion(t: float, state: Array) -> list[float]:
        length = 1 + 0.1 * math.sin(2 * t)
        return [state[1] / length**2, -GRAVITY * length * math.sin(state[0])]

    return float(np.max(np.abs(result["swing.theta"] - _solved(motion, [0.5, 0.0], result.time)[0])))


# a Taylor polynomial of second order is wrong by H³ at the end of a step; half an order for finite H
@pytest.mark.parametrize(("mode", "step", "order", "bound"), [(2, 0.1, 6.0, 1e-9), (1, 0.05, 3.0, 1e-4)])
def test_order_through_a_system(component: FmuPaths, mode: int, step: float, order: float, bound: float) -> None:
    coarse, fine = (_pumped_error(_pumped(component, mode, H)) for H in (2 * step, step))
    assert fine <= bound
    assert math.log2(coarse / fine) == pytest.approx(order, abs=0.5)


def test_process_ends_well_after_a_python_fmu(component: FmuPaths) -> None:
    path = component("python/Pendulum")
    code = f"from liaisons.cosim import simulate; simulate({str(path)!r}, stop_time=1); simulate({str(path)!r})"
    finished = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (finished.returncode, finished.stderr) == (0, "")
