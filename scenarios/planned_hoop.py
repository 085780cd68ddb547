"""A turning hoop carries its bead from one end of the ellipse over the top to the other, with the least ∫ β''² dt.

M 8.4 with M 2: at a constant β' = Ω the bead can rest at either end of the long axis; between them is an unstable
equilibrium, at u = π/2.  With s² = a² sin² u + b² cos² u, the motion is s² u'' = -½ (a² - b²) sin 2u (u'² + β'²) - a b
β'', derived by hand here.  The extremal that reaches the other end at rest is found by shooting backwards from there
with Hamilton's equations.  Its costates are the derivatives of the cost with respect to the end, dJ/d(end), which the
plan has as multipliers.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from liaisons import hamiltonian_flow, plan
from liaisons.scenarios import Claims, dots, panels, scenario, within

LONG, SHORT, OMEGA, DURATION = 2.0, 1.0, 1.0, 4.0
END = {"u": np.pi, "u_dot": 0.0, "beta_dot": OMEGA}


def hamiltonian(*z: Any) -> Any:
    """Of (u, u', β', cost) and their costates, the best β'' = -by/(2 p_cost) put in."""
    u, v, w, _, p_u, p_v, p_w, p_cost = z
    s_squared = LONG**2 * np.sin(u) ** 2 + SHORT**2 * np.cos(u) ** 2
    falling = (LONG**2 - SHORT**2) * np.sin(2 * u) * (v**2 + w**2) / (2 * s_squared)
    by = p_w - p_v * LONG * SHORT / s_squared
    return p_u * v - p_v * falling - by**2 / (4 * p_cost)


def back(costates: NDArray, times: Any) -> NDArray:
    """The extremal, as long before its end as the times say."""
    return hamiltonian_flow(lambda *z: -hamiltonian(*z), [*END.values(), 0, *costates, -1], times)


@scenario
def main(claim: Claims) -> None:
    bead, hoop = panels(("over the top", "t [s]", "u [rad]"), ("as the hoop turns", "t [s]", "β' [rad/s]"))
    ellipse: Any = {"semi_axis_a": LONG, "semi_axis_b": SHORT}
    start: Any = {"u": 0, "u_dot": 0, "beta_dot": OMEGA}
    motion = plan("EllipticHoop", start=start, end=END, duration=DURATION, minimize="beta_ddot**2", **ellipse)
    prices = np.array([motion.multipliers[name] for name in END])
    shot: Any = root(lambda p: back(p, DURATION)[:3] - [0, 0, OMEGA], prices, tol=1e-14)
    shooting = within(1e-9, because="relative error; the mesh is of tenth order, the shooting has tolerance 1e-13")
    claim("the least cost, by shooting", -back(shot.x, DURATION)[3] / motion.cost, 1.0, shooting)
    claim("the multipliers are the costates at the end", prices / shot.x, 1.0, shooting)
    run = motion.replay()
    exact = back(shot.x, DURATION - run.time[::-1])[:, ::-1]
    replay = within(1e-8, because="error of the mesh, and solver tolerance 1e-12")
    claim("the FMUs move bead and hoop as planned", run, dict(zip(END, exact, strict=False)), replay)
    claim.verdicts += motion.verify()
    for axis, name in ((bead, "u"), (hoop, "beta_dot")):
        axis.plot(run.time, run[name], label="FMU")
        dots(axis, run.time, exact[list(END).index(name)], label="shooting")
    bead.axhline(np.pi / 2, linestyle=":", label="the top")
