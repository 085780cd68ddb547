"""The action is stationary on a motion, but least only up to the first conjugate point, T < π/ω.

K 3.1, Fig. 4: eq. 76 says "Min".  The oscillator's action in a path x + ε sin(nπt/T) about an FMU's motion x is
S + ½ ε² (m T/2) ((nπ/T)² - ω²), which falls with ε for n < ωT/π.  The other way round the principle finds the motion:
Newton's method on S alone, given the two ends, meets the FMU; for ωT = kπ it finds none, or too many.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from liaisons import LiaisonsError, Verdict, analysis, fmu_path, max_error, run_scenario, simulate, verdict
from liaisons.models import Oscillator

BODY: dict[str, Any] = {"mass": 0.5, "stiffness": 2.0}
OMEGA = 2.0
START: dict[str, Any] = {"x_0": 1.0, "x_dot_0": 0.5}
TIMES = {"before": 0.75 * np.pi / OMEGA, "beyond": 1.6 * np.pi / OMEGA}  # of the first conjugate point
EPSILON = np.linspace(-0.6, 0.6, 25)
Samples = dict[str, NDArray]


def motion(duration: float, samples: int = 201) -> tuple[NDArray, Samples]:
    """Instants, and the path of the FMU."""
    step = duration / (samples - 1)
    result = simulate(fmu_path("Oscillator"), stop_time=duration, step_size=step, tolerance=1e-12, **BODY, **START)
    return result.time, {name: result[name] for name in ("x", "x_dot")}


def sine(t: NDArray, n: int) -> Samples:
    k = n * np.pi / t[-1]
    return {"x": np.sin(k * t), "x_dot": k * np.cos(k * t)}


def varied(x: Samples, change: Samples, epsilon: float) -> Samples:
    return {name: x[name] + epsilon * change[name] for name in x}


def second_variation(duration: float, n: int) -> float:
    return BODY["mass"] * duration / 2 * ((n * np.pi / duration) ** 2 - OMEGA**2)


def claims(label: str, duration: float) -> list[Verdict]:
    t, x = motion(duration)
    series = {n: analysis.action(Oscillator, t, x, sine(t, n), **BODY) for n in (1, 2, 3)}
    S = series[1].action
    parabola = [analysis.action(Oscillator, t, varied(x, sine(t, 1), e), **BODY).action - S for e in EPSILON]
    t, x = t[::2], {name: samples[::2] for name, samples in x.items()}
    found = analysis.stationary_path(Oscillator, t, joined(t, x), **BODY)
    return [
        verdict(
            f"{label} π/ω: δS = 0 for n = 1, 2, 3",
            error=max(abs(s.first) for s in series.values()),
            tolerance=1e-8,
            unit="J.s",
            reason="interpolation of the samples, (nπ/200)⁴/720 times an action of 1 J.s",
        ),
        verdict(
            f"{label} π/ω: δ²S = ½ m T ((nπ/T)² - ω²)",
            error=max(abs(s.second - second_variation(duration, n)) for n, s in series.items()),
            tolerance=1e-6,
            unit="J.s",
            reason="interpolation of the sine, (nπ/200)⁴/720 times a δ²S of 30 J.s",
        ),
        verdict(
            f"{label} π/ω: S(ε) is this parabola, {'least' if label == 'before' else 'largest'} at ε = 0 for n = 1",
            error=max_error(parabola, EPSILON**2 / 2 * second_variation(duration, 1)),
            tolerance=1e-8,
            unit="J.s",
            reason="as δS",
        ),
        verdict(
            f"{label} π/ω: Newton's method on S meets the FMU",
            error=max_error(found.path["x"], x["x"]),
            tolerance=1e-7,
            unit="m",
            reason="spline of fourth order, (ω h)⁴/384 = 2e-8, amplified by 1/sin ωT < 2",
        ),
        verdict(
            f"{label} π/ω: S falls in as many directions as conjugate points were passed, {found.index}",
            error=abs(found.index - int(OMEGA * duration / np.pi)),
            tolerance=0.0,
            reason="a count",
        ),
    ]


def joined(t: NDArray, x: Samples) -> Samples:
    """The straight line between the ends of a path, a first guess."""
    speed = (x["x"][-1] - x["x"][0]) / t[-1]
    return {"x": x["x"][0] + speed * t, "x_dot": np.full_like(t, speed)}


def is_refused(duration: float) -> bool:
    t, x = motion(duration, 41)
    try:
        analysis.stationary_path(Oscillator, t, joined(t, x), **BODY)
    except LiaisonsError as error:
        return "conjugate" in str(error)
    return False


def main(figure: Path) -> list[Verdict]:
    verdicts = [claim for label, duration in TIMES.items() for claim in claims(label, duration)]
    verdicts.append(
        verdict(
            "ends with ωT = π, 2π, 3π are refused as conjugate",
            error=sum(not is_refused(k * np.pi / OMEGA) for k in (1, 2, 3)),
            tolerance=0.0,
            reason="a count",
        )
    )
    draw(figure)
    return verdicts


def draw(figure: Path) -> None:
    _, axes = plt.subplots(1, 3, figsize=(13, 4), layout="constrained")
    for axis, (label, duration) in zip(axes[1:], TIMES.items(), strict=True):
        t, x = motion(duration)
        for n, colour in ((1, "tab:red"), (2, "tab:green"), (3, "tab:purple")):
            S = [analysis.action(Oscillator, t, varied(x, sine(t, n), e), **BODY).action for e in EPSILON]
            axis.plot(EPSILON, S, color=colour, label=f"n = {n}")
            if label == "before":
                for epsilon in (-0.2, 0.2):
                    axes[0].plot(t, varied(x, sine(t, n), epsilon)["x"], "--", color=colour, linewidth=1)
        phase = OMEGA * duration / np.pi
        axis.set(xlabel="ε [m]", ylabel="S [J.s]", title=f"{label} the conjugate point: ωT = {phase:g} π")
        axis.legend()
        if label == "before":
            axes[0].plot(t, x["x"], color="tab:blue", linewidth=2.5, label="motion of the FMU")
    axes[0].set(xlabel="t [s]", ylabel="x [m]", title="Fig. 4: the motion and its variations")
    axes[0].legend()
    plt.savefig(figure, dpi=150)


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
