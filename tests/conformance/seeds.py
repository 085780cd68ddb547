"""Random lives of mechanisms with contacts, through contacts.c.

    python tests/conformance/seeds.py [--count N] [--first N]

runs so many lives of each kind, and prints a line for each.
"""

from __future__ import annotations

import argparse
import collections
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "kernel/fmu"))
sys.path.insert(0, str(Path(__file__).parent))

import bodies
from trial import SOURCES, Trial, compile_program, reals, start_values, unpack

from liaisons import Mechanism, System, build, flatten
from liaisons.models import BallRow, BouncingBall, Sinusoid, StringPendulum

Generator = np.random.Generator


@dataclass(frozen=True, slots=True)
class Kind:
    """What is put through its lives: parameters at random, and positions, which scale gaps."""

    body: type[Mechanism]
    gaps: tuple[str, ...]
    positions: tuple[str, ...]
    coordinates: Mapping[str, float]  # prescribed, and where they are on average
    draw: Callable[[Generator], dict[str, float]]
    shaken: bool = False  # by Sinusoid, inside one FMU


@dataclass(frozen=True, slots=True)
class Life:
    """How a life went."""

    kind: str
    seed: int
    status: int
    time: float
    longest_call: float  # [s]
    lowest_gap: float  # in parts of its scale
    imbalance: float  # of energy, in parts of the energies
    gain: float  # the same of impact_loss, where it falls
    trace: bool  # of a refused step
    said: str

    @property
    def faults(self) -> list[str]:
        """What must not be."""
        found = {
            "penetrates": self.lowest_gap < -1e-12,
            "gains energy": self.gain > 1e-13,  # rounding of a hundred impacts without loss
            "leaves a trace": self.trace,
            "does not balance": self.imbalance > 1e-7,
        }
        return [name for name, is_so in found.items() if is_so]


def _ball(random: Generator) -> dict[str, float]:
    return {
        "mass": 10 ** random.uniform(-2, 2),
        "bounce": random.choice([0.0, 0.2, 0.5, 0.8, 0.95, 1.0, random.uniform()]),
        "gravity": random.choice([9.81, 1.0, 0.0], p=[0.8, 0.1, 0.1]),
        "height_0": random.choice([1.0, random.uniform(0.2, 3.0)]),
        "height_dot_0": random.normal() * 2,
    }


def _sledge(random: Generator) -> dict[str, float]:
    ball = _ball(random)
    drag = random.choice([0.0, 0.3, random.uniform(0, 1)])
    return {
        **{name: ball[name] for name in ("mass", "bounce", "gravity")},
        "drag": drag,
        "grip": drag * random.choice([1.0, 1.5]),
        "z_0": ball["height_0"],
        "x_dot_0": random.normal() * 2,
        "z_dot_0": ball["height_dot_0"],
    }


def _block(random: Generator) -> dict[str, float]:
    drag = random.uniform(0, 2)
    return {
        "stiffness": 10 ** random.uniform(0, 2),
        "drag": drag,
        "grip": drag * random.choice([1.0, 1.5]),
        "x_0": random.normal(),
        "x_dot_0": random.choice([0.0, random.normal()]),
    }


def _stone(random: Generator) -> dict[str, float]:
    angle, length = random.uniform(-np.pi, np.pi), random.choice([0.5, random.uniform(0.2, 0.6)])
    return {
        "bounce": random.choice([0.0, 0.5, random.uniform()]),
        "x_0": length * np.sin(angle),
        "z_0": -length * np.cos(angle),
        "x_dot_0": random.normal() * 2,
        "z_dot_0": random.normal() * 2,
    }


def _rod(random: Generator) -> dict[str, float]:
    return {
        "bounce": random.choice([0.0, 0.5, 0.9, random.uniform()]),
        "gravity": 9.81,
        "angle_0": random.uniform(-1, 1),
        "angle_dot_0": random.normal(),
        "z_0": 2.0,
        "x_dot_0": random.normal(),
        "z_dot_0": random.normal(),
    }


def _row(random: Generator) -> dict[str, float]:
    masses = {f"mass[{i}]": 10 ** random.choice([0.0, random.uniform(-1, 1)]) for i in (1, 2, 3)}
    return {
        **masses,
        "bounce": random.choice([0.0, 0.5, 1.0, random.uniform()]),
        "x_0[1]": -1.0,
        "x_0[2]": random.choice([0.0, random.uniform(-0.5, 0.5)]),
        "x_0[3]": random.choice([0.6, random.uniform(0.6, 1)]),
        **{f"x_dot_0[{i}]": random.normal() for i in (1, 2, 3)},
    }


def _shaken(random: Generator) -> dict[str, float]:
    frequency = random.uniform(2, 40)
    return {
        **{f"ball.{name}": value for name, value in _ball(random).items()},
        "shaker.amplitude": random.uniform(0, 3) * 9.81 / frequency**2,
        "shaker.angular_frequency": frequency,
        "shaker.phase": random.uniform(0, 2 * np.pi),
        "shaker.offset": -10.0,
    }


KINDS = {
    "ball": Kind(BouncingBall, ("gap",), ("height", "table"), {"table": -0.5}, _ball),
    "shaken ball": Kind(BouncingBall, ("ball.gap",), ("ball.height", "ball.table"), {}, _shaken, shaken=True),
    "sledge": Kind(bodies.Sledge, ("gap",), ("z", "table"), {"table": -0.5, "belt": 0.0}, _sledge),
    "block": Kind(bodies.Block, (), (), {"belt": 0.0}, _block),
    "stone": Kind(StringPendulum, ("slack",), ("x", "z", "length"), {"length": 1.5}, _stone),
    "rod": Kind(bodies.Rod, ("left", "right"), ("z", "floor"), {"belt": 0.0, "floor": -0.5}, _rod),
    "row": Kind(BallRow, ("gap[1]", "gap[2]"), ("x[1]", "x[2]", "x[3]"), {}, _row),
}


def built(kind: Kind, folder: Path) -> Path:
    """The FMU of a kind."""
    body = build(kind.body, folder)
    if not kind.shaken:
        return body
    system = System("shaken ball")
    shaker = system.add("shaker", build(Sinusoid, folder), offset=-10.0)
    ball = system.add("ball", body)
    system.connect(shaker["y"], ball["table"])
    return flatten(system, folder, components={kind.body.__name__: kind.body})


def motion(random: Generator, mean: float, mode: int, step: float) -> list[float]:
    """Offset, amplitude, frequency and phase of a sine, height and half period of a triangular wave.

    Between communication points the FMU extrapolates or interpolates: what it misses of the motion must be less than
    it may follow.  In mode 0 nothing moves inside a step, so that motions are slow.
    """
    frequency = random.uniform(0.5, min(10.0, 0.1 / step))
    amplitude = random.choice([0.0, random.uniform(0, 0.2)])
    height = random.choice([0.0, random.uniform(0, 0.2)]) if mode == 2 else 0.0
    period = step * np.ceil(random.uniform(0.2, 1.0) / step)  # its rate jumps at communication points
    if mode == 0:
        amplitude = 0.0
    return [mean, amplitude, frequency, random.uniform(0, 6.28), height, period]


def trial_words(kind: Kind, it: Trial, seeds: Iterable[int]) -> str:
    """What contacts.c reads."""
    references = {v.name: v.valueReference for v in it.description.modelVariables}
    prefix = "ball." if kind.shaken else ""
    energies = [f"{prefix}{name}" for name in ("impact_loss", "energy", "energy_balance")]
    read = [*kind.gaps, *kind.positions, *energies]
    rows = [f"{name}{end}" for name in kind.coordinates for end in ("", "_dot", "_ddot")]
    head = [references.get("input_reconstruction", 0), len(kind.gaps), len(kind.positions), len(kind.coordinates)]
    lines = [" ".join(map(str, [*head, *(references[name] for name in (*read, *rows))]))]
    parameters = reals(it.description, "parameter")
    for seed in seeds:
        random = np.random.default_rng(seed)
        step, mode = float(random.choice([0.01, 0.02, 0.05])), int(random.integers(3))
        values = {v.name: float(start_values(v)[0]) for v in parameters}
        drawn = kind.draw(random)
        assert set(drawn) <= set(values), set(drawn) - set(values)
        numbers = [float(10 ** random.uniform(-10, -7)), step, round(5 / step), *(values | drawn).values()]
        moved = [motion(random, mean, mode, step) for mean in kind.coordinates.values()]
        lines.append(" ".join([str(seed), str(mode), *map(repr, map(float, [*numbers, *np.ravel(moved)]))]))
    return "\n".join(lines)


def lives(name: str, fmu: Path, program: Path, seeds: Iterable[int], time_out: float = 600.0) -> list[Life]:
    """Lives of a kind, one for each seed."""
    kind = KINDS[name]
    with tempfile.TemporaryDirectory() as folder:
        it = unpack(fmu, Path(folder))
        words = trial_words(kind, it, seeds)
        done = subprocess.run(
            [program, it.library, it.plan], input=words, capture_output=True, text=True, timeout=time_out, check=False
        )
    assert done.returncode == 0, f"{name}: {done.stderr}, after {done.stdout[-300:]}"
    return [_life(name, line) for line in done.stdout.splitlines()]


def _life(kind: str, line: str) -> Life:
    seed, status, time, longest, lowest, off, gain, trace, said = line.split(" ", 8)
    return Life(
        kind,
        *map(int, (seed, status)),
        *map(float, (time, longest, lowest, off, gain)),
        trace=trace == "1",
        said=said,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--kinds", default=",".join(KINDS))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        program = compile_program([SOURCES / "contacts.c", SOURCES / "fmu.c"], folder / "contacts")
        for kind in options.kinds.split(","):
            seeds = range(options.first, options.first + options.count)
            sys.stdout.write(report(kind, lives(kind, built(KINDS[kind], folder), program, seeds, time_out=3600)))


def report(kind: str, found: list[Life]) -> str:
    """A line on the lives of a kind, then one for each fault and for each reason of what was refused."""
    worst = max(found, key=lambda life: life.longest_call)
    head = (
        f"{kind}: {len(found)} lives, {sum(life.status <= 1 for life in found)} to the end, "
        f"longest call {worst.longest_call:.3g} s (seed {worst.seed}), "
        f"lowest gap {min(life.lowest_gap for life in found):.3g}, "
        f"imbalance {max(life.imbalance for life in found):.3g}, gain {max(life.gain for life in found):.3g}"
    )
    first: dict[str, Life] = {}
    count: collections.Counter[str] = collections.Counter()
    for life in found:
        said = "refused: " + "".join(c for c in life.said if not c.isdigit())
        for what in (*life.faults, *[said] * (life.status > 1)):
            first.setdefault(what, life)
            count[what] += 1
    return "\n".join([head, *(f"  {count[what]} such as {life}" for what, life in first.items()), ""])


if __name__ == "__main__":
    main()
