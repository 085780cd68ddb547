"""The vector field of a bead on a moving hoop has three parts: free motion, a force from K_Y, and the connection.

M eq. 52, D_Y = D_0 - X_K + H(Y), with the terms of eq. 65-67 for the hoop, Y = β', in the coordinates ξ and p_ξ:

    D_0 = (p_ξ/m, 0)        H(Y) = (-a Y, a' p_ξ Y)        -X_K = (0, ½ m b' Y²)

On a circle whose centre is at the distance d from O, a = R + d cos ξ/R and b = d² sin² ξ/R.  A FourierSeries shakes the
hoop; at every communication point the three terms add up to the derivatives of the FMU.  At a given (ξ, p_ξ) they are
also read off the FMU one by one: as its field at rest, and as the parts that are odd and even in Y.  The terms that
``analysis`` derives from the Lagrangian of a hoop of any shape agree.  If the hoop turns about the centre of the
circle, -X_K vanishes, as for a swing or a cat.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.patches import Circle
from numpy.typing import NDArray

from liaisons import Result, analysis, operator, simulate
from liaisons.models import CircularHoop, FourierHoop
from liaisons.scenarios import Claims, panels, scenario, within

OFFSET = 0.5  # d [m], R = 1 m, m = 1 kg
BENT = {"radius": 1.2, "cos_1": 0.25, "sin_2": 0.15, "cos_3": -0.1}
STATES = ((0.3, 1.0), (1.9, -0.8), (3.3, 2.0), (5.0, 0.0))  # (ξ, p_ξ)


def field(xi: float, p: float, rate: float) -> NDArray:
    """(ξ', p_ξ') of the FMU at one state."""
    xi_dot = p - (1 + OFFSET * np.cos(xi)) * rate
    start: Any = {"xi_0": xi, "xi_dot_0": xi_dot, "beta_dot": rate, "offset": OFFSET}
    return simulate("CircularHoop", stop_time=1e-3, record=["xi_dot", "p_xi_dot"], **start).values[:, 0]


def shake(hoop: str, q: str, **body: Any) -> Result:
    beta = operator("FourierSeries", angular_frequency=1.0, sin_1=1.2, cos_2=0.5, sin_3=-0.2)
    record = [q, f"{q}_dot", f"p_{q}", f"p_{q}_dot", "beta_dot", "bead_x", "bead_y"]
    settings: Any = {"stop_time": 15.0, "step_size": 0.02, "tolerance": 1e-10, "record": record}
    return simulate(hoop, beta=beta, **settings, **body)


@scenario
def main(claim: Claims) -> None:
    identity = within(1e-12, "m/s, N", because="an identity at every state: rounding errors of terms of about 10")
    off = shake("CircularHoop", "xi", xi_dot_0=0.4, offset=OFFSET)
    parts = CircularHoop.dynamic_field(off["xi"], off["p_xi"], off["beta_dot"], offset=OFFSET)
    rates, total = [off["xi_dot"], off["p_xi_dot"]], np.sum(list(parts.values()), axis=0)
    claim("circle off its centre, M eq. 65-67: the three terms add up to the FMU's field", total, rates, identity)
    bent = shake("FourierHoop", "theta", theta_dot_0=0.4, **BENT)
    state = {name: bent[name] for name in ("theta", "p_theta", "beta_dot")}
    derived = analysis.dynamic_field(FourierHoop).evaluate(**state, **BENT)[[0, 2]]  # θ and p_θ, without β
    own = [bent["theta_dot"], bent["p_theta_dot"]]
    claim("bent hoop, by analysis: the three terms add up to the FMU's field", derived, own, identity)

    still, forth, back = (np.transpose([field(xi, p, Y) for xi, p in STATES]) for Y in (0.0, 1.7, -1.7))
    expected = CircularHoop.dynamic_field(*np.transpose(STATES), 1.7, offset=OFFSET)
    text = "circle: {} is the part of the FMU's field {}"
    claim(text.format("D_0", "at rest"), still, expected["D_0"], identity)
    claim(text.format("H(Y)", "odd in Y"), (forth - back) / 2, expected["H(Y)"], identity)
    claim(text.format("-X_K", "even in Y, beyond that at rest"), (forth + back) / 2 - still, expected["-X_K"], identity)

    p_xi = shake("CircularHoop", "xi", xi_dot_0=0.4, offset=0.0)["p_xi"]
    rounding = "its rate consists of rounding errors of terms of about 10, which do not add up over 15 s"
    centred = "circle about its centre: -X_K = 0 and a' = 0, so that p_ξ is constant"
    claim(centred, p_xi, p_xi[0], within(1e-12, "kg.m/s", because=rounding))

    path, *axes = panels(
        ("a hoop, shaken about O (+)", "x [m]", "y [m]"),
        ("what drives it: the three terms of M eq. 52", "", "ξ' [m/s]"),
        ("", "t [s]", "p$_ξ$' [N]"),
        mosaic="ab;ac",
        size=(14, 5),
        width_ratios=[1, 2.4],
    )
    path.add_patch(Circle((OFFSET, 0), 1, fill=False, linewidth=2, label="the hoop at β = 0"))
    path.plot(off["bead_x"], off["bead_y"], linewidth=0.7, label="path of the bead")
    path.plot(0, 0, "k+")
    path.set(aspect="equal")
    for row, axis in enumerate(axes):
        for (term, part), colour in zip(parts.items(), ("tab:gray", "tab:blue", "tab:red"), strict=True):
            axis.plot(off.time, part[row], color=colour, linewidth=1.2, label=f"${term}$" if row else None)
        axis.plot(off.time, rates[row], color="k", linewidth=0.8, label="FMU" if row else None)
