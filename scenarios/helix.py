"""A charge in a uniform magnetic field moves on a helix; with an electric field across it, it drifts at E∧B/B².

K Ex. 4 and Fig. 3 (Ω = QB/m = 1 rad/s, start at the origin with velocity (1, 0, 0.1)).  The canonical momenta of the
FMU are those of the symmetric gauge, p = m r' + Q B∧r/2: they change although the speed, the guiding centre and the
angular momentum (r∧p)_z do not.  Two charges of opposite sign and unequal mass drift alike.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from liaisons import Result, Verdict, fmu_path, max_error, run_scenario, simulate, verdict
from liaisons.models import ChargedParticle

TURNS = 2 * np.pi  # period of a turn for Ω = 1 [s]
START = {"x_dot_0": 1.0, "z_dot_0": 0.1}
ELECTRIC = {"E_x": 0.0, "E_y": 0.3, "E_z": 0.0}
CHARGES = {"Q = 1 C, m = 1 kg": {}, "Q = -1 C, m = 2 kg": {"charge": -1.0, "mass": 2.0}}


def run(stop_time: float, **starts: Any) -> Result:
    return simulate(
        fmu_path("ChargedParticle"), stop_time=stop_time, step_size=TURNS / 200, tolerance=1e-10, **START, **starts
    )


def example_4(t: NDArray) -> dict[str, NDArray]:
    """K's solution as printed, for Ω = 1 and the start of Fig. 3."""
    return {"x": np.sin(t), "y": np.cos(t) - 1, "z": 0.1 * t}


def main(figure: Path) -> list[Verdict]:
    helix = run(10 * TURNS)
    reason = "10 x solver tolerance 1e-10; no amplification, the equations are linear with constant coefficients"
    verdicts = [
        verdict(
            f"{axis}(t) is that of K Ex. 4",
            error=max_error(helix[axis], values),
            tolerance=1e-9,
            unit="m",
            reason=reason,
        )
        for axis, values in example_4(helix.time).items()
    ]
    momenta = [np.array([helix[form.format(axis)] for axis in "xyz"]) for form in ("p_{}", "kinetic_momentum_{}")]
    r = np.array([helix[axis] for axis in "xyz"])
    kept = {
        "speed": np.linalg.norm(momenta[1], axis=0),
        "guiding centre across the field": helix["guiding_centre_x"] + 1j * helix["guiding_centre_y"],
        "(r∧p)_z with canonical p": np.cross(r, momenta[0], axis=0)[2],
    }
    verdicts += [
        verdict(f"{name} is constant", error=float(np.max(np.abs(values - values[0]))), tolerance=1e-9, reason=reason)
        for name, values in kept.items()
    ]
    gauge = np.array([-helix["y"], helix["x"], 0 * helix["z"]]) / 2  # Q A for Q = B_z = 1
    verdicts.append(
        verdict(
            "canonical minus kinetic momentum is Q B∧r/2",
            error=max_error(momenta[0] - momenta[1], gauge),
            tolerance=1e-14,
            unit="kg.m/s",
            reason="algebra: a few roundings of numbers of size 1",
        )
    )

    drifting = {name: run(20 * TURNS, **charge, **ELECTRIC) for name, charge in CHARGES.items()}
    drift = ChargedParticle.drift(**ELECTRIC)
    for name, result in drifting.items():
        # After whole turns of both charges, those of the heavier one taking twice as long, the turning is gone.
        shift = np.array([result[axis][-1] - result[axis][0] for axis in "xy"])
        verdicts.append(
            verdict(
                f"{name}: mean velocity across B is E∧B/B² = ({drift[0]:g}, {drift[1]:g}) m/s",
                error=max_error(shift / result.time[-1], drift[:2]),
                tolerance=1e-9,
                unit="m/s",
                reason="1e-9 m of the trajectory, over 126 s, and a rounding of the instant",
            )
        )
    draw(figure, helix, drifting)
    return verdicts


def draw(figure: Path, helix: Result, drifting: dict[str, Result]) -> None:
    canvas = plt.figure(figsize=(11, 4.5), layout="constrained")
    spiral = canvas.add_subplot(1, 2, 1, projection="3d")
    shown = helix.time <= 5 * TURNS
    spiral.plot(*(helix[axis][shown] for axis in "xyz"), color="tab:purple", label="FMU")
    spiral.plot(*example_4(helix.time[shown][::10]).values(), "k.", markersize=3, label="K Ex. 4")
    spiral.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title="K Fig. 3: Ω = 1 rad/s, v(0) = (1, 0, 0.1) m/s")
    spiral.set(xticks=[-1, 0, 1], yticks=[-2, -1, 0], zticks=[0, 1, 2, 3])
    spiral.legend(loc="upper left")
    plane = canvas.add_subplot(1, 2, 2)
    for name, result in drifting.items():
        shown = result.time <= 4 * TURNS
        (line,) = plane.plot(result["x"][shown], result["y"][shown], label=name)
        centre = [result[f"guiding_centre_{axis}"][shown] for axis in "xy"]
        plane.plot(*centre, "--", color=line.get_color())
    plane.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title="E = 0.3 V/m along y: both drift along x (dashed)")
    plane.set_ylim(top=4.2)  # room for the legend
    plane.legend(loc="upper left")
    plt.savefig(figure, dpi=150)


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
