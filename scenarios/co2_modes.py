"""Along its axis CO2 has three normal modes, with Ω = 0, √(κ/m), √(κ(1/m + 2/M)), and every motion is a sum of these.

K Ex. 11, eq. 152-158, with the masses of oxygen and carbon.  The eigenvalues of K eq. 156 are the squares of the
frequencies.  Each mode is started alone, and its frequency is read off the simulated motion.  Then one atom is struck,
which excites all three modes, and each keeps its energy.
"""

from __future__ import annotations

import numpy as np

from liaisons import Result, analysis, crossings, simulate
from liaisons.models import LinearMolecule
from liaisons.scenarios import Claims, panels, scenario, within

MASSES, SPACING = np.array([15.999, 12.011, 15.999]), 0.116  # consistent units: only ratios matter
AMPLITUDE, PICTURES = 0.02, {1: "→ → →", 2: "←  |  →", 3: "→ ← →"}
RECORD = [form.format(k) for k in PICTURES for form in ("x_{}", "x_{}_dot", "p_x_{}", "mode_{}")]


def run(stop_time: float, **starts: float) -> Result:
    return simulate("LinearMolecule", times=np.arange(0, stop_time, 0.05), tolerance=1e-11, record=RECORD, **starts)  # type: ignore[arg-type]


def started_in(k: int) -> Result:
    """At rest, displaced along u_k; the translation is pushed instead."""
    u = AMPLITUDE * LinearMolecule.modes(mass_outer=MASSES[0], mass_inner=MASSES[1])[:, k - 1]
    if k == 1:
        return run(100.0, x_1_0=0.0, **{f"x_{i}_dot_0": 0.1 * u[i - 1] for i in PICTURES})
    return run(100.0, **{f"x_{i}_0": (i - 1) * SPACING + u[i - 1] for i in PICTURES})


def frequency(result: Result, k: int) -> float:
    """Of mode k, from the zeros of its normal coordinate."""
    rates = np.linalg.solve(LinearMolecule.modes(), [result[f"x_{i}_dot"] for i in PICTURES])
    return np.pi / np.diff(crossings(result.time, result[f"mode_{k}"], rates[k - 1])).mean()


@scenario
def main(claim: Claims) -> None:
    # K eq. 156, from eq. 154 and 155
    stiffness = np.array([[1, -1, 0], [-1, 2, -1], [0, -1, 1]]) / np.sqrt(np.outer(MASSES, MASSES))
    squares = np.linalg.eigvalsh(stiffness)
    matrix = within(1e-15, "rad2/s2", because="rounding errors of eigenvalues of a matrix with entries of about 0.2")
    derived = analysis.normal_modes(LinearMolecule, x_1=0.0).squares
    claim("K eq. 156 follows from the Lagrangian at its equilibrium", derived, squares, matrix)

    alone = {k: started_in(k) for k in PICTURES}
    zeros = within(1e-9, because="relative errors of the solver, 1e-11, and of zeros of the spline, (0.05 Ω)⁴/384")
    mixed = within(1e-10, "m", because="10 times tolerance 1e-11: in linear equations, only errors mix the modes")
    for k in (2, 3):
        text = f"mode {k} {PICTURES[k]}: Ω = {np.sqrt(squares[k - 1]):.5f} rad/s, root of the eigenvalue"
        claim(text, frequency(alone[k], k) / np.sqrt(squares[k - 1]), 1.0, zeros)
    for k, result in alone.items():
        others = [result[f"mode_{other}"] for other in PICTURES if other != k]
        claim(f"mode {k} {PICTURES[k]} started alone excites no other", others, 0.0, mixed)

    struck = run(300.0, x_1_0=0.0, x_1_dot_0=0.01)
    exact = LinearMolecule.exact(struck.time, x_1_0=0.0, x_1_dot_0=0.01)
    phase = within(1e-9, "m", because="100 times the solver tolerance 1e-11: a phase Ωt of 140, at amplitudes of 0.1 m")
    text = "a struck molecule: the sum of three modes, each with its frequency"
    claim(text, struck, exact, phase, names=("x_1", "x_2", "x_3"))
    momentum = np.sum([struck[f"p_x_{i}"] for i in PICTURES], axis=0)
    pairs = within(1e-13, "kg.m/s", because="the forces of a spring on its ends cancel up to rounding")
    claim("the total momentum, with each atom's own mass, is constant", momentum, momentum[0], pairs)

    titles = {k: f"mode {k}: {picture}" for k, picture in PICTURES.items()} | {4: "left atom struck"}
    axes = panels(*((title, "position [m]", "t [s]") for title in titles.values()), size=(14, 4), sharey=True)
    for axis, result in zip(axes, (*alone.values(), struck), strict=True):
        for i, (atom, colour) in enumerate((("O", "tab:red"), ("C", "0.2"), (None, "tab:red")), 1):
            axis.plot(result[f"x_{i}"][:1201], result.time[:1201], color=colour, label=atom)
