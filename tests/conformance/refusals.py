"""What is refused, in importers that know nothing of us: how each run ends, with which words, and when.

    python tests/conformance/refusals.py [COMPONENT ...]

prints a table of the cases below, or of those that are found for these components (``all``: for each of the catalogue).
Each case runs in a process of its own, which is ended if it takes too long.
"""

from __future__ import annotations

import ctypes
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

import fmpy
import numpy as np

from liaisons.mechanics import assemble

Master = Literal["fmpy 2", "fmpy 3", "libcosimpy 2", "ecospy 2", "ecospy 3", "ours 2", "ours 3"]
MASTERS: tuple[Master, ...] = ("fmpy 2", "fmpy 3", "libcosimpy 2", "ecospy 2", "ecospy 3", "ours 2", "ours 3")
LONGEST = 20.0
"""A process that takes longer hangs [s]."""


@dataclass(frozen=True)
class Case:
    """One thing that is refused.

    :param words: pattern that the FMU's message has.
    :param starts: start values of parameters and inputs; integers are meant for integers.
    :param ramp: input, value at the start, rate [1/s]: what is set at the communication points.
    :param times: start time and communication step [s].
    :param statuses: which the FMU returns where it is asked again, as by fmpy 2.
    :param masters: to which it can be put: some know no start time, or count time in nanoseconds.
    """

    kind: str
    component: str
    words: str
    starts: dict[str, float] = field(default_factory=dict)
    ramp: tuple[str, float, float] | None = None
    times: tuple[float, float] = (0.0, 0.1)
    steps: int = 20
    statuses: tuple[str, ...] = ("Error",)
    masters: tuple[Master, ...] = MASTERS


_WITH_START_TIME: tuple[Master, ...] = ("fmpy 2", "fmpy 3")
_NOT_OURS: tuple[Master, ...] = MASTERS[:5]  # ours refuses these numbers itself
_CURABLE, _SET = ("Discard", "Error"), ("Discard",)

CASES = (
    Case(
        "input leaves its domain in a step",
        "Pendulum",
        "length = -.*must be > 0",
        {"length": 0.2, "length_dot": -3.0},
        statuses=_CURABLE,
    ),
    Case(
        "input outside its domain, set",
        "Pendulum",
        "length = -0.05 at t = 1: it must be > 0",
        {"input_reconstruction": 0},  # its rates, which are not set, stay 0
        masters=_NOT_OURS,  # which sets rates, too
        ramp=("length", 1.0, -1.05),
    ),
    Case("parameter outside its domain", "Pendulum", "mass = -1 at t = 0: it must be > 0", {"mass": -1.0}),
    Case("input nan", "Pendulum", "length = nan: set a fin", {"length": np.nan}, statuses=_SET, masters=_NOT_OURS),
    Case("input infinite", "Pendulum", "length = inf: set a fin", {"length": np.inf}, statuses=_SET, masters=_NOT_OURS),
    Case("start is singular", "KeplerOrbit", "r must stay > 0", {"x_0": 0.0, "y_dot_0": 0.0}),
    Case("start off the constraint", "CartesianPendulum", "rod .* must be kept to", {"x_0": 0.5}),
    Case(
        "motion ends in a step",
        "KeplerOrbit",
        "r must stay > 0: .* at t = 1.11072",
        {"y_dot_0": 0.0},
        statuses=_CURABLE,
        times=(0.0, 0.5),
    ),
    Case("energy is not finite", "Pendulum", "= (nan|-?inf) at t = 0: it must be finite", {"theta_dot_0": 1e200}),
    Case(
        "output is not finite, read",
        "Pendulum",
        "length_power = inf at t = 0: it must be finite",
        {"length_dot": 10.0, "length_ddot": 1e308},
        masters=("fmpy 2", "fmpy 3", "libcosimpy 2", "ours 2", "ours 3"),  # which read at the start
    ),
    Case("state overflows", "FreeParticle", "= inf at t = 0: the motion ends there", {"x_force": 1e308}),
    Case(
        "symplectic step does not converge",
        "Pendulum",
        "symplectic_steps = 1 is not enough",
        {"symplectic_steps": 1, "gravity": 1e6, "theta_0": 1.0},
        statuses=_CURABLE,
        times=(0.0, 1.0),
    ),
    Case(
        "too many steps of the solver",
        "Pendulum",
        "more than 100000 solver steps are needed",
        {"gravity": 1e14},
        statuses=_CURABLE,
        times=(0.0, 1e3),
    ),
    Case("start time infinite", "Pendulum", "start time = inf: it must", times=(np.inf, 0.1), masters=_WITH_START_TIME),
    Case("stop time infinite", "Pendulum", "stop time = inf: it must", times=(0.0, np.inf), masters=_WITH_START_TIME),
)


@dataclass(frozen=True)
class Outcome:
    """How a run ended.

    :param end: raises, returns false, aborts, goes on, or hangs.
    :param statuses: with which the FMU refused, the first ones of a kind.
    :param message: the FMU's first words about it.
    :param printed: everything that the process wrote.
    """

    end: str
    statuses: tuple[str, ...]
    message: str
    seconds: float
    printed: str


def installed(master: Master) -> bool:
    """Whether a master can run here."""
    name = master.split()[0]
    return name == "ours" or (find_spec(name) is not None and (name != "ecospy" or _tbb() is not None))


def run(master: Master, tasks: Sequence[tuple[Case, Path]], sources: Path | None = None) -> list[Outcome]:
    """Put cases to a master, one after the other.

    :param tasks: each with the FMU of its component.
    :param sources: an FMU ``Ramp`` of FMI 2.0, for masters that need one.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "tasks.json"
        content = [[asdict(case), str(fmu), str(sources or "")] for case, fmu in tasks]
        file.write_text(json.dumps(content))
        command = [sys.executable, __file__, "--run", master, str(file)]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60 + LONGEST * len(tasks))
        if done.returncode != 0:
            raise RuntimeError(done.stderr)
        return [_outcome(*json.loads(line)) for line in done.stdout.splitlines()]


# ---- what the process of a master does ---------------------------------------------------------------------------


def _serve(master: Master, file: Path) -> None:
    """Fork for each of the tasks, print a line for each."""
    simulate = _load(master.split()[0])
    for case, fmu, source in json.loads(file.read_text()):
        with tempfile.TemporaryFile("w+", errors="replace") as printed:
            begin = time.perf_counter()
            child = os.fork()
            if child == 0:
                for stream in (1, 2):
                    os.dup2(printed.fileno(), stream)
                _child(simulate, Case(**case), fmu, source)
            status = _wait(child, begin)
            seconds = time.perf_counter() - begin
            printed.seek(0)
            sys.stdout.write(json.dumps([status, seconds, printed.read()]) + "\n")
            sys.stdout.flush()


def _child(simulate: Callable[[Case, str, str], bool], case: Case, fmu: str, source: str) -> None:
    status = 10  # an exception
    try:
        status = 0 if simulate(case, fmu, source) else 11
    except BaseException as error:  # noqa: BLE001 - whatever it is, it is the end of the run
        sys.stdout.write(f"{type(error).__name__}: {error}\n")
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


def _wait(child: int, begin: float) -> int:
    """Exit status; negative: of a signal; 12: it was ended after too long a time."""
    while time.perf_counter() - begin < LONGEST:
        found, status = os.waitpid(child, os.WNOHANG)
        if found:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.002)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return 12


def _load(name: str) -> Callable[[Case, str, str], bool]:
    """How a master simulates; what takes long to import is imported before the clock runs."""
    if name == "ecospy":
        ctypes.CDLL(str(_tbb()), mode=ctypes.RTLD_GLOBAL)
        from ecospy import EcosLib, EcosSimulation  # noqa: F401

        return _in_ecos
    if name == "libcosimpy":
        from libcosimpy.CosimExecution import CosimExecution  # noqa: F401

        return _in_libcosim
    if name == "ours":
        import liaisons.cosim  # noqa: F401

        return _in_ours
    return _in_fmpy


def _in_fmpy(case: Case, fmu: str, _: str) -> bool:
    begin, step = case.times
    options: dict[str, Any] = {}
    if case.ramp:
        name, value, rate = case.ramp
        end = begin + case.steps * step
        rows = [(begin, value), (end, value + rate * (end - begin))]
        options["input"] = np.array(rows, dtype=[("time", float), (name, float)])
    fmpy.simulate_fmu(
        fmu,
        start_values=case.starts,
        start_time=begin,
        stop_time=begin + case.steps * step,
        output_interval=step,
        **options,
    )
    return True


def _in_libcosim(case: Case, fmu: str, source: str) -> bool:
    from libcosimpy._internal import get_last_error_message
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    execution = CosimExecution.from_step_size(round(case.times[1] * 1e9))
    execution.add_observer(CosimObserver.create_last_value())
    it = execution.add_local_slave(CosimLocalSlave(fmu, "it"))
    places = _references(fmu)
    for name, value in case.starts.items():
        if isinstance(value, int):
            execution.integer_initial_value(it, places[name], value)
        else:
            execution.real_initial_value(it, places[name], value)
    if case.ramp:
        ramp, others = execution.add_local_slave(CosimLocalSlave(source, "ramp")), _references(source)
        for name, value in zip(("offset", "rate"), case.ramp[1:], strict=True):
            execution.real_initial_value(ramp, others[name], value)
        execution.connect_real_variables(ramp, others["y"], it, places[case.ramp[0]])
    fine = execution.step(case.steps)
    sys.stdout.write(get_last_error_message())
    return fine


def _in_ecos(case: Case, fmu: str, source: str) -> bool:
    from ecospy import EcosLib, EcosSimulation, EcosSimulationStructure

    EcosLib.set_log_level("debug")  # where it puts what FMUs say
    with EcosSimulationStructure() as structure:
        structure.add_model("it", fmu)
        values = {f"it::{name}": value for name, value in case.starts.items()}
        if case.ramp:
            structure.add_model("ramp", source)
            structure.make_real_connection("ramp::y", f"it::{case.ramp[0]}")
            values |= {"ramp::offset": case.ramp[1], "ramp::rate": case.ramp[2]}
        structure.add_parameter_set("values", values)
        with EcosSimulation(structure=structure, step_size=case.times[1]) as simulation:
            simulation.init(parameter_set="values")
            simulation.step(case.steps)
            names = [v.name for v in fmpy.read_model_description(fmu, validate=False).modelVariables]
            [simulation.get_real(f"it::{name}") for name in names if name in {"energy", "theta"}]
    return True


def _in_ours(case: Case, fmu: str, _: str) -> bool:
    from liaisons.cosim import simulate

    begin, step = case.times
    inputs: dict[str, Any] = {}
    starts: dict[str, Any] = case.starts
    if case.ramp:
        starts = starts | {"input_reconstruction": 1}  # else the FMU would be told of the ramp inside the step, too
        name, value, rate = case.ramp
        inputs[name] = lambda t: value + rate * (t - begin)
    end = begin + case.steps * step
    simulate(fmu, start_time=begin, stop_time=end, step_size=step, inputs=inputs, **starts)
    return True


def _references(fmu: str) -> dict[str, int]:
    return {v.name: v.valueReference for v in fmpy.read_model_description(fmu, validate=False).modelVariables}


def _tbb() -> Path | None:
    """The library that ecos needs, which the wheel puts where no loader looks."""
    spec = find_spec("ecospy")
    places = [Path(sys.prefix), *(Path(spec.origin).parents if spec and spec.origin else ())]
    return next((p / "lib" / "libtbb.so.12" for p in places if (p / "lib" / "libtbb.so.12").exists()), None)


# ---- what they print ---------------------------------------------------------------------------------------------

_SAID = re.compile(
    r"(?:^\[|\[FMI status=|\] (?:fmi2)?|\breturned )(discard|error)\b(?:, category=\w+)?[]:]* (.*)",
    re.IGNORECASE | re.MULTILINE,
)
"""Status and message as fmpy, libcosim, ecos, and this project print them."""

_ENDS = {0: "goes on", 10: "raises", 11: "returns false", 12: "hangs"}


def _outcome(status: int, seconds: float, printed: str) -> Outcome:
    said = [(found[1].capitalize(), found[2]) for found in _SAID.finditer(printed)]
    statuses = tuple(dict.fromkeys(status for status, _ in said))
    message = said[0][1] if said else printed.strip().splitlines()[-1] if printed.strip() else ""
    return Outcome(_ENDS.get(status, "aborts"), statuses, message, seconds, printed)


# ---- cases for any component -------------------------------------------------------------------------------------


def cases(name: str, fmu: Path) -> Iterator[Case]:
    """What can be refused by a component, from its description; arrays of FMI 3.0, which not all can set, left out."""
    description = fmpy.read_model_description(str(fmu), validate=False)
    everything = {v.name: v for v in description.modelVariables}
    given = [v for v in description.modelVariables if v.causality in {"parameter", "input"} and not v.shape]
    reals = [v for v in given if v.type in {"Real", "Float64"}]
    lowest = {v.name: float(v.min) for v in reals if v.min is not None}
    for variable in reals[:1]:
        yield Case(
            "number nan", name, f"{re.escape(variable.name)} = nan: set", {variable.name: np.nan}, masters=_NOT_OURS
        )
        yield Case("number infinite", name, " = -?inf: set", {variable.name: -np.inf}, masters=_NOT_OURS)
    for variable in [v.name for v in reals if v.causality == "parameter" and v.name in lowest][:1]:
        yield Case("parameter outside its domain", name, "must be >", {variable: lowest[variable] - 1.0})
    for variable in [v for v in lowest if f"{v}_dot" in everything and everything[v].causality == "input"]:
        starts = {variable: lowest[variable] + 0.2, f"{variable}_dot": -3.0}
        yield Case(f"{variable} leaves its domain", name, "", starts)
    huge = {v.name: 1e200 for v in reals if v.name.endswith("_dot_0") or "_dot_0[" in v.name}
    if huge:
        yield Case("rates 1e200", name, "", huge)
    forces = {v.name: 1e308 for v in reals if v.causality == "input" and re.search(r"_force(\[|$)", v.name)}
    if forces:
        yield Case("forces 1e308", name, "", forces)
    if "symplectic_steps" in everything:
        yield Case("one symplectic step of 1000 s", name, "", {"symplectic_steps": 1}, times=(0.0, 1e3), steps=2)
    yield Case("step of 1e6 s", name, "", times=(0.0, 1e6), steps=1)
    for times in ((np.inf, 0.1), (0.0, np.inf)):
        yield Case(f"start {times[0]:g}, step {times[1]:g}", name, "time = inf", times=times, masters=_WITH_START_TIME)


# ---- the table ---------------------------------------------------------------------------------------------------


def table(rows: Sequence[tuple[Case, Master, Outcome]]) -> Iterator[str]:
    """Lines of Markdown."""
    yield "| component | refused | importer | statuses | the run | s | message |"
    yield "|---|---|---|---|---|---|---|"
    for case, master, outcome in rows:
        statuses, message = " then ".join(outcome.statuses), outcome.message.strip()[:90].replace("|", "\\|")
        entry = [case.component, case.kind, master, statuses, outcome.end, f"{outcome.seconds:.2f}", message]
        yield f"| {' | '.join(entry)} |"


def main(names: Sequence[str]) -> None:
    """Build what is needed and print the table."""
    from liaisons.fmu import build
    from liaisons.models import CATALOGUE

    models = {component.__name__: component for component in CATALOGUE}
    names = list(models) if list(names) == ["all"] else names
    with tempfile.TemporaryDirectory() as folder:

        def fmu(name: str, master: Master) -> Path:
            version = "3" if master.endswith("3") else "2"
            found = Path(folder, "fmi3" * (version == "3"), f"{name}.fmu")
            return found if found.exists() else build(assemble(models[name]), folder, backend="native", fmi=version)

        chosen = [case for name in names for case in cases(name, fmu(name, "ours 2"))] or list(CASES)
        rows: list[tuple[Case, Master, Outcome]] = []
        for master in MASTERS:
            if not installed(master):
                continue
            mine = [case for case in chosen if master in case.masters]
            tasks = [(case, fmu(case.component, master)) for case in mine]
            for case, outcome in zip(mine, run(master, tasks, fmu("Ramp", "ours 2")), strict=True):
                rows.append((case, master, outcome))
        rows.sort(key=lambda row: (chosen.index(row[0]), MASTERS.index(row[1])))
        with suppress(BrokenPipeError):
            sys.stdout.writelines(f"{line}\n" for line in table(rows))


if __name__ == "__main__":
    if sys.argv[1:2] == ["--run"]:
        _serve(sys.argv[2], Path(sys.argv[3]))  # type: ignore[arg-type] - one of them
    else:
        main(sys.argv[1:])
