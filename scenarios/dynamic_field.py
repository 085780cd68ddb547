"""The motion of a bead on a moving hoop is the sum of three fields: free motion, the hoop's energy, connection.

M eq. 52, D_Y = D_0 - X_K + H(Y), with the terms of eq. 65-67 for the hoop, Y = β', in the coordinates ξ and p_ξ:

    D_0 = (p_ξ/m, 0)        H(Y) = (-a Y, a' p_ξ Y)        -X_K = (0, ½ m b' Y²)

On a circle, centre at d from O, a = R + d cos ξ/R, b = d² sin² ξ/R.  A FourierSeries shakes it; at every communication
point the three terms add up to the FMU's own derivatives.  At a given (ξ, p_ξ) the FMU shows them one by one: its
field at rest, and what is odd and even in Y.  The terms that the analysis derives from the Lagrangian of a hoop of any
shape do the same.  About the centre of the circle -X_K vanishes, as for a swing or a cat.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Circle
from numpy.typing import ArrayLike, NDArray

from liaisons import Result, System, Verdict, analysis, fmu_path, max_error, run_scenario, simulate, verdict
from liaisons.models import FourierHoop

OFFSET = 0.5  # d [m], R = 1 m, m = 1 kg
BENT = {"radius": 1.2, "cos_1": 0.25, "sin_2": 0.15, "cos_3": -0.1}
SHAKING = {"angular_frequency": 1.0, "sin_1": 1.2, "cos_2": 0.5, "sin_3": -0.2}
STATES = ((0.3, 1.0), (1.9, -0.8), (3.3, 2.0), (5.0, 0.0))  # (ξ, p_ξ)
REASON = "an identity at every state: roundings of terms of size 10"
Terms = dict[str, NDArray]  # D_0, H(Y), -X_K, each with rows for ξ and p_ξ


def printed(xi: ArrayLike, p: ArrayLike, Y: ArrayLike) -> Terms:
    """M eq. 65-67 for the circle."""
    xi, p, Y = np.broadcast_arrays(xi, p, Y)
    a, a_dash, b_dash = 1 + OFFSET * np.cos(xi), -OFFSET * np.sin(xi), OFFSET**2 * np.sin(2 * xi)
    zero = np.zeros_like(p)
    fields = {"D_0": (p, zero), "H(Y)": (-a * Y, a_dash * p * Y), "-X_K": (zero, b_dash * Y**2 / 2)}
    return {name: np.array(field) for name, field in fields.items()}


def taken_apart(xi: float, p: float, Y: float) -> Terms:
    """The three terms at one state, from FMUs at rest and turning either way."""

    def field(rate: float) -> NDArray:
        xi_dot = p - (1 + OFFSET * np.cos(xi)) * rate
        start: dict[str, Any] = {"xi_0": xi, "xi_dot_0": xi_dot, "beta_dot": rate, "offset": OFFSET}
        run = simulate(fmu_path("CircularHoop"), stop_time=1e-3, record=["xi_dot", "p_xi_dot"], **start)
        return run.values[:, 0]

    still, forth, back = field(0.0), field(Y), field(-Y)
    return {"D_0": still, "H(Y)": (forth - back) / 2, "-X_K": (forth + back) / 2 - still}


def shake(fmu: str, coordinate: str, **start: Any) -> Result:
    system = System("shaken hoop")
    hoop = system.add("hoop", fmu_path(fmu), input_reconstruction=2, **start)
    motor = system.add("operator", fmu_path("FourierSeries"), **SHAKING)
    system.connect(motor["y"], hoop["beta"])
    names = [coordinate, f"{coordinate}_dot", f"p_{coordinate}", f"p_{coordinate}_dot", "beta_dot", "bead_x", "bead_y"]
    return system.simulate(15.0, 0.02, tolerance=1e-10, record=[f"hoop.{name}" for name in names])


def main(figure: Path) -> list[Verdict]:
    off = shake("CircularHoop", "xi", xi_dot_0=0.4, offset=OFFSET)
    parts = printed(off["hoop.xi"], off["hoop.p_xi"], off["hoop.beta_dot"])
    bent = shake("FourierHoop", "theta", theta_dot_0=0.4, **BENT)
    state = {name: bent[f"hoop.{name}"] for name in ("theta", "p_theta", "beta_dot")}
    derived = analysis.dynamic_field(FourierHoop).evaluate(**state, **BENT)[[0, 2]]  # θ and p_θ, without β
    about = shake("CircularHoop", "xi", xi_dot_0=0.4, offset=0.0)
    rates = np.array([off["hoop.xi_dot"], off["hoop.p_xi_dot"]])
    verdicts = [
        verdict(
            f"{hoop}: the three terms add up to the FMU's field",
            error=max_error(total, field),
            tolerance=1e-12,
            unit="m/s, N",
            reason=REASON,
        )
        for hoop, total, field in (
            ("circle off its centre, M eq. 65-67", np.sum(list(parts.values()), axis=0), rates),
            ("bent hoop, by analysis", derived, np.array([bent["hoop.theta_dot"], bent["hoop.p_theta_dot"]])),
        )
    ]
    states = [(taken_apart(xi, p, 1.7), printed(xi, p, 1.7)) for xi, p in STATES]
    for name, meaning in {"D_0": "at rest", "H(Y)": "odd in Y", "-X_K": "even in Y, beyond that at rest"}.items():
        errors = [max_error(found[name], expected[name]) for found, expected in states]
        claim = f"circle: {name} is the part of the FMU's field {meaning}"
        verdicts.append(verdict(claim, error=max(errors), tolerance=1e-12, unit="m/s, N", reason=REASON))
    verdicts.append(
        verdict(
            "circle about its centre: -X_K = 0 and a' = 0, so that p_ξ is constant",
            error=max_error(about["hoop.p_xi"], about["hoop.p_xi"][0]),
            tolerance=1e-12,
            unit="kg.m/s",
            reason="its rate is made of roundings of terms of size 10, which do not add up over 15 s",
        )
    )
    draw(figure, off, parts, rates)
    return verdicts


def draw(figure: Path, result: Result, parts: Terms, rates: NDArray) -> None:
    axes = plt.figure(figsize=(14, 4.6), layout="constrained").subplot_mosaic(
        [["path", "xi"], ["path", "p"]], width_ratios=[1, 2.4]
    )
    axes["path"].add_patch(Circle((OFFSET, 0), 1, fill=False, linewidth=2, label="the hoop at β = 0"))
    axes["path"].plot(result["hoop.bead_x"], result["hoop.bead_y"], linewidth=0.7, label="path of the bead")
    axes["path"].plot(0, 0, "k+")
    axes["path"].set(
        aspect="equal", xlabel="x [m]", ylabel="y [m]", ylim=(-1.7, 2.2), title="a hoop, shaken about O (+)"
    )
    axes["path"].legend(loc="upper center", ncols=2, fontsize="small")
    colours = {"D_0": "tab:gray", "H(Y)": "tab:blue", "-X_K": "tab:red"}
    for row, (name, label) in enumerate({"xi": "ξ' [m/s]", "p": "p$_ξ$' [N]"}.items()):
        for term, part in parts.items():
            axes[name].plot(result.time, part[row], color=colours[term], linewidth=1.2, label=f"${term}$")
        axes[name].plot(result.time, rates[row], color="k", linewidth=0.8, label="FMU")
        axes[name].set_ylabel(label)
    axes["xi"].set_title("what drives it: the three terms of M eq. 52")
    axes["xi"].legend(loc="upper right", ncols=4, fontsize="small")
    axes["xi"].set_ylim(top=1.45 * axes["xi"].get_ylim()[1])
    axes["p"].set_xlabel("t [s]")
    plt.savefig(figure, dpi=150)


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
