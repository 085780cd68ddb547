"""A bead runs on a hoop on the shaft of a free flywheel: momentum and energy of both together are constant.

The hoop's port β receives the flywheel's angle, and its torque λ = dp_β/dt (M eq. 27) is returned as the flywheel's
load.  With the moment of the tangent a = R + d cos ψ and b = d² sin² ψ (ψ = ξ/R), the momentum and energy of both
together,

    p_β = m a (ξ' + a β') + (I + I_f + m b) β',    E = ½ m (ξ' + a β')² + ½ (I + I_f + m b) β'²    (M eq. 61, 62)

are constant.  This leaves one equation of first order for ξ, which is the reference.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import System
from liaisons.models import CircularHoop
from liaisons.scenarios import Claims, dots, panels, scenario, within

OFFSET, INERTIA, WHEEL, TOLERANCE = 0.5, 0.1, 0.3, 1e-11  # d [m], I and I_f [kg.m2]; R = 1 m, m = 1 kg
HOOP: Any = {"offset": OFFSET, "hoop_inertia": INERTIA, "xi_0": 0.0, "xi_dot_0": 1.5}


@scenario
def main(claim: Claims) -> None:
    system = System("hoop and flywheel")
    hoop = system.add("hoop", "CircularHoop", **HOOP)
    wheel = system.add("wheel", "Flywheel", inertia=WHEEL, angle_dot_0=0.0)
    system.connect(wheel["angle"], hoop["beta"])
    run = system.simulate(20.0, 0.01, tolerance=TOLERANCE)

    xi, turn = run["hoop.xi"], run["wheel.angle_dot"]
    a, whole = 1 + OFFSET * np.cos(xi), INERTIA + WHEEL + (OFFSET * np.sin(xi)) ** 2
    momentum = a * (run["hoop.xi_dot"] + a * turn) + whole * turn
    energy, handed = (run[f"hoop.{name}"] + run[f"wheel.{name}"] for name in ("energy", "work"))
    why = f"solver tolerance {TOLERANCE:g}, and errors H⁴/720 of the torque, amplified less than 100-fold in 20 s"
    claim("the total angular momentum is constant", np.ptp(momentum), 0.0, within(1e-8, "kg.m2/s", because=why))
    claim("the total energy is constant", np.ptp(energy), 0.0, within(1e-8, "J", because=why))
    claim("the work done on one FMU is taken from the other", handed, 0.0, within(1e-8, "J", because=why))
    one = CircularHoop.on_a_free_shaft(run.time, shaft_inertia=WHEEL, **HOOP)
    claim("ξ agrees with one system", xi, one["xi"], within(1e-7, "m", because=why))
    claim("β agrees with one system", run["wheel.angle"], one["beta"], within(1e-7, "rad", because=why))

    motion, parts = panels(("motion", "t [s]", "ξ [m], β [rad]"), ("its parts", "t [s]", "angular momentum [kg.m2/s]"))
    motion.plot(run.time, xi, label="ξ, bead")
    motion.plot(run.time, run["wheel.angle"], label="β, flywheel")
    dots(motion, run.time, one["xi"], label="one system")
    parts.plot(run.time, WHEEL * turn, label="flywheel")
    parts.plot(run.time, momentum - WHEEL * turn, label="hoop and bead")
    parts.plot(run.time, momentum, "k", label="both")
