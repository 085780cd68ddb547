"""A communication step through FMPy: both back ends beside what one writes by hand, and what FMPy itself costs.

    python benchmarks/step_cost.py [--quick]

The native back end is compared with ``by_hand/pendulum.c`` (same state, same inputs, as many right-hand sides a step),
the Python back end against ``by_hand/plain_python_pendulum.py``.  A communication sets inputs, steps, and gets outputs,
with FMPy's lists; the by-hand FMU gets and sets as many numbers.  All is processor time of the thread.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from ctypes import byref, c_bool, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from typing import Any

import fmpy
from _measure import HERE, Row, command, interleaved
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.simulation import instantiate_fmu
from pythonfmu import FmuBuilder

from liaisons.fmu import build
from liaisons.mechanics import assemble
from liaisons.models import Pendulum

STEP_SIZE = 0.01
INPUTS, OUTPUTS = range(3, 13), range(13, 17)  # places in by_hand/pendulum.c

Call = Callable[[], object]


def measure(quick: bool, plots: Path) -> list[Row]:  # noqa: ARG001 - no diagram
    rounds, steps = (3, 500) if quick else (15, 5000)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        folder = Path(name)
        native = build(assemble(Pendulum), folder, backend="native")
        three = build(assemble(Pendulum), folder / "fmi3", backend="native", fmi="3")
        python = build(assemble(Pendulum), folder / "python", backend="python")
        plain = FmuBuilder.build_FMU(HERE / "by_hand" / "plain_python_pendulum.py", dest=folder)
        by_hand, nothing = load_by_hand("pendulum", folder / "by_hand"), load_by_hand("nothing", folder / "nothing")
        slaves = {"native": load(native), "by hand": by_hand, "Python": load(python), "plain": load(plain)}
        rows = _steps(slaves, rounds, steps)
        is_model_exchange = {
            "native, FMI 2": _exchange(native),
            "native, FMI 3": _exchange(three),
            "Python back end": _exchange(python),
        }
        rows += _communications(is_model_exchange, by_hand, rounds, steps)
        rows += _calls(_pairs_of_calls(nothing, _nothing3(folder / "nothing3")), rounds, steps)
        for slave in (*slaves.values(), nothing):
            slave.terminate()
            slave.freeInstance()
    return rows


def _steps(slaves: dict[str, FMU2Slave], rounds: int, steps: int) -> list[Row]:
    steppers = {name: stepper(slave) for name, slave in slaves.items()}
    times = interleaved({name: lambda run=run: 1e9 * run(steps) for name, run in steppers.items()}, rounds)
    return [
        Row.of(
            *("doStep of 10 ms", f"{case} back end", times[ours], "ns"),
            yardstick=yardstick,
            beside=times[theirs],
            better="less",
        )
        for case, ours, yardstick, theirs in (
            ("native", "native", "C by hand", "by hand"),
            ("Python", "Python", "plain Python in pythonfmu", "plain"),
        )
    ]


def _communications(
    is_model_exchange: dict[str, Callable[[int | None], Call]], by_hand: FMU2Slave, rounds: int, steps: int
) -> list[Row]:
    rows = []
    for count, words in ((1, "1 input, 1 output"), (None, "13 inputs, 23 outputs")):
        inputs = [INPUTS[k % len(INPUTS)] for k in range(count or 13)]
        outputs = [OUTPUTS[k % len(OUTPUTS)] for k in range(count or 23)]
        calls = {name: exchange(count) for name, exchange in is_model_exchange.items()}
        calls["by hand"] = _communication(by_hand, inputs, outputs, by_hand.setReal, by_hand.getReal)
        times = interleaved({name: lambda c=call: nanoseconds(c, steps) for name, call in calls.items()}, rounds)
        rows += [
            Row.of(
                f"Communication: set {words.replace(', ', ', step, get ')}",
                name,
                [t / 1e3 for t in times[name]],
                "µs",
                yardstick="C by hand",
                beside=[t / 1e3 for t in times["by hand"]],
                better="less",
            )
            for name in is_model_exchange
        ]
    return rows


def _exchange(path: Path) -> Callable[[int | None], Call]:
    """A function that opens the FMU and gives a communication with so many inputs and outputs, or all."""
    description = fmpy.read_model_description(path, validate=False)
    folder = fmpy.extract(path, path.with_suffix(".exchanged"))  # `load` has mapped the library of its own

    def opened(count: int | None) -> Call:
        slave: Any = instantiate_fmu(folder, description, fmi_type="CoSimulation")
        three = description.fmiVersion == "3.0"
        if not three:
            slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        inputs, outputs = (
            [v.valueReference for v in description.modelVariables if v.causality == causality][:count]
            for causality in ("input", "output")
        )
        put, get = (slave.setFloat64, slave.getFloat64) if three else (slave.setReal, slave.getReal)
        return _communication(slave, inputs, outputs, put, get)

    return opened


def _communication(slave: Any, inputs: list[int], outputs: list[int], put: Callable, get: Callable) -> Call:
    values, steps = get(inputs), iter(range(sys.maxsize))

    def call() -> None:
        put(inputs, values)
        slave.doStep(next(steps) * STEP_SIZE, STEP_SIZE)
        get(outputs)

    return call


def _calls(pairs: dict[str, tuple[Call, Call]], rounds: int, repeats: int) -> list[Row]:
    runs: dict[str, Callable[[], float]] = {}
    for title, (through_fmpy, bare) in pairs.items():
        runs[title] = lambda call=through_fmpy: nanoseconds(call, repeats)
        runs[f"{title}, bare"] = lambda call=bare: nanoseconds(call, repeats)
    times = interleaved(runs, rounds)
    topic, yardstick = "FMPy's own part: an FMU that does nothing", "ctypes, arguments prepared once"
    return [
        Row.of(topic, title, times[title], "ns", yardstick=yardstick, beside=times[f"{title}, bare"]) for title in pairs
    ]


def _pairs_of_calls(slave: FMU2Slave, slave3: FMU3Slave) -> dict[str, tuple[Call, Call]]:
    """Through FMPy, and bare."""
    component, component3 = (c_void_p(_address(it)) for it in (slave, slave3))
    now, size, yes, keep = c_double(0.0), c_double(STEP_SIZE), c_int(1), c_bool(True)
    step, set_real, get_real = (slave.dll[f"fmi2{name}"] for name in ("DoStep", "SetReal", "GetReal"))
    step3, answers = slave3.dll["fmi3DoStep"], [byref(c_bool()), byref(c_bool()), byref(c_bool()), byref(c_double())]
    pairs: dict[str, tuple[Call, Call]] = {
        "doStep, FMI 2": (lambda: slave.doStep(0.0, STEP_SIZE), lambda: step(component, now, size, yes)),
        "doStep, FMI 3": (
            lambda: slave3.doStep(0.0, STEP_SIZE),
            lambda: step3(component3, now, size, keep, *answers),
        ),
    }
    for count in (1, 100):
        numbers, values = list(range(count)), [0.0] * count
        references, array, n = (c_uint * count)(*numbers), (c_double * count)(), c_size_t(count)

        def lists(numbers: list[int] = numbers, values: list[float] = values) -> None:
            slave.setReal(numbers, values)
            slave.getReal(numbers)

        def bare(words: tuple[object, ...] = (component, references, n, array)) -> None:
            set_real(*words)
            get_real(*words)

        pairs[f"set and get {count} variable{'s'[: count > 1]}, FMI 2"] = lists, bare
    return pairs


def _address(slave: FMU2Slave | FMU3Slave) -> int:
    component: Any = slave.component  # an int, whatever fmpy declares
    return component


def _nothing3(folder: Path) -> FMU3Slave:
    compile_by_hand("nothing3", folder, platform=fmpy.platform_tuple)
    slave = FMU3Slave(
        guid="by hand",
        modelIdentifier="nothing3",
        unzipDirectory=str(folder),
        instanceName="nothing3",
        requireFunctions=False,
    )
    slave.instantiate()
    return slave


def nanoseconds(call: Call, repeats: int) -> float:
    """Processor time of a call."""
    begin = time.thread_time_ns()
    for _ in range(repeats):
        call()
    return (time.thread_time_ns() - begin) / repeats


def stepper(slave: FMU2Slave) -> Callable[[int], float]:
    """A function that makes n steps and returns seconds a step; the time goes on from call to call."""
    state = {"i": 0}

    def run(n: int) -> float:
        do_step, component, first = slave.fmi2DoStep, slave.component, state["i"]
        begin = time.thread_time()
        for i in range(first, first + n):
            do_step(component, i * STEP_SIZE, STEP_SIZE, 1)
        state["i"] = first + n
        return (time.thread_time() - begin) / n

    return run


def load(fmu: Path) -> FMU2Slave:
    """An initialized instance of an FMU for FMI 2.0."""
    description = fmpy.read_model_description(str(fmu), validate=False)
    folder = fmpy.extract(str(fmu), unzipdir=str(fmu.with_suffix("")))
    identifier = fmu.stem  # of our FMUs, and of pythonfmu's
    return instantiate(Path(folder), identifier, description.guid or "")


def instantiate(folder: Path, identifier: str, guid: str, starts: Mapping[int, float] | None = None) -> FMU2Slave:
    """An initialized instance; start values by reference."""
    slave = FMU2Slave(
        guid=guid,
        modelIdentifier=identifier,
        unzipDirectory=str(folder),
        instanceName=identifier,
        requireFunctions=False,
    )
    slave.instantiate()
    slave.setupExperiment(startTime=0.0)
    slave.setReal([*(starts or {})], [*(starts or {}).values()])
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    return slave


def load_by_hand(name: str, folder: Path) -> FMU2Slave:
    """An instance of ``by_hand/NAME.c``, which is compiled into the folder."""
    compile_by_hand(name, folder)
    return instantiate(folder, name, "by hand")


def compile_by_hand(name: str, folder: Path, *flags: str | Path, platform: str = fmpy.platform) -> Path:
    """The library of ``by_hand/NAME.c``, where an FMU that is unpacked in the folder has it; flags for the compiler."""
    compiler = shutil.which("cc")
    if compiler is None:
        sys.exit("the hand-written yardstick needs a C compiler called cc")
    binaries = folder / "binaries" / platform
    binaries.mkdir(parents=True)
    library = binaries / f"{name}{fmpy.sharedLibraryExtension}"
    headers = Path(fmpy.__file__).parent / "c-code"
    sources = [HERE / "by_hand" / f"{name}.c", HERE / "by_hand" / f"unused{'3' * name.endswith('3')}.c"]
    command = [compiler, "-std=c99", "-O2", "-fPIC", "-shared", f"-I{headers}", *sources, *flags]
    subprocess.run([*command, "-o", library, "-lm"], check=True)
    return library


if __name__ == "__main__":
    command(measure)
