"""The action is stationary along a motion, but a minimum only up to the first conjugate point, T < π/ω.

K 3.1, Fig. 4: eq. 76 says "Min".  The oscillator's action in a path x + ε sin(nπt/T) about an FMU's motion x is S + ½
ε² (m T/2) ((nπ/T)² - ω²), which falls with ε for n < ωT/π.  Conversely, the principle finds the motion: Newton's method
on S alone, with both ends given, agrees with the FMU; for ωT = kπ there is no solution, or there are many.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from liaisons import LiaisonsError, analysis, simulate
from liaisons.models import Oscillator
from liaisons.scenarios import Claims, panels, scenario, within

BODY: Any = {"mass": 0.5, "stiffness": 2.0}
OMEGA = 2.0
TIMES = {"before": 0.75 * np.pi / OMEGA, "beyond": 1.6 * np.pi / OMEGA}  # of the first conjugate point
EPSILON = np.linspace(-0.6, 0.6, 25)
Path = dict[str, NDArray]  # x, x_dot


def motion(T: float, samples: int = 201) -> tuple[NDArray, Path]:
    """Instants, and the path of the FMU."""
    step = T / (samples - 1)
    run = simulate("Oscillator", stop_time=T, step_size=step, tolerance=1e-12, x_0=1.0, x_dot_0=0.5, **BODY)
    return run.time, {name: run[name] for name in ("x", "x_dot")}


def varied(t: NDArray, path: Path, n: int, epsilon: float = 1.0) -> Path:
    """The path and ε sin(nπt/T)."""
    k = n * np.pi / t[-1]
    return {"x": path["x"] + epsilon * np.sin(k * t), "x_dot": path["x_dot"] + epsilon * k * np.cos(k * t)}


def stationary(t: NDArray, path: Path) -> Any:
    """What Newton's method finds between the ends of a path, from the straight line on."""
    speed = (path["x"][-1] - path["x"][0]) / t[-1]
    line = {"x": path["x"][0] + speed * t, "x_dot": np.full_like(t, speed)}
    return analysis.stationary_path(Oscillator, t, line, **BODY)


def is_refused(T: float) -> bool:
    try:
        stationary(*motion(T, 41))
    except LiaisonsError as error:
        return "conjugate" in str(error)
    return False


@scenario
def main(claim: Claims) -> None:
    paths, *axes = panels(
        ("Fig. 4: the motion and its variations", "t [s]", "x [m]"),
        ("before the conjugate point: ωT = 0.75 π", "ε [m]", "S [J.s]"),
        ("beyond the conjugate point: ωT = 1.6 π", "ε [m]", "S [J.s]"),
    )
    first = within(1e-8, "J.s", because="error of interpolating the samples: (nπ/200)⁴/720 times an action of 1 J.s")
    second = within(1e-6, "J.s", because="error of interpolating the sine: (nπ/200)⁴/720 times a δ²S of 30 J.s")
    spline = within(1e-7, "m", because="error of the spline, (ω h)⁴/384 = 2e-8, amplified by 1/sin ωT < 2")
    count = within(0.0, because="a whole number")
    modes, still = np.array([1, 2, 3]), {"x": np.zeros(201), "x_dot": np.zeros(201)}
    for axis, (label, T) in zip(axes, TIMES.items(), strict=True):
        t, x = motion(T)
        series = [analysis.action(Oscillator, t, x, varied(t, still, n), **BODY) for n in modes]
        S = {n: [analysis.action(Oscillator, t, varied(t, x, n, e), **BODY).action for e in EPSILON] for n in modes}
        expected = BODY["mass"] * T / 2 * ((modes * np.pi / T) ** 2 - OMEGA**2)
        claim(f"{label} π/ω: δS = 0 for n = 1, 2, 3", [s.first for s in series], 0.0, first)
        claim(f"{label} π/ω: δ²S = ½ m T ((nπ/T)² - ω²)", [s.second for s in series], expected, second)
        text = f"{label} π/ω: S(ε) is this parabola, {'least' if label == 'before' else 'largest'} at ε = 0 for n = 1"
        claim(text, np.array(S[1]) - series[0].action, EPSILON**2 / 2 * expected[0], first)
        found = stationary(t[::2], {name: samples[::2] for name, samples in x.items()})
        claim(f"{label} π/ω: Newton's method on S meets the FMU", found.path["x"], x["x"][::2], spline)
        passed = f"{label} π/ω: S falls in as many directions as conjugate points were passed, {found.index}"
        claim(passed, found.index, int(OMEGA * T / np.pi), count)
        for n, colour in zip(modes, ("tab:red", "tab:green", "tab:purple"), strict=True):
            axis.plot(EPSILON, S[n], color=colour, label=f"n = {n}")
            for epsilon in (-0.2, 0.2) if label == "before" else ():
                paths.plot(t, varied(t, x, n, epsilon)["x"], "--", color=colour)
        if label == "before":
            paths.plot(t, x["x"], label="motion of the FMU")
    refused = [is_refused(k * np.pi / OMEGA) for k in modes]
    claim("ends with ωT = π, 2π, 3π are refused as conjugate", refused, True, count)
