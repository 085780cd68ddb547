"""A falling cat without angular momentum turns by moving its limbs: by an area in the space of shapes, at any speed.

M 8.2.  Two FourierSeries drive the limbs of a PlanarCat three times round a circle of shapes while its centre of mass
flies along a parabola (M eq. 59).  However long that takes, the trunk turns by the holonomy of the kinetic connection
(M 7), -3 ∮ (J_1 dψ_1 + J_2 dψ_2)/I = -3 ∬ curvature dψ_1 dψ_2; the circle is chosen so that this is half a turn.  Run
through backwards the loop turns the cat the other way, and a path that is retraced turns it not at all.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import casadi as ca
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from scipy.optimize import brentq

from liaisons import Result, System, Verdict, analysis, fmu_path, max_error, run_scenario, verdict
from liaisons.models import PlanarCat

CAT = {"arm_1": 0.25, "arm_2": 0.25}  # longer limbs than by default
CENTRE = (np.pi / 2, -np.pi / 2)  # of the circle of shapes: both limbs stretched to the same side
ROUNDS = 3
FALL = 0.9  # duration of the jump [s]
LEAP = 4.5  # its horizontal speed [m/s]
DURATIONS = (FALL, 3.0, 10.0)  # of the three rounds; the longer ones are for weightless cats
CONNECTION = analysis.kinetic_connection(PlanarCat)
REASON = "solver tolerance 1e-10, no amplification; σ interpolated over a 100th of a round, 1e-12"


def circle(r: float) -> Callable[[ca.SX], dict[str, ca.SX]]:
    return lambda a: {"psi_1": CENTRE[0] + r * ca.cos(a), "psi_2": CENTRE[1] + r * ca.sin(a)}


@cache
def radius() -> float:
    """Of the circle that turns the cat by half a turn in three rounds."""

    def excess(r: float) -> float:
        return ROUNDS * analysis.holonomy(PlanarCat, circle(r), **CAT)["phi"] + np.pi

    return float(brentq(excess, 0.5, 2.0, xtol=1e-14))  # type: ignore[arg-type]


def fall(duration: float, *, retrace: bool = False, backwards: bool = False) -> Result:
    """Three rounds of the circle, or to and fro on its diameter, from rest: no angular momentum."""
    frequency = (-1 if backwards else 1) * 2 * np.pi * ROUNDS / duration
    psi_2 = {"cos_1": radius()} if retrace else {"sin_1": radius()}
    shape = {"psi_1": CENTRE[0] + radius(), "psi_2": CENTRE[1] + psi_2.get("cos_1", 0.0)}
    spin = CONNECTION.evaluate(**shape, **CAT)[2, 1] * psi_2.get("sin_1", 0.0) * frequency
    start: dict[str, Any] = {"phi_dot_0": spin, "com_z_dot_0": 9.81 * FALL / 2, "com_x_dot_0": LEAP, **CAT}
    system = System("falling cat")
    cat = system.add("cat", fmu_path("PlanarCat"), phi_0=np.pi, input_reconstruction=2, **start)
    for i, motion in enumerate(({"cos_1": radius()}, psi_2), 1):
        series = {"offset": CENTRE[i - 1], "angular_frequency": frequency, **motion}
        system.connect(system.add(f"limb_{i}", fmu_path("FourierSeries"), **series)["y"], cat[f"psi_{i}"])
    return system.simulate(duration, duration / ROUNDS / 100, tolerance=1e-10)


def main(figure: Path) -> list[Verdict]:
    results = {duration: fall(duration) for duration in DURATIONS}
    turns = {f"three rounds in {duration:g} s": result for duration, result in results.items()}
    turns |= {"backwards": fall(FALL, backwards=True), "a path that is retraced": fall(FALL, retrace=True)}
    expected = dict.fromkeys(turns, -np.pi) | {"backwards": np.pi, "a path that is retraced": 0.0}
    area = analysis.curvature_integral(PlanarCat, circle(radius()), **CAT)["phi"]
    verdicts = [
        verdict(
            "the line integral of the connection is the area integral of its curvature",
            error=abs(area + np.pi / ROUNDS),
            tolerance=1e-10,
            unit="rad",
            reason="integration at 1e-12 over one turn, 24 Gauss nodes a radius",
        )
    ]
    for name, result in turns.items():
        verdicts.append(
            verdict(
                f"{name}: the trunk turns by {np.degrees(expected[name]):.0f}°",
                error=abs(result["cat.phi"][-1] - result["cat.phi"][0] - expected[name]),
                tolerance=1e-8,
                unit="rad",
                reason=REASON,
            )
        )
    shown = results[FALL]
    exact = PlanarCat.exact(shown.time, com_x_dot_0=LEAP, com_z_dot_0=9.81 * FALL / 2)
    verdicts += [
        verdict(
            "the centre of mass flies along a parabola",
            error=max(max_error(shown[f"cat.{q}"], exact[q]) for q in ("com_x", "com_z")),
            tolerance=1e-12,
            unit="m",
            reason="a polynomial of second degree: roundings of 1 m over some hundred steps",
        ),
        verdict(
            "the angular momentum stays 0",
            error=max_error(shown["cat.angular_momentum"], 0.0),
            tolerance=1e-14,
            unit="kg.m2/s",
            reason="φ is cyclic; roundings of the parts, some 0.5 kg.m2/s each",
        ),
    ]
    draw(figure, results)
    return verdicts


def draw(figure: Path, results: dict[float, Result]) -> None:
    _, axes = plt.subplot_mosaic("ff;st", figsize=(10, 8), layout="constrained")
    flight, shapes, turn = (axes[panel] for panel in "fst")
    result = results[FALL]
    com = result["cat.com_x"] + 1j * result["cat.com_z"]
    for i in np.linspace(0, len(result.time) - 1, 10).astype(int):
        draw_cat(flight, *(float(result[f"cat.{q}"][i]) for q in ("phi", "psi_1", "psi_2")), com=complex(com[i]))
    flight.plot(result["cat.com_x"], result["cat.com_z"], color="tab:gray", linewidth=0.8, zorder=0)
    flight.set(aspect="equal", xlabel="x [m]", ylabel="z [m]", title=f"a jump of {FALL} s, without angular momentum")

    grid = np.linspace(-np.pi, np.pi, 200)
    psi_1, psi_2 = np.meshgrid(grid, grid, indexing="ij")
    curvature = analysis.curvature(PlanarCat).evaluate(psi_1=psi_1, psi_2=psi_2, **CAT)[2]
    picture = shapes.pcolormesh(psi_1, psi_2, -curvature, cmap="RdBu", rasterized=True)
    plt.colorbar(picture, ax=shapes, label="curvature")
    shapes.plot(result["limb_1.y"], result["limb_2.y"], "k", linewidth=1)
    shapes.set(aspect="equal", xlabel="ψ$_1$ [rad]", ylabel="ψ$_2$ [rad]", title="the loop in the space of shapes")

    for (duration, run), width in zip(results.items(), (5, 2.5, 1), strict=True):
        turn.plot(run.time / duration * ROUNDS, np.degrees(run["cat.phi"]), linewidth=width, label=f"in {duration:g} s")
    turn.axhline(0, color="k", linewidth=0.6, linestyle="--")
    turn.set(xlabel="rounds", ylabel="φ [deg]", title="the trunk turns by π, at any speed")
    turn.legend()
    plt.savefig(figure, dpi=150)


def draw_cat(axes: Axes, phi: float, psi_1: float, psi_2: float, *, com: complex) -> None:
    """Trunk and limbs as rods: red at its front end, blue at its back end."""
    parameters = {p.name: p.start for p in PlanarCat.parameters} | CAT
    trunk = parameters["hinge"] * np.exp(1j * phi)
    limbs = parameters["arm_1"] * np.exp(1j * (phi + psi_1)), -parameters["arm_2"] * np.exp(1j * (phi + psi_2))
    centre = parameters["mass_1"] * (trunk + limbs[0]) + parameters["mass_2"] * (limbs[1] - trunk)
    origin = com - centre / (parameters["mass_0"] + parameters["mass_1"] + parameters["mass_2"])
    rods = ((origin - trunk, 2 * trunk, "k", 3), (origin + trunk, 1.6 * limbs[0], "tab:red", 1.5))
    for begin, rod, color, width in (*rods, (origin - trunk, 1.6 * limbs[1], "tab:blue", 1.5)):
        ends = np.array([begin, begin + rod])
        axes.plot(np.real(ends), np.imag(ends), color=color, linewidth=width, solid_capstyle="round")


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
