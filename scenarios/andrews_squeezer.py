"""Andrews' squeezer (IVP Test Set, IFToMM A03) from joints: ten digits of the angles, eight of the multipliers.

Seven bodies in a plane hang on a tree of seven hinges; three more hinges close loops, by six constraints with
multipliers.  A motor turns the crank, a spring holds the rocker.  Each angle of the test set is the coordinate of a
hinge; they are compared at t = 0.03.  The published multipliers are right to seven digits.  Further digits are
extrapolated from two step sizes, with the equations of the test set in extended precision.
"""

from __future__ import annotations

import numpy as np

from liaisons import Body, Linkage, Parameter, Result, Revolute, SpringDamper, ground, simulate
from liaisons.scenarios import Claims, panels, scenario, within

TOLERANCE, TORQUE = 1e-12, 0.033  # N.m of the motor
ANCHOR = (-0.06934, 0, -0.00227)
# Test Set for IVP Solvers, release 2.4, Andrews' squeezing mechanism: angles and multipliers at t = 0.03.
PUBLISHED = {
    "beta": 0.1581077119629904e2,
    "theta": -0.1575637105984298e2,
    "gamma": 0.4082224013073101e-1,
    "phi": -0.5347301163226948,
    "delta": 0.5244099658805304,
    "omega": 0.5347301163226948,
    "epsilon": 0.1048080741042263e1,
}
MULTIPLIERS = {  # published, converged
    "pin_3": (199.1753333731910 - 29.75531228015052j, 199.1753481045389 - 29.7553099749719j),
    "pin_4": (23.06654119098399 + 31.45271365475927j, 23.0665436116221 + 31.4527252757711j),
    "pin_6": (22.64249232082739 + 11.61740700019673j, 22.6424947863944 + 11.6173923526117j),
}


def _flat(mass: float, inertia: float, *centre: float) -> Body:
    return Body(mass=mass, inertia=(0, inertia, inertia), centre=(centre[0], 0, centre[1]))


class Squeezer(Linkage):
    """Andrews' squeezing mechanism in the plane of x and z, without weight.

    Source: W. Schiehlen (ed.), Multibody Systems Handbook (1990); E. Hairer, G. Wanner, Solving ODEs II, VII.7.
    """

    gravity = Parameter(0.0, "m/s2", "gravitational acceleration", symbol="g")
    crank = _flat(0.04325, 2.194e-6, 0.00092, 0)
    rod = _flat(0.00365, 4.410e-7, -0.0115, 0)
    rocker = _flat(0.02373, 5.255e-6, 0.01043, -0.01874)
    arm_5 = _flat(0.07050, 1.169e-5, 0.02308, 0.00916)
    arm_4 = _flat(0.00706, 5.667e-7, 0, -0.00579)
    arm_7 = _flat(0.05498, 1.912e-5, -0.00449, -0.01228)
    arm_6 = _flat(0.00706, 5.667e-7, 0.00579, 0)
    beta = Revolute(ground, crank, axis="-y", start=-0.0617138900142764496358948458001)
    theta = Revolute(crank, rod, axis="-y", at=(0.007, 0, 0))
    gamma = Revolute(ground, rocker, axis="-y", at=(-0.03635, 0, 0.03273), start=0.455279819163070380255912382449)
    delta = Revolute(ground, arm_5, axis="-y", at=ANCHOR, start=0.487364979543842550225598953530)
    phi = Revolute(arm_5, arm_4, axis="-y", at=(0.04, 0, 0), start=0.222668390165885884674473185609)
    epsilon = Revolute(ground, arm_7, axis="-y", at=ANCHOR, start=1.23054744454982119249735015568)
    omega = Revolute(arm_7, arm_6, axis="-y", at=(0, 0, -0.04), start=-0.222668390165885884674473185609)
    pin_3 = Revolute(rod, rocker, axis="-y", at=(-0.028, 0, 0), at_child=(0, 0, -0.035))
    pin_4 = Revolute(rod, arm_4, axis="-y", at=(-0.028, 0, 0), at_child=(0, 0, -0.02))
    pin_6 = Revolute(rod, arm_6, axis="-y", at=(-0.028, 0, 0), at_child=(0.02, 0, 0))
    spring = SpringDamper((ground, (0.014, 0, 0.072)), (rocker, (0.02, 0, -0.018)), stiffness=4530, length=0.07785)


def pin_forces(run: Result) -> dict[str, complex]:
    """Multipliers at the end, x + i z [N]: conditions are along the z and -x axes of the rod."""
    turned = 1j * np.exp(1j * (run["beta"] + run["theta"])[-1])
    return {pin: turned * complex(*(run[f"lambda_{pin}_offset_{i}"][-1] for i in (1, 2))) for pin in MULTIPLIERS}


@scenario
def main(claim: Claims) -> None:
    run = simulate(Squeezer, beta_force=TORQUE, stop_time=0.03, step_size=1e-4, tolerance=TOLERANCE)
    ten = within(15.8e-10, "rad", because="ten digits of the largest angle; the published angles are right to 1.4e-9")
    for name, angle in PUBLISHED.items():
        claim(f"{name} at t = 0.03: {angle:.11g}", run[name][-1], angle, ten)
    forces = pin_forces(run)
    seven = within(2e-5, "N", because="seven digits of the largest multiplier; the published ones are right to 1.5e-5")
    eight = within(2e-6, "N", because="eight digits of the largest multiplier")
    for pin, (published, converged) in MULTIPLIERS.items():
        claim(f"multipliers of {pin}, as published", forces[pin], published, seven)
        claim(f"multipliers of {pin}, converged", forces[pin], converged, eight)
    claim.energy("energy", run, tolerance=TOLERANCE)
    axes = panels(("crank and rod", "t [s]", "angle [rad]"), ("rocker and arms", "t [s]", "angle [rad]"))
    for name in ("beta", "theta", "gamma", "phi", "delta", "epsilon"):
        axes[name not in {"beta", "theta"}].plot(run.time, run[name], label=name)
