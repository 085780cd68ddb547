"""The phase portrait of the pendulum: closed orbits in an incompressible flow; friction shrinks volumes as e^(-ηt).

K Ex. 8, Fig. 5 and 6, in x_1 = θ and x_2 = p_θ/(m l² Ω), Ω = 1; K 3.4, eq. 95-103.  Released at θ = 10 the pendulum
swings about 4π.  Liouville's theorem is shown twice: by the area of a patch of phase space, whose rim 128 FMUs carry
along, and by the determinant of the Jacobi matrix from the variational equations.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from liaisons import Result, Verdict, analysis, fmu_path, max_error, run_scenario, simulate, verdict
from liaisons.models import Pendulum

FAR, NEAR = 10.0, 1.0  # x_1(0) of Fig. 5 and of Fig. 6
CENTRE, RADIUS, RIM = 1.0, 0.5, 128  # the patch and the points of its rim
DURATION, FRICTION = 8.0, 0.15
FRICTIONS = (0.0, FRICTION)


@cache
def pendulum() -> Path:
    """Looked up once, not for every point of a rim."""
    return fmu_path("Pendulum")


def run(theta: float, theta_dot: float = 0.0, stop_time: float = DURATION, friction: float = 0.0) -> Result:
    return simulate(
        pendulum(),
        stop_time=stop_time,
        step_size=0.1,
        tolerance=1e-10,
        record=["theta", "p_theta", "theta_dot", "theta_ddot", "energy"],
        gravity=1.0,
        theta_0=theta,
        theta_dot_0=theta_dot,
        friction=friction,
    )


def carried(friction: float) -> NDArray[np.complex128]:
    """The rim of the patch as the flow carries it, x_1 + i x_2; (rim, time)."""
    rim = CENTRE + RADIUS * np.exp(2j * np.pi * np.arange(RIM) / RIM)
    results = [run(point.real, point.imag, friction=friction) for point in rim]
    return np.array([result["theta"] + 1j * result["p_theta"] for result in results])


def area(rim: NDArray) -> NDArray:
    """½ ∮ (x_1 dx_2 - x_2 dx_1) = π Σ k |c_k|² in the Fourier coefficients of the rim; one number a time."""
    coefficients = np.fft.fft(rim, axis=0) / len(rim)
    return np.pi * np.fft.fftfreq(len(rim), 1 / len(rim)) @ np.abs(coefficients) ** 2


def main(figure: Path) -> list[Verdict]:
    far, near = run(FAR, stop_time=40.0), run(NEAR, stop_time=40.0)
    first_integral = {x: r["p_theta"] ** 2 / 2 - np.cos(r["theta"]) for x, r in ((FAR, far), (NEAR, near))}
    field = analysis.phase_velocity(Pendulum).evaluate(theta=far["theta"], p_theta=far["p_theta"], gravity=1.0)
    time = np.linspace(0, DURATION, round(DURATION / 0.1) + 1)
    rims = {eta: carried(eta) for eta in FRICTIONS}
    areas = {eta: area(rim) for eta, rim in rims.items()}
    flows = {eta: analysis.flow(Pendulum, DURATION, theta=CENTRE, gravity=1.0, friction=eta) for eta in FRICTIONS}
    verdicts = [
        verdict(
            "the FMU moves along the velocity field V(X)",
            error=max_error([far["theta_dot"], far["theta_ddot"]], field),
            tolerance=1e-13,
            unit="1/s, 1/s2",
            reason="two evaluations of the same equations at the same states: roundings",
        ),
        verdict(
            "V is that of K eq. 104, 105",
            error=max_error(field, [far["p_theta"], -np.sin(far["theta"])]),
            tolerance=1e-13,
            reason="roundings",
        ),
        verdict(
            "released at 10 it swings about 4π, between 10 and 8π - 10",
            error=abs(max(far["theta"]) - (8 * np.pi - FAR)) + abs(min(far["theta"]) - FAR),
            tolerance=2 * 0.05**2 * np.sin(8 * np.pi - FAR) / 2 + 1e-7,
            unit="rad",
            reason="the turning points lie up to half a step beside a sample, θ'' (h/2)²/2",
        ),
        verdict(
            "orbits are closed: x_2²/2 - cos x_1 is constant on both",
            error=max(max_error(values, -np.cos(x)) for x, values in first_integral.items()),
            tolerance=40 * 10 * 1e-10,
            reason="10 x tolerance 1e-10 x time",
        ),
    ]
    verdicts += [
        verdict(
            f"η = {eta}: the area of a patch goes as e^(-ηt)",
            error=max_error(areas[eta] / (np.pi * RADIUS**2), np.exp(-eta * time)),
            tolerance=1e-7,
            reason="relative; the rim's Fourier series ends at k = 64, tolerance 1e-10, amplification below 100",
        )
        for eta in FRICTIONS
    ]
    verdicts += [
        verdict(
            f"η = {eta}: det J = e^(-ηt) by the variational equations",
            error=abs(flows[eta].determinant / np.exp(-eta * DURATION) - 1),
            tolerance=1e-9,
            reason="integration at 1e-11, entries of J below 10",
        )
        for eta in FRICTIONS
    ]
    _, axes = plt.subplots(2, 2, figsize=(10, 8), layout="constrained")
    draw_portrait(axes[0, 0], far, np.sin, "Fig. 5: pendulum", (8, 17, 2.4))
    draw_portrait(axes[0, 1], near, np.asarray, "Fig. 6: pendulum in the linearised field", (-1.6, 1.6, 1.3))
    draw_patches(axes[1, 0], rims)
    for eta, colour in zip(FRICTIONS, ("tab:blue", "tab:red"), strict=True):
        axes[1, 1].plot(time, areas[eta], color=colour, label=f"FMUs, η = {eta} /s")
        axes[1, 1].plot(time[::8], np.pi * RADIUS**2 * np.exp(-eta * time[::8]), "k.", markersize=5)
    axes[1, 1].set(xlabel="t [s]", ylabel="area of the patch", ylim=(0, None), title="dots: π ρ² e^(-ηt)")
    axes[1, 1].legend()
    plt.savefig(figure, dpi=150)
    return verdicts


def draw_portrait(
    axis: Axes, orbit: Result, force: Callable[[NDArray], NDArray], title: str, extent: tuple[float, float, float]
) -> None:
    """Velocity field (x_2, -force(x_1)), the linear one with force(x_1) = x_1, and an orbit of the FMU."""
    left, right, height = extent
    x_1, x_2 = np.meshgrid(np.linspace(left, right, 19), np.linspace(-height, height, 15))
    axis.quiver(x_1, x_2, x_2, -force(x_1), angles="xy", color="0.6", width=0.003)
    axis.plot(orbit["theta"], orbit["p_theta"], color="tab:blue")
    if force is not np.sin:
        turn = np.linspace(0, 2 * np.pi, 100)
        axis.plot(np.cos(turn), np.sin(turn), "--", color="tab:purple", label="linearised")
        axis.legend(loc="upper right")
    axis.set(xlabel="x₁ = θ", ylabel="x₂ = p/(m l² Ω)", title=title)


def draw_patches(axis: Axes, rims: dict[float, NDArray[np.complex128]]) -> None:
    for (eta, rim), colour in zip(rims.items(), ("tab:blue", "tab:red"), strict=True):
        for k in range(0, rim.shape[1], 20):
            at = rim[:, k]
            axis.fill(at.real, at.imag, color=colour, alpha=0.3, label=f"η = {eta} /s" if k == 0 else None)
            if eta == 0:
                axis.annotate(f"{k / 10:g} s", (at.real.mean(), at.imag.mean()), ha="center")
    axis.set(xlabel="x₁", ylabel="x₂", title="a patch of phase space on its way", ylim=(-2, 1.5))
    axis.legend(loc="lower right")


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
