"""The motion of a bead on a moving hoop is the sum of three fields: free motion, the hoop's energy, connection.

M eq. 52, D_Y = D_0 - X_K + H(Y), with the terms of eq. 65-67 for the hoop, Y = β', in the coordinates ξ and p_ξ:

    D_0 = (p_ξ/m, 0)        H(Y) = (-a Y, a' p_ξ Y)        -X_K = (0, ½ m b' Y²)

a = r²θ', b = r²r'², ' = d/dξ.  A FourierSeries shakes a Fourier hoop; at every communication point the three terms,
from the shape of the hoop and the FMU's ξ and p_ξ, have to add up to the FMU's own derivatives.  At a given (ξ, p_ξ)
the FMU shows them one by one: its derivatives at rest, and what is odd and even in Y.  On a circle ξ is the free
coordinate, so that the rate of p_ξ can be read off directly; about its centre -X_K vanishes, as for a swing or a cat.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from liaisons import Result, System, Verdict, fmu_path, max_error, run_scenario, simulate, verdict

BENT = {"radius": 1.2, "cos_1": 0.25, "sin_2": 0.15, "cos_3": -0.1}
SHAKING = {"angular_frequency": 1.0, "sin_1": 1.2, "cos_2": 0.5, "sin_3": -0.2}
SPEED = 0.4  # of the bead on the hoop at the start [rad/s]
Terms = dict[str, NDArray]  # D_0, H(Y), -X_K, each with rows for ξ and p_ξ
Curve = Callable[[NDArray, int], NDArray]  # (u, n) -> n-th derivative of OP(u) as a complex number


def bent(theta: NDArray, order: int) -> NDArray:
    """OP and its derivatives by θ: r e^{iθ} is a sum of exponentials."""
    waves = {0: 1.0, 1: BENT["cos_1"] / 2, 2: BENT["sin_2"] / 2j, 3: BENT["cos_3"] / 2}
    waves |= {-k: np.conj(wave) for k, wave in waves.items() if k}
    terms = [(1j * (k + 1)) ** order * wave * np.exp(1j * (k + 1) * theta) for k, wave in waves.items()]
    return BENT["radius"] * np.sum(terms, axis=0)


def circle(offset: float) -> Curve:
    return lambda u, order: (1j**order) * np.exp(1j * u) + (offset if order == 0 else 0)


def terms(curve: Curve, u: NDArray, p: NDArray, Y: NDArray) -> Terms:
    """M eq. 65-67 for unit mass."""
    position, first, second = (curve(u, order) for order in range(3))
    speed = np.abs(first)
    tangent = first / speed
    curvature = np.imag(np.conj(first) * second) / speed**3
    r_dot_t, a = np.real(np.conj(position) * tangent), np.imag(np.conj(position) * tangent)
    a_dash = r_dot_t * curvature  # tangent' = i · curvature · tangent
    b_dash = 2 * r_dot_t * (1 - a * curvature)
    zero = np.zeros_like(p)
    return {
        "D_0": np.array([p, zero]),
        "H(Y)": np.array([-a * Y, a_dash * p * Y]),
        "-X_K": np.array([zero, b_dash * Y**2 / 2]),
    }


def shake(fmu: str, names: list[str], **start: Any) -> Result:
    system = System("shaken hoop")
    hoop = system.add("hoop", fmu_path(fmu), input_reconstruction=2, **start)
    motor = system.add("operator", fmu_path("FourierSeries"), **SHAKING)
    system.connect(motor["y"], hoop["beta"])
    names = [*names, "xi_dot", "p_xi", "beta_dot", "bead_x", "bead_y"]
    return system.simulate(15.0, 0.02, tolerance=1e-10, record=[f"hoop.{name}" for name in names])


def derivative(result: Result, prefix: str = "") -> NDArray:
    """The Fourier hoop's derivative of (ξ, p_ξ); p_θ = p_ξ dξ/dθ."""
    theta, rate, p, p_dot = (result[f"{prefix}{name}"] for name in ("theta", "theta_dot", "p_xi", "p_theta_dot"))
    first, second = bent(theta, 1), bent(theta, 2)
    speed = np.abs(first)
    speed_dot = np.real(np.conj(first) * second) / speed * rate
    return np.array([result[f"{prefix}xi_dot"], (p_dot - speed_dot * p) / speed])


def taken_apart(theta: float, p: float, Y: float) -> tuple[Terms, Terms]:
    """The three terms at one state: from the FMU, and from the shape of the hoop."""
    names = ["theta", "theta_dot", "xi_dot", "p_xi", "p_theta_dot"]

    def field(rate: float) -> NDArray:
        speed, shape = (
            float(np.abs(bent(np.array(theta), 1))),
            terms(bent, np.array(theta), np.array(p), np.array(rate)),
        )
        xi_dot = float(shape["D_0"][0] + shape["H(Y)"][0])
        start: dict[str, Any] = {"theta_0": theta, "theta_dot_0": xi_dot / speed, "beta_dot": rate, **BENT}
        run = simulate(fmu_path("FourierHoop"), stop_time=1e-3, record=names, **start)
        return derivative(run)[:, 0]

    still, forth, back = field(0.0), field(Y), field(-Y)
    found = {"D_0": still, "H(Y)": (forth - back) / 2, "-X_K": (forth + back) / 2 - still}
    return found, terms(bent, np.array(theta), np.array(p), np.array(Y))


def main(figure: Path) -> list[Verdict]:
    verdicts = []
    result = shake("FourierHoop", ["theta", "theta_dot", "p_theta_dot"], theta_dot_0=SPEED, **BENT)
    parts = terms(bent, result["hoop.theta"], result["hoop.p_xi"], result["hoop.beta_dot"])
    rates = derivative(result, "hoop.")
    verdicts += judge_sum("Fourier hoop", parts, rates)
    off, about = (shake("CircularHoop", ["xi", "p_xi_dot"], xi_dot_0=SPEED, offset=offset) for offset in (0.5, 0.0))
    circular = terms(circle(0.5), off["hoop.xi"], off["hoop.p_xi"], off["hoop.beta_dot"])
    verdicts += judge_sum("circle off its centre", circular, np.array([off["hoop.xi_dot"], off["hoop.p_xi_dot"]]))
    verdicts.append(
        verdict(
            "circle about its centre: -X_K = 0 and a' = 0, so that p_ξ is constant",
            error=max_error(about["hoop.p_xi"], about["hoop.p_xi"][0]),
            tolerance=1e-12,
            unit="kg.m/s",
            reason="its rate is made of roundings of terms of size 10, which do not add up over 15 s",
        )
    )
    states = [taken_apart(theta, p, 1.7) for theta, p in ((0.3, 1.0), (1.9, -0.8), (3.3, 2.0), (5.0, 0.0))]
    meanings = {"D_0": "at rest", "H(Y)": "odd in Y", "-X_K": "even in Y, beyond that at rest"}
    for name, meaning in meanings.items():
        verdicts.append(
            verdict(
                f"Fourier hoop: {name} is the part of the FMU's field {meaning}",
                error=max(max_error(found[name], expected[name]) for found, expected in states),
                tolerance=1e-12,
                reason="an identity at each state: roundings of terms of size 10",
            )
        )
    draw(figure, result, parts, rates)
    return verdicts


def judge_sum(name: str, parts: Terms, rates: NDArray) -> list[Verdict]:
    total = np.sum(list(parts.values()), axis=0)
    return [
        verdict(
            f"{name}: the three terms add up to the FMU's derivative of {symbol}",
            error=max_error(total[row], rates[row]),
            tolerance=1e-12,
            unit=unit,
            reason="an identity at every state: roundings of terms of size 10",
        )
        for row, symbol, unit in ((0, "ξ", "m/s"), (1, "p_ξ", "N"))
    ]


def draw(figure: Path, result: Result, parts: Terms, rates: NDArray) -> None:
    colors = {"D_0": "tab:gray", "H(Y)": "tab:blue", "-X_K": "tab:red"}
    picture = plt.figure(figsize=(14, 4.6), layout="constrained")
    axes = picture.subplot_mosaic([["path", "xi"], ["path", "p"]], width_ratios=[1, 2.4])
    path, speed, force = (axes[name] for name in ("path", "xi", "p"))
    force.sharex(speed)
    hoop = bent(np.linspace(0, 2 * np.pi, 400), 0)
    path.plot(np.real(hoop), np.imag(hoop), color="k", linewidth=2, label="the hoop at β = 0")
    path.plot(result["hoop.bead_x"], result["hoop.bead_y"], color="tab:blue", linewidth=0.7, label="path of the bead")
    path.plot(0, 0, "k+")
    path.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", ylim=(-1.7, 2.2), title="a hoop is shaken about O (+)")
    path.legend(loc="upper center", ncols=2, fontsize="small")
    labels = {"D_0": "$D_0$", "H(Y)": "$H(Y)$", "-X_K": "$-X_K$"}
    for graph, row, unit in ((speed, 0, "ξ' [m/s]"), (force, 1, "p$_ξ$' [N]")):
        for name, part in parts.items():
            graph.plot(result.time, part[row], color=colors[name], linewidth=1.2, label=labels[name])
        graph.plot(result.time, np.sum(list(parts.values()), axis=0)[row], color="k", linewidth=0.8, label="sum")
        graph.plot(result.time[::10], rates[row][::10], "k.", markersize=4, label="FMU")
        graph.set_ylabel(unit)
    speed.set_title("what drives it: the three terms of M eq. 52")
    speed.legend(loc="upper right", ncols=5, fontsize="small")
    speed.set_ylim(top=1.45 * speed.get_ylim()[1])
    force.set_xlabel("t [s]")
    plt.savefig(figure, dpi=150)


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
