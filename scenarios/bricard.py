"""Bricard's six rods move although Grübler's formula gives no degree of freedom; every second hinge has the same angle.

A loop of six hinges in space has 6 · 5 - 6 · 5 = 0 degrees of freedom.  If the rods lie at right angles along the edges
of a cube, one of the constraints follows from the others; it is found from the rank of the Jacobian.  Gravity moves the
rods.
"""

from __future__ import annotations

import numpy as np

from liaisons import simulate
from liaisons.models import Bricard
from liaisons.scenarios import Claims, panels, scenario, within

TOLERANCE = 1e-12


@scenario
def main(claim: Claims) -> None:
    run = simulate("Bricard", stop_time=3.0, step_size=0.01, tolerance=TOLERANCE)
    exact_count = within(0, because="a rank is a whole number")
    claim("one constraint of five is redundant", len(Bricard.redundant), 1, exact_count)
    symmetric = within(1e-7, "rad", because="tolerance 1e-12 over 3 s; errors grow where the loop is nearly flat")
    claim("hinges 1, 3, 5 turn together", [run["hinge_3"], run["hinge_5"]], run["hinge_1"], symmetric)
    claim("hinges 2 and 4 turn together", run["hinge_4"], run["hinge_2"], symmetric)
    # A closed loop of unit rods with right angles between the hinges: 1 + cos a + cos b = sum that stays.
    first, second = np.cos(run["hinge_1"]), np.cos(run["hinge_2"])
    relation = first + second + first * second
    claim("cos a + cos b + cos a cos b = 0 closes the loop", relation, 0.0, symmetric)
    claim.energy("energy", run, tolerance=TOLERANCE)
    axes = panels(("hinges", "t [s]", "angle [rad]"), ("corner", "x [m]", "z [m]"))
    for k in (1, 2):
        axes[0].plot(run.time, run[f"hinge_{k}"], label=f"hinge {k}")
    axes[1].plot(run["corner_x"], run["corner_z"])
