"""Liouville's theorem: a moving patch of phase space keeps its area; with friction, the area shrinks as e^(-ηt).

K 3.4, eq. 95-103, for the pendulum in x_1 = θ and x_2 = p_θ/(m l² Ω), Ω = 1.  This is shown in two ways: by the area of
a patch whose rim consists of 128 motions of the FMU, and by the determinant of the Jacobian from the variational
equations.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from liaisons import analysis, simulate
from liaisons.models import Pendulum
from liaisons.scenarios import Claims, dots, panels, scenario, within

CENTRE, RADIUS, RIM = 1.0, 0.5, 128  # the patch and the points of its rim
DURATION = 8.0


def carried(friction: float) -> NDArray:
    """The rim of the patch as the flow carries it, x_1 + i x_2; (rim, time)."""
    found = []
    for point in CENTRE + RADIUS * np.exp(2j * np.pi * np.arange(RIM) / RIM):
        start = {"theta_0": point.real, "theta_dot_0": point.imag, "gravity": 1.0, "friction": friction}
        run = simulate("Pendulum", stop_time=DURATION, step_size=0.1, tolerance=1e-10, **start)  # type: ignore[arg-type]
        found.append(run["theta"] + 1j * run["p_theta"])
    return np.array(found)


@scenario
def main(claim: Claims) -> None:
    patch, law = panels(
        ("a patch of phase space on its way", "x$_1$", "x$_2$"), ("area of the patch", "t [s]", "π ρ² e$^{-ηt}$")
    )
    fourier = "relative; the rim's Fourier series ends at k = 64; tolerance 1e-10, amplified less than 100-fold"
    variational = within(1e-9, because="error of integration at tolerance 1e-11, for entries of J below 10")
    time = np.linspace(0, DURATION, 81)
    for eta, colour in ((0.0, "tab:blue"), (0.15, "tab:red")):
        rim = carried(eta)
        # ½ ∮ (x_1 dx_2 - x_2 dx_1) = π Σ k |c_k|² in the Fourier coefficients of the rim
        area = np.pi * np.fft.fftfreq(RIM, 1 / RIM) @ np.abs(np.fft.fft(rim, axis=0) / RIM) ** 2
        expected, whole = np.exp(-eta * time), np.pi * RADIUS**2
        claim(f"η = {eta}: the area of a patch falls as e^(-ηt)", area / whole, expected, within(1e-7, because=fourier))
        flow = analysis.flow(Pendulum, DURATION, theta=CENTRE, gravity=1.0, friction=eta)
        text = f"η = {eta}: det J = e^(-ηt) by the variational equations"
        claim(text, flow.determinant / expected[-1], 1.0, variational)
        for k in range(0, time.size, 20):
            x_1, x_2 = np.real(rim[:, k]), np.imag(rim[:, k])
            patch.fill(x_1, x_2, color=colour, alpha=0.3, label=f"η = {eta} /s" if k == 0 else None)
            if eta == 0.0:
                patch.annotate(f"{time[k]:g} s", (x_1.mean(), x_2.mean()), ha="center")
        law.plot(time, area, color=colour, label=f"FMUs, η = {eta} /s")
        dots(law, time, whole * expected, every=8)
    law.set(ylim=(0, None))
