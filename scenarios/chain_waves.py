"""A chain of masses and springs carries waves, long ones at c = √(κ/m) Δx; shorter ones are slower, and none is faster.

K 5.3, eq. 159-165.  One mass of a free chain is displaced, which starts all modes at once; their frequencies, read off
the simulated motion mode by mode, are Ω_k = 2 √(κ/m) sin(kπ/2N).  Then an operator moves the end of a driven chain:
the modal sum with a prescribed end, the arrival of a slow push at j Δx/c, and of a sudden one, ahead of which there is
next to nothing: the chain's own response to a step is the integral of 2j J_2j(2 √(κ/m) t)/t.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import trapezoid
from scipy.special import jv

from liaisons import Result, System, Verdict, fmu_path, max_error, run_scenario, simulate, verdict
from liaisons.models import DrivenChain, OscillatorChain

N = 64
BODY: dict[str, Any] = {"mass": 0.5, "stiffness": 2.0, "spacing": 0.25}
OMEGA = 2.0  # √(κ/m) [rad/s]
C = OMEGA * BODY["spacing"]
J = np.arange(1, N + 1)
PUSH = 12.0  # duration of the slow push [s]
REACHED, ECHO = 24, 48.0  # masses that it has passed before its echo comes back to them [s]
SINE = {"amplitude": 0.1, "angular_frequency": 1.3}
AHEAD = 0.85  # part of the time of arrival at which the sudden push is looked for


def columns(result: Result, name: str = "u[{}]") -> NDArray:
    """A signal of all masses, (n, time)."""
    return np.array([result[name.format(j)] for j in J])


def driven(chain: Path, operator: str, stop_time: float, **values: float) -> Result:
    system = System("driven chain")
    masses = system.add("chain", chain, input_reconstruction=2, **BODY)
    motor = system.add("operator", fmu_path(operator), **values)
    system.connect(motor["y"], masses["drive"])
    return system.simulate(stop_time, 0.05, tolerance=1e-10)


def frequencies(q: NDArray, step: float) -> NDArray:
    """Of the rows of q, each a cosine: q(t + h) + q(t - h) = 2 cos(Ωh) q(t), by least squares."""
    around, middle = q[:, 2:] + q[:, :-2], q[:, 1:-1]
    cosine = np.sum(around * middle, axis=1) / np.sum(middle**2, axis=1) / 2
    return np.arccos(cosine) / step


def arrivals(time: NDArray, u: NDArray) -> NDArray:
    """∫ t u' dt = ∫ (1 - u) dt, the mean time at which a push by 1 m passes each of the masses; before its echo."""
    before = time <= ECHO
    return trapezoid(1 - u[:REACHED, before], time[before])


def main(figure: Path) -> list[Verdict]:
    chain, grip = (fmu_path(name, n=N) for name in ("OscillatorChain", "DrivenChain"))
    displaced = np.eye(N)[0]  # the first mass, by 1 m
    free = simulate(chain, stop_time=100.0, step_size=0.5, tolerance=1e-12, u_0=displaced, **BODY)
    sine = driven(grip, "Sinusoid", 60.0, **SINE)
    slow = driven(grip, "SmoothStep", 80.0, duration=PUSH)
    sudden = simulate(grip, stop_time=40.0, step_size=0.05, tolerance=1e-12, drive=1.0, **BODY)
    u = columns(free)
    expected, modes = OscillatorChain.normal_modes(n=N, mass=BODY["mass"], stiffness=BODY["stiffness"])
    found = frequencies((np.linalg.inv(modes) @ u)[1:], 0.5)
    momentum = np.sum(columns(free, "p_u[{}]"), axis=0)
    group = np.diff(found) / (np.pi / (N * BODY["spacing"]))
    exact = DrivenChain.exact(sine.time, n=N, mass=BODY["mass"], stiffness=BODY["stiffness"], **SINE)
    pushed, struck = columns(slow, "chain.u[{}]"), columns(sudden)
    passing = arrivals(slow.time, pushed) - PUSH / 2
    looked_at = np.arange(20, N + 1, 10)
    times = AHEAD * looked_at / OMEGA
    early = [np.max(np.abs(struck[j - 1][sudden.time <= t])) for j, t in zip(looked_at, times, strict=True)]
    bound = jv(2 * looked_at, 2 * OMEGA * times) / np.sqrt(1 - AHEAD**2)
    draw(figure, found, slow, pushed)
    return [
        verdict(
            f"{N - 1} normal modes: Ω_k = 2 √(κ/m) sin(kπ/2N)",
            error=max_error(found, expected[1:]),
            tolerance=1e-7,
            unit="rad/s",
            reason="errors of 1e-11 in amplitudes of 1e-3, over h sin Ωh = 0.02",
        ),
        verdict(
            "the free chain is the sum of its modes",
            error=max_error(u, OscillatorChain.exact(free.time, u_0=displaced, mass=0.5, stiffness=2.0)["u"].T),
            tolerance=1e-9,
            unit="m",
            reason="tolerance 1e-12 over a phase Ωt of 400",
        ),
        verdict(
            "its total momentum stays",
            error=max_error(momentum, 0.0),
            tolerance=1e-12,
            unit="kg.m/s",
            reason=f"the forces of a spring on its ends cancel: roundings of {N} terms",
        ),
        verdict(
            "no group velocity exceeds c",
            error=max(0.0, float(np.max(group)) / C - 1),
            tolerance=1e-6,
            reason="the error of Ω_k above, over the distance of two of them",
        ),
        verdict(
            "driven by a sine: the modal sum with a prescribed end",
            error=max_error(columns(sine, "chain.u[{}]"), exact["u"].T),
            tolerance=1e-8,
            unit="m",
            reason="tolerance 1e-10 over a phase Ωt of 240; σ interpolated, 1e-10",
        ),
        verdict(
            f"a push of {PUSH:g} s passes masses 1 to {REACHED} at j Δx/c: c = {C:g} m/s",
            error=max_error(passing, J[:REACHED] / OMEGA),
            tolerance=1e-5,
            unit="s",
            reason="the mean time knows long waves only; the ripples behind the front are cut off",
        ),
        verdict(
            f"a sudden push: at {AHEAD} j Δx/c nothing is there but J_2j",
            error=float(np.max(early / bound)),
            tolerance=1.0,
            reason="part of the bound J_2j(x)/√(1 - (x/2j)²), which is 4e-3 at mass 20 and 4e-8 at mass 60",
        ),
    ]


def draw(figure: Path, found: NDArray, slow: Result, pushed: NDArray) -> None:
    _, (law, front) = plt.subplots(1, 2, figsize=(11, 4.4), layout="constrained")
    q = np.arange(1, N) * np.pi / (N * BODY["spacing"])
    law.plot(q, 2 * OMEGA * np.sin(q * BODY["spacing"] / 2), color="0.6", label="2 √(κ/m) sin(qΔx/2)")
    law.plot(q, C * q, "k--", linewidth=0.8, label="c q")
    law.plot(q, found, ".", markersize=4, label="FMU, mode by mode")
    law.set(xlabel="q [rad/m]", ylabel="Ω [rad/s]", ylim=(0, 2.6 * OMEGA), title="dispersion")
    law.legend()
    place = J * BODY["spacing"]
    colours = front.pcolormesh(slow.time, place, pushed, cmap="Blues", rasterized=True)
    plt.colorbar(colours, ax=front, label="u [m]")
    front.plot(place / C + PUSH / 2, place, "k--", linewidth=0.8, label="x = c (t - 6 s)")
    front.set(xlabel="t [s]", ylabel="x [m]", title="a slow push at the left end")
    front.legend(loc="lower right")
    plt.savefig(figure, dpi=150)


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
