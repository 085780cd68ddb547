"""An oscillator whose support moves at its own frequency: the amplitude grows with time."""

from dataclasses import replace

import numpy as np
from sympy.physics.mechanics import dynamicsymbols

from referee.equations import TIME, lagrange
from referee.task import Answer, sinusoid

OMEGA, AMPLITUDE, STIFFNESS = 5.0, 0.1, 25.0  # mass 1 kg
x, support = dynamicsymbols("x support")
INTEGRATED = lagrange(
    "resonance",
    6.4,
    (x.diff(TIME) ** 2 - STIFFNESS * (x - support) ** 2) / 2,
    {x: (0.0, 0.0)},
    {support: sinusoid(0.0, AMPLITUDE, OMEGA)},
    component="Oscillator",
    asked=["stretch"],
    whole=True,
    carrier=1.0,
    springs={"stretch": STIFFNESS},
    parameters={"x_0": 0.0, "stiffness": STIFFNESS},
    signals=["x"],
)


def reference(times):
    """x = (a/2) (sin τ - τ cos τ), τ = ω t; force K (σ - x), work its integral over σ."""
    tau = OMEGA * times
    x = AMPLITUDE / 2 * (np.sin(tau) - tau * np.cos(tau))
    work = np.sin(tau) ** 2 / 2 + tau**2 / 4 + tau * np.sin(2 * tau) / 4 + (np.cos(2 * tau) - 1) / 8
    found = Answer(x[:, None], STIFFNESS * (AMPLITUDE * np.sin(tau) - x), STIFFNESS * AMPLITUDE**2 / 2 * work)
    integrated, checks = INTEGRATED.reference(times)
    return found, {**checks, "integrated": max(integrated.errors(found))}


TASK = replace(INTEGRATED, reference=reference, start={"stretch": (0.0, -OMEGA * AMPLITUDE)})
