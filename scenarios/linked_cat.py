"""The planar cat built from bodies and joints turns like the one whose Lagrangian was written by hand.

An operator moves the limbs of both.  The trunk of the LinkedCat turns and falls like that of the PlanarCat, whose
coordinates are those of the common centre of mass (M eq. 58).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import operator, simulate
from liaisons.scenarios import Claims, dots, panels, scenario, within

TOLERANCE = 1e-12


def limb(amplitude: float, angular_frequency: float) -> Any:
    """A limb that sets out from rest, in line with the trunk."""
    wave: dict[str, Any] = {"amplitude": amplitude, "angular_frequency": angular_frequency, "phase": np.pi / 2}
    return operator("Sinusoid", offset=-amplitude, **wave)


@scenario
def main(claim: Claims) -> None:
    moves = {"psi_1": limb(1.0, 5.0), "psi_2": limb(0.7, 7.0)}
    settings: Any = {"stop_time": 2.0, "step_size": 0.01, "tolerance": TOLERANCE, "input_reconstruction": 2}
    cat, linked = (simulate(name, **settings, **moves) for name in ("PlanarCat", "LinkedCat"))
    solver = within(1e-10, because="solver tolerance 1e-12, and the error of interpolating σ, 1e-12")
    claim("the trunk turns like that of the PlanarCat", linked["fall_angle"], cat["phi"], solver)
    limbs = 0.2 + 0.15 * np.exp(1j * cat["psi_1"]) - 0.2 - 0.15 * np.exp(1j * cat["psi_2"])
    trunk = cat["com_x"] + 1j * cat["com_z"] - limbs / 4.0 * np.exp(1j * cat["phi"])
    claim("the trunk falls like that of the PlanarCat", linked["fall_x"] + 1j * linked["fall_y"], trunk, solver)
    work = within(1e-9, "J", because="the error of the angles, times torques of 10 N m")
    claim("the operator's work is the same", linked["work"], cat["work"], work)
    claim.energy("energy", linked, tolerance=TOLERANCE)
    (axis,) = panels(("direction of the trunk", "t [s]", "φ [rad]"), size=(7, 4))
    axis.plot(linked.time, linked["fall_angle"], label="bodies and joints")
    dots(axis, cat.time, cat["phi"], every=10, label="Lagrangian by hand")
