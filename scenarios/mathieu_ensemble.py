"""An ensemble of a hundred thousand shaken pendulums gives the stability map, which Mathieu's a_m and b_m bound.

K Ex. 3, M 8.1.  With the pivot at z = (ε/2) cos 2t and l = 1 m, small swings obey θ'' + (δ - 2ε cos 2t) θ = 0, δ = g in
m/s².  Over the period π of the pivot the motion is a matrix of determinant 1; the motion is bounded where |trace| < 2.
The ensemble integrates the equations of the FMU, and two members give the matrix at each point of the map.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from liaisons import ensemble, grid
from liaisons.models import Pendulum, Sinusoid
from liaisons.scenarios import Claims, panels, scenario, within

STIFFNESS, DEPTH = np.linspace(-2.0, 10.0, 400), np.linspace(0.02, 4.0, 250)  # δ, ε
NEAR = 1e-9  # start [rad, rad/s]; what is not linear is of relative size NEAR²


def monodromy() -> tuple[NDArray, NDArray]:
    """Matrix (start, θ or θ', δ, ε) of a period, and the largest error of its entries (δ, ε)."""
    points = grid({"gravity": STIFFNESS, "pivot_z.amplitude": DEPTH / 2})
    entries, errors = [], []
    for start in ({"theta_0": NEAR, "theta_dot_0": 0.0}, {"theta_0": 0.0, "theta_dot_0": NEAR}):
        found = ensemble(
            Pendulum,
            {**points, **start, "pivot_z.angular_frequency": 2.0, "pivot_z.phase": np.pi / 2},
            stop_time=np.pi,
            step_size=np.pi / 80,
            operators={"pivot_z": Sinusoid},
            record=["theta", "theta_dot"],
        )
        entries.append(found.values[:, -1] / NEAR)
        errors.append(np.maximum(found.error("theta"), found.error("theta_dot")) / NEAR)
    shape = STIFFNESS.size, DEPTH.size
    return np.reshape(entries, (2, 2, *shape)), np.max(errors, axis=0).reshape(shape)


@scenario
def main(claim: Claims) -> None:
    matrix, error = monodromy()
    trace, size = matrix[0, 0] + matrix[1, 1], np.max(np.abs(matrix), axis=(0, 1))
    # What Mathieu's functions say, and how far a point is from the nearest boundary, in δ.
    edges = Pendulum.shaken_edges(DEPTH / 2, angular_frequency=2.0)
    inside = Pendulum.shaken_is_bounded(STIFFNESS[:, None], DEPTH / 2, angular_frequency=2.0)
    near = np.min(np.abs(edges[:, None, :] - STIFFNESS[:, None]), axis=0)
    wrong = (np.abs(trace) < 2) != inside
    why = "δ of the farthest point on the wrong side; an error of 1e-10 of the trace moves edges of tongues by 1e-6"
    text = f"{trace.size} points are stable or unstable as a_m and b_m predict"
    claim(text, np.max(near[wrong], initial=0.0), 0.0, within(1e-6, because=why))
    determinant = matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0]
    products = within(4e-10, because="relative to products of entries, each with the error of the next claim")
    claim("area in phase space is conserved: the determinant is 1", (determinant - 1) / size**2, 0.0, products)
    why = "relative error of 80 steps of order 8, frequencies below 4.3 /s: (4.3 π/80)^8 = 7e-7 times about 1e-6"
    claim("steps twice as long give the same matrix", error / size, 0.0, within(1e-10, because=why))

    (axis,) = panels(("θ'' + (δ - 2ε cos 2t) θ = 0", "δ", "ε"), size=(8, 5))
    growth = np.arccosh(np.maximum(np.abs(trace) / 2, 1)) / np.pi
    filled = axis.pcolormesh(STIFFNESS, DEPTH, growth.T, cmap="magma_r", shading="auto")
    axis.figure.colorbar(filled, label="rate of growth [1/s]; bounded where it is bright")
    for i, curve in enumerate(edges):
        colour, label = (("tab:blue", "a$_m$"), ("tab:green", "b$_m$"))[i % 2]
        axis.plot(curve, DEPTH, color=colour, linewidth=0.8, label=label if i < 2 else None)
    axis.set(xlim=STIFFNESS[[0, -1]])
