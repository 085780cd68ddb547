"""On a hoop that turns at a constant rate, a bead moves like a pendulum: ψ'' = -(d/R) β'² sin ψ.

M 8.4 for a circle that turns about a point O other than its centre.  The operator (a Ramp FMU on the port beta) has to
supply the torque that balances the moment of the normal force about O.  The closed form, by elliptic functions, gives
this torque and its power, too.
"""

from __future__ import annotations

from liaisons import operator, simulate
from liaisons.models import CircularHoop
from liaisons.scenarios import Claims, Lesson, dots, panels, scenario, within

RATE = 2.0  # rad/s
TOLERANCE = 1e-10
BOUNDS = {"xi": 1e-7, "xi_dot": 1e-7, "normal_force": 1e-6, "beta_force": 1e-6, "beta_power": 1e-6}


def lesson() -> Lesson:
    return Lesson(
        "CircularHoop",
        question="A hoop turns at a constant rate about a point that is not its centre.  What does the bead on it do?",
        predict="Does it come to rest, run round at a constant speed, or swing?  If it swings, about which point?",
        try_out="Change the rate at which the hoop turns, then the start position of the bead.",
        answer="It swings like a pendulum about the point farthest from the axis, ψ'' = -(d/R) β'² sin ψ.  Its "
        "frequency is proportional to the rate of the hoop.  There is no gravity.",
        controls=["beta", "xi_0"],
        plots=["xi", "beta_force"],
        start_values={"xi_0": 2.5, "xi_dot_0": 0.0, "beta": operator("Ramp", rate=RATE)},
    )


@scenario
def main(claim: Claims) -> None:
    motor = operator("Ramp", rate=RATE)
    # 143° from A, at rest on the hoop: a large swing
    run = simulate(
        "CircularHoop", stop_time=60.0, step_size=0.02, tolerance=TOLERANCE, xi_0=2.5, xi_dot_0=0.0, beta=motor
    )
    exact = CircularHoop.exact(run.time, beta_dot=RATE, xi_0=2.5, xi_dot_0=0.0)
    why = "errors at solver tolerance 1e-10, amplified less than 100-fold over 60 s; for forces 10 times more"
    for name, bound in BOUNDS.items():
        claim(f"{name} against the closed form", run[name], exact[name], within(bound, run.units[name], because=why))
    claim.energy("energy - work of the operator is constant", run, tolerance=TOLERANCE)

    path, motion, power = panels(
        ("the bead in the fixed frame", "x [m]", "y [m]"),
        ("on the hoop", "t [s]", "ξ [m]"),
        ("what the operator supplies", "t [s]", "torque [N.m], power [W]"),
    )
    t, shown = run.time[:751], slice(751)
    path.plot(run["bead_x"][shown], run["bead_y"][shown], linewidth=0.8)
    path.plot(0, 0, "k+")
    path.set(aspect="equal")
    motion.plot(t, run["xi"][shown], label="FMU")
    dots(motion, t, exact["xi"][shown], label="elliptic functions")
    power.plot(t, run["beta_force"][shown], label="torque")
    power.plot(t, run["beta_power"][shown], label="power")
