"""An oscillator whose support moves at its own frequency: the amplitude grows with time."""

import numpy as np

from referee.task import Answer, Task, sinusoid

OMEGA, AMPLITUDE, STIFFNESS = 5.0, 0.1, 25.0  # mass 1 kg


def answer(times):
    """x = (a/2) (sin τ - τ cos τ), τ = ω t; force K (σ - x), work its integral over σ."""
    tau = OMEGA * times
    x = AMPLITUDE / 2 * (np.sin(tau) - tau * np.cos(tau))
    work = np.sin(tau) ** 2 / 2 + tau**2 / 4 + tau * np.sin(2 * tau) / 4 + (np.cos(2 * tau) - 1) / 8
    return Answer(x[:, None], STIFFNESS * (AMPLITUDE * np.sin(tau) - x), STIFFNESS * AMPLITUDE**2 / 2 * work)


def reference(times):
    """The equation of motion and the energy account; derivatives by Cauchy's integral."""
    t, radius, circle = 3.3, 0.05, np.exp(2j * np.pi * np.arange(16) / 16)
    x = answer(t + radius * circle).motion[:, 0]
    first, second = (np.mean(x * circle**-k).real * k / radius**k for k in (1, 2))
    _, [force], [work] = answer(np.array([t]))
    account = (first**2 + force**2 / STIFFNESS) / 2 - work
    checks = {"equation of motion": abs(second - force), "energy account": abs(account / work)}
    return answer(times), checks


TASK = Task(
    "resonance",
    6.4,
    {"support": sinusoid(0.0, AMPLITUDE, OMEGA)},
    ["stretch"],
    "Oscillator",
    reference,
    start={"stretch": (0.0, -OMEGA * AMPLITUDE)},
    whole=True,
    carrier=1.0,
    springs={"stretch": STIFFNESS},
    parameters={"x_0": 0.0, "stiffness": STIFFNESS},
    signals=["x"],
)
