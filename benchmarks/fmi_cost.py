"""What the generated FMUs cost beside hand-written C, interleaved, medians of the ratios of each round.

    python benchmarks/fmi_cost.py [--rounds 15]

Called from C (``by_hand/cost.c``, processor time): a communication step beside ``by_hand/pendulum.c`` with the same
solver, so that the ratio is that of the code for the equations and of all that an FMU checks; FMI 3.0 beside FMI 2.0;
reading all outputs and writing all inputs in one call beside ``by_hand/nothing.c``, whose call is a memcpy; an instance
that is made, initialized and freed.  Called through fmpy: a step beside that of the FMU that does nothing.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from step_cost import HERE, compile_by_hand, load, load_by_hand, report

from liaisons.fmu import build
from liaisons.models import Constant, Pendulum

CONFORMANCE = HERE.parent / "tests" / "conformance"
RUNTIME = HERE.parent / "components" / "liaisons" / "fmu" / "runtime"
sys.path.insert(0, str(CONFORMANCE))

from trial import Trial, compile_program, unpack  # noqa: E402 - it lies with the tests


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--rounds", type=int, default=15)
    rounds = options.parse_args().rounds
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        fmus = {version: build(Pendulum.model(), folder, backend="native", fmi=version) for version in ("2", "3")}
        for version, fmu in fmus.items():
            print(f"Pendulum.fmu, FMI {version}.0, host binary and sources: {fmu.stat().st_size / 1000:.0f} kB")
        trials = {version: unpack(fmu, folder / f"unpacked{version}") for version, fmu in fmus.items()}
        _from_c(folder, trials, rounds)
        nothing = load_by_hand("nothing", folder / "nothing_in_fmpy")
        for component in (Constant, Pendulum):
            ours = load(build(component.model(), folder, backend="native"))
            report(f"doStep in fmpy: {component.__name__} / nothing", ours, nothing, rounds, 20000)


def _from_c(folder: Path, trials: dict[str, Trial], rounds: int) -> None:
    flags = ("-O2", f"-I{CONFORMANCE}")
    cost = compile_program([HERE / "by_hand" / "cost.c", CONFORMANCE / "fmu.c"], folder / "cost", flags)
    solver = ("-DSAME_METHOD", f"-I{RUNTIME}", RUNTIME / "solver.c", "-fno-math-errno", "-ffp-contract=off")
    pendulum = compile_by_hand("pendulum", folder / "pendulum", *solver)
    nothing = compile_by_hand("nothing", folder / "nothing")
    # The hand-written ones take no notice of references, so they may have the plan of the generated one.
    plan = trials["2"].plan

    def timer(library: Path, plan: Path, *arguments: object) -> Callable[[], float]:
        command = [str(word) for word in (cost, library, plan, *arguments)]
        return lambda: float(subprocess.check_output(command, text=True))

    def compare(title: str, unit: str, ours: Callable[[], float], yardstick: Callable[[], float]) -> None:
        scale = {"ns": 1.0, "us": 1e-3}[unit]
        pairs = [(ours() * scale, yardstick() * scale) for _ in range(rounds)]
        ratios = [a / b for a, b in pairs]
        a, b = (statistics.median(column) for column in zip(*pairs, strict=True))
        print(
            f"{title:46s} {a:9.1f} {unit} / {b:9.1f} {unit} = {statistics.median(ratios):5.2f}"
            f"   (rounds {min(ratios):.2f} .. {max(ratios):.2f})"
        )

    two, three = ((trials[version].library, trials[version].plan) for version in ("2", "3"))
    for size, n in ((0.01, 100_000), (1.0, 10_000), (10.0, 1_000)):
        title = f"step of {size:g} s: generated / by hand"
        compare(title, "ns", timer(*two, "step", n, size), timer(pendulum, plan, "step", n, size))
    compare("step of 0.01 s: FMI 3 / FMI 2", "ns", timer(*three, "step", 100_000), timer(*two, "step", 100_000))
    for operation, words in (("get", "get 23 outputs"), ("set", "set 13 inputs")):
        n = 2_000_000
        compare(f"{words}: generated / memcpy", "ns", timer(*two, operation, n), timer(nothing, plan, operation, n))
        compare(f"{words}: FMI 3 / FMI 2", "ns", timer(*three, operation, n), timer(*two, operation, n))
    compare("save the state: FMI 3 / FMI 2", "ns", timer(*three, "save", 1_000_000), timer(*two, "save", 1_000_000))
    for version, instance in (("2", two), ("3", three)):
        nanoseconds = statistics.median(timer(*instance, "start", 20_000)() for _ in range(rounds))
        print(f"instantiate, initialize, free, FMI {version}: {nanoseconds / 1000:.2f} us")


if __name__ == "__main__":
    main()
