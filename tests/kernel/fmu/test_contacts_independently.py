"""FMUs with several contacts against SciPy: other state (q, q'), all modes tried, linear equations of each in NumPy."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import product
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from bodies import Rod
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from liaisons import simulate
from liaisons.mechanics import derive

TIMES = np.linspace(0.0, 1.0, 101)
ZERO = 1e-9
"""Positions, rates and accelerations of metres and seconds that are roundings here."""
OPEN, CLOSED = 0, 1
FORWARD, STICKS, BACKWARD = 1, 0, -1

Floats = NDArray[Any]


def floor(t: float) -> tuple[float, float, float]:
    """Height of the floor, its rate and acceleration."""
    return 0.1 * t, 0.1, 0.0


def belt(t: float) -> tuple[float, float, float]:
    """Way sideways, its rate and acceleration, so that the rod sticks and slides again."""
    return 0.5 * t**3, 1.5 * t**2, 3.0 * t


class Independent:
    """The rod between its events; contacts are left, right, slip."""

    def __init__(self, **values: float) -> None:
        derived = derive(Rod)
        m, numbers = derived.mechanism, {p.name: values.get(p.name, p.start) for p in Rod.parameters}
        v, x, rates = m.free.q_dot, m.contact_forces, m.contact_rates()
        change = ca.substitute(m.dot(rates), m.free.q_ddot, derived.accelerations)
        impulses = ca.solve(derived.mass_matrix, ca.jacobian(rates, v).T)
        results = [derived.accelerations, ca.vertcat(m.left, m.right), rates, change, ca.jacobian(change, x), impulses]
        rest = {str(f): (f, 0.0) for f in ca.vertsplit(ca.vertcat(derived.applied.drives, derived.applied.loads))}
        rest |= {name: (m.symbols[name], value) for name, value in numbers.items()}
        symbols, constants = zip(*rest.values(), strict=True)
        fixed = ca.substitute(results, [ca.vertcat(*symbols)], [ca.DM(constants)])
        moved = ca.vertcat(m.active.s, m.active.s_dot, m.active.s_ddot)
        self._function = ca.Function("rod", [m.free.q, v, moved, x], fixed)
        self.e, self.static, self.sliding = (numbers[name] for name in ("bounce", "grip", "drag"))

    def at(self, t: float, y: Floats, x: Floats | None = None) -> list[Floats]:
        """Accelerations, gaps, rates, their derivatives, G, and what unit impulses make of q'."""
        moved = np.transpose([belt(t), floor(t)]).ravel()
        return [np.array(r).squeeze() for r in self._function(y[:3], y[3:], moved, np.zeros(3) if x is None else x)]

    def forces(self, modes: tuple[int, ...], rates: Floats, G: Floats, sliding: float) -> Floats:
        """What makes rates + G x 0 where a mode holds; x = 0 where it is open, and as it slides."""
        left, right, slips = modes
        rows, wanted = np.eye(3), np.zeros(3)
        for i, held in enumerate((left, right, left and slips == STICKS)):
            if held:
                rows[i], wanted[i] = G[i], -rates[i]
        if left and slips != STICKS:
            rows[2, 0] = slips * sliding
        return np.linalg.solve(rows, wanted)

    def chosen(
        self, rates: Floats, G: Floats, may: list[tuple[int, ...]], static: float
    ) -> tuple[tuple[int, ...], Floats]:
        """The modes that are right for rates, or accelerations, and their forces."""
        for modes in product(*may):
            x = self.forces(modes, rates, G, self.sliding)
            after = rates + G @ x
            gaps_hold = all(x[i] >= -ZERO if modes[i] else after[i] >= -ZERO for i in (0, 1) if len(may[i]) > 1)
            if not modes[0]:
                rubs = modes[2] == STICKS
            elif modes[2] == STICKS:
                rubs = abs(x[2]) < static * x[0] - ZERO
            else:
                rubs = len(may[2]) == 1 or modes[2] * after[2] >= -ZERO
            if gaps_hold and rubs:
                return modes, x
        raise AssertionError(f"no modes are right: {rates}, {G}, {may}")

    def settled(self, t: float, y: Floats) -> tuple[Floats, tuple[int, ...]]:
        """State after impacts, and the modes from there on."""
        while True:
            _, gaps, v, change, G, impulses = self.at(t, y)
            touching = gaps <= ZERO
            if not (touching & (v[:2] < -ZERO)).any():
                break
            strikes = touching & (v[:2] <= ZERO)
            rates = v + np.append(self.e * np.minimum(v[:2], 0), 0)
            may = [(CLOSED, OPEN) if s else (OPEN,) for s in strikes]
            _, x = self.chosen(rates, G, [*may, (STICKS, FORWARD, BACKWARD)], self.sliding)
            y = y + np.append(np.zeros(3), impulses @ x)
        rests = touching & (np.abs(v[:2]) <= ZERO)
        may = [(CLOSED, OPEN) if r else (OPEN,) for r in rests]
        slips = (STICKS, FORWARD, BACKWARD) if abs(v[2]) <= ZERO else (int(np.sign(v[2])),)
        modes, _ = self.chosen(change, G, [*may, slips if rests[0] else (STICKS,)], self.static)
        return y, modes

    def events(self, modes: tuple[int, ...]) -> Iterator[Callable[[float, Floats], float]]:
        """What ends a mode where it falls to 0."""
        for i in (0, 1):
            if modes[i]:
                yield lambda t, y, i=i: self._x(modes, t, y)[i]
            else:
                yield lambda t, y, i=i: self.at(t, y)[1][i]
        if modes[0] and modes[2] == STICKS:
            yield lambda t, y: self.static * self._x(modes, t, y)[0] - abs(self._x(modes, t, y)[2])
        elif modes[0]:
            yield lambda t, y: modes[2] * self.at(t, y)[2][2]

    def _x(self, modes: tuple[int, ...], t: float, y: Floats) -> Floats:
        *_, change, G, _ = self.at(t, y)
        return self.forces(modes, change, G, self.sliding)

    def run(self, y: Floats, stop: float) -> tuple[Floats, list[tuple[float, tuple[int, ...]]]]:
        """States at the times, and each instant at which modes were chosen, with these."""
        t, rows, history = 0.0, [], []
        while t < stop:
            y, modes = self.settled(t, y)
            history.append((t, modes))
            events = list(self.events(modes))
            for event in events:
                event.terminal, event.direction = True, -1  # type: ignore[attr-defined]

            def rate(t: float, y: Floats, modes: tuple[int, ...] = modes) -> Floats:
                return np.append(y[3:], self.at(t, y, self._x(modes, t, y))[0])

            inside = [time for time in TIMES if t <= time <= stop]
            done = solve_ivp(
                rate, (t, stop), y, "DOP853", max_step=0.01, events=events, dense_output=True, rtol=1e-11, atol=1e-12
            )
            assert done.success
            rows += [done.sol(time) for time in inside if time < done.t[-1]]
            t, y = float(done.t[-1]), done.y[:, -1]
        return np.array([*rows, y]), history


STATES = ["x", "z", "angle", "x_dot", "z_dot", "angle_dot"]
START = np.array([0.0, 0.5, 0.4, 1.0, 0.0, 1.0])
BODY = {"mass": 2.0, "length": 0.6, "bounce": 0.0, "grip": 0.5, "drag": 0.3}


def assert_agrees(path: Path, start: Floats, stop: float, **values: float) -> list[tuple[int, ...]]:
    """Compare all states at all times; returns the modes that came one after the other."""
    values = BODY | values
    rows, history = Independent(**values).run(start, stop)
    values |= dict(zip((f"{name}_0" for name in STATES), start.tolist(), strict=True))
    moves = {"belt": belt, "floor": floor}
    run = simulate(path, stop_time=stop, step_size=0.01, tolerance=1e-11, inputs=moves, start_values=values)
    assert np.transpose([run[name] for name in STATES]) == pytest.approx(rows, abs=1e-9)
    return [modes for _, modes in history]


def test_rod_slides_and_sticks(fmu: Callable[..., Path]) -> None:
    """It lands on its left end, then on its right one, slides forward, sticks, and slides backward."""
    modes = assert_agrees(fmu(Rod), START, 1.0)
    assert modes == [(0, 0, 0), (1, 0, 1), (1, 1, 1), (1, 1, 0), (1, 1, -1)]


def test_rod_bounces(fmu: Callable[..., Path]) -> None:
    """From one end onto the other, four times."""
    modes = assert_agrees(fmu(Rod), START, 0.6, drag=0.0, grip=0.0, bounce=0.6)
    assert modes == [(0, 0, 0)] * 5


@pytest.mark.slow
def test_rods(fmu: Callable[..., Path], seed: int) -> None:
    """From random starts, with friction, without restitution."""
    rng = np.random.default_rng(seed)
    start = np.array([0.0, 0.45, *rng.uniform((-0.5, -2.0, -1.0, -4.0), (0.5, 2.0, 1.0, 4.0))])
    assert_agrees(fmu(Rod), start, 1.0, grip=0.6, drag=rng.uniform(0.1, 0.6))
