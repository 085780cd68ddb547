"""What the generated FMUs cost beside hand-written C: a step, access to variables, an instance.

    python benchmarks/fmi_cost.py [--quick]

Called from C (``by_hand/cost.c``, processor time): a communication step beside ``by_hand/pendulum.c`` with the same
solver and the same flags, so that the ratio is that of the code for the equations and of all that an FMU checks.  Ours
leaves out what loads of 0 and operators at rest would add, which the hand-written one does not: "loaded" is a step with
loads, "moved" one with loads and moving operators, all of them too small to change anything (the operators' inputs are
followed inside the step, too, which is not done by hand at all).  FMI 3.0 beside FMI 2.0; reading all outputs and
writing all inputs in one call beside ``by_hand/nothing.c``, whose call is a memcpy that looks at no reference, or a
loop over the references without any check; an instance that is made, initialized and freed.  Called through FMPy: a
step beside that of the FMU that does nothing.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from _measure import HERE, Row, command, interleaved
from step_cost import compile_by_hand, load, load_by_hand, stepper

from liaisons.base.compiler import FLAGS
from liaisons.fmu import build
from liaisons.mechanics import assemble
from liaisons.models import Constant, Pendulum

CONFORMANCE = HERE.parent / "tests" / "conformance"
RUNTIME = HERE.parent / "components" / "liaisons" / "fmu" / "runtime"
sys.path.insert(0, str(CONFORMANCE))

from trial import VERSIONS, Trial, compile_program, unpack  # noqa: E402 # pyright: ignore[reportMissingImports] - it lies with the tests

ASKED = "<= 1.1"  # times the yardstick
STEPS = {0.01: 100_000, 1.0: 10_000, 10.0: 1_000}  # sizes [s], and how many are timed at once
ACCESS = {"get": "get 23 outputs", "set": "set 13 inputs"}

Timer = Callable[[], float]
"""Nanoseconds of an operation."""


@dataclass(frozen=True, slots=True)
class Bench:
    """An FMU for each version of FMI, the hand-written libraries, and the program that times their operations."""

    program: Path
    fmus: Mapping[str, Trial]  # by version
    by_hand: Mapping[str, Path]
    rounds: int
    share: int  # of the usual numbers of operations, one in so many is timed

    def fmu(self, version: str, operation: str, n: int, *size: float) -> Timer:
        return self._timer(self.fmus[version].library, self.fmus[version].plan, operation, n, *size)

    def acted_on(self, version: str, n: int, size: float, *endings: str) -> Timer:
        """Steps in which inputs whose names end like this are not 0, but too small for any sum."""
        trial = self.fmus[version]
        inputs = [v for v in trial.description.modelVariables if v.causality == "input" and v.name.endswith(endings)]
        places = " ".join(f"{variable.valueReference} 1" for variable in inputs)
        group = f"input {len(inputs)} {len(inputs)} {places}{' 1e-290' * len(inputs)}"
        lines = trial.plan.read_text().splitlines()
        plan = trial.plan.with_name("_".join(["plan", *endings]))
        plan.write_text("\n".join(group if line.startswith("input ") else line for line in lines) + "\n")
        return self._timer(trial.library, plan, "acted_on", n, size)

    def hand(self, name: str, operation: str, n: int, *size: float) -> Timer:
        # The hand-written ones take no notice of references, so they may have the plan of the generated one.
        return self._timer(self.by_hand[name], self.fmus["2"].plan, operation, n, *size)

    def _timer(self, library: Path, plan: Path, operation: str, n: int, *size: float) -> Timer:
        words = [str(word) for word in (self.program, library, plan, operation, n // self.share, *size)]
        return lambda: float(subprocess.check_output(words, text=True))

    def compare(self, topic: str, case: str, ours: Timer, yardsticks: Mapping[str, Timer], asked: str) -> list[Row]:
        """A row for each yardstick; what is asked is a bound on the ratio to the first."""
        times = interleaved({"": ours, **yardsticks}, self.rounds)
        return [
            Row.of(topic, case, times[""], "ns", yardstick=name, beside=times[name], asked="" if i else asked)
            for i, name in enumerate(yardsticks)
        ]


def measure(quick: bool, plots: Path) -> list[Row]:  # noqa: ARG001 - no diagram
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        folder = Path(name)
        fmus = {version: build(assemble(Pendulum), folder, backend="native", fmi=version) for version in VERSIONS}
        trials = {version: unpack(fmu, folder / f"unpacked{version}") for version, fmu in fmus.items()}
        bench = _bench(folder, trials, rounds=3 if quick else 15, share=10 if quick else 1)
        return [
            *_steps(bench),
            *_access(bench),
            *_instances(bench),
            *_through_fmpy(bench, folder),
            *(_size(version, fmu) for version, fmu in fmus.items()),
        ]


def _bench(folder: Path, fmus: Mapping[str, Trial], rounds: int, share: int) -> Bench:
    sources = [HERE / "by_hand" / "cost.c", CONFORMANCE / "fmu.c"]
    # The flags of FMUs, so that it is the code that is compared.
    flags = [flag for flag in FLAGS if flag.startswith("-f") and flag not in {"-fPIC", "-fvisibility=hidden"}]
    solver = ("-DSAME_METHOD", f"-I{RUNTIME}", RUNTIME / "solver.c", *flags)
    return Bench(
        program=compile_program(sources, folder / "cost", ("-O2", f"-I{CONFORMANCE}")),
        fmus=fmus,
        by_hand={
            "pendulum": compile_by_hand("pendulum", folder / "pendulum", *solver),
            "memcpy": compile_by_hand("nothing", folder / "nothing"),
            "loop": compile_by_hand("nothing", folder / "by_reference", "-DBY_REFERENCE"),
        },
        rounds=rounds,
        share=share,
    )


def _steps(bench: Bench) -> list[Row]:
    rows = []
    for size, n in STEPS.items():
        two, three = (bench.fmu(version, "step", n, size) for version in VERSIONS)
        by_hand = bench.hand("pendulum", "step", n, size)
        topic, case = "A step, called from C", f"step of {size:g} s"
        rows += bench.compare(topic, f"{case}, FMI 2", two, {"C by hand": by_hand}, ASKED)
        loaded = bench.acted_on("2", n, size, "_load")
        moved = bench.acted_on("2", n, size, "_load", "_dot", "_ddot")
        rows += bench.compare(topic, f"{case}, loaded, FMI 2", loaded, {"C by hand": by_hand}, ASKED)
        rows += bench.compare(topic, f"{case}, moved, FMI 2", moved, {"C by hand": by_hand}, "")
        rows += bench.compare(topic, f"{case}, FMI 3", three, {"FMI 2": two}, ASKED)
    return rows


def _access(bench: Bench, n: int = 2_000_000) -> list[Row]:
    rows = []
    for operation, case in ACCESS.items():
        two, three = (bench.fmu(version, operation, n) for version in VERSIONS)
        by_hand = {
            "a call with a memcpy": bench.hand("memcpy", operation, n),
            "a loop over the references": bench.hand("loop", operation, n),
        }
        rows += bench.compare("Access to variables", f"{case}, FMI 2", two, by_hand, ASKED)
        rows += bench.compare("Access to variables", f"{case}, FMI 3", three, {"FMI 2": two}, ASKED)
    return rows


def _instances(bench: Bench) -> list[Row]:
    topic = "An instance"
    times = interleaved({version: bench.fmu(version, "start", 20_000) for version in VERSIONS}, bench.rounds)
    two, three = (bench.fmu(version, "save", 1_000_000) for version in VERSIONS)
    return [
        *(
            Row.of(topic, f"instantiate, initialize, free, FMI {v}", [t / 1e3 for t in ns], "µs", asked="<= 50")
            for v, ns in times.items()
        ),
        *bench.compare(topic, "save the state, FMI 3", three, {"FMI 2": two}, ASKED),
    ]


def _through_fmpy(bench: Bench, folder: Path, n: int = 20_000) -> list[Row]:
    nothing = load_by_hand("nothing", folder / "nothing_in_fmpy")
    slaves = {c.__name__: load(build(assemble(c), folder, backend="native")) for c in (Constant, Pendulum)}
    steppers = {name: stepper(slave) for name, slave in {"nothing": nothing, **slaves}.items()}
    times = interleaved(
        {name: lambda run=run: 1e9 * run(n // bench.share) for name, run in steppers.items()}, bench.rounds
    )
    for slave in (nothing, *slaves.values()):
        slave.terminate()
        slave.freeInstance()
    topic, yardstick = "doStep through FMPy", "an FMU that does nothing"
    return [Row.of(topic, name, times[name], "ns", yardstick=yardstick, beside=times["nothing"]) for name in slaves]


def _size(version: str, fmu: Path) -> Row:
    remark = "binary of this machine, and sources"
    return Row("Size", f"Pendulum.fmu, FMI {version}", fmu.stat().st_size / 1e3, "kB", asked="<= 300", remark=remark)


if __name__ == "__main__":
    command(measure)
