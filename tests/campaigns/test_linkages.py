"""Random linkages whose prescribed coordinate may leave what they can reach: right, or refused by name.

Whether a value can be reached, and where everything is then, comes from triangles and circles; no equation of ours is
asked.  `pytest tests/campaigns -m slow` runs it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from making import exchange_only
from numpy.random import Generator

from liaisons import System, build, ensemble, operator, simulate
from liaisons.errors import SimulationError
from liaisons.language import (
    ActiveCoordinate,
    Coordinate,
    Gravity,
    Mechanism,
    Parameter,
    constraint,
    rheonomic_constraint,
)
from liaisons.linkages import Body, Linkage, Prismatic, Revolute, Spherical, ground
from liaisons.models import FourBar

pytestmark = pytest.mark.slow

COUNT, FURTHER, RUNS, OTHERS, MEMBERS, SEED = 300, 18, 9, 24, 40, 43
DURATION = 2.0  # s, in which σ goes from one value to another, at rest at both
NEAR = -6.0, -2.0  # exponents of distances from dead points
OFF_BY_COUPLING = 1e-3  # by extrapolation over steps of 20 ms; it is warned of
CLOSE = 1e-6  # relative error of positions; at a margin μ they have that of σ, 1e-16, over √μ


class SliderCrank(Linkage):
    """A crank moves a slider, which is off its axis."""

    crank = Body(mass=1.0, inertia=(0, 0.02, 0.02), centre=(0.25, 0, 0))
    rod = Body(mass=2.0, inertia=(0, 0.4, 0.4), centre=(0.5, 0, 0))
    block = Body(mass=1.5, inertia=(0.1, 0.1, 0.1))
    turn = Revolute(ground, crank, axis="-y", prescribed=True, start=1.0)
    knee = Revolute(crank, rod, axis="-y", at=(0.5, 0, 0), start=-1.4)
    slide = Prismatic(ground, block, axis="x", at=(0, 0, 0.1), start=1.2)
    pin = Revolute(rod, block, axis="-y", at=(1.0, 0, 0))


class DrivenSlider(Linkage):
    """A slider, which is off the axis of a crank, moves it."""

    crank = Body(mass=1.0, inertia=(0, 0.02, 0.02), centre=(0.25, 0, 0))
    rod = Body(mass=2.0, inertia=(0, 0.4, 0.4), centre=(0.5, 0, 0))
    block = Body(mass=1.5, inertia=(0.1, 0.1, 0.1))
    turn = Revolute(ground, crank, axis="-y", start=1.0)
    knee = Revolute(crank, rod, axis="-y", at=(0.5, 0, 0), start=-1.4)
    slide = Prismatic(ground, block, axis="x", at=(0, 0, 0.1), prescribed=True, start=1.2)
    pin = Revolute(rod, block, axis="-y", at=(1.0, 0, 0))


def turned(phi: float) -> np.ndarray:
    """Rotation by an angle about the axis z."""
    return np.array([[np.cos(phi), -np.sin(phi), 0], [np.sin(phi), np.cos(phi), 0], [0, 0, 1]])


def along_rod(a: float, c: float, d: float, phi: float, psi: float) -> np.ndarray:
    """From the ball of the crank to that of the rocker, seen from the crank."""
    return turned(phi).T @ np.array([d, c * np.cos(psi), c * np.sin(psi)]) - [a, 0, 0]


ROD = along_rod(0.5, 0.6, 1.2, 1.0, 1.65)  # its balls fit where the linkage is declared


class BallJointed(Linkage):
    """Crank and rocker on axes at right angles, and a rod with balls at its ends."""

    crank = Body(mass=1.0, inertia=(0.02, 0.02, 0.02), centre=(0.25, 0, 0))
    rocker = Body(mass=1.5, inertia=(0.2, 0.2, 0.2), centre=(0, 0.3, 0))
    rod = Body(mass=0.5, inertia=(0.05, 0.03, 0.05), centre=(0, -0.6, 0))
    turn = Revolute(ground, crank, axis="z", prescribed=True, start=1.0)
    swing = Revolute(ground, rocker, axis="x", at=(1.2, 0, 0), start=1.65)
    head = Spherical(crank, rod, at=(0.5, 0, 0))
    tail = Spherical(rod, rocker, at=tuple(ROD.tolist()), at_child=(0, 0.6, 0))


class Rods(Mechanism):
    """Two rods in a plane, whose end is pulled along the axis x."""

    gravity, mass = Gravity(), Parameter(1.0, "kg", "mass of the knee", above=0)
    first = Parameter(1.0, "m", "length of the first rod", above=0)
    second = Parameter(1.0, "m", "length of the second rod", above=0)
    x = Coordinate("m", "position of the knee")
    z = Coordinate("m", "height of the knee", start=-1.0)
    pull = ActiveCoordinate("m", "position of the end", start=1.0)

    @constraint("m2", "length of the first rod")
    def inner(self) -> ca.SX:
        return self.x**2 + self.z**2 - self.first**2

    @constraint("m2", "length of the second rod")
    def outer(self) -> ca.SX:
        return (self.x - self.pull) ** 2 + self.z**2 - self.second**2

    def kinetic_energy(self) -> ca.SX:
        return self.mass * (self.dot(self.x) ** 2 + self.dot(self.z) ** 2) / 2

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.z


class ThreeRods(Mechanism):
    """Three rods in a plane, whose end is pulled along the axis x; the knees move in it."""

    gravity, mass = Gravity(), Parameter(1.0, "kg", "mass of each knee", above=0)
    first = Parameter(1.0, "m", "length of the first rod", above=0)
    second = Parameter(1.0, "m", "length of the second rod", above=0)
    third = Parameter(1.0, "m", "length of the third rod", above=0)
    x = Coordinate("m", "position of the first knee")
    z = Coordinate("m", "height of the first knee", start=-1.0)
    x_2 = Coordinate("m", "position of the second knee", start=1.0)
    z_2 = Coordinate("m", "height of the second knee", start=-1.0)
    pull = ActiveCoordinate("m", "position of the end", start=1.0)

    @constraint("m2", "length of the first rod")
    def inner(self) -> ca.SX:
        return self.x**2 + self.z**2 - self.first**2

    @constraint("m2", "length of the second rod")
    def middle(self) -> ca.SX:
        return (self.x_2 - self.x) ** 2 + (self.z_2 - self.z) ** 2 - self.second**2

    @constraint("m2", "length of the third rod")
    def outer(self) -> ca.SX:
        return (self.x_2 - self.pull) ** 2 + self.z_2**2 - self.third**2

    def kinetic_energy(self) -> ca.SX:
        rates = ca.vertcat(*(self.dot(x) for x in (self.x, self.z, self.x_2, self.z_2)))
        return self.mass * ca.sumsqr(rates) / 2

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * (self.z + self.z_2)


class Tether(Mechanism):
    """A pendulum in Cartesian coordinates, whose distance from a point at its height is prescribed."""

    gravity, mass = Gravity(), Parameter(1.0, "kg", "mass of the bob", above=0)
    length = Parameter(1.0, "m", "of the rod", above=0)
    away = Parameter(1.0, "m", "distance of the point", above=0)
    x = Coordinate("m", "position of the bob")
    z = Coordinate("m", "height of the bob", start=-1.0)

    @constraint("m", "length of the rod")
    def rod(self) -> ca.SX:
        return ca.norm_2(ca.vertcat(self.x, self.z)) - self.length

    @rheonomic_constraint("m", "distance from the point", start=1.0)
    def rope(self) -> ca.SX:
        return ca.norm_2(ca.vertcat(self.x - self.away, self.z))

    def kinetic_energy(self) -> ca.SX:
        return self.mass * (self.dot(self.x) ** 2 + self.dot(self.z) ** 2) / 2

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.z


@dataclass(frozen=True)
class Case:
    """A linkage, and what its geometry says.

    :param margin: of σ: > 0 where it can be reached.
    :param positions: coordinates at σ; with ``off`` those at the start.
    :param off: error of coordinates at σ, where they are not known one by one.
    """

    component: type[Mechanism]
    moved: str
    constants: dict[str, float]
    margin: Callable[[float], float]
    positions: Callable[[float], dict[str, float]]
    begin: float
    direction: float
    off: Callable[[dict[str, float], float], float] | None = None

    def error(self, found: dict[str, float], end: float) -> float:
        """Error of what is found at an end of σ."""
        if self.off is not None:
            return self.off(found, end)
        right = self.positions(end)
        return max(abs(np.exp(1j * found[x]) - np.exp(1j * right[x])) for x in right)


def third(a: np.ndarray, b: np.ndarray, from_a: float, from_b: float, side: float) -> np.ndarray:
    """Third corner of a triangle in a plane."""
    r = float(np.linalg.norm(b - a))
    along = (from_a**2 - from_b**2 + r**2) / (2 * r)
    across = side * np.sqrt(max(from_a**2 - along**2, 0.0))
    u = (b - a) / r
    return a + along * u + across * np.array([-u[1], u[0]])


def root(f: Callable[[float], float], begin: float, end: float) -> float:
    """Where a function that is > 0 at the beginning vanishes, by bisection."""
    while begin < (middle := (begin + end) / 2) < end or end < middle < begin:
        begin, end = (middle, end) if f(middle) > 0 else (begin, middle)
    return end


def inside(r: float, a: float, b: float) -> float:
    """How far a distance is inside of what two bars reach."""
    return min(a + b - r, r - abs(a - b))


def angle(v: np.ndarray) -> float:
    return float(np.arctan2(v[1], v[0]))


def four_bar(random: Generator) -> Case:
    a, b, c, d = random.uniform([0.3, 0.5, 0.5, 1.0], [0.8, 1.5, 1.5, 2.0]).tolist()
    side = random.choice([-1.0, 1.0])
    frame = np.array([d, 0.0])

    def tip(phi: float) -> np.ndarray:
        return a * np.array([np.cos(phi), np.sin(phi)])

    def positions(phi: float) -> dict[str, float]:
        pin = third(tip(phi), frame, b, c, side)
        return {"elbow": angle(pin - tip(phi)) - phi, "swing": angle(pin - frame)}

    constants = {"elbow_at_x": a, "swing_at_x": d, "pin_at_x": b, "pin_at_child_x": c}
    return Case(
        FourBar,
        "turn",
        constants,
        lambda phi: inside(float(np.linalg.norm(frame - tip(phi))), b, c),
        positions,
        random.uniform(-3, 3),
        random.choice([-2.0, 2.0]),
    )


def slider_crank(random: Generator) -> Case:
    a, b, e = random.uniform([0.3, 0.3, -0.3], [0.8, 1.0, 0.3]).tolist()
    side = random.choice([-1.0, 1.0])

    def positions(phi: float) -> dict[str, float]:
        x, z = a * np.cos(phi), a * np.sin(phi)
        reach = side * np.sqrt(max(b * b - (e - z) ** 2, 0.0))
        return {"knee": angle(np.array([reach, e - z])) - phi, "slide": x + reach}

    return Case(
        SliderCrank,
        "turn",
        {"knee_at_x": a, "pin_at_x": b, "slide_at_z": e},
        lambda phi: b - abs(e - a * np.sin(phi)),
        positions,
        random.uniform(-3, 3),
        random.choice([-2.0, 2.0]),
    )


def driven_slider(random: Generator) -> Case:
    a, b, e = random.uniform([0.3, 0.3, -0.3], [0.8, 1.0, 0.3]).tolist()
    side = random.choice([-1.0, 1.0])

    def positions(x: float) -> dict[str, float]:
        tip = third(np.zeros(2), np.array([x, e]), a, b, side)
        return {"turn": angle(tip), "knee": angle(np.array([x, e]) - tip) - angle(tip)}

    return Case(
        DrivenSlider,
        "slide",
        {"knee_at_x": a, "pin_at_x": b, "slide_at_z": e},
        lambda x: inside(float(np.hypot(x, e)), a, b),
        positions,
        random.uniform(0.2, a + b),
        random.choice([-1.0, 1.0]),
    )


def ball_jointed(random: Generator) -> Case:
    a, c, d, rod = random.uniform([0.3, 0.4, 0.8, 0.8], [0.8, 0.9, 1.8, 1.8]).tolist()
    side, along = random.choice([-1.0, 1.0]), (rod * ROD / np.linalg.norm(ROD)).tolist()

    def parts(phi: float) -> tuple[float, float, float]:  # |tip - (d, c cos ψ, c sin ψ)|² = rod²: A cos ψ = C
        x, y = a * np.cos(phi), a * np.sin(phi)
        return 2 * c * y, (d - x) ** 2 + y * y + c * c - rod * rod, y

    def positions(phi: float) -> dict[str, float]:
        A, C, _ = parts(phi)
        return {"swing": side * float(np.arccos(np.clip(C / A, -1, 1)))}

    return Case(
        BallJointed,
        "turn",
        {
            "head_at_x": a,
            "tail_at_child_y": c,
            "swing_at_x": d,
            **dict(zip(("tail_at_x", "tail_at_y", "tail_at_z"), along, strict=True)),
        },
        lambda phi: abs(parts(phi)[0]) - abs(parts(phi)[1]),
        positions,
        random.uniform(-3, 3),
        random.choice([-1.0, 1.0]),
    )


def rods(random: Generator) -> Case:
    a, b = random.uniform(0.5, 1.5, 2).tolist()
    side = random.choice([-1.0, 1.0])

    def positions(pull: float) -> dict[str, float]:
        x, z = third(np.zeros(2), np.array([pull, 0.0]), a, b, side)
        return {"x": float(x), "z": float(z)}

    return Case(
        Rods,
        "pull",
        {"first": a, "second": b},
        lambda pull: inside(abs(pull), a, b),
        positions,
        random.uniform(abs(a - b), a + b),
        random.choice([-1.0, 1.0]),
    )


def tether(random: Generator) -> Case:
    length, away = random.uniform(0.5, 1.5, 2).tolist()
    side = random.choice([-1.0, 1.0])

    def positions(rope: float) -> dict[str, float]:
        x, z = third(np.zeros(2), np.array([away, 0.0]), length, rope, side)
        return {"x": float(x), "z": float(z)}

    return Case(
        Tether,
        "rope",
        {"length": length, "away": away},
        lambda rope: min(length + away - rope, rope - abs(length - away)),
        positions,
        random.uniform(abs(length - away), length + away),
        random.choice([-1.0, 1.0]),
    )


def parallelogram(random: Generator) -> Case:
    """It reaches every angle; where it is flat it keeps its branch."""
    a, d = random.uniform([0.3, 1.0], [0.8, 2.0]).tolist()
    return Case(
        FourBar,
        "turn",
        {"elbow_at_x": a, "swing_at_x": d, "pin_at_x": d, "pin_at_child_x": a},
        lambda _: np.inf,
        lambda phi: {"elbow": -phi, "swing": phi},
        random.choice([-1.0, 1.0]) * random.uniform(0.3, 2.8),
        random.choice([-2.0, 2.0]),
    )


def longer_chain(random: Generator) -> Case:
    """Three rods, of which only the lengths are known where they swing; taut they reach no farther."""
    lengths = random.uniform(0.5, 1.0, 3)
    a, b, c = lengths.tolist()
    pull = 0.9 * (a + b + c)
    corner = np.array([a * np.cos(0.3), -a * np.sin(0.3)])  # of the first rod; the others hang below
    x, z = third(corner, np.array([pull, 0.0]), b, c, -1.0)
    begin = {"x": float(corner[0]), "z": float(corner[1]), "x_2": float(x), "z_2": float(z)}

    def off(found: dict[str, float], end: float) -> float:
        first, second, last = (found["x"], found["z"]), (found["x_2"], found["z_2"]), (end, 0.0)
        ways = zip(((0.0, 0.0), first, second), (first, second, last), lengths, strict=True)
        return max(abs(np.hypot(q[0] - p[0], q[1] - p[1]) - length) for p, q, length in ways)

    return Case(
        ThreeRods,
        "pull",
        {"first": a, "second": b, "third": c},
        lambda pull: a + b + c - abs(pull),
        lambda _: begin,
        pull,
        random.choice([-1.0, 1.0]),
        off,
    )


EVERYWHERE = (four_bar, slider_crank, driven_slider, ball_jointed, rods, tether)
KINDS = (*EVERYWHERE, parallelogram, longer_chain)


@dataclass(frozen=True)
class Drive:
    """A case with an end of σ; ``dead``: where it cannot be reached any more on the way there, or none."""

    case: Case
    end: float
    dead: float | None

    @property
    def starts(self) -> dict[str, Any]:
        case = self.case
        values = {f"{name}_0": value for name, value in case.positions(case.begin).items()}
        return {**case.constants, **values, **(ball_starts(case) if case.component is BallJointed else {})}

    def values(self, component: str, sigma: str) -> dict[str, Any]:
        """Start values with what stands before the names of the component, and of the operator."""
        own = {component + name: value for name, value in self.starts.items()}
        return own | {sigma + name: value for name, value in self.sigma.items()}

    @property
    def sigma(self) -> dict[str, float]:
        return {"start_value": self.case.begin, "end_value": self.end, "duration": DURATION}


def ball_starts(case: Case) -> dict[str, float]:
    """Attitude of the rod at the start, relative to the crank: its axis leads to the rocker's ball."""
    a, c, d = (case.constants[name] for name in ("head_at_x", "tail_at_child_y", "swing_at_x"))
    phi, psi = case.begin, case.positions(case.begin)["swing"]
    u, v = (x / np.linalg.norm(x) for x in (ROD, along_rod(a, c, d, phi, psi)))
    q = np.r_[1 + u @ v, np.cross(u, v)]
    return dict(zip((f"head_q_{x}_0" for x in "wxyz"), (q / np.linalg.norm(q)).tolist(), strict=True))


def drives(count: int, random: Generator, kinds: Sequence[Callable[[Generator], Case]] = ()) -> Iterator[Drive]:
    """Yield cases in turn, with ends inside, outside, and near dead points at both sides."""
    made, kinds = 0, kinds or EVERYWHERE
    while made < count:
        case = kinds[made % len(kinds)](random)
        if not case.margin(case.begin) > 0.05 or (case.component is BallJointed and not well_posed(case)):
            continue
        way = np.linspace(0, 1, 400)[1:]
        path = case.begin + case.direction * way * random.uniform(0.2, 1)
        beyond = np.flatnonzero([not case.margin(s) > 0 for s in path])
        end, dead, turn = float(path[-1]), None, made // len(kinds) % 4
        if beyond.size:
            i = int(beyond[0])
            dead = root(case.margin, float(path[i - 1]) if i else case.begin, float(path[i]))
            step = float(np.sign(case.direction) * 10 ** random.uniform(*NEAR))
            end = (end, dead + step, dead - step, dead - step)[turn]
            if turn >= 2:
                dead = None
        elif np.isfinite(case.margin(case.begin)) and (turn < 3 or min(case.margin(s) for s in path) < 1e-3):
            continue
        made += 1
        yield Drive(case, end, dead)


def counted(kind: Callable[[Generator], Case]) -> int:
    """How many linkages of a kind each version of FMI gets."""
    return COUNT // (2 * len(EVERYWHERE)) if kind in EVERYWHERE else FURTHER


def well_posed(case: Case) -> bool:
    """Whether the rod of a ball-jointed loop stays away from where the two angles of the rocker meet otherwise."""
    return abs(np.sin(case.begin)) > 0.2


class Count:
    """What became of the drives."""

    def __init__(self, bound: float = CLOSE) -> None:
        self.bound = bound
        self.right = self.refused = 0
        self.wrong: list[str] = []

    def take(self, label: str, drive: Drive, found: dict[str, float] | str, near: float = 1e-4) -> None:
        """Judge an end, or a sentence; ``near``: how exactly it has to tell the dead point."""
        text = f"{label} {drive.case.component.__name__} {drive.starts} {drive.sigma}: "
        if isinstance(found, str):
            told = re.search(rf"{drive.case.moved} = ([-+.e0-9]+)", found)
            if drive.dead is None:
                self.wrong.append(f"{text}refused although it can be reached: {found}")
            elif "cannot be kept" not in found or told is None or not abs(float(told[1]) - drive.dead) < near:
                self.wrong.append(f"{text}not by name, or elsewhere than at {drive.dead}: {found}")
            else:
                self.refused += 1
            return
        error = drive.case.error(found, drive.end)
        if drive.dead is not None:
            self.wrong.append(f"{text}nothing said beyond {drive.dead}")
        elif not error < self.bound:
            self.wrong.append(f"{text}off by {error:.2g}")
        else:
            self.right += 1

    def check(self, count: int, *kinds: Callable[[Generator], Case]) -> None:
        assert not self.wrong, f"{len(self.wrong)} of {count}:\n" + "\n".join(self.wrong[:20])
        assert self.refused > count / 5 or kinds == (parallelogram,), "too few that cannot be reached"


def outcome(drive: Drive, run: Callable[[], Any], before: str = "") -> dict[str, float] | str:
    try:
        result = run()
    except SimulationError as refusal:
        return str(refusal)
    return {name: float(result[before + name][-1]) for name in drive.case.positions(drive.end)}


@pytest.fixture(scope="module")
def forms(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """FMUs of the components by form, each built once."""
    made: dict[Any, Path] = {}

    def form(component: type, **options: Any) -> Path:
        key = (component, *options.items())
        if key not in made:
            made[key] = build(component, tmp_path_factory.mktemp("fmu"), **options)
        return made[key]

    return form


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("fmi", ["2", "3"])
def test_in_co_simulation(forms: Callable[..., Path], kind: Callable[[Generator], Case], fmi: str) -> None:
    """By Gauss-Seidel after the operator's FMU, run after run of the same instances: all solvers, random tolerances."""
    random, count = np.random.default_rng([SEED, int(fmi), KINDS.index(kind)]), Count()
    chosen = drives(counted(kind), random, (kind,))
    while part := [*islice(chosen, RUNS)]:
        case, tolerance, step = part[0].case, 10 ** random.uniform(-10, -4), random.uniform(0.01, 0.1)
        system = System("driven")
        it, sigma = system.add("it", forms(case.component, fmi=fmi)), system.add("sigma", "SmoothStep")
        system.connect(sigma["y"], it[case.moved])
        begun = part[0].values("it.", "sigma.")
        with system.with_start_values(begun).start(stop_time=DURATION, tolerance=tolerance, step_size=step) as run:
            for i, drive in enumerate(part):
                solver = {"it.stiff_solver": int(i % 4 == 2), "it.symplectic_steps": 8 * int(i % 4 == 3)}

                def follow(drive: Drive = drive, solver: dict[str, int] = solver) -> Any:
                    run.reset({**drive.values("it.", "sigma."), **solver})
                    while run.time < DURATION - 1e-9:
                        run.step()
                    return run.result

                found = outcome(drive, follow, "it.")
                while isinstance(found, str) and "is not enough" in found and solver["it.symplectic_steps"] < 5000:
                    solver["it.symplectic_steps"] *= 8  # as it says: near a dead point all moves fast
                    found = outcome(drive, follow, "it.")
                count.take(f"{tolerance:.1e} {step:.3f} {solver}", drive, found)
    count.check(counted(kind), kind)


@pytest.mark.parametrize("way", ["Python back end", "Model Exchange", "Jacobi", "verify"])
def test_in_other_ways(forms: Callable[..., Path], tmp_path: Path, way: str) -> None:
    """A part of them: all linkages, each near its dead points, too."""
    count = Count(OFF_BY_COUPLING if way == "Jacobi" else CLOSE)
    for drive in drives(OTHERS, np.random.default_rng(SEED + 1)):
        fmu = forms(drive.case.component, backend="python" if way == "Python back end" else "native")
        fmu = exchange_only(fmu, tmp_path) if way == "Model Exchange" else fmu
        settings: dict[str, Any] = {"Jacobi": {"coupling": "jacobi"}, "verify": {"verify": True}}.get(way, {})

        def run(fmu: Path = fmu, drive: Drive = drive, settings: dict[str, Any] = settings) -> Any:
            starts = {**drive.starts, drive.case.moved: operator("SmoothStep", start_values=drive.sigma)}
            return simulate(fmu, stop_time=DURATION, step_size=0.02, start_values=starts, **settings)

        count.take(way, drive, outcome(drive, run))
    count.check(OTHERS)


@pytest.mark.parametrize("kind", KINDS)
def test_in_ensembles(kind: Callable[[Generator], Case]) -> None:
    random, count = np.random.default_rng(SEED + 2), Count(1e-5)  # steps of 5 ms
    chosen = list(drives(MEMBERS, random, (kind,)))
    moved, component = chosen[0].case.moved, chosen[0].case.component
    rows = [drive.values("", f"{moved}.") for drive in chosen]
    values = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    found = ensemble(
        component, values, operators={moved: "SmoothStep"}, stop_time=DURATION, step_size=0.005, samples=20,
        record=[*chosen[0].case.positions(chosen[0].end)],
    )  # fmt: skip
    for i, drive in enumerate(chosen):
        ends = {name: float(found[name][-1, i]) for name in found.names}
        count.take("ensemble", drive, found.failures.get(i, ends))
    count.check(MEMBERS, kind)
