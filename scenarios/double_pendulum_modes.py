"""Small motions of a double pendulum are sums of two normal modes; the deviation grows as the cube of the amplitude.

K 5.2 for two equal rods and a light lower bob, where the frequencies are close together.  Released with only the lower
rod displaced, the pendulum beats: the motion passes to the upper rod and back.  At large amplitude the motion is
chaotic, and only the energy can be checked: two motions whose start values differ by 1e-9 rad end more than a turn
apart.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from liaisons import Result, max_error, simulate
from liaisons.models import DoublePendulum
from liaisons.scenarios import Claims, panels, scenario, within

LIGHT = {"mass_2": 0.05}
AMPLITUDES = 0.2 / 2 ** np.arange(6)  # [rad]
ANGLES = ("theta_1", "theta_2")
TOLERANCE = 1e-12


def run(stop_time: float, theta_1: float, theta_2: float, **body: float) -> Result:
    start: Any = {"theta_1_0": theta_1, "theta_2_0": theta_2, **body}
    return simulate("DoublePendulum", stop_time=stop_time, step_size=0.02, tolerance=TOLERANCE, **start)


@scenario
def main(claim: Claims) -> None:
    beat, order, chaos = panels(
        ("light lower bob: beats", "t [s]", "angle [µrad]"),
        ("small motion: off by the cube", "amplitude [rad]", "distance from the modes after 5 s [rad]"),
        ("large: starts 1e-9 rad apart", "t [s]", "|Δθ$_2$| [rad]"),
    )

    def modes(result: Result, theta_1: float, theta_2: float) -> dict[str, np.ndarray]:
        return DoublePendulum.small_angles(result.time, theta_1_0=theta_1, theta_2_0=theta_2, **LIGHT)

    linear = within(1e-10, "rad", because="nonlinear terms: the cube of the amplitude 1e-4, times a phase Ωt of 80")
    fifth = within(0.05, because="terms of fifth order, smaller by the square of the amplitude")
    errors = []
    _, shapes = DoublePendulum.normal_modes(**LIGHT)
    for name, shape, marker in zip(("slow", "fast"), shapes.T, "os", strict=True):
        unit = shape / np.max(np.abs(shape))
        still = run(20.0, *(1e-4 * unit), **LIGHT)
        claim(f"{name} mode started alone excites no other", still, modes(still, *(1e-4 * unit)), linear, names=ANGLES)
        errors = []
        for amplitude in AMPLITUDES:
            result = run(5.0, *(amplitude * unit), **LIGHT)
            expected = modes(result, *(amplitude * unit))
            errors.append(max(max_error(result[angle], expected[angle]) for angle in ANGLES))
        claim.order(f"{name} mode: exponent of the error in the amplitude is 3", AMPLITUDES, errors, 3, fifth)
        order.loglog(AMPLITUDES, errors, marker, label=f"{name} mode")
    order.loglog(AMPLITUDES, errors[0] * (AMPLITUDES / AMPLITUDES[0]) ** 3, color="0.6", label="amplitude³")

    beats = run(60.0, 0.0, 1e-3, **LIGHT)
    cubed = within(1e-3**3 * 250, "rad", because="nonlinear terms: the cube of the amplitude, times a phase Ωt of 250")
    claim("beats: the sum of both modes", beats, modes(beats, 0.0, 1e-3), cubed, names=ANGLES)
    for angle in reversed(ANGLES):
        beat.plot(beats.time[:1501], 1e6 * beats[angle][:1501], linewidth=1, label=angle.replace("theta", "θ"))

    wild, disturbed = run(60.0, 2.0, 2.5), run(60.0, 2.0 + 1e-9, 2.5)
    claim.energy("large motion: the energy is constant", wild, tolerance=TOLERANCE)
    apart = np.abs(wild["theta_2"] - disturbed["theta_2"])
    sign = within(0.0, "rad", because="an inequality")
    claim.below("large motion: two starts 1e-9 rad apart end a turn apart", 2 * np.pi, np.max(apart), sign)
    chaos.semilogy(wild.time[1:], apart[1:], linewidth=0.8)
