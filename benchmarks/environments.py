"""Environments beside those of Gymnasium: steps a second on one core, energy in 100 s without forces.

    python benchmarks/environments.py [--quick]

Steps of 4096 copies, with observations, rewards, energy balance and resets, in processor time of the thread, beside
Gymnasium's own vectorised CartPole, which makes one Euler step in NumPy.  Then Acrobot (steps of fourth order) and
CartPole (Euler) as Gymnasium has them, and the same mechanisms as ours, from the same starts at the same step sizes.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import casadi as ca
import gymnasium
import numpy as np
from _measure import Row, command, interleaved

from liaisons import Coordinate, Gravity, Mechanism, Parameter
from liaisons_motion.gymnasium import Environment, VectorEnvironment

COPIES = 4096
DURATION = 100.0  # [s]
GRAVITY = 9.8
PENDULUM: dict[str, Any] = {
    "observe": ["theta", "theta_dot"],
    "act": {"theta_force": (-1.0, 1.0)},
    "reward": "-theta**2",
    "step_size": 0.02,
    "stop_time": 5.0,
}
REGISTERED = ("SwingUp", "FallingCat", "CraneShift", "TorqueFreeTurn")


class Acrobot(Mechanism):
    """Two links, a torque between them."""

    mass = Parameter(1.0, "kg", "mass of each link", above=0)
    inertia = Parameter(1.0, "kg.m2", "moment of inertia of each link about its centre", above=0)
    length = Parameter(1.0, "m", "length of each link", above=0)
    gravity = Gravity()
    theta_1 = Coordinate("rad", "angle of the first link from the downward vertical")
    theta_2 = Coordinate("rad", "angle of the second link from the first")

    def _centres(self) -> list[dict[str, ca.SX]]:
        a, b, h = self.theta_1, self.theta_1 + self.theta_2, self.length / 2
        first = {"x": h * ca.sin(a), "z": -h * ca.cos(a)}
        return [first, {"x": 2 * first["x"] + h * ca.sin(b), "z": 2 * first["z"] - h * ca.cos(b)}]

    def kinetic_energy(self) -> ca.SX:
        rates = (self.dot(self.theta_1), self.dot(self.theta_1 + self.theta_2))
        moving = self.mass / 2 * sum(map(self.speed_squared, self._centres()))
        return moving + self.inertia / 2 * sum(rate**2 for rate in rates)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * sum(centre["z"] for centre in self._centres())


class CartPole(Mechanism):
    """A uniform pole on a cart."""

    mass_cart = Parameter(1.0, "kg", "mass of the cart", above=0)
    mass_pole = Parameter(0.1, "kg", "mass of the pole", above=0)
    half = Parameter(0.5, "m", "half of the length of the pole", above=0)
    gravity = Gravity()
    x = Coordinate("m", "position of the cart")
    theta = Coordinate("rad", "angle of the pole from the upward vertical")

    def _centre(self) -> dict[str, ca.SX]:
        return {"x": self.x + self.half * ca.sin(self.theta), "z": self.half * ca.cos(self.theta)}

    def kinetic_energy(self) -> ca.SX:
        turning = self.half**2 / 3 * self.dot(self.theta) ** 2
        pole = self.mass_pole / 2 * (self.speed_squared(self._centre()) + turning)
        return self.mass_cart / 2 * self.dot(self.x) ** 2 + pole

    def potential_energy(self) -> ca.SX:
        return self.mass_pole * self.gravity * self._centre()["z"]


def acrobot_energy(state: Any) -> float:
    a, b, u, v = state
    moving = 1.25 * u**2 + (u**2 + (u + v) ** 2 / 4 + u * (u + v) * np.cos(b)) + (u + v) ** 2
    return moving / 2 - GRAVITY * (1.5 * np.cos(a) + np.cos(a + b) / 2)


def cart_pole_energy(state: Any) -> float:
    _, v, a, w = state
    pole = (v + np.cos(a) * w / 2) ** 2 + (np.sin(a) * w / 2) ** 2 + w**2 / 12
    return v**2 / 2 + 0.1 / 2 * pole + 0.1 * GRAVITY * np.cos(a) / 2


class Drift(NamedTuple):
    """An environment of Gymnasium, and the same mechanism.

    :param attribute: of the environment, its step size.
    :param energy: of its state.
    :param state: at rest; ``starts``: the same for ours.
    :param force: that is acted on.
    """

    name: str
    mechanism: type[Mechanism]
    attribute: str
    energy: Callable[[Any], float]
    state: tuple[float, ...]
    starts: dict[str, float]
    force: str
    sizes: tuple[float, ...]


HANGING = np.pi - 0.5
DRIFTS = (
    Drift(
        "Acrobot-v1", Acrobot, "dt", acrobot_energy,
        (0.1, 0.05, 0.0, 0.0), {"theta_1_0": 0.1, "theta_2_0": 0.05}, "theta_2_force", (0.2, 0.05, 0.01),
    ),
    Drift(
        "CartPole-v1", CartPole, "tau", cart_pole_energy,
        (0.0, 0.0, HANGING, 0.0), {"theta_0": HANGING}, "x_force", (0.02, 0.01),
    ),
)  # fmt: skip


def measure(quick: bool, plots: Path) -> list[Row]:  # noqa: ARG001 - no diagram
    rounds, steps = (3, 20) if quick else (9, 100)
    copies: dict[str, Any] = {"pendulum": VectorEnvironment("Pendulum", num_envs=COPIES, **PENDULUM)}
    copies |= {name: gymnasium.make_vec(f"liaisons/{name}-v0", num_envs=COPIES) for name in REGISTERED}
    copies["CartPole"] = gymnasium.make_vec("CartPole-v1", num_envs=COPIES, vectorization_mode="vector_entry_point")
    rates = interleaved({name: _rate(environment, steps) for name, environment in copies.items()}, rounds)
    cart_poles = rates.pop("CartPole")
    topic = f"Steps a second on one core, {COPIES} copies"
    rows = [Row.of(topic, "pendulum", rates.pop("pendulum"), "steps/s", asked=">= 1e6")]
    yardstick = "Gymnasium's CartPole"
    rows += [
        Row.of(topic, name, values, "steps/s", yardstick=yardstick, beside=cart_poles) for name, values in rates.items()
    ]
    for drift in DRIFTS:
        for size in drift.sizes[:1] if quick else drift.sizes:
            ours, theirs = _drifts(drift, size)
            topic, case = f"Largest relative change of the energy in {DURATION:g} s", f"{drift.name}, steps of {size} s"
            rows.append(Row.of(topic, case, [ours], "", yardstick="Gymnasium's", beside=[theirs], asked="<= 1e-5"))
    return rows


def _rate(environment: Any, steps: int) -> Callable[[], float]:
    environment.reset(seed=0)
    environment.action_space.seed(0)
    acts = environment.action_space.sample()

    def run() -> float:
        begin = time.thread_time()
        for _ in range(steps):
            environment.step(acts)
        return steps * COPIES / (time.thread_time() - begin)

    return run


def _drifts(drift: Drift, size: float) -> tuple[float, float]:
    """Of ours and theirs; action 1 of Acrobot is no torque, the force of CartPole is switched off."""
    gymnasium.logger.min_level = gymnasium.logger.ERROR  # what goes on after the end of an episode is meant
    theirs: Any = gymnasium.make(drift.name).unwrapped
    theirs.reset(seed=0)
    setattr(theirs, drift.attribute, size)
    theirs.force_mag, theirs.state = 0.0, np.array(drift.state)
    starts, act = {**drift.starts, "gravity": GRAVITY}, {drift.force: (-1.0, 1.0)}
    ours = Environment(drift.mechanism, ["energy"], act, "0", step_size=size, start_values=starts)
    first, first_of_theirs, worst = ours.reset()[0][0], drift.energy(drift.state), np.zeros(2)
    for _ in range(round(DURATION / size)):
        theirs.step(1)
        changes = (ours.step([0.0])[0][0] / first - 1, drift.energy(theirs.state) / first_of_theirs - 1)
        worst = np.maximum(worst, np.abs(changes))
    ours.close()
    return float(worst[0]), float(worst[1])


if __name__ == "__main__":
    command(measure)
