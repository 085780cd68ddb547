"""Cost of one doStep through fmpy: generated FMUs beside hand-written ones, interleaved, medians.

    python benchmarks/step_cost.py [--rounds 9] [--steps 20000]

Rows: the native back end beside ``by_hand/pendulum.c`` (same state, same inputs, as many right-hand sides a step),
the Python back end beside ``by_hand/plain_python_pendulum.py``.  Ratios are taken round by round, so that a machine
whose speed drifts does not favour one side.
"""

from __future__ import annotations

import argparse
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import fmpy
from fmpy.fmi2 import FMU2Slave
from pythonfmu import FmuBuilder

from liaisons.fmu import build
from liaisons.models import Pendulum

HERE = Path(__file__).parent
STEP_SIZE = 0.01


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--rounds", type=int, default=9)
    options.add_argument("--steps", type=int, default=20000)
    arguments = options.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        native = load(build(Pendulum.model(), folder, backend="native"))
        by_hand = load_by_hand("pendulum", folder / "by_hand")
        python = load(build(Pendulum.model(), folder, backend="python"))
        plain = load(FmuBuilder.build_FMU(HERE / "by_hand" / "plain_python_pendulum.py", dest=folder))
        report("native / C by hand", native, by_hand, arguments.rounds, arguments.steps)
        report("Python back end / plain Python", python, plain, arguments.rounds, arguments.steps // 10)
        for slave in (native, by_hand, python, plain):
            slave.terminate()
            slave.freeInstance()


def report(title: str, ours: FMU2Slave, yardstick: FMU2Slave, rounds: int, steps: int) -> None:
    step_ours, step_yardstick = stepper(ours), stepper(yardstick)
    step_ours(steps), step_yardstick(steps)  # warm up
    pairs = [(step_ours(steps), step_yardstick(steps)) for _ in range(rounds)]
    ratios = [a / b for a, b in pairs]
    median_ours, median_yardstick = (statistics.median(column) * 1e9 for column in zip(*pairs, strict=True))
    print(
        f"{title:32s} {median_ours:8.0f} ns / {median_yardstick:8.0f} ns = {statistics.median(ratios):5.2f}"
        f"   (rounds {min(ratios):.2f} .. {max(ratios):.2f})"
    )


def stepper(slave: FMU2Slave) -> Callable[[int], float]:
    """A function that makes n steps and returns seconds a step; the time goes on from call to call."""
    state = {"i": 0}

    def run(n: int) -> float:
        do_step, component, first = slave.fmi2DoStep, slave.component, state["i"]
        begin = time.perf_counter()
        for i in range(first, first + n):
            do_step(component, i * STEP_SIZE, STEP_SIZE, 1)
        state["i"] = first + n
        return (time.perf_counter() - begin) / n

    return run


def load(fmu: Path) -> FMU2Slave:
    description = fmpy.read_model_description(str(fmu), validate=False)
    folder = fmpy.extract(str(fmu), unzipdir=str(fmu.with_suffix("")))
    identifier = fmu.stem  # of our FMUs, and of pythonfmu's
    return instantiate(FMU2Slave, Path(folder), identifier, description.guid or "")


def instantiate(kind: type[FMU2Slave], folder: Path, identifier: str, guid: str) -> FMU2Slave:
    slave = kind(
        guid=guid,
        modelIdentifier=identifier,
        unzipDirectory=str(folder),
        instanceName=identifier,
        requireFunctions=False,
    )
    slave.instantiate()
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    return slave


def load_by_hand(name: str, folder: Path) -> FMU2Slave:
    """An instance of ``by_hand/NAME.c``, which is compiled into the folder."""
    compile_by_hand(name, folder)
    return instantiate(FMU2Slave, folder, name, "by hand")


def compile_by_hand(name: str, folder: Path, *flags: str | Path) -> Path:
    """The library of ``by_hand/NAME.c``, where an FMU that is unpacked in the folder has it; flags for the compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        sys.exit("the hand-written yardstick needs a C compiler called cc")
    binaries = folder / "binaries" / fmpy.platform
    binaries.mkdir(parents=True)
    library = binaries / f"{name}{fmpy.sharedLibraryExtension}"
    headers = Path(fmpy.__file__).parent / "c-code"
    sources = [HERE / "by_hand" / f"{name}.c", HERE / "by_hand" / "unused.c"]
    command = [compiler, "-std=c99", "-O2", "-fPIC", "-shared", f"-I{headers}", *sources, *flags]
    subprocess.run([*command, "-o", library, "-lm"], check=True)
    return library


if __name__ == "__main__":
    main()
