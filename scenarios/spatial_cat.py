"""A falling cat without angular momentum turns over if its bend goes round once: Φ = 2π J c/(I s² + J c²).

M 8.2, the motion of Rademaker and ter Braak: the cat is bent by κ, the direction of the bend goes round once, and there
is no twist; c, s = cos, sin of κ/2.  I and J are the moments of inertia of a half across and about its axis; with I = 5
J half a turn needs κ = 52.8°.  The bisector a + b of the axes of both halves is fixed in space.  Scenario ``cone_cat``
has the motion of Kane and Scher.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from liaisons import Result, operator, simulate
from liaisons.models import SpatialCat
from liaisons.scenarios import Claims, panels, scenario, within

HALF_TURN = SpatialCat.bend_for(np.pi)
BENDS = (0.3, 0.6, HALF_TURN, 1.3, 1.8, 2.4)
TOLERANCE = 1e-11


def attitude(q: Any) -> Rotation:
    return Rotation.from_quat(np.transpose([q[name] for name in ("q_w", "q_x", "q_y", "q_z")]), scalar_first=True)


def bisector(run: Result) -> NDArray:
    """Direction of a + b in space, one a sample."""
    return attitude(run).apply(SpatialCat.bisector(run["bend"], run["azimuth"]))


def azimuth_in_space(run: Result) -> NDArray:
    """Angle of the bend's plane about the bisector since the start, unwrapped."""
    e = bisector(run)[0]
    across = np.cross(attitude(run).apply([0, 0, 1]), e)
    first = across[0] / np.linalg.norm(across[0])
    return np.unwrap(np.arctan2(across @ np.cross(e, first), across @ first))


@scenario
def main(claim: Claims) -> None:
    law, turning = panels(
        ("the bend once round", "bend κ [deg]", "turn Φ [deg]"),
        ("the plane of the bend turns about a + b", "t [s]", "angle [deg]"),
    )
    why = f"errors at solver tolerance {TOLERANCE:g}, and of σ interpolated over 1/400 of the turn, 1e-11"
    solver = within(1e-9, because=why)
    runs, fixed, fallen = [], [], []
    for bend in BENDS:
        motion: Any = {
            "bend": operator("Constant", value=bend),
            "azimuth": operator("SmoothStep", end_value=2 * np.pi, duration=1.0),
        }
        run = simulate("SpatialCat", stop_time=1.0, step_size=0.0025, tolerance=TOLERANCE, **motion)
        e, phi = bisector(run), SpatialCat.turn(bend)
        expected = Rotation.from_rotvec(phi * e[0]).as_matrix()
        text = f"bent by {np.degrees(bend):.1f}°, once round: turned by {np.degrees(phi):.1f}° about a + b"
        claim(text, attitude(run)[-1].as_matrix(), expected, solver)
        found = (attitude(run)[-1].as_rotvec() @ e[0]) % (2 * np.pi)
        law.plot(np.degrees(bend), np.degrees(found), "ko", label="FMU" if bend == BENDS[0] else None)
        turning.plot(run.time, np.degrees(azimuth_in_space(run)), label=f"κ = {np.degrees(bend):.1f}°")
        runs.append(run)
        fixed.append(e - e[0])
        fallen.append(run["com_z"])
        if bend == HALF_TURN:
            path = attitude(SpatialCat.exact(run.time, azimuth=run["azimuth"], bend=bend))
            claim("the half turn, at every instant", attitude(run).as_matrix(), path.as_matrix(), solver)
    claim("the direction of a + b in space is constant", fixed, 0.0, solver)
    claim.energy("the energy is the cat's work", *runs, tolerance=TOLERANCE)
    t = runs[0].time
    claim("the centre of mass falls freely", fallen, 9.81 * t * (1 - t / 2), within(1e-10, "m", because=why))
    fine = np.linspace(0.01, 3.1, 200)
    law.plot(np.degrees(fine), [np.degrees(SpatialCat.turn(bend)) for bend in fine], label="2π J c/(I s² + J c²)")
