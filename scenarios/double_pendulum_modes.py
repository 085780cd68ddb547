"""A double pendulum swings slightly in two normal modes: apart from them it is off by the cube of the amplitude.

K 5.2 for two equal rods and a light lower bob, where the frequencies lie close together: let go with the lower rod
displaced alone, the pendulum beats, and the swing wanders up the rods and back.  At large amplitude there is chaos, and
only the energy is left to check: two starts that differ by 1e-9 rad part by more than a turn.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from liaisons import Result, Verdict, fmu_path, max_error, run_scenario, simulate, slope, verdict
from liaisons.models import DoublePendulum

LIGHT = {"mass_2": 0.05}
AMPLITUDES = 0.2 / 2 ** np.arange(6)  # [rad]
ANGLES = ("theta_1", "theta_2")
WILD = {"theta_1_0": 2.0, "theta_2_0": 2.5}
SPAN, TOLERANCE = 60.0, 1e-12


def run(stop_time: float, **starts: Any) -> Result:
    return simulate(fmu_path("DoublePendulum"), stop_time=stop_time, step_size=0.02, tolerance=TOLERANCE, **starts)


def in_mode(mode: int, amplitude: float) -> dict[str, float]:
    """Start at rest in a mode whose larger angle is the amplitude."""
    _, modes = DoublePendulum.normal_modes(**LIGHT)
    shape = modes[:, mode] / np.max(np.abs(modes[:, mode]))
    return dict(zip(("theta_1_0", "theta_2_0"), amplitude * shape, strict=True))


def distance(result: Result, small: dict[str, NDArray]) -> float:
    return max(max_error(result[q], small[q]) for q in ANGLES)


def main(figure: Path) -> list[Verdict]:
    verdicts, errors = [], {}
    for mode, name in enumerate(("slow", "fast")):
        start = in_mode(mode, 1e-4)
        still = run(20.0, **start, **LIGHT)
        verdicts.append(
            verdict(
                f"{name} mode started alone stays alone",
                error=distance(still, DoublePendulum.small_angles(still.time, **start, **LIGHT)),
                tolerance=1e-10,
                unit="rad",
                reason="amplitude 1e-4 cubed, times a phase of 80: the equations are linear up to that",
            )
        )
        errors[name] = []
        for amplitude in AMPLITUDES:
            start = in_mode(mode, amplitude)
            result = run(5.0, **start, **LIGHT)
            errors[name].append(distance(result, DoublePendulum.small_angles(result.time, **start, **LIGHT)))
        verdicts.append(
            verdict(
                f"{name} mode: exponent of the error in the amplitude is 3",
                error=abs(slope(AMPLITUDES, errors[name]) - 3),
                tolerance=0.05,
                reason="terms of fifth order, amplitude² relative",
            )
        )
    beating = {"theta_1_0": 0.0, "theta_2_0": 1e-3} | LIGHT
    beats = run(SPAN, **beating)
    verdicts.append(
        verdict(
            "beats: the sum of both modes",
            error=distance(beats, DoublePendulum.small_angles(beats.time, **beating)),
            tolerance=1e-3**3 * 250,
            unit="rad",
            reason="amplitude cubed x phase Ωt of 250",
        )
    )
    wild, disturbed = run(SPAN, **WILD), run(SPAN, **(WILD | {"theta_1_0": WILD["theta_1_0"] + 1e-9}))
    verdicts += [
        verdict(
            "large motion: the energy stays",
            error=max_error(wild["energy"], wild["energy"][0]),
            tolerance=10 * TOLERANCE * float(np.max(wild["kinetic_energy"])) * SPAN,
            unit="J",
            reason="10 x tolerance x energy scale x time",
        ),
        verdict(
            "large motion: two starts 1e-9 rad apart part by more than a turn",
            error=max(0.0, 2 * np.pi - max_error(wild["theta_2"], disturbed["theta_2"])),
            tolerance=0.0,
            unit="rad",
            reason="a sign, no number",
        ),
    ]
    draw(figure, beats, errors, wild, disturbed)
    return verdicts


def draw(figure: Path, beats: Result, errors: dict[str, list[float]], wild: Result, disturbed: Result) -> None:
    _, (beat, order, chaos) = plt.subplots(1, 3, figsize=(14, 4), layout="constrained")
    shown = beats.time <= 30
    for name, label in (("theta_2", "θ_2"), ("theta_1", "θ_1")):
        beat.plot(beats.time[shown], 1e6 * beats[name][shown], linewidth=1, label=label)
    beat.set(xlabel="t [s]", ylabel="angle [µrad]", ylim=(-1100, 1400), title="light lower bob: beats")
    beat.legend(loc="upper center", ncols=2)
    for name, marker in (("slow", "o"), ("fast", "s")):
        order.loglog(AMPLITUDES, errors[name], marker, label=f"{name} mode")
    order.loglog(AMPLITUDES, errors["slow"][0] * (AMPLITUDES / AMPLITUDES[0]) ** 3, color="0.6", label="amplitude³")
    order.set(
        xlabel="amplitude [rad]",
        ylabel="distance from the modes after 5 s [rad]",
        title="small motion: off by the cube",
    )
    order.legend()
    chaos.semilogy(wild.time[1:], np.abs(wild["theta_2"] - disturbed["theta_2"])[1:], linewidth=0.8)
    chaos.set(xlabel="t [s]", ylabel="|Δθ_2| [rad]", title="large: starts 1e-9 rad apart")
    plt.savefig(figure, dpi=150)


if __name__ == "__main__":
    raise SystemExit(run_scenario(main))
