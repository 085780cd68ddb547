"""A Furuta pendulum whose arm is free moves by the published equations, and the momentum of the arm is constant.

Arm and pendulum are two bodies with two hinges at right angles; the equations of Cazzolato and Prime were derived by
hand.  No torque acts about the vertical axis, so the momentum about it is constant.
"""

from __future__ import annotations

from liaisons import simulate
from liaisons.models import FurutaPendulum
from liaisons.scenarios import Claims, dots, panels, scenario, within

TOLERANCE = 1e-11


@scenario
def main(claim: Claims) -> None:
    run = simulate("FurutaPendulum", stop_time=5.0, step_size=0.01, tolerance=TOLERANCE)
    exact = FurutaPendulum.exact(run.time)
    solver = within(1e-7, "rad", because="errors at solver tolerance 1e-11, amplified up to 1e4 times in 5 s")
    for name, text in (("turn", "arm"), ("swing", "pendulum")):
        claim(f"{text}: the published equations", run[name], exact[name], solver)
    momentum = run["p_turn"]
    rounding = within(1e-12, "kg.m2/s", because="each term of its rate is 0")
    claim("momentum of the arm is constant", momentum, momentum[0], rounding)
    claim.energy("energy", run, tolerance=TOLERANCE)
    axes = panels(("arm", "t [s]", "φ [rad]"), ("pendulum", "t [s]", "θ [rad]"))
    for axis, name in zip(axes, ("turn", "swing"), strict=True):
        axis.plot(run.time, run[name], label="FMU")
        dots(axis, run.time, exact[name], every=20, label="Cazzolato and Prime")
