"""A ball that falls onto a table: its bounces, where they end, and bouncing in step with a table that is shaken."""

import numpy as np
from numpy.typing import NDArray

from liaisons.closed_forms import Values, closed_form


def _impacts(end: float, at: Values) -> tuple[NDArray, NDArray]:
    """Instants [s] and speeds [m/s] of the impacts until ``end``, or until the ball is at rest to rounding."""
    speed = np.sqrt(at.height_dot_0**2 + 2 * at.gravity * (at.height_0 - at.table))
    instants, speeds = [(at.height_dot_0 + speed) / at.gravity], [speed]
    while instants[-1] <= end and at.bounce * speeds[-1] > 1e-17 * speed:
        speeds.append(at.bounce * speeds[-1])
        instants.append(instants[-1] + 2 * speeds[-1] / at.gravity)
    return np.array(instants), np.array(speeds)


@closed_form("the instant [s] at which the ball comes to rest on a table at rest", gravity="> 0", bounce="< 1")
def rests_at(at: Values) -> float:
    """Return the instant: √(2h/g) (1 + e)/(1 - e) for a drop from h, as each flight takes e times the one before."""
    instants, speeds = _impacts(-1.0, at)
    return float(instants[0] + 2 * speeds[0] * at.bounce / (at.gravity * (1 - at.bounce)))


@closed_form(
    "the motion above a table at rest: parabolas, infinitely many of them in a finite time",
    gravity="> 0",
    height_0=">= table",
    table_dot="== 0",
)
def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
    instants, speeds = _impacts(np.max(t), at)
    count = np.searchsorted(instants, t, side="right")  # of the impacts so far
    rests = t >= (rests_at(at) if at.bounce < 1 else np.inf)
    last = np.maximum(count - 1, 0)
    falls = count == 0
    since = np.where(falls, t, t - instants[last])
    up = np.where(rests, 0.0, np.where(falls, at.height_dot_0, at.bounce * speeds[last]))
    height = np.where(falls, at.height_0, at.table) + (up - at.gravity / 2 * since) * since
    lost = at.mass / 2 * (speeds[0] ** 2 - up**2)
    return {
        "height": np.where(rests, at.table, height),
        "height_dot": np.where(rests, 0.0, up - at.gravity * since),
        "gap_force": np.where(rests, at.mass * at.gravity, 0.0),
        "impact_loss": np.where(falls, 0.0, lost),
    }


# ---- on a table that is shaken, A sin ωt, with Γ = Aω²/g -----------------------------------------------------------


@closed_form("the instant [s] at which a ball at rest leaves the table A sin ωt: sin ωt = 1/Γ, never for Γ <= 1")
def leaves_at(at: Values, *, amplitude: float, angular_frequency: float) -> float:
    ratio = amplitude * angular_frequency**2 / at.gravity
    return float(np.arcsin(1 / ratio) / angular_frequency) if ratio > 1 else np.inf


@closed_form("the range of Γ in which bouncing once a period of the table is stable", gravity="> 0")
def period_one_range(at: Values) -> tuple[float, float]:
    """Return the smallest and the largest Γ, from the stability of the map of an impact (t, v) to the next.

    δt and δv are deviations from bouncing in step.  In step the flight of T = 2π/ω ends with the speed w = gT/2 it
    began with: w - ż = e (w + ż), ż = Aω cos φ, so that Γ cos φ = π (1 - e)/(1 + e), and w + ż = gT/(1 + e).  The next
    impact is where the table is met:
    δt' = δt + (1 + e)/g δv.  There v' = (1 + e) ż - e (v - gτ), so that δv' = (1 + e) z̈ δt' - eδv + eg (δt' - δt).
    This matrix has determinant e² and trace 1 + e² - (1 + e)² Γ sin φ.  |trace| < 1 + determinant is
    0 < Γ sin φ < 2 (1 + e²)/(1 + e)²: born where φ = 0, lost where a multiplier is -1, and the period doubles.
    """
    e = at.bounce
    in_step = np.pi * (1 - e) / (1 + e)
    return in_step, float(np.hypot(in_step, 2 * (1 + e**2) / (1 + e) ** 2))


@closed_form("bouncing once a period of the table A sin ωt, stable or not", gravity="> 0")
def period_one(at: Values, *, amplitude: float, angular_frequency: float) -> tuple[float, float]:
    """Return the phase φ of the table at the impacts [rad], sin φ > 0, and the ball's speed after each [m/s]."""
    cosine = period_one_range(at=at)[0] * at.gravity / (amplitude * angular_frequency**2)
    at.require(cosine <= 1, f"amplitude = {amplitude}: a table so slow throws no ball that high")
    return float(np.arccos(cosine)), float(np.pi * at.gravity / angular_frequency)
