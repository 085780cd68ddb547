"""A pendulum is stable upright if its pivot is shaken fast enough, beyond a²ν² = 2gl, where the trace falls below 2.

A Sinusoid moves pivot_z of a Pendulum, z = a sin νt.  Linearised about the upright position, φ = θ - π, the motion over
one period is a matrix of determinant 1.  The equilibrium is stable while the modulus of the trace is below 2.  The
matrix is obtained from the FMU, started near the upright position, and by integrating l φ'' = (g - a ν² sin νt) φ.  K_Y
is not constant here, unlike in the examples of M 8.1-8.3: its mean ¼ m a²ν² sin² θ is Kapitza's potential.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import Result, operator, simulate
from liaisons.models import Pendulum
from liaisons.scenarios import Claims, Lesson, panels, scenario, within

AMPLITUDE, TOLERANCE = 0.1, 1e-12  # l = 1 m
NEAR = 1e-4  # start beside the upright position; what is not linear is of relative size NEAR²
FREQUENCIES = np.array([40.0, 42.0, 43.0, 44.0, 45.0, 46.0, 48.0, 52.0, 60.0, 80.0, 100.0])


def shaken(frequency: float, stop_time: float, steps: int, theta: float, theta_dot: float = 0.0) -> Result:
    start: Any = {"theta_0": np.pi + theta, "theta_dot_0": theta_dot}
    pivot = operator("Sinusoid", amplitude=AMPLITUDE, angular_frequency=frequency)
    step = stop_time / steps
    return simulate("Pendulum", stop_time=stop_time, step_size=step, tolerance=TOLERANCE, pivot_z=pivot, **start)


def trace_of_fmu(frequency: float) -> float:
    """Trace of the map of (φ, φ') over one period, by differences of runs on both sides of the upright position."""

    def end(name: str, *start: float) -> float:
        return shaken(frequency, 2 * np.pi / frequency, 40, *start)[name][-1]

    theta = end("theta", NEAR) - end("theta", -NEAR)
    return (theta + end("theta_dot", 0.0, NEAR) - end("theta_dot", 0.0, -NEAR)) / (2 * NEAR)


def trace_of_mathieu(frequency: float) -> float:
    """About the bob that stands on its pivot: weight upwards."""
    return Pendulum.shaken_trace(gravity=-9.81, amplitude=AMPLITUDE, angular_frequency=frequency)


def lesson() -> Lesson:
    return Lesson(
        "Pendulum",
        question="The pivot is shaken with an amplitude of 10 cm.  How fast must it be to hold the pendulum upright?",
        predict="At which angular frequency ν does it begin to stand: 6, 45 or 300 rad/s?",
        try_out="It stands at ν = 60 rad/s.  Lower the angular frequency until it falls; Reset starts again.",
        answer="It stands where a²ν² > 2gl, from 44.3 rad/s on: shaking adds a potential ¼ m a²ν² sin² θ, whose well "
        "about the top is then stronger than the weight.",
        controls=["pivot_z", "theta_0"],
        plots=["theta"],
        start_values={"theta_0": np.pi - 0.2, "pivot_z": operator("Sinusoid", amplitude=0.1, angular_frequency=60.0)},
    )


@scenario
def main(claim: Claims) -> None:
    traces = np.array([trace_of_fmu(frequency) for frequency in FREQUENCIES])
    linear = within(1e-6, because="NEAR² = 1e-8; errors of solver and interpolation, 1e-10, divided by NEAR")
    expected = [trace_of_mathieu(frequency) for frequency in FREQUENCIES]
    claim("trace of the motion over one period, ν = 40 to 100 rad/s", traces, expected, linear)
    leading = Pendulum.upright_from(AMPLITUDE)
    text = f"the upright position becomes stable between 44 and 45 rad/s; the leading term gives {leading:.2f}"
    count = within(0.0, because="a whole number; the traces at 44 and 45 differ from 2 by 4e-3")
    claim(text, np.sum((traces < 2) != (leading < FREQUENCIES)), 0, count)
    slow = np.arccos(traces[-1] / 2) * FREQUENCIES[-1] / (2 * np.pi)
    averaged, _ = Pendulum.upright_well(AMPLITUDE, FREQUENCIES[-1])
    text = f"ν = 100: it swings about the top with √(a²ν²/2l² - g/l) = {averaged:.2f} rad/s"
    next_term = within(
        AMPLITUDE, because="the averaged potential is the leading term; the next is smaller by the factor a/l"
    )
    claim(text, slow / averaged, 1.0, next_term)
    standing, falling = shaken(60.0, 20.0, 8000, -0.2), shaken(40.0, 20.0, 8000, -0.01)
    _, edge = Pendulum.upright_well(AMPLITUDE, 60.0)
    well = within(edge, "rad", because="edge of the well of the averaged potential -mgl cos θ + ¼ m a²ν² sin² θ")
    claim("ν = 60: started 0.2 rad off the top, it stays near the top for 20 s", standing["theta"], np.pi, well)
    claim.energy("the energy gained is the shaker's work", standing, tolerance=TOLERANCE)

    trace, swing = panels(("stable below 2", "ν [rad/s]", "trace"), ("upright is 180°", "t [s]", "θ [deg]"))
    fine = np.linspace(40, 100, 121)
    trace.plot(fine, [trace_of_mathieu(frequency) for frequency in fine], label="Mathieu's equation")
    trace.plot(FREQUENCIES, traces, "k.", label="FMU")
    trace.axhline(2, color="gray", linewidth=0.8)
    for label, run in (("ν = 60 rad/s", standing), ("ν = 40 rad/s", falling)):
        swing.plot(run.time, np.degrees(run["theta"]), linewidth=0.8, label=label)
