"""The best half swing multiplies 1 - cos θ by (l_max/l_min)³: rise at the lowest point, crouch at the turning point.

M 8.1 with M 2: the length of a Pendulum lies between l_min and l_max and may jump, since only l enters the equations of
(θ, p).  The plan maximizes the amplitude at the end of one half swing of free duration.  It finds that the length
switches once, where the swing passes its lowest point, as every child does.  If the acceleration is bounded, |l''| <=
A, the amplitude loses a term in 1/A.  With an upright torso on the seat, I(l) θ'' = -D(l) sin θ: p is constant through
the jump, and the energy on either side of it, so the ratio is that of I D.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import Plan, plan
from liaisons.scenarios import Claims, dots, panels, scenario, within

SHORT, LONG, AMPLITUDE = 1.0, 1.1, 0.5
RATIO = (LONG / SHORT) ** 3
BODIES = np.array([15.0, 30.0, 60.0])  # what a body accelerates by [m/s2]
MASS, TORSO, GRAVITY = 20.0, 0.5, 9.81


def swung(component: str, rope: str, **more: Any) -> Plan:
    """The half swing that gains most of 1 - cos θ."""
    goal: Any = {"end": {"p_theta": 0, "theta": (0.3, 2)}, "duration": (0.5, 3), "minimize": "-sin(theta)*theta_dot"}
    start, bounds = {"theta": -AMPLITUDE} | more.pop("start", {}), {rope: (SHORT, LONG)} | more.pop("bounds", {})
    return plan(component, [rope], start=start, bounds=bounds, **goal, **more)


def gain(motion: Plan) -> float:
    """Of 1 - cos θ."""
    return 1 - motion.cost / (1 - np.cos(AMPLITUDE))


def with_torso(rope: float) -> float:
    """I D of the swing with a torso upright, M eq. 54-55."""
    I, D = (MASS * (rope**n + (rope - TORSO) ** n) for n in (2, 1))  # noqa: E741
    return I * GRAVITY * D


@scenario
def main(claim: Claims) -> None:
    angle, length, losses = panels(
        ("half a swing", "t [s]", "θ [rad]"),
        ("its length", "t [s]", "l [m]"),
        ("a body that accelerates by A", "A [m/s²]", "loss of the ratio"),
    )
    sudden = swung("Pendulum", "length")
    run = sudden.replay()
    mesh = within(1e-9, because="the instant of the switch is an unknown, so arcs are smooth and of tenth order")
    ratio = (1 - np.cos(run["theta"][-1])) / (1 - np.cos(AMPLITUDE))
    claim("1 - cos θ grows by (l_max/l_min)³", ratio, RATIO, mesh)
    claim("the length switches once", sudden.switches.size, 1, within(0, because="a whole number"))
    at_switch = run["theta"][np.searchsorted(run.time, sudden.switches[0])]
    claim("... at the lowest point", at_switch, 0.0, within(1e-7, "rad", because="the cost is stationary: √1e-14"))

    bodies: list[Any] = [{"start": {"length": LONG}, "bounds": {"length_ddot": (-A, A)}} for A in BODIES]
    smooth = [swung("Pendulum", "length", **body) for body in bodies]
    loss = RATIO - np.array([gain(motion) for motion in smooth])
    next_term = within(0.02, because="it is smaller by √(Δl/A), what the switch lasts, squared")
    claim.order("a body that accelerates by A loses a term in 1/A", BODIES, loss, -1, next_term)
    torso = swung(
        "Swing", "rope", start={"rope": None}, lean=np.pi, mass_seat=MASS, mass_torso=MASS, torso_length=TORSO
    )
    claim("with a torso, 1 - cos θ grows by the ratio of I D", gain(torso), with_torso(LONG) / with_torso(SHORT), mesh)
    claim.verdicts += [verdict for motion in (sudden, smooth[0], torso) for verdict in motion.verify()]

    for motion, label, rope in ((sudden, "sudden", "length"), (smooth[0], "A = 15 m/s²", "length")):
        run = motion.replay()
        angle.plot(run.time, run["theta"], label=label)
        length.plot(run.time, run[rope], label=label)
    dots(angle, run.time[-1:], np.arccos(1 - (1 - np.cos([AMPLITUDE])) * RATIO), label="closed form")
    losses.loglog(BODIES, loss, ".-")
