"""Loops whose conditions depend on each other, in Model Exchange: multipliers are the shortest ones, or it is refused.

Along each motion the states that an importer hands over are put onto the loop, and the multipliers calculated there by
NumPy's pseudo-inverse, in the metric in which redundant conditions share their force.  `pytest tests/campaigns -m slow`
runs it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import casadi as ca
import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from numpy.typing import NDArray

from liaisons import build
from liaisons.language import Coordinate, Gravity, Mechanism, Parameter, constraint
from liaisons.mechanics import assemble
from liaisons.models import Bricard

pytestmark = pytest.mark.slow

SEED, RUNS, STOP, EVERY = 46, 4, 1.0, 0.1
WAYS = [("CVode", tolerance) for tolerance in (1e-4, 1e-6, 1e-8, 1e-10)]
WAYS += [("Euler", step) for step in (1e-2, 1e-3, 1e-4)]
RANK = 1e-7
"""Singular value, relative to the largest one, below which there is none: far above rounding, far below the others."""
ROUNDING, MAGNIFIED = 5e-4, 100.0
"""Errors of multipliers, relative to the largest: a rounding of 1e-14 over the slack of 1e-10 by which they share
their force, and per unit of a drift."""


class Cranks(Mechanism):
    """Parallelogram of a heavy coupler on two cranks, and on a third one in its middle."""

    gravity = Gravity()
    mass_1 = Parameter(1.0, "kg", "mass at one end of the coupler", above=0)
    mass_2 = Parameter(2.0, "kg", "mass at its other end", above=0)
    crank = Parameter(0.7, "m", "length of the cranks", above=0)
    base = Parameter(1.3, "m", "distance of the outer cranks", above=0)
    x_1 = Coordinate("m", "position of one end", start=0.7)
    z_1 = Coordinate("m", "height of one end")
    x_2 = Coordinate("m", "position of the other end", start=2.0)
    z_2 = Coordinate("m", "height of the other end")

    @constraint("m2", "length of the first crank")
    def first(self) -> ca.SX:
        return self.x_1**2 + self.z_1**2 - self.crank**2

    @constraint("m2", "length of the last crank")
    def last(self) -> ca.SX:
        return (self.x_2 - self.base) ** 2 + self.z_2**2 - self.crank**2

    @constraint("m2", "length of the coupler")
    def coupler(self) -> ca.SX:
        return (self.x_2 - self.x_1) ** 2 + (self.z_2 - self.z_1) ** 2 - self.base**2

    @constraint("m2", "length of the crank in the middle")
    def middle(self) -> ca.SX:
        return ((self.x_1 + self.x_2 - self.base) ** 2 + (self.z_1 + self.z_2) ** 2) / 4 - self.crank**2

    def kinetic_energy(self) -> ca.SX:
        squares = [self.dot(x) ** 2 + self.dot(z) ** 2 for x, z in ((self.x_1, self.z_1), (self.x_2, self.z_2))]
        return (self.mass_1 * squares[0] + self.mass_2 * squares[1]) / 2

    def potential_energy(self) -> ca.SX:
        return self.gravity * (self.mass_1 * self.z_1 + self.mass_2 * self.z_2)


class Truss(Mechanism):
    """Two masses on a pin, and all rods between pin, masses and a third, light point: one of the rods is too many."""

    gravity = Gravity()
    mass = Parameter(1.0, "kg", "mass of each point", above=0)
    side = Parameter(1.0, "m", "side of the square", above=0)
    x_1 = Coordinate("m", "position of the first point", start=1.0)
    z_1 = Coordinate("m", "height of the first point")
    x_2 = Coordinate("m", "position of the second point", start=1.0)
    z_2 = Coordinate("m", "height of the second point", start=1.0)
    x_3 = Coordinate("m", "position of the third point")
    z_3 = Coordinate("m", "height of the third point", start=1.0)

    def rod(self, i: int, j: int, square: float) -> ca.SX:
        points = [(0, 0), (self.x_1, self.z_1), (self.x_2, self.z_2), (self.x_3, self.z_3)]
        (a, b), (c, d) = points[i], points[j]
        return (c - a) ** 2 + (d - b) ** 2 - square * self.side**2

    @constraint("m2", "side from the pin")
    def side_1(self) -> ca.SX:
        return self.rod(0, 1, 1)

    @constraint("m2", "second side")
    def side_2(self) -> ca.SX:
        return self.rod(1, 2, 1)

    @constraint("m2", "third side")
    def side_3(self) -> ca.SX:
        return self.rod(2, 3, 1)

    @constraint("m2", "side to the pin")
    def side_4(self) -> ca.SX:
        return self.rod(0, 3, 1)

    @constraint("m2", "diagonal from the pin")
    def diagonal_1(self) -> ca.SX:
        return self.rod(0, 2, 2)

    @constraint("m2", "other diagonal")
    def diagonal_2(self) -> ca.SX:
        return self.rod(1, 3, 2)

    def kinetic_energy(self) -> ca.SX:
        rates = [self.dot(x) for x in (self.x_1, self.z_1, self.x_2, self.z_2, self.x_3, self.z_3)]
        return self.mass / 2 * ca.sumsqr(ca.vertcat(*rates))

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * (self.z_1 + self.z_2 + self.z_3)


def cranks(random: np.random.Generator) -> dict[str, float]:
    """Values at a random angle and rate, not flat."""
    crank, base, angle, rate = random.uniform([0.3, 0.5, 0.5, -2], [1.0, 2.0, 2.6, 2]).tolist()
    x, z = crank * np.cos(angle), crank * np.sin(angle)
    values = {"mass_1": random.uniform(0.5, 2), "mass_2": random.uniform(0.5, 2), "crank": crank, "base": base}
    for end, shift in (("1", 0.0), ("2", base)):
        values |= {f"x_{end}_0": x + shift, f"z_{end}_0": z, f"x_{end}_dot_0": -rate * z, f"z_{end}_dot_0": rate * x}
    return values


def truss(random: np.random.Generator) -> dict[str, float]:
    """Values at a random angle and rate."""
    side, angle, rate = random.uniform([0.5, -3, -3], [1.5, 3, 3]).tolist()
    values = {"side": side, "mass": random.uniform(0.5, 2)}
    for point, at in (("1", (1, 0)), ("2", (1, 1)), ("3", (0, 1))):
        x, z = side * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) @ at
        values |= {f"x_{point}_0": x, f"z_{point}_0": z, f"x_{point}_dot_0": -rate * z, f"z_{point}_dot_0": rate * x}
    return values


LOOPS: list[tuple[type[Mechanism], Callable[[np.random.Generator], dict[str, float]]]] = [
    (Cranks, cranks), (Truss, truss), (Bricard, lambda _: {}),
]  # fmt: skip


@dataclass(frozen=True)
class Mechanics:
    """What a declaration says, as numbers: conditions, their Jacobian and its change, masses and forces."""

    coordinates: list[str]
    conditions: list[str]
    function: ca.Function

    def on_loop(self, q: NDArray, v: NDArray, k: NDArray) -> tuple[NDArray, NDArray, float]:
        """Coordinates and rates on the loop next to others, and how far these were off it, relative to sizes."""
        begin, rates = q, v
        for _ in range(6):
            c, J, _, A, *_ = self(q, v, k)
            q = q - np.linalg.solve(A, J.T) @ np.linalg.pinv(J @ np.linalg.solve(A, J.T), RANK) @ c
        _, J, _, A, *_ = self(q, v, k)
        v = v - np.linalg.solve(A, J.T) @ np.linalg.pinv(J @ np.linalg.solve(A, J.T), RANK) @ (J @ v)
        off = max(np.max(np.abs(q - begin)), np.max(np.abs(v - rates)) / max(1.0, np.max(np.abs(v))))
        return q, v, float(off)

    def __call__(self, q: NDArray, v: NDArray, k: NDArray) -> list[NDArray]:
        found = [np.array(x) for x in self.function(q, v, k)]
        return [x[:, 0] if x.shape[1] == 1 else x for x in found]

    def multipliers(self, q: NDArray, v: NDArray, k: NDArray) -> tuple[NDArray, float]:
        """Those of J q'' = -J' q' with A q'' = f + Jᵀ λ that are shortest in the metric of the loop.

        :returns: them, and how near it is to where more rank is lost: the least singular value, of the largest.
        """
        _, J, change, A, f, squares = self(q, v, k)
        W = np.sqrt(squares @ (1 / np.diag(A)))
        towards = np.linalg.solve(A, J.T)
        sizes = np.linalg.svd(J @ towards / W, compute_uv=False) / np.linalg.norm(J @ towards / W, 2)
        found = np.linalg.pinv(J @ towards / W, RANK) @ (-change - towards.T @ f) / W
        return found, float(sizes[sizes > RANK].min())


@cache
def mechanics(component: type[Mechanism]) -> tuple[Mechanics, dict[str, float]]:
    """Of a declaration, and the values of its parameters."""
    m, model = component(), assemble(component)
    values = {p.name: float(p.starts[0]) for p in model.parameters if p.name in m.symbols}
    q, v, L = m.free.q, m.free.q_dot, m.lagrangian()
    c = ca.vertcat(*(getattr(m, item.name) for item in m.constraints))
    J, p = ca.jacobian(c, q), ca.gradient(L, v)
    squares = J**2
    for k in range(q.numel()):
        squares += (ca.reshape(ca.jacobian(ca.vec(J), q[k]), *J.shape) * m.free.sizes[k]) ** 2
    results = [c, J, ca.jacobian(J @ v, q) @ v, ca.hessian(L, v)[0], ca.gradient(L, q) - ca.jacobian(p, q) @ v, squares]
    constants = ca.vertcat(*(m.symbols[name] for name in values))
    results = [ca.densify(x) for x in results]
    names = [symbol.name() for symbol in ca.vertsplit(q)]
    function = ca.Function("mechanics", [q, v, constants], results)
    return Mechanics(names, [item.name for item in m.constraints], function), values


@pytest.mark.parametrize("way", WAYS, ids=lambda way: f"{way[0]}-{way[1]:g}")
@pytest.mark.parametrize("loop", LOOPS, ids=lambda loop: loop[0].__name__)
def test_multipliers_are_the_shortest_ones(
    forms: Callable[[type], Path],
    loop: tuple[type[Mechanism], Callable[[np.random.Generator], dict[str, float]]],
    way: tuple[str, float],
) -> None:
    component, draw = loop
    (own, constants), random = mechanics(component), np.random.default_rng(SEED)
    (solver, setting), wrong, right, refused = way, list[Any](), 0, 0
    options: dict[str, Any] = {"step_size": setting} if solver == "Euler" else {"relative_tolerance": setting}
    read = [f"{name}{end}" for end in ("", "_dot") for name in own.coordinates]
    multipliers = [f"lambda_{name}" for name in own.conditions]
    for _ in range(RUNS if component is not Bricard else 1):
        values = draw(random)
        k = np.array([values.get(name, default) for name, default in constants.items()])
        try:
            run = fmpy.simulate_fmu(
                str(forms(component)), fmi_type="ModelExchange", solver=solver, stop_time=STOP, output_interval=EVERY,
                start_values=values, output=[*read, *multipliers], **options,
            )  # fmt: skip
        except FMICallException:
            refused += 1
            continue
        n = len(own.coordinates)
        for row in run:
            y, found = np.array([row[name] for name in read]), np.array([row[name] for name in multipliers])
            q, v, off = own.on_loop(y[:n], y[n:], k)
            expected, rank = own.multipliers(q, v, k)
            error = np.max(np.abs(found - expected)) / np.max(np.abs(expected))
            if error < ROUNDING + MAGNIFIED * off / rank:
                right += 1
            else:
                wrong.append((values, row["time"], off, rank, error))
    sys.stdout.write(f"{component.__name__} {way}: {right} right, {refused} runs refused, {len(wrong)} silent\n")
    assert wrong == []
    assert right > 0


@pytest.fixture(scope="module")
def forms(tmp_path_factory: pytest.TempPathFactory) -> Callable[[type], Path]:
    """FMUs of the loops, each built once."""
    return cache(lambda component: build(component, tmp_path_factory.mktemp("fmu")))
