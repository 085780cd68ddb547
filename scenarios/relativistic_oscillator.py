"""The period of a mass on a spring near the speed of light grows with the amplitude, up to that of a light ray.

L = -m c² √(1 - (x' + σ')²/c²) - k x²/2 is not T - V with a T quadratic in the rates, but it is hyper-regular (M 3): the
FMU solves p = ∂L/∂x' for the velocity.  The period is compared with a quadrature of E = γ m c² + k x²/2.  While an
operator shakes the other end of the spring, the motion is compared with the equation of y = x + σ, derived by hand: d(γ
m y')/dt = -k (y - σ).
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from scipy.integrate import quad, solve_ivp

from liaisons import ActiveCoordinate, Coordinate, Mechanism, Parameter, operator, simulate
from liaisons.scenarios import Claims, panels, scenario, within

AMPLITUDES = np.array([0.1, 0.3, 1.0, 2.0, 4.0, 8.0])  # [m]; m, k and c are 1
SHAKEN: Any = {"amplitude": 0.3, "angular_frequency": 2.0}


class RelativisticOscillator(Mechanism):
    """Point mass of special relativity on a spring whose other end, the support, is moved."""

    mass = Parameter(1.0, "kg", "rest mass", above=0)
    light = Parameter(1.0, "m/s", "speed of light", above=0)
    stiffness = Parameter(1.0, "N/m", "stiffness of the spring", minimum=0)
    x = Coordinate("m", "elongation of the spring", start=1.0)
    support = ActiveCoordinate("m", "position of the support")

    def lagrangian(self) -> ca.SX:
        beta = self.dot(self.x + self.support) / self.light
        return -self.mass * self.light**2 * ca.sqrt(1 - beta**2) - self.stiffness / 2 * self.x**2


def quarter_period(amplitude: float) -> float:
    """Time from x = 0 to x = A, by x = A sin φ in dx/dt = c √(1 - 1/γ²) with γ - 1 = k (A² - x²)/2 m c² [s]."""

    def slowness(phi: float) -> float:
        gained = (amplitude * np.cos(phi)) ** 2 / 2
        return amplitude * np.cos(phi) * (1 + gained) / np.sqrt(gained * (2 + gained))

    return quad(slowness, 0, np.pi / 2, epsabs=1e-14, epsrel=1e-13)[0]


@scenario
def main(claim: Claims) -> None:
    motions, growth = panels(
        ("the larger the amplitude, the straighter", "t [s]", "x / amplitude"),
        ("the period", "amplitude [m]", "period [s]"),
    )
    quarters = np.array([quarter_period(a) for a in AMPLITUDES])
    settings: Any = {"tolerance": 1e-12}
    for amplitude, quarter in zip(AMPLITUDES.tolist(), quarters, strict=True):
        run = simulate(RelativisticOscillator, x_0=amplitude, stop_time=5 * quarter, step_size=quarter / 40, **settings)
        reason = within(1e-10 * amplitude, "m", because="100 times the solver tolerance 1e-12 of the amplitude")
        claim(f"amplitude {amplitude:g} m: at 0 after 1, 3, 5 quarters", run["x"][[40, 120, 200]], 0.0, reason)
        motions.plot(run.time, run["x"] / amplitude, label=f"{amplitude:g} m")
    growth.plot(AMPLITUDES, 4 * quarters, "k.", label="quadrature")
    growth.plot(AMPLITUDES, 4 * AMPLITUDES, label="light, 4 A/c")
    growth.axhline(2 * np.pi, linestyle="--", label="Newton, 2π √(m/k)")

    run = simulate(
        RelativisticOscillator, support=operator("Sinusoid", **SHAKEN), stop_time=20.0, step_size=0.02, **settings
    )
    sigma = 0.3 * np.sin(2 * run.time)
    start = [1.0, 0.6 / 0.8]  # y and γ m y', as the spring starts with the speed of the support, 0.6 c

    def rates(t: float, y: np.ndarray) -> list[float]:
        return [y[1] / np.hypot(1, y[1]), 0.3 * np.sin(2 * t) - y[0]]

    y, _ = solve_ivp(rates, (0, 20), start, "DOP853", run.time, rtol=1e-13, atol=1e-13).y
    shaken = within(1e-9, "m", because="errors at tolerance 1e-12 and of inputs of sixth order; they grow with time")
    claim("shaken: x + σ moves by the equation derived by hand", run["x"] + sigma, y, shaken)
    force = within(1e-9, "N", because="k times the error of the position")
    claim("the operator's force is the spring's", run["support_force"], sigma - y, force)
    balance = within(1e-10, "J", because="100 times the solver tolerance 1e-12")
    claim("E(t) - E(0) is the operator's work", run["energy"] - run["energy"][0], run["work"], balance)
