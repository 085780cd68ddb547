"""A charge in a uniform magnetic field moves on a helix; with an electric field across it, it drifts at E∧B/B².

K Ex. 4 and Fig. 3 (Ω = QB/m = 1 rad/s, start at the origin with velocity (1, 0, 0.1)).  The canonical momenta of the
FMU are those of the symmetric gauge, p = m r' + Q B∧r/2: they change although the speed, the guiding centre and the
angular momentum (r∧p)_z do not.  Two charges of opposite sign and unequal mass drift alike.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import Result, simulate
from liaisons.models import ChargedParticle
from liaisons.scenarios import Claims, panels, scenario, within

TURN = 2 * np.pi  # period of a turn for Ω = 1 [s]
ELECTRIC: Any = {"E_x": 0.0, "E_y": 0.3, "E_z": 0.0}
CHARGES: Any = {"Q = 1 C, m = 1 kg": {}, "Q = -1 C, m = 2 kg": {"charge": -1.0, "mass": 2.0}}


def run(turns: int, **values: Any) -> Result:
    start = {"x_dot_0": 1.0, "z_dot_0": 0.1, **values}
    return simulate("ChargedParticle", stop_time=turns * TURN, step_size=TURN / 200, tolerance=1e-10, **start)


@scenario
def main(claim: Claims) -> None:
    helix = run(10)
    why = "10 times the solver tolerance 1e-10, not amplified: linear equations with constant coefficients"
    printed = {"x": np.sin(helix.time), "y": np.cos(helix.time) - 1, "z": 0.1 * helix.time}  # K, for Ω = 1
    for axis, values in printed.items():
        claim(f"{axis}(t) is that of K Ex. 4", helix[axis], values, within(1e-9, "m", because=why))
    x, y, z = r = np.array([helix[axis] for axis in "xyz"])
    canonical, kinetic = (np.array([helix[f"{name}_{axis}"] for axis in "xyz"]) for name in ("p", "kinetic_momentum"))
    kept = {
        "speed": np.linalg.norm(kinetic, axis=0),
        "guiding centre across the field": helix["guiding_centre_x"] + 1j * helix["guiding_centre_y"],
        "(r∧p)_z with canonical p": np.cross(r, canonical, axis=0)[2],
    }
    for name, values in kept.items():
        claim(f"{name} is constant", values, values[0], within(1e-9, because=why))
    algebra = within(1e-14, "kg.m/s", because="algebra: a few rounding errors of numbers of about 1")
    gauge = np.array([-y, x, 0 * z]) / 2  # Q A for Q = B_z = 1
    claim("canonical minus kinetic momentum is Q B∧r/2", canonical - kinetic, gauge, algebra)

    spiral, plane = panels(
        ("K Fig. 3: Ω = 1 rad/s, v(0) = (1, 0, 0.1) m/s", "x [m]", "y [m]", "z [m]"),
        ("E = 0.3 V/m along y: both drift along x (dashed)", "x [m]", "y [m]"),
        size=(11, 5),
    )
    spiral.plot(*r[:, :1001], color="tab:purple", label="FMU")
    spiral.plot(*(values[:1001:10] for values in printed.values()), "k.", markersize=3, label="K Ex. 4")
    spiral.set(xticks=[-1, 0, 1], yticks=[-2, -1, 0], zticks=[0, 1, 2, 3])
    drift = ChargedParticle.drift(**ELECTRIC)
    whole = within(1e-9, "m/s", because="error of 1e-9 m divided by 126 s, and rounding of the instant")
    for name, charge in CHARGES.items():
        drifting = run(20, **charge, **ELECTRIC)
        # After whole turns of both charges, those of the heavier one taking twice as long, the turning is gone.
        velocity = [(drifting[axis][-1] - drifting[axis][0]) / drifting.time[-1] for axis in "xy"]
        text = f"{name}: mean velocity across B is E∧B/B² = ({drift[0]:g}, {drift[1]:g}) m/s"
        claim(text, velocity, drift[:2], whole)
        (line,) = plane.plot(drifting["x"][:801], drifting["y"][:801], label=name)
        centre = (drifting[f"guiding_centre_{axis}"][:801] for axis in "xy")
        plane.plot(*centre, "--", color=line.get_color())
    plane.set(aspect="equal")
