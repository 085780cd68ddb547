"""A free rigid body: its rates are elliptic functions, its attitude an elliptic integral of the third kind.

M 8.3 with the wheels locked.  Rotations about the axes of the largest and the smallest moment of inertia are stable.
Started about the middle axis, the body turns over again and again, each time after an interval that grows with the
logarithm of the inverse of the disturbance.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import product
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from liaisons import simulate
from liaisons.models import Satellite
from liaisons.scenarios import Claims, dots, panels, scenario, within

MOMENTS = np.array([10.0, 12.0, 8.0])  # kg.m2: x is the middle axis
STARTS = {"least": (0.3, 0.2, 1.0), "largest": (0.3, 1.0, 0.2), "middle": (1.0, 1e-3, 1e-3)}  # ω by the axis of most
RATES, QUATERNION = ("omega_x", "omega_y", "omega_z"), ("q_w", "q_x", "q_y", "q_z")
STOP, TOLERANCE = 300.0, 1e-13


def start(omega: Iterable[float]) -> dict[str, Any]:
    return {f"{name}_0": float(rate) for name, rate in zip(RATES, omega, strict=True)}


@scenario
def main(claim: Claims) -> None:
    body, over = panels(
        ("direction of H in the body", "x (middle)", "y (largest)", "z (least)"),
        ("about the middle axis", "t [s]", "ω [rad/s]"),
        size=(12, 5),
    )
    # Started in the plane of the extreme and the middle axis, with the same |H|.
    for extreme, size, sign in product((1, 2), (0.2, 0.5, 0.8), (1, -1)):
        H = np.zeros(3)
        H[extreme], H[0] = sign * 10 * np.cos(size), 10 * np.sin(size)
        exact = Satellite.exact(np.linspace(0, 150, 1500), **start(H / MOMENTS))
        body.plot(*(exact[name] * J / 10 for name, J in zip(RATES, MOMENTS, strict=True)), color="grey", linewidth=0.4)

    steady = within(1e-10, because=f"solver tolerance {TOLERANCE:g}, amplified less than 100-fold over {STOP:g} s")
    # How near the axis it comes back, ε, follows from ε² = a difference of energies: an error over ε².
    near = within(10 * TOLERANCE / 1e-3**2, because="10 times tolerance, over the squared distance 1e-3 to the axis")
    state = within(1e-13, "kg.m2/s", because="H is a state whose rate is 0: rounding errors of 12 kg.m2/s")
    for axis, omega in STARTS.items():
        run = simulate("Satellite", stop_time=STOP, step_size=0.1, tolerance=TOLERANCE, **start(omega))
        exact = Satellite.exact(run.time, **start(omega))
        for kind, names in (("ω", RATES), ("attitude", QUATERNION)):
            claim(f"about the {axis} axis: {kind}", run, exact, near if axis == "middle" else steady, names=names)
        R = Rotation.from_quat(np.transpose([run[name] for name in QUATERNION]), scalar_first=True)
        in_body = np.transpose([run[name] for name in RATES]) * MOMENTS
        H = R.apply(in_body)
        claim(f"about the {axis} axis: R J ω is constant", H, H[0], state)
        body.plot(*(in_body / np.linalg.norm(H[0])).T, linewidth=1.2, label=f"about the {axis} axis")
        for name in RATES if axis == "middle" else ():
            (line,) = over.plot(run.time, run[name], linewidth=0.9, label=name.replace("omega", "ω"))
            dots(over, run.time, exact[name], every=50, color=line.get_color())
    body.set(aspect="equal")
    dots(over, [], [], color="0.5", label="elliptic functions")
