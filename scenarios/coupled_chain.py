"""Ten Oscillator FMUs in a row, each mass the support of the next spring, are one chain with its normal modes.

Mass j is a port both ways: its motion is the support of oscillator j + 1, whose force is its load.  The first has no
spring.  Then u_j'' = (κ/m)(u_(j+1) - 2 u_j + u_(j-1)) with free ends, and (K 5.3)

    Ω_k = 2 √(κ/m) sin(kπ/2N),    φ_k(j) = cos(kπ (j - ½)/N)

Three ways to the same motion stand in the table that is printed: the ten co-simulated, at several H; the same system
flattened, which is one FMU without coupling; the modes.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from liaisons import Result, System, Verdict, fmu_path, max_error, run_scenario, simulate, slope, table, verdict

N, MASS, STIFFNESS, STOP = 10, 0.5, 2.0, 20.0
SIZES = (0.2, 0.1, 0.05)
START = np.eye(N)[0]  # the first mass is displaced by 1 m

fmu = cache(fmu_path)  # asking for the path checks that the FMU is up to date


def motion(times: NDArray) -> NDArray:
    """Displacements as the superposition of the normal modes, shape (masses, times)."""
    k, j = np.arange(N), np.arange(1, N + 1)[:, None]
    frequencies, modes = 2 * np.sqrt(STIFFNESS / MASS) * np.sin(k * np.pi / 2 / N), np.cos(k * np.pi * (j - 0.5) / N)
    amplitudes = np.linalg.solve(modes, START)
    return modes @ (amplitudes[:, None] * np.cos(frequencies[:, None] * times))


def chain() -> System:
    system = System("chain of FMUs")
    before = None
    for j in range(N):
        start = {"x_0": START[j], "support": START[max(j - 1, 0)], "stiffness": STIFFNESS if before else 0.0}
        mass = system.add(f"mass_{j + 1}", fmu("Oscillator"), mass=MASS, **start)
        if before:
            system.connect(before["x"], mass["support"])
        before = mass
    return system


def displacements(result: Result) -> NDArray:
    return np.array([result[f"mass_{j}.x"] for j in range(1, N + 1)])


def compare(results: list[Result], errors: list[float], flat: NDArray, times: NDArray) -> None:
    """Print largest differences of displacements: co-simulated, flattened, closed form."""
    modes, one = "against the normal modes [m]", "against the flattened FMU [m]"
    rows = [{"": "flattened, one FMU", modes: f"{max_error(flat, motion(times)):.1e}", one: "0"}]
    for step, result, error in zip(SIZES, results, errors, strict=True):
        there = flat[:, :: round(step / SIZES[-1])]
        rows.append(
            {
                "": f"co-simulated, H = {step:g} s",
                modes: f"{error:.1e}",
                one: f"{max_error(displacements(result), there):.1e}",
            }
        )
    print(table(rows))


def main(figure: Path) -> list[Verdict]:
    system = chain()
    results = [system.simulate(STOP, step, tolerance=1e-11) for step in SIZES]
    errors = [max_error(displacements(result), motion(result.time)) for result in results]
    fine = results[-1]
    single = simulate(fmu("OscillatorChain"), times=fine.time, tolerance=1e-12, mass=MASS, stiffness=STIFFNESS)
    alone = np.array([single[f"u[{j}]"] for j in range(1, N + 1)])
    flat = displacements(simulate(system.flatten(), times=fine.time, tolerance=1e-12))
    compare(results, errors, flat, fine.time)
    order = slope(SIZES, errors)
    parts = [[fine[f"mass_{j}.{name}"] for j in range(1, N + 1)] for name in ("p_x", "energy", "work")]
    momentum, energy, handed = np.sum(parts, axis=1)
    # H⁴/720 of the loads' fourth derivative, rates up to 2 √(κ/m) = 4 /s, force 2 N a mass of ½ kg, over 20 s
    bound = SIZES[-1] ** 4 / 720 * 4.0**4 * 4 * STOP
    _, (waves, convergence) = plt.subplots(1, 2, figsize=(11, 4), layout="constrained")
    for j, u in enumerate(displacements(fine)):
        waves.plot(fine.time, u + j, color="tab:blue", linewidth=0.8)
        waves.plot(fine.time[::10], motion(fine.time)[j, ::10] + j, "k.", markersize=2)
    waves.set(xlabel="t [s]", ylabel="mass, displacement", title="ten FMUs (lines) and normal modes (dots)")
    convergence.loglog(SIZES, errors, "o-", label=f"order {order:.2f}")
    convergence.set(xlabel="H [s]", ylabel="error [m]", title="implicit coupling")
    convergence.legend()
    plt.savefig(figure, dpi=150)
    why = "quadrature of the loads, H⁴/720"
    rows = (
        (f"order {order:.2f} is 4", abs(order - 4), 0.15, "", "terms of order (4 H)²"),
        ("against normal modes", errors[-1], bound, "m", why),
        ("flattened, against normal modes", max_error(flat, motion(fine.time)), 1e-10, "m", "tolerance 1e-12, 20 s"),
        ("ten FMUs against flattened", max_error(displacements(fine), flat), bound, "m", why),
        ("against OscillatorChain", max_error(displacements(fine), alone), bound, "m", why),
        ("total momentum", np.ptp(momentum), bound, "kg.m/s", why),
        ("energy of the chain", np.ptp(energy), 4 * bound, "J", f"{why}, times forces"),
        ("work in one mass is work out of another", max(abs(handed)), 4 * bound, "J", f"{why}, times forces"),
    )
    return [verdict(c, error=e, tolerance=limit, unit=u, reason=reason) for c, e, limit, u, reason in rows]


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
