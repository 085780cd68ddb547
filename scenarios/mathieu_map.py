"""A pendulum on a shaken pivot is unstable in tongues, which Mathieu's characteristic values a_m, b_m bound.

M 8.1(a), K Ex. 3.  With the pivot at z = (ε/2) cos 2t and l = 1 m small swings obey Mathieu's equation,

    θ'' + (δ - 2ε cos 2t) θ = 0,    δ = g in m/s²

Over a period T = π the motion is a matrix of determinant 1 (Floquet).  It is bounded while |trace| < 2, that is,
between a_m and b_(m+1), and otherwise grows as e^(μt), cosh μT = |trace|/2.  The matrix is obtained from two runs near
the equilibrium of a Pendulum that a Sinusoid shakes, in a sweep of FMUs.  If the weight points upwards, δ < 0, this is
the pendulum that stands on its pivot, and shaking can make it stable.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from liaisons import System, operator, sweep
from liaisons.models import Pendulum
from liaisons.scenarios import Claims, panels, scenario, within

PERIOD = np.pi
NEAR = 1e-5  # start [rad, rad/s]; what is not linear is of relative size NEAR²
STIFFNESS, DEPTH = np.linspace(-1.45, 9.8, 25), np.linspace(0.1, 4.1, 13)  # δ, ε


def monodromy(delta: NDArray, epsilon: NDArray) -> NDArray:
    """(θ, θ') after one period, per unit of each of them at its beginning; shape (points, 2, 2)."""
    system = System("shaken pendulum")
    system.add("swing", "Pendulum", pivot_z=operator("Sinusoid", angular_frequency=2.0, phase=np.pi / 2))
    cases = {
        "swing.gravity": np.repeat(delta, 2),
        "swing_pivot_z.amplitude": np.repeat(epsilon / 2, 2),
        "swing.theta_0": np.tile([NEAR, 0.0], delta.size),
        "swing.theta_dot_0": np.tile([0.0, NEAR], delta.size),
    }
    keep = ["swing.theta", "swing.theta_dot"]
    table = sweep(system, cases, keep, stop_time=PERIOD, step_size=PERIOD / 40, tolerance=1e-12)
    return np.stack([table[name] for name in keep], axis=-1).reshape(-1, 2, 2).swapaxes(1, 2) / NEAR


@scenario
def main(claim: Claims) -> None:
    matrices = monodromy(np.tile(STIFFNESS, DEPTH.size), np.repeat(DEPTH, STIFFNESS.size))
    traces = np.trace(matrices, axis1=1, axis2=2).reshape(DEPTH.size, STIFFNESS.size)
    stable = np.abs(traces) < 2
    expected = Pendulum.shaken_is_bounded(STIFFNESS, DEPTH[:, None] / 2, angular_frequency=2.0)
    nearest = within(
        0.0, because=f"a whole number; the nearest trace differs from 2 by {np.min(np.abs(np.abs(traces) - 2)):.2g}"
    )
    claim(f"{traces.size} points of the map are stable or unstable as a_m and b_m predict", stable, expected, nearest)
    depths = np.array([0.5, 1.0, 2.0])
    curves = Pendulum.shaken_edges(depths / 2, angular_frequency=2.0, count=3)  # a_0, b_1, a_1, ...
    found = [np.trace(monodromy(curve, depths), axis1=1, axis2=2) for curve in curves]
    signs = [[2 * (-1.0) ** ((i + 1) // 2)] for i in range(len(curves))]
    linear = "ten times the solver tolerance 1e-12 of angles of 1 rad, divided by NEAR"
    claim("on the curves a_0 ... a_3, b_1 ... b_3 the trace is 2 (-1)^m", found, signs, within(1e-6, because=linear))
    area = (np.linalg.det(matrices) - 1) / np.sum(matrices**2, axis=(1, 2))
    squares = within(1e-6, because=f"relative to the squares of the entries; {linear}")
    claim("the determinant is 1 everywhere (Liouville)", area, 0.0, squares)
    upright = np.count_nonzero((STIFFNESS < 0) & stable)
    text = f"{upright} points with δ < 0 are stable: the pendulum stands on its pivot"
    claim(text, upright > 0, True, within(0.0, because="true or false"))

    (axis,) = panels(("θ'' + (δ - 2ε cos 2t) θ = 0", "δ", "ε"), size=(8, 5))
    growth = np.arccosh(np.maximum(np.abs(traces) / 2, 1)) / PERIOD
    colours = axis.pcolormesh(STIFFNESS, DEPTH, np.where(growth > 0, growth, np.nan), cmap="viridis_r")
    axis.figure.colorbar(colours, label="growth rate μ from FMUs [1/s]; white: bounded")
    epsilon = np.linspace(0, DEPTH[-1], 200)
    for i, curve in enumerate(Pendulum.shaken_edges(epsilon / 2, angular_frequency=2.0, count=3)):
        axis.plot(curve, epsilon, "k--" if i % 2 else "k", linewidth=1, label=("a$_m$", "b$_m$")[i] if i < 2 else None)
    axis.axvline(0, color="tab:gray", linewidth=0.6)
    axis.set(xlim=STIFFNESS[[0, -1]])
