"""An oscillator whose support moves at its own frequency: the amplitude grows with time."""

import numpy as np

from referee.bodies import body, joint
from referee.task import Answer, Task, sinusoid

OMEGA, AMPLITUDE, STIFFNESS = 5.0, 0.1, 25.0  # mass 1 kg
SUPPORT = sinusoid(0.0, AMPLITUDE, OMEGA)


def answer(times):
    """x = (a/2) (sin τ - τ cos τ), τ = ω t; force K (σ - x), work its integral over σ."""
    tau = OMEGA * times
    x = AMPLITUDE / 2 * (np.sin(tau) - tau * np.cos(tau))
    work = np.sin(tau) ** 2 / 2 + tau**2 / 4 + tau * np.sin(2 * tau) / 4 + (np.cos(2 * tau) - 1) / 8
    return Answer(x[:, None], STIFFNESS * (AMPLITUDE * np.sin(tau) - x), STIFFNESS * AMPLITUDE**2 / 2 * work)


def checks():
    """The equation of motion by differences in the complex plane, and the energy account."""
    t, h = 3.3, 1e-3
    angles = np.exp(2j * np.pi * np.arange(16) / 16)
    x = np.array([(np.sin(OMEGA * z) - OMEGA * z * np.cos(OMEGA * z)) * AMPLITUDE / 2 for z in t + h * 50 * angles])
    first, second = (np.mean(x * angles**-k).real * f / (50 * h) ** k for k, f in ((1, 1), (2, 2)))
    exact = answer(np.array([t]))
    residual = second + STIFFNESS * (exact.motion[0, 0] - SUPPORT(t)[0])
    account = (first**2 + STIFFNESS * (exact.motion[0, 0] - SUPPORT(t)[0]) ** 2) / 2 - exact.work[0]
    return {"equation of motion": float(abs(residual)), "energy account": float(abs(account / exact.work[0]))}


TASK = Task(
    "resonance",
    stop=6.4,
    bodies=body(
        "wall",
        joint("support", "slide", "1 0 0"),
        mass=1.0,
        inside=body("mass", joint("stretch", "slide", "1 0 0", f'stiffness="{STIFFNESS}"'), mass=1.0),
    ),
    motions={"support": SUPPORT},
    asked=[("support", "stretch")],
    start={"stretch": (0.0, -OMEGA * AMPLITUDE)},
    answer=answer,
    checks=checks,
    carrier=1.0,
    component="Oscillator",
    start_values={"x_0": 0.0, "stiffness": STIFFNESS},
    ports={"support": "support"},
    signals=["x"],
    springs={"stretch": STIFFNESS},
)
