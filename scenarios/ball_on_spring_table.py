"""A ball bounces on a table on a spring, which is another FMU: each impact acts on both, through their port.

One FMU is the ball, another the table.  Their port passes the table's height to the ball, and forces and impulses back.
With the masses m and M and the restitution e, an impact at the relative speed w gives the table the impulse (1 + e) w m
M/(m + M).  Between impacts the ball falls freely and the table oscillates.  The expected motion consists of these
flights, each of which ends at the root of an equation.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from liaisons import System
from liaisons.scenarios import Claims, dots, panels, scenario, within

MASS, TABLE, STIFFNESS, BOUNCE, GRAVITY, HEIGHT, STOP = 0.5, 1.5, 60.0, 0.8, 9.81, 0.4, 2.0
OMEGA, SHARED = np.sqrt(STIFFNESS / TABLE), (1 + BOUNCE) * MASS * TABLE / (MASS + TABLE)


def flight(s: Any, h: float, v: float, x: float, u: float) -> Any:
    """Heights and rates of ball and table a time s after they were h, x and v, u."""
    c, w = np.cos(OMEGA * s), np.sin(OMEGA * s)
    return np.array([h + v * s - GRAVITY / 2 * s**2, v - GRAVITY * s, x * c + u / OMEGA * w, u * c - x * OMEGA * w])


def flights(times: NDArray) -> NDArray:
    """Height of the ball, height of the table [m], and sum of the impulses [N.s], shape (3, times)."""
    t, start, total, rows = 0.0, (HEIGHT, 0.0, 0.0, 0.0), 0.0, np.empty((3, len(times)))
    grid = np.linspace(1e-6, STOP, 20_001)
    while t < STOP:
        h, _, x, _ = flight(grid, *start)
        k = int(np.argmax(h < x))
        end: Any = brentq(lambda s, start=start: flight(s, *start)[[0, 2]] @ (1, -1), grid[k - 1], grid[k], xtol=1e-15)
        inside = (times >= t) & (times < t + end)
        rows[:2, inside], rows[2, inside] = flight(times[inside] - t, *start)[[0, 2]], total
        h, v, x, u = flight(end, *start)
        impulse = SHARED * (u - v)
        t, total, start = t + end, total + impulse, (h, v + impulse / MASS, x, u - impulse / TABLE)
    return rows


@scenario
def main(claim: Claims) -> None:
    system = System("ball on a table")
    ball = system.add("ball", "BouncingBall", height_0=HEIGHT, mass=MASS, bounce=BOUNCE)
    table = system.add("table", "Oscillator", x_0=0.0, mass=TABLE, stiffness=STIFFNESS)
    system.connect(table["x"], ball["table"])
    run = system.simulate(stop_time=STOP, step_size=0.004, tolerance=1e-12)
    exact, reason = flights(run.time), "inputs of sixth order at steps of 4 ms; impacts are solved to rounding"
    for k, name in enumerate(("ball.height", "table.x", "ball.gap_impulse")):
        claim(name, run[name], exact[k], within(1e-8, "N.s" if k == 2 else "m", because=reason))
    claim("works of both cancel", run["ball.work"] + run["table.work"], 0.0, within(1e-8, "J", because=reason))

    (axis,) = panels(("a ball on a table on a spring", "t [s]", "height [m]"), size=(8, 4))
    axis.plot(run.time, np.transpose([run["ball.height"], run["table.x"]]), label=["ball", "table"])
    dots(axis, run.time, exact[0], label="flights and impacts")
