"""A swing whose length varies at twice its own frequency is pumped: its amplitude grows at the rate ¾ ε Ω_0.

The operator prescribes the length of a Pendulum (M 8.1), l = 1 + ε sin 2Ω_0 t from a Sinusoid.  The motion agrees with
a high-order integration of l θ'' = -g sin θ - 2 l' θ', and the growth of small swings with the first Mathieu tongue.
Scenario ``crouching_swing`` moves the length suddenly.
"""

from __future__ import annotations

import numpy as np

from liaisons import Result, operator, simulate
from liaisons.models import Pendulum
from liaisons.scenarios import Claims, Lesson, dots, panels, scenario, within

OMEGA, DEPTH, TOLERANCE = np.sqrt(9.81), 0.1, 1e-11


def pumped(theta_0: float) -> Result:
    length = operator("Sinusoid", offset=1.0, amplitude=DEPTH, angular_frequency=2 * OMEGA)
    return simulate("Pendulum", stop_time=20.0, step_size=0.02, tolerance=TOLERANCE, theta_0=theta_0, length=length)


def lesson() -> Lesson:
    return Lesson(
        "Pendulum",
        question="How often must a swing be lengthened and shortened so that it swings higher and higher?",
        predict="Once per period, twice per period, or as often as you like?",
        try_out="It is pumped twice per period, at 6.26 rad/s.  Try 3.13 and 4.5 rad/s; then pump by hand.",
        answer="Twice per period: long at the turning points, short at the lowest point.  It grows like exp(¾ ε Ω_0 "
        "t), with ε = 0.1 and Ω_0 = 3.13 rad/s.  Shortening it at the lowest point takes work against weight and "
        "centrifugal force; lengthening it at the turning points gives less back.",
        controls=["length", "theta_0"],
        plots=["theta"],
        start_values={
            "theta_0": 0.05,
            "length": operator("Sinusoid", offset=1.0, amplitude=DEPTH, angular_frequency=2 * OMEGA),
        },
    )


@scenario
def main(claim: Claims) -> None:
    run = pumped(0.05)
    exact = Pendulum.pumped(run.time, theta_0=0.05, amplitude=DEPTH, angular_frequency=2 * OMEGA)["theta"]
    growing = within(1e-7, "rad", because="error of σ interpolated over 0.02 s, 1e-13 a step, amplified about 100-fold")
    claim("θ(t) against a 1e-13 integration", run["theta"], exact, growing)
    claim.energy("the energy gained is the operator's work", run, tolerance=TOLERANCE)

    # Small swings, once the growing mode is alone: from their sixth period to the ninth.
    small, instants = pumped(1e-6), 2 * np.pi / OMEGA * np.array([6, 9])
    size = np.interp(instants, small.time, np.hypot(small["theta"], small["p_theta"]))
    rate = np.log(size[1] / size[0]) / np.ptp(instants)
    leading = within(DEPTH, because="¾ ε Ω_0 is the leading term; the next term is smaller by the factor ε")
    claim(f"small swings: growth rate {rate:.4f} /s is ¾ ε Ω_0", rate / Pendulum.pumping_rate(DEPTH), 1.0, leading)

    title = "pumped at twice the swing's frequency"
    angle, length = panels(
        (title, "", "θ [deg]"),
        ("", "t [s]", "length [m]"),
        mosaic="a;b",
        size=(7, 5),
        sharex=True,
        height_ratios=[3, 1],
    )
    angle.plot(run.time, np.degrees(run["theta"]), label="FMU")
    dots(angle, run.time, np.degrees(exact), label="integration at 1e-13", every=20)
    length.plot(run.time, run["length"], color="tab:orange")
