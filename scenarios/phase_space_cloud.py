"""A cloud of pendulums winds itself up into a spiral, and its area in phase space stays the same: Liouville.

K 3.4, eq. 95-103, without friction; with it the area shrinks as e^(-ηt).  Far swings are slower than near ones, so the
disc is sheared more and more.  Its area is measured twice: by the polygon that the rim has become, and by the Jacobi
determinant of the flow at every member, from four neighbours each.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from liaisons import Verdict, ensemble, run_scenario, verdict
from liaisons.models import Pendulum

CENTRE, RADIUS = (1.0, 0.5), 0.8  # θ, p_θ/(m l² Ω), Ω = 1
STOP, SAMPLES, STEP, FRICTION = 60.0, 4, 0.05, 0.02
RIM, CLOUD = 20_000, 20_000
NEIGHBOUR = 1e-5


def main(figure: Path) -> list[Verdict]:
    verdicts, clouds = [], {}
    for friction in (0.0, FRICTION):
        angles = 2 * np.pi * np.arange(RIM) / RIM
        time, rim = carried(disc(angles, RADIUS), friction)
        random = np.random.default_rng(1)
        members = disc(random.uniform(0, 2 * np.pi, CLOUD), RADIUS * np.sqrt(random.random(CLOUD)))
        _, cloud = carried(members, friction)
        expected = np.exp(-friction * time)
        areas = area(rim) / (np.pi * RADIUS**2)
        lengths = np.sum(np.abs(np.diff(rim, axis=-1, append=rim[..., :1])), axis=(0, 2))
        determinants = determinant(members[:, :2000], friction)
        clouds[friction] = cloud
        title = f"η = {friction}"
        verdicts += [
            verdict(
                f"{title}: the rim, {lengths[-1] / lengths[0]:.0f} times as long, encloses e^(-ηt) of its area",
                error=float(np.max(np.abs(areas - expected))),
                tolerance=1e-5,
                reason="polygon: (2π/20000)²/6 = 2e-8, times the stretching, 25 at most, and its square where it bends",
            ),
            verdict(
                f"{title}: the Jacobi determinant of every member is e^(-ηt)",
                error=float(np.max(np.abs(determinants - expected[-1]))),
                tolerance=1e-4,
                reason="differences: (1e-5)² times third derivatives and stretching, 1e5 at most; roundings 1e-13/1e-5",
            ),
        ]
    draw(figure, clouds)
    return verdicts


def disc(angle: NDArray, radius: NDArray | float) -> NDArray:
    """Points of the cloud, (2, members)."""
    return np.array([CENTRE[0] + radius * np.cos(angle), CENTRE[1] + radius * np.sin(angle)])


def carried(points: NDArray, friction: float) -> tuple[NDArray, NDArray]:
    """Times, and where the flow has carried the points, (2, times, members)."""
    found = ensemble(
        Pendulum,
        {"theta_0": points[0], "theta_dot_0": points[1], "gravity": 1.0, "friction": friction},
        stop_time=STOP,
        step_size=STEP,
        samples=SAMPLES,
        estimate=False,
    )
    return found.time, found.values


def area(rim: NDArray) -> NDArray:
    """½ ∮ (x_1 dx_2 - x_2 dx_1) of closed polygons, one a time."""
    x, y = rim
    return np.sum(x * np.roll(y, -1, axis=-1) - np.roll(x, -1, axis=-1) * y, axis=-1) / 2


def determinant(points: NDArray, friction: float) -> NDArray:
    """det ∂(end)/∂(start) at each point, by central differences."""
    columns = []
    for axis in np.eye(2):
        shift = NEIGHBOUR * axis[:, None]
        _, ahead = carried(points + shift, friction)
        _, behind = carried(points - shift, friction)
        columns.append((ahead[:, -1] - behind[:, -1]) / (2 * NEIGHBOUR))
    (a, c), (b, d) = columns
    return a * d - b * c


def draw(figure: Path, clouds: dict[float, NDArray]) -> None:
    _, axes = plt.subplots(1, len(clouds), figsize=(13, 4.5), layout="constrained", sharey=True)
    for axis, (friction, (x, y)) in zip(axes, clouds.items(), strict=True):
        for k in range(0, SAMPLES + 1, 2):
            axis.plot(x[k], y[k], ".", markersize=0.5, label=f"{k * STOP / SAMPLES:g} s")
        axis.set(xlabel="θ [rad]", title=f"η = {friction} /s")
        axis.legend(loc="upper right", markerscale=20)
    axes[0].set_ylabel("p$_θ$/(m l² Ω)")
    plt.savefig(figure, dpi=150)


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
