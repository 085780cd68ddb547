"""A falling cat without angular momentum turns itself over by going round with its bend: Φ = 2π J c/(I s² + J c²).

M 8.2.  Rademaker and ter Braak: bent by κ, the direction of the bend once round, no twist; c, s = cos, sin of κ/2.
With I = 5 J half a turn takes κ = 52.8°.  Kane and Scher: half B's axis goes round a cone tilted against half A; the
turn is their integral.  The operators of this file prescribe the cone, and both motions keep a + b fixed in space.
"""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from liaisons import Operator, Parameter, Result, System, Verdict, fmu_path, max_error, run_scenario, verdict
from liaisons.models import SpatialCat

HALF_TURN = 2 * np.arccos((np.sqrt(84) - 2) / 8)  # the bend for Φ = π: 4 c² + 2 c - 5 = 0
BENDS = (0.3, 0.6, HALF_TURN, 1.3, 1.8, 2.4)
TILT, HALF_ANGLE, RATIO = 0.4, 1.1, 0.2  # the cone [rad]; J/I
DURATION, TOLERANCE = 1.0, 1e-11
QUATERNION, MOMENTA = ("q_w", "q_x", "q_y", "q_z"), ("H_x", "H_y", "H_z")


class Cone(Operator, abstract=True):
    """Half B's axis b goes round a cone, smoothly from rest to rest; in the frame of half A, whose axis is z."""

    tilt = Parameter(TILT, "rad", "angle of the cone's axis from half A's")
    half_angle = Parameter(HALF_ANGLE, "rad", "half angle of the cone; more than the tilt")
    duration = Parameter(DURATION, "s", "time of one round", above=0)

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


def fall(bend: tuple[str, dict[str, float]], azimuth: tuple[str, dict[str, float]]) -> Result:
    system = System("falling cat")
    cat = system.add("cat", fmu_path("SpatialCat"), input_reconstruction=2)
    for port, (kind, values) in (("bend", bend), ("azimuth", azimuth)):
        operator = system.add(port, fmu_path(kind), **values)
        system.connect(operator["y"], cat[port])
    return system.simulate(stop_time=DURATION, step_size=0.0025, tolerance=TOLERANCE)


def attitude(result: Result) -> Rotation:
    return Rotation.from_quat(np.array([result[f"cat.{q}"] for q in QUATERNION]).T, scalar_first=True)


def bisector(result: Result) -> NDArray:
    """Direction of a + b in space, one a sample."""
    half, chi = result["cat.bend"] / 2, result["cat.azimuth"]
    in_a = np.stack([np.sin(half) * np.sin(chi), -np.sin(half) * np.cos(chi), np.cos(half)], axis=-1)
    return attitude(result).apply(in_a)


def kane_and_scher(theta: float) -> float:
    """Their dψ/dθ, as printed."""
    T = np.cos(TILT) * np.cos(HALF_ANGLE) - np.sin(TILT) * np.sin(HALF_ANGLE) * np.cos(theta)
    S = np.cos(TILT) * np.sin(HALF_ANGLE) + np.sin(TILT) * np.cos(HALF_ANGLE) * np.cos(theta)
    S *= -np.sin(HALF_ANGLE)
    return RATIO * S * np.sqrt(2 / (1 + T)) / ((T - 1) * (1 - T + RATIO * (1 + T)))


def main(figure: Path) -> list[Verdict]:
    why = f"solver tolerance {TOLERANCE:g}; σ interpolated over 1/400 of the turn: 1e-11"
    step = {"end_value": 2 * np.pi, "duration": DURATION}
    bent = {bend: fall(("Constant", {"value": bend}), ("SmoothStep", step)) for bend in BENDS}
    verdicts = []
    for bend, result in bent.items():
        axis, phi = bisector(result)[0], SpatialCat.turn(bend)
        expected = Rotation.from_rotvec(phi * axis).as_matrix()
        claim = f"bent by {np.degrees(bend):.1f}°, once round: turned by {np.degrees(phi):.1f}° about a + b"
        error = max_error(attitude(result)[-1].as_matrix(), expected)
        verdicts.append(verdict(claim, error=error, tolerance=1e-9, reason=why))
    half = bent[HALF_TURN]
    exact = SpatialCat.exact(half.time, azimuth=half["cat.azimuth"], bend=HALF_TURN)
    path = Rotation.from_quat(np.array([exact[q] for q in QUATERNION]).T, scalar_first=True)
    error = max_error(attitude(half).as_matrix(), path.as_matrix())
    verdicts.append(verdict("the half turn, at every instant", error=error, tolerance=1e-9, reason=why))

    cone = fall((f"{__file__}:ConeBend", {}), (f"{__file__}:ConeAzimuth", {}))
    psi = quad(kane_and_scher, 0, 2 * np.pi, epsabs=1e-13)[0]
    expected = Rotation.from_rotvec(psi * bisector(cone)[0]).as_matrix()
    claim = f"Kane and Scher's cone: turned by their integral, {np.degrees(psi):.1f}°"
    error = max_error(attitude(cone)[-1].as_matrix(), expected)
    verdicts.append(verdict(claim, error=error, tolerance=1e-9, reason=why))

    everything = [*bent.values(), cone]
    error = max(max_error(bisector(r), np.broadcast_to(bisector(r)[0], (r.time.size, 3))) for r in everything)
    verdicts.append(verdict("a + b keeps its direction in space", error=error, tolerance=1e-9, reason=why))
    error = max(max_error(r["cat.energy_balance"], 0.0) for r in everything)
    reason = "10 x tolerance x energy scale 200 J x 1 s"
    verdicts.append(verdict("energy is the cat's work", error=error, tolerance=2e-8, unit="J", reason=reason))
    error = max(max_error(r["cat.com_z"], 9.81 * r.time * (1 - r.time / 2)) for r in everything)
    verdicts.append(verdict("its centre of mass falls freely", error=error, tolerance=1e-10, unit="m", reason=why))
    draw(figure, bent, cone)
    return verdicts


def draw(figure: Path, bent: dict[float, Result], cone: Result) -> None:
    plt.figure(figsize=(13, 4.4), layout="constrained")
    law, turning, poses = plt.subplot(1, 3, 1), plt.subplot(1, 3, 2), plt.subplot(1, 3, 3)
    fine = np.linspace(0.01, 3.1, 200)
    law.plot(np.degrees(fine), [np.degrees(SpatialCat.turn(bend)) for bend in fine], label="2π J c/(I s² + J c²)")
    ends = [(attitude(r)[-1].as_rotvec() @ bisector(r)[0]) % (2 * np.pi) for r in bent.values()]
    law.plot(np.degrees(list(bent)), np.degrees(ends), "ko", label="FMU")
    law.set(xlabel="bend κ [deg]", ylabel="turn Φ [deg]", title="the bend once round")
    law.legend()
    for name, result in (("Rademaker-ter Braak, 52.8°", bent[HALF_TURN]), ("Kane-Scher cone", cone)):
        turning.plot(result.time, np.degrees(azimuth_in_space(result)), label=name)
    turning.set(xlabel="t [s]", ylabel="[deg]", title="the plane of the bend turns about a + b")
    turning.legend()
    result = bent[HALF_TURN]
    back = attitude(result).apply([0, 1, 0])  # a mark on half A: the back, outside of the bend at the start
    for i in np.linspace(0, result.time.size - 1, 6).astype(int):
        place = np.array([result.time[i], 0.0])
        R, half = attitude(result)[i], result["cat.bend"][i] / 2
        e = bisector(result)[i]
        a = R.apply([0, 0, 1])
        b = 2 * np.cos(half) * e - a
        frame = np.stack([np.cross([1, 0, 0], e), e])  # seen along x, a + b to the right
        for axis, colour, sign in ((a, "tab:blue", -1), (b, "tab:orange", 1)):
            poses.plot(*np.stack([place, place + sign * 0.09 * (frame[::-1] @ axis)]).T, color=colour, linewidth=5)
        poses.arrow(*(place - 0.045 * (frame[::-1] @ a)), *(0.08 * (frame[::-1] @ back[i])), width=0.004, color="k")
    poses.set(
        aspect="equal", xlabel="t [s]", yticks=[], ylim=(-0.2, 0.2), title="the half turn: A, B, arrow on A's back"
    )
    plt.savefig(figure, dpi=150)


def azimuth_in_space(result: Result) -> NDArray:
    """Angle of the bend's plane about the bisector since the start, unwrapped."""
    e = bisector(result)[0]
    across = np.cross(attitude(result).apply([0, 0, 1]), e)
    first = across[0] / np.linalg.norm(across[0])
    return np.unwrap(np.arctan2(across @ np.cross(e, first), across @ first))


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
