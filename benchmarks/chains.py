"""Chains: what derivation, generated C, compilation, steps and memory cost against the number of links.

    python benchmarks/chains.py [--quick] [--output FOLDER]

The yardstick of the oscillator chain is by_hand/chain.c, compiled for vectors: with the same vectors as the component
(forces and loads at each mass, and their power), and as an isolated chain without any.  Each size is built in a process
of its own.  All times are processor times, of a process or of the compiler; slopes are fits to log-log points.
"""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import resource
import subprocess
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from _measure import Row, command, interleaved
from native_code import BY_HAND

from liaisons import models
from liaisons.base.compiler import FLAGS, compile_library, host_target
from liaisons.chains.loops import ChainLoops, loops_code, preamble
from liaisons.fmu.code import model_code, source_files
from liaisons.mechanics import assemble

CHAINS = {"PendulumChain": (10, 30, 100, 300, 1000), "OscillatorChain": (100, 1000, 10_000, 100_000)}
QUICK = {"PendulumChain": (10, 100), "OscillatorChain": (100, 1000)}
STEPS = {"PendulumChain": 0.01, "OscillatorChain": 0.05}  # [s] of communication
YARDSTICKS = {
    "PendulumChain": {"sine and cosine alone": ""},
    "OscillatorChain": {"C by hand": "<= 4", "C by hand, isolated": "<= 4"},
}
FUNCTIONS = {"generated": 0, "C by hand": 1, "C by hand, isolated": 2, "sine and cosine alone": 3}  # of by_hand/chain.c
TOLERANCE = 1e-6
GUID = "{00000000-0000-0000-0000-000000000000}"
MEBI = 2.0**20


@dataclass(frozen=True, slots=True)
class Built:
    """What it took to build one chain [s, B], and its right-hand side alone; ``code``: bytes of C of that."""

    n: int
    derive: float
    generate: float
    compile: float
    memory: float
    alone: float
    code: int


@dataclass(frozen=True, slots=True)
class Run:
    """Nanoseconds a link, round by round, and bytes of an instance."""

    rates: dict[str, list[float]]  # of functions of by_hand/chain.c
    step: list[float]
    instance: float


def measure(quick: bool, plots: Path) -> list[Row]:
    """Rows of the tables, and the diagram ``chains.png``."""
    rows: list[Row] = []
    figure, axes = plt.subplots(figsize=(7, 5))
    for name, sizes in (QUICK if quick else CHAINS).items():
        built = [_in_a_process(name, n) for n in sizes]
        runs = [_run(name, n, rounds=5 if quick else 41) for n in sizes]
        rows += [*_of_rates(name, sizes, runs), *_of_building(name, built, runs)]
        for part in ("derive", "generate", "compile"):
            axes.loglog(sizes, [getattr(b, part) for b in built], ".-", label=f"{name}: {part}")
        steps = [1e-9 * n * float(np.median(run.step)) for n, run in zip(sizes, runs, strict=True)]
        axes.loglog(sizes, steps, ".--", label=f"{name}: communication step")
    axes.set(xlabel="links", ylabel="seconds")
    axes.legend()
    figure.savefig(plots / "chains.png", dpi=120)
    plt.close(figure)
    return rows


def _of_rates(name: str, sizes: Sequence[int], runs: Sequence[Run]) -> list[Row]:
    found = []
    for n, run in zip(sizes, runs, strict=True):
        case, generated = f"{name}, n = {n}", run.rates["generated"]
        add = partial(Row.of, "Right-hand side, a link", case, generated, "ns")
        if name == "PendulumChain":
            found.append(add(asked="<= 50"))
        for yardstick, asked in YARDSTICKS[name].items():
            found.append(add(yardstick=yardstick, beside=run.rates[yardstick], asked=asked))
        found.append(Row.of("Communication step, a link", f"{case}, {STEPS[name]:g} s", run.step, "ns"))
    return found


def _of_building(name: str, built: Sequence[Built], runs: Sequence[Run]) -> list[Row]:
    sizes, largest = [b.n for b in built], built[-1]
    found = [
        Row(f"From {name} to FMU 3.0", f"{part}, n = {b.n}", getattr(b, part), "s")
        for part in ("derive", "generate", "compile")
        for b in built
    ]
    per_link = 1e3 * largest.compile / largest.n
    found.append(Row(f"From {name} to FMU 3.0", f"compile, a link of {largest.n}", per_link, "ms", asked="<= 10"))
    columns = {part: [getattr(b, part) for b in built] for part in ("derive", "generate", "compile")}
    for function in ("generated", *YARDSTICKS[name]):
        columns[f"right-hand side, {function}"] = [
            float(np.median(run.rates[function])) * n for run, n in zip(runs, sizes, strict=True)
        ]
    columns["communication step"] = [float(np.median(run.step)) * n for run, n in zip(runs, sizes, strict=True)]
    columns["memory to build"] = [max(b.memory, MEBI) for b in built]
    columns["memory of an instance"] = [run.instance for run in runs]
    for part, values in columns.items():
        asked = "" if part.removeprefix("right-hand side, ") in YARDSTICKS[name] else "<= 1.1"
        slope = float(np.polyfit(np.log(sizes), np.log(values), 1)[0])
        found.append(Row("Growth with n, log-log slope", f"{name}: {part}", slope, "", asked=asked))
    alone = f"{name}, n = {largest.n}"
    time_asked, length_asked = {"OscillatorChain": ("<= 1", "<= 20")}.get(name, ("", ""))
    found += [
        Row("Right-hand side alone", f"{alone}: derive, generate, compile", largest.alone, "s", asked=time_asked),
        Row("Right-hand side alone", f"{alone}: C", largest.code / 1000, "kB", asked=length_asked),
        Row("Memory", f"{alone}: to derive and generate", largest.memory / MEBI, "MiB"),
        Row("Memory", f"{alone}: an instance, a link", runs[-1].instance / largest.n, "B"),
    ]
    return found


# ---- building ----------------------------------------------------------------------------------------------------


def _in_a_process(name: str, n: int) -> Built:
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool, tempfile.TemporaryDirectory() as cache:
        return pool.submit(_built, name, n, cache).result()


def _built(name: str, n: int, cache: str) -> Built:
    os.environ["XDG_CACHE_HOME"] = cache  # all is compiled
    component = getattr(models, name)
    source_files(assemble(component, 3), GUID, "3")  # what is loaded and done once is left out
    before = _peak()
    start = time.process_time()
    model = assemble(component, n)
    derived = time.process_time()
    code = source_files(model, GUID, "3")
    generated = time.process_time()
    memory = _peak() - before
    start_of_compiler = _compilers()
    compile_library({file: text for file, text in code.items() if file.endswith((".c", ".h"))}, host_target())
    compiled = _compilers() - start_of_compiler

    start_alone = time.process_time()
    assert isinstance(model.loops, ChainLoops)
    (program,) = (program for program in model.loops.programs if program.name == "derivatives")
    rates = loops_code(program)
    text = "\n".join(["#include <math.h>", "#include <stddef.h>", preamble([rates]), rates.text])
    text = text.replace("static VECTORISED int", "VECTORISED int")
    start_of_compiler = _compilers()
    compile_library({"rates.c": text.encode()}, host_target())
    alone = derived - start + time.process_time() - start_alone + _compilers() - start_of_compiler
    return Built(n, derived - start, generated - derived, compiled, memory, alone, len(text))


def _peak() -> float:
    return 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _compilers() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


# ---- running -----------------------------------------------------------------------------------------------------


def _run(name: str, n: int, *, rounds: int) -> Run:
    model = assemble(getattr(models, name), n)
    with tempfile.TemporaryDirectory() as scratch:
        library = _library(Path(scratch), source_files(model, GUID) | {"model.c": model_code(model, GUID).encode()})
    for function in ("chain_time", "chain_difference", "chain_start", "chain_advance"):
        getattr(library, function).restype = ctypes.c_double
    if not library.chain_open():
        raise MemoryError(f"{name}: n = {n}")
    calls = max(1, 200_000 // n)
    if "C by hand" in YARDSTICKS[name] and not library.chain_difference(FUNCTIONS["C by hand"]) < 1e-9 * n:
        raise ArithmeticError(f"{name}: the generated rates are not those by hand")
    instance = library.chain_start(ctypes.c_double(TOLERANCE))

    def rates(which: int) -> float:
        return library.chain_time(which, ctypes.c_long(calls)) / n

    def step() -> float:
        return library.chain_advance(ctypes.c_double(STEPS[name]), ctypes.c_long(max(1, 10_000 // n))) / n

    kinds = {kind: partial(rates, FUNCTIONS[kind]) for kind in ("generated", *YARDSTICKS[name])}
    values = interleaved(kinds | {"step": step}, rounds)
    return Run(step=values.pop("step"), rates=values, instance=instance)


def _library(folder: Path, code: dict[str, bytes]) -> ctypes.CDLL:
    """The component without what is FMI's of it, and by_hand/chain.c, which is compiled for vectors."""
    for file, text in code.items():
        (folder / file).write_bytes(text)
    flags = [flag for flag in FLAGS if flag not in ("-fvisibility=hidden", "-shared")] + ["-D_GNU_SOURCE", "-I."]
    component = [path.name for path in sorted(folder.glob("*.c")) if not path.name.startswith("fmi")]
    subprocess.run(["cc", *flags, "-c", *component], cwd=folder, check=True)
    subprocess.run(["cc", *flags, "-O3", "-c", str(BY_HAND / "chain.c")], cwd=folder, check=True)
    objects = [path.name for path in sorted(folder.glob("*.o"))]
    subprocess.run(["cc", "-shared", *objects, "-o", "chain.so", "-lm"], cwd=folder, check=True)
    return ctypes.CDLL(str(folder / "chain.so"))


if __name__ == "__main__":
    command(measure)
