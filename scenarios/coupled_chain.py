"""Ten Oscillator FMUs in a row, in which each mass supports the next spring, have the normal modes of one chain.

The port of mass j works both ways: its motion moves the support of oscillator j + 1, whose force is its load.  The
first oscillator has no spring.  Then u_j'' = (κ/m)(u_(j+1) - 2 u_j + u_(j-1)) with free ends, and (K 5.3)

    Ω_k = 2 √(κ/m) sin(kπ/2N),    φ_k(j) = cos(kπ (j - ½)/N)

The printed table compares three ways to the same motion: co-simulation of the ten FMUs with several step sizes H; the
flattened system, which is one FMU without coupling; and the modes.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from liaisons import Result, System, max_error, simulate
from liaisons.models import OscillatorChain
from liaisons.scenarios import Claims, dots, panels, scenario, table, within

N, STOP, SIZES = 10, 20.0, (0.2, 0.1, 0.05)
START = np.eye(N)[0]  # the first mass is displaced by 1 m
BODY: Any = {"mass": 0.5, "stiffness": 2.0}
# H⁴/720 of the loads' fourth derivative, rates up to 2 √(κ/m) = 4 /s, force 2 N a mass of ½ kg, over 20 s
BOUND, WHY = SIZES[-1] ** 4 / 720 * 4.0**4 * 4 * STOP, "quadrature of the loads, H⁴/720"


def chain() -> System:
    system = System("chain of FMUs")
    before = system.add("mass_1", "Oscillator", **BODY | {"x_0": 1.0, "support": 1.0, "stiffness": 0.0})
    for j in range(2, N + 1):
        mass = system.add(f"mass_{j}", "Oscillator", x_0=0.0, support=START[j - 2], **BODY)
        system.connect(before["x"], mass["support"])
        before = mass
    return system


def of_all(run: Result, name: str = "x") -> NDArray:
    """A signal of all masses, (N, time)."""
    return np.array([run[f"mass_{j}.{name}"] for j in range(1, N + 1)])


def modes(times: NDArray) -> NDArray:
    return OscillatorChain.exact(times, n=N, u_0=START, **BODY)["u"].T


@scenario
def main(claim: Claims) -> None:
    system = chain()
    runs = [system.simulate(STOP, step, tolerance=1e-11) for step in SIZES]
    fine, found, expected = runs[-1], of_all(runs[-1]), modes(runs[-1].time)
    flat = of_all(simulate(system.flatten(), times=fine.time, tolerance=1e-12))
    errors = [max_error(of_all(run), modes(run.time)) for run in runs]
    rows = [("flattened, one FMU", max_error(flat, expected), 0.0)]
    for step, run, error in zip(SIZES, runs, errors, strict=True):
        rows.append(
            (f"co-simulated, H = {step:g} s", error, max_error(of_all(run), flat[:, :: round(step / SIZES[-1])]))
        )
    print(table({"": way, "from the modes [m]": f"{a:.1e}", "from one FMU [m]": f"{b:.1e}"} for way, a, b in rows))

    coupling = within(BOUND, "m", because=WHY)
    claim.order("coupling error of order 4", SIZES, errors, 4, within(0.15, because="terms of relative order (4 H)²"))
    claim("ten FMUs against normal modes", found, expected, coupling)
    claim("flattened against normal modes", flat, expected, within(1e-10, "m", because="tolerance 1e-12 over 20 s"))
    claim("ten FMUs against flattened", found, flat, coupling)
    alone = simulate("OscillatorChain", times=fine.time, tolerance=1e-12, **BODY)["u"].T
    claim("ten FMUs against OscillatorChain", found, alone, coupling)
    momentum, energy, handed = (of_all(fine, name).sum(axis=0) for name in ("p_x", "energy", "work"))
    force = within(4 * BOUND, "J", because=f"{WHY}; times the forces")
    claim("the total momentum is constant", np.ptp(momentum), 0.0, within(BOUND, "kg.m/s", because=WHY))
    claim("the energy of the chain is constant", np.ptp(energy), 0.0, force)
    claim("the work done on one mass is taken from another", handed, 0.0, force)

    waves, convergence = panels(
        ("ten FMUs (lines) and normal modes (dots)", "t [s]", "mass, displacement [m]"),
        ("implicit coupling", "H [s]", "error [m]"),
    )
    for j in range(N):
        waves.plot(fine.time, found[j] + j, color="tab:blue", linewidth=0.8)
        dots(waves, fine.time, expected[j] + j, every=10, markersize=2)
    convergence.loglog(SIZES, errors, "o-", label="co-simulated")
    convergence.loglog(SIZES, errors[-1] * (np.array(SIZES) / SIZES[-1]) ** 4, color="0.6", label="H⁴")
