"""Jacobi's scheme call by call, and other masters that take portable SSP archives, each in a process of its own.

What each of them does with the systems of this project (Jacobi's scheme: all step, all are read, all are set):

* libcosimpy (OSP): parameter sets count; outputs are handed on in initialization, as often as there are components.
* ecospy: the same, but once less.
* fmpy.ssp: parameter sets of components are passed over (their values stand in the FMUs, too); nothing is handed on in
  initialization, and each connected input is set to 0 before the first step.  Where 0 is not allowed, the FMU keeps its
  start value.

So they differ in the first step, where outputs and inputs that depend on each other go round in a circle, and fmpy in
each that does not start from 0.  An output that depends directly on connected inputs is read with old inputs in it (but
in ecos); what is compared does not.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from ctypes import c_double
from graphlib import TopologicalSorter
from importlib.metadata import PackageNotFoundError, files
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.simulation import apply_start_values, instantiate_fmu
from numpy.typing import NDArray

from liaisons import System
from liaisons.cosim import Connection, SystemComponent, make_instance

_LIBCOSIM = """
import json, sys
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver

path, size, steps, wanted = json.loads(sys.argv[1])
execution = CosimExecution.from_ssp_file(path, step_size=size * 1e9)
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
assert execution.step(steps)
slave = execution.slave_index_from_instance_name
print("result", json.dumps([observer.last_real_values(slave(c), [r])[0] for c, _, r in wanted]))
"""

_ECOS = """
import ctypes, json, sys
from importlib.metadata import files

# ecos needs TBB; the wheel puts it where no loader looks.
library = next(file for file in files("tbb") if file.name == "libtbb.so.12")
ctypes.CDLL(str(library.locate()), mode=ctypes.RTLD_GLOBAL)
from ecospy import EcosSimulation

path, size, steps, wanted = json.loads(sys.argv[1])
with EcosSimulation(ssp_path=path, step_size=size) as simulation:
    simulation.init(parameter_set="initialValues")
    simulation.step(steps)
    print("result", json.dumps([simulation.get_real(f"{c}::{v}") for c, v, _ in wanted]))
"""

_FMPY = """
import json, sys
from fmpy.ssp.simulation import simulate_ssp

path, size, steps, wanted = json.loads(sys.argv[1])
rows = simulate_ssp(path, stop_time=(steps - 0.5) * size, step_size=size)
assert len(rows) == steps
print("result", json.dumps([float(rows[f"{c}.{v}"][-1]) for c, v, _ in wanted]))
"""

_MASTERS = {"libcosimpy": _LIBCOSIM, "ecospy": _ECOS, "fmpy": _FMPY}

MASTERS = tuple(_MASTERS)

SWEEPS: Mapping[str, Callable[[int], int]] = {"libcosimpy": int, "ecospy": lambda n: n - 1, "fmpy": lambda _: 0}
"""How often outputs are handed on in initialization, by the number of components."""

Values = dict[str, float]


class RefusalError(Exception):
    """What a master says when it fails."""


def compared(system: System) -> list[tuple[str, str]]:
    """Outputs that no connected input enters directly: read before or after inputs are set, they are the same."""
    fed = {link.target.reference for link in system.connections}
    return [
        (c.name, output)
        for c in system.parts.values()
        for output in c.fmu.reals("output")
        if not any(owner == c.name and c.fmu.depends(output, name) for owner, name in fed)
    ]


def elsewhere(
    master: str, system: System, folder: Path, *, size: float, steps: int, also: Sequence[tuple[str, str]] = ()
) -> Values:
    """The compared outputs at the end, in another master that is given the portable archive.

    :param also: further outputs, by component and name.
    :raises RefusalError: if it fails.
    """
    if find_spec(master) is None:
        pytest.skip(f"{master} is not installed")
    if master == "ecospy" and not _has_tbb():
        pytest.skip("TBB is not installed as a wheel")
    path = folder / "system.ssp"
    system.write_ssp(path, stop_time=size * steps, step_size=size)
    places = [*compared(system), *also]
    wanted = [(c, v, system.parts[c].fmu.variables[v].reference) for c, v in places]
    task = json.dumps([str(path), size, steps, wanted])
    command = [sys.executable, "-c", _MASTERS[master], task]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    if ended.returncode != 0:
        raise RefusalError(ended.stderr + ended.stdout)
    (line,) = (line for line in ended.stdout.splitlines() if line.startswith("result "))  # among what they log
    return dict(zip(map(".".join, places), json.loads(line.removeprefix("result ")), strict=True))


def _has_tbb() -> bool:
    try:
        return any(file.name == "libtbb.so.12" and Path(file.locate()).exists() for file in files("tbb") or ())
    except PackageNotFoundError:
        return False


def jacobi(
    system: System,
    folder: Path,
    *,
    size: float,
    steps: int,
    sweeps: int,
    first: float | None = None,
    kept: Collection[str] = (),
) -> Values:
    """The same, call by call.

    :param sweeps: how often outputs are handed on in initialization.
    :param first: what connected inputs hold during the first step, in place of the outputs at the start.
    :param kept: names of inputs that hold their start values there, all the same.
    """
    with _instances(system, folder, size * steps) as instances:
        links = system.connections

        def read(owner: str, variable: str) -> float:
            buffer = (c_double * 1)()
            assert not instances[owner].getter([system.parts[owner].fmu.variables[variable]], buffer)()
            return buffer[0]

        def hand_on(value: float | None = None) -> None:
            values = [read(*link.source.reference) if value is None else value for link in links]
            for link, given in zip(links, values, strict=True):
                if value is not None and link.target.name in kept:
                    continue
                buffer = (c_double * 1)(given)
                assert not instances[link.target.part.name].setter([link.target.variable], buffer)()

        for _ in range(sweeps):
            hand_on()
        for instance in instances.values():
            instance.exit_initialization()
        hand_on(first)
        time, length = c_double(), c_double(size)
        steppers = [instance.stepper(time, length) for instance in instances.values()]
        for step in range(steps):
            time.value = step * size
            assert not any(stepper() for stepper in steppers)
            hand_on()
        return {".".join(place): read(*place) for place in compared(system)}


def in_order(
    system: System, folder: Path, times: NDArray[np.float64], ahead: Mapping[str, str] | None = None
) -> Values:
    """The compared outputs at the end of a loop with FMPy, in which each output is read after the inputs that enter it.

    :param times: communication points.
    :param ahead: parts that step before all others, with the part that takes their outputs at the end of its own step
        (Gauss-Seidel); without it all step at once (Jacobi).
    """
    slaves = {name: _slave(part, folder / name) for name, part in system.parts.items()}

    def read(owner: str, variable: str) -> float:
        return float(slaves[owner].getReal([system.parts[owner].fmu.variables[variable].reference])[0])

    def hand_on(links: Iterable[Connection]) -> None:
        for link in links:
            slaves[link.target.part.name].setReal([link.target.variable.reference], [read(*link.source.reference)])

    def enters(before: Connection, link: Connection) -> bool:
        (owner, output), (reader, variable) = link.source.reference, before.target.reference
        return owner == reader and system.parts[owner].fmu.depends(output, variable)

    links, ahead = system.connections, ahead or {}
    ordered = [*TopologicalSorter({a: [b for b in links if enters(b, a)] for a in links}).static_order()]
    hand_on(ordered)
    for slave in slaves.values():
        slave.exitInitializationMode()
    hand_on(ordered)
    for time, size in zip(times[:-1].tolist(), np.diff(times).tolist(), strict=True):
        for name in ahead:
            slaves[name].doStep(time, size)
        hand_on(link for link in links if ahead.get(link.source.part.name) == link.target.part.name)
        for name in slaves.keys() - ahead.keys():
            slaves[name].doStep(time, size)
        hand_on(ordered)
    values = {".".join(place): read(*place) for place in compared(system)}
    for slave in slaves.values():
        slave.terminate()
        slave.freeInstance()
    return values


def _slave(part: SystemComponent, folder: Path) -> Any:
    """A component in FMPy, in initialization, with its start values."""
    description = fmpy.read_model_description(part.fmu.path, validate=False)
    slave: Any = instantiate_fmu(fmpy.extract(part.fmu.path, folder), description, fmi_type="CoSimulation")
    starts: dict[str, Any] = {}
    for variable, values in part.starts.items():
        starts |= zip(part.fmu.elements(variable), np.ravel(values).tolist(), strict=True)
    slave.setupExperiment(tolerance=1e-11, startTime=0.0)
    apply_start_values(slave, description, starts, settable=lambda _: True)
    slave.enterInitializationMode()
    return slave


@contextmanager
def _instances(system: System, folder: Path, stop_time: float) -> Iterator[Mapping[str, Any]]:
    """In initialization, with the start values of the archive."""
    path = folder / "starts.ssp"
    system.write_ssp(path, stop_time=stop_time)
    starts = {name: part.starts for name, part in System.from_ssp(path).parts.items()}
    with ExitStack() as stack:
        instances = {}
        for name, part in system.parts.items():
            fmpy.extract(part.fmu.path, folder / name)
            instance = instances[name] = stack.enter_context(make_instance(name, part.fmu, folder / name))
            instance.initialize(starts[name], None, 0.0, stop_time)
        yield instances
