"""The car axis of the IVP Test Set, built from joints on a prescribed ground, is right to nine digits at t = 3.

Joints replace the two constraints of the test set and their multipliers: an operator turns the road, the left wheel
moves perpendicular to it, and the axle is a hinge.  No constraint is left, so nothing drifts.
"""

from __future__ import annotations

import casadi as ca

from liaisons import Operator, Parameter, operator, simulate
from liaisons.scenarios import Claims, panels, scenario, within

TOLERANCE = 1e-12
PUBLISHED = {  # Mazzia and Magherini, II-12-4: positions and velocities at t = 3
    "wheel_l_x": 0.4934557842755629e-1,
    "wheel_l_z": 0.4969894602303324,
    "wheel_r_x": 0.1041742524885400e1,
    "wheel_r_z": 0.3739110272652214,
    "wheel_l_x_dot": -0.7705836840321485e-1,
    "wheel_l_z_dot": 0.7446866596327776e-2,
    "wheel_r_x_dot": 0.1755681574942899e-1,
    "wheel_r_z_dot": 0.7703410437794031,
}


class Bump(Operator):
    """Angle of a road of 1 m whose end goes up and down by sin β = 0.1 sin 10 t."""

    angular_frequency = Parameter(10.0, "rad/s", "of the road")

    def signal(self, t: ca.SX) -> ca.SX:
        return ca.asin(0.1 * ca.sin(self.angular_frequency * t))


@scenario
def main(claim: Claims) -> None:
    run = simulate(
        "CarAxis", stop_time=3.0, step_size=0.001, tolerance=TOLERANCE, lift=operator(Bump), input_reconstruction=2
    )
    digits = within(1e-9, because="errors at solver tolerance 1e-12 over 3 s, 14 periods of the stiff springs")
    for name, value in PUBLISHED.items():
        claim(f"{name} at t = 3: {value:.10g}", run[name][-1], value, digits)
    claim.energy("energy", run, tolerance=TOLERANCE)
    axes = panels(("height of the right wheel", "t [s]", "z [m]"), ("path of the left wheel", "x [m]", "z [m]"))
    axes[0].plot(run.time, run["wheel_r_z"])
    axes[1].plot(run["wheel_l_x"], run["wheel_l_z"])
