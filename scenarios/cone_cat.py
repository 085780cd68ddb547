"""A falling cat turns over as one half goes round a cone, tilted against the other half: Kane and Scher's integral.

M 8.2.  In the frame of half A, the axis of half B goes round a cone, smoothly from rest to rest.  The operators of this
file prescribe bend and azimuth, without twist, and a + b stays fixed in space.  In scenario ``spatial_cat`` the bend is
constant.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from liaisons import Operator, Parameter, operator, simulate
from liaisons.models import SpatialCat
from liaisons.scenarios import Claims, panels, scenario, within

TILT, HALF_ANGLE = 0.4, 1.1  # the cone [rad]
TOLERANCE = 1e-11


class Cone(Operator, abstract=True):
    """Half B's axis b goes round a cone; in the frame of half A, whose axis is z."""

    tilt = Parameter(TILT, "rad", "angle of the cone's axis from half A's")
    half_angle = Parameter(HALF_ANGLE, "rad", "half angle of the cone; more than the tilt")
    duration = Parameter(1.0, "s", "time of one round", above=0)

    def _around(self, t: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Angle on the cone, and b."""
        u = t / self.duration
        theta = 2 * np.pi * u**4 * (35 - 84 * u + 70 * u**2 - 20 * u**3)
        (s, c), (sb, cb) = ((ca.sin(angle), ca.cos(angle)) for angle in (self.tilt, self.half_angle))
        b = ca.vertcat(s * cb + c * sb * ca.cos(theta), sb * ca.sin(theta), c * cb - s * sb * ca.cos(theta))
        return theta, b


class ConeBend(Cone):
    """Bend of a cat whose half B goes round a cone."""

    def signal(self, t: ca.SX) -> ca.SX:
        return ca.acos(self._around(t)[1][2])


class ConeAzimuth(Cone):
    """Azimuth of the bend of a cat whose half B goes round a cone; it grows by 2π."""

    def signal(self, t: ca.SX) -> ca.SX:
        theta, b = self._around(t)
        ahead = ca.atan2(b[1] * ca.cos(theta) - b[0] * ca.sin(theta), b[0] * ca.cos(theta) + b[1] * ca.sin(theta))
        return theta + ahead + np.pi / 2


@scenario
def main(claim: Claims) -> None:
    cone = {"bend": operator(ConeBend), "azimuth": operator(ConeAzimuth)}
    run = simulate("SpatialCat", stop_time=1.0, step_size=0.0025, tolerance=TOLERANCE, **cone)  # type: ignore[arg-type]
    quaternion = np.transpose([run[name] for name in ("q_w", "q_x", "q_y", "q_z")])
    attitude = Rotation.from_quat(quaternion, scalar_first=True)
    e = attitude.apply(SpatialCat.bisector(run["bend"], run["azimuth"]))  # direction of a + b in space
    psi = SpatialCat.cone_turn(tilt=TILT, half_angle=HALF_ANGLE)
    why = f"errors at solver tolerance {TOLERANCE:g}, and of σ interpolated over 1/400 of the turn, 1e-11"
    solver, expected = within(1e-9, because=why), Rotation.from_rotvec(psi * e[0])
    text = f"Kane and Scher's cone: turned by their integral, {np.degrees(psi):.1f}°"
    claim(text, attitude[-1].as_matrix(), expected.as_matrix(), solver)
    claim("the direction of a + b in space is constant", e, e[0], solver)
    claim.energy("the energy is the cat's work", run, tolerance=TOLERANCE)
    fall = 9.81 * run.time * (1 - run.time / 2)
    claim("the centre of mass falls freely", run["com_z"], fall, within(1e-10, "m", because=why))

    shape, turn = panels(
        ("what the operators do", "t [s]", "angle [deg]"), ("half A", "t [s]", "turned about a + b [deg]")
    )
    shape.plot(run.time, np.degrees(run["bend"]), label="bend")
    shape.plot(run.time, np.degrees(run["azimuth"]), label="azimuth")
    about = np.unwrap(2 * np.arctan2(quaternion[:, 1:] @ e[0], quaternion[:, 0]), period=4 * np.pi)
    turn.plot(run.time, np.degrees(about), label="FMU")
    turn.axhline(np.degrees(psi) - 360, color="k", linewidth=0.6, label="Kane and Scher's integral, less a turn")
