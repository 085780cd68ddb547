"""FMPy's objects of running FMUs, and what FMPy does otherwise than a run needs: a test fails when FMPy mends it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from equations import equations
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.fmi3 import FMU3Model, FMU3Slave
from fmpy.sundials import CVodeSolver
from making import FmuPaths, Trace, exchange_only, wired

from liaisons.base.unit_definitions import UnitDefinition
from liaisons.cosim import System, read_description
from liaisons.cosim.instances import loading
from liaisons.errors import SimulationError


def _alone(path: Path, **options: Any) -> System:
    system = System("alone")
    system.add("mass", path, **options)
    return system


_MESSAGES = """
import sys
import fmpy, pytest
from fmpy.fmi1 import FMICallException
from liaisons.cosim import System
from liaisons.errors import SimulationError

system = System("alone")
system.add("mass", sys.argv[1])
with system.start(step_size=0.1) as run:
    run.step()
    with pytest.raises(FMICallException, match="fmi2ExitInitializationMode"):
        fmpy.simulate_fmu(sys.argv[1], start_values={"mass": -1.0}, stop_time=0.1)
    print("FMPy was here", flush=True)
    with pytest.raises(SimulationError, match="mass = -2 at t = 0: it must be > 0"):
        run.reset({"mass.mass": -2.0})
"""


def test_messages_of_fmpy_and_of_a_run_go_their_ways(component: FmuPaths) -> None:
    """FMPy has one logger of FMI 2.0 in a process, and prints what a run of ours leaves to it.

    In a process of its own: FMPy's logger is as old as its process, whatever tests have run there.
    """
    command = [sys.executable, "-c", _MESSAGES, str(component("Pendulum"))]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    printed, after = done.stdout.split("FMPy was here\n")
    assert "mass = -1 at t = 0: it must be > 0" in printed
    assert after == ""


@pytest.mark.parametrize(
    ("name", "exchange", "kind"),
    [
        ("Oscillator", False, FMU2Slave),
        ("Oscillator", True, FMU2Model),
        ("fmi3/Oscillator", False, FMU3Slave),
        ("fmi3/Oscillator", True, FMU3Model),
    ],
)
def test_run_hands_out_the_object_of_fmpy(
    component: FmuPaths, tmp_path: Path, name: str, exchange: bool, kind: type
) -> None:
    """It reads what the run records, and the FMU goes on from a state that it has brought back."""
    path = exchange_only(component(name), tmp_path) if exchange else component(name)
    system = _alone(path, x_0=0.5)
    reference = system.parts["mass"].fmu.variables["x"].reference
    with system.start(stop_time=1.0, step_size=0.1) as run:
        mass = run.fmu("mass")
        assert isinstance(mass, kind)
        read = getattr(mass, "getReal", None) or mass.getFloat64
        assert read([reference]) == [0.5]
        state = mass.deserializeFMUState(mass.serializeFMUState(mass.getFMUState()))
        mass.setFMUState(state)
        run.finish()
        result = run.result
        assert read([reference]) == [result["mass.x"][-1]]
    assert result["mass.x"].tolist() == system.simulate(stop_time=1.0, step_size=0.1)["mass.x"].tolist()


@pytest.mark.parametrize(
    ("name", "words"), [("mess", r"no component 'mess'.*mass"), ("mass", "mass runs in a process of its own")]
)
def test_no_object_to_hand_out(fmu: FmuPaths, name: str, words: str) -> None:
    with (
        _alone(fmu("Cart"), isolated=name == "mass").start(stop_time=1.0, step_size=0.5) as run,
        pytest.raises(SimulationError, match=f"^alone: .*{words}"),
    ):
        run.fmu(name)


def test_run_that_cannot_start_is_released(fmu: FmuPaths, trace: Trace) -> None:
    with pytest.raises(SimulationError, match="limit = -1 must be >= 0"):
        wired(good=fmu("Cart"), bad=(fmu("Faulty"), {"limit": -1.0})).start(stop_time=1.0, step_size=0.5)
    assert sorted(line for line in trace() if "free" in line) == ["bad free", "good free"]


def test_instances_share_the_functions_of_their_library(fmu: FmuPaths) -> None:
    before = dict(loading._libraries)  # an FMU that has returned Fatal keeps its library
    system = wired(a=fmu("Cart"), b=fmu("Cart"), c=fmu("Probe"))
    with system.start(stop_time=1.0, step_size=0.5) as run:
        a, b, c = (run.fmu(name)._functions for name in "abc")
        assert a is b is not c
        assert len(loading._libraries) == len(before) + 2
    assert loading._libraries == before


@pytest.mark.parametrize("name", ["Oscillator", "fmi3/Oscillator", "python/Oscillator", "PendulumChain"])
def test_descriptions_are_read_as_fmpy_reads_them(component: FmuPaths, name: str) -> None:
    """One reader for all uses; FMPy's takes ten times the memory where variables are many."""
    theirs = fmpy.read_model_description(str(component(name)))
    ours = read_description(component(name))
    assert theirs.defaultExperiment is not None
    assert (ours.root["modelName"], ours.experiment["stopTime"]) == (
        theirs.modelName,
        theirs.defaultExperiment.stopTime,
    )
    assert list(ours.attributes) == [variable.name for variable in theirs.modelVariables]
    for variable in theirs.modelVariables:
        seen = ours.attributes[variable.name]
        names = "causality", "start", "unit", "min", "max", "description"
        assert [seen.get(name) for name in names] == [getattr(variable, name) for name in names]
        assert (seen["tag"], int(seen["valueReference"])) == (variable.type, variable.valueReference)
    units = {unit.name: unit.baseUnit for unit in theirs.unitDefinitions}
    assert ours.units.keys() == units.keys()
    for unit, base in units.items():
        assert unit
        assert base
        assert ours.units[unit] == UnitDefinition(
            tuple(getattr(base, quantity) for quantity in ("kg", "m", "s", "A", "K", "mol", "cd", "rad")),
            base.factor,
            base.offset,
        )
    assert len(ours.outputs) == len(theirs.outputs)
    assert ours.states == len(theirs.derivatives)


# ---- what FMPy does otherwise


def _extracted(path: Path, folder: Path) -> dict[str, Any]:
    fmpy.extract(path, folder)
    return {"guid": path.stem, "modelIdentifier": path.stem, "unzipDirectory": str(folder), "instanceName": "x"}


def test_fmpy_refuses_a_library_without_every_function(tmp_path: Path) -> None:
    path = equations(tmp_path, 1)
    with pytest.raises(AttributeError, match="undefined symbol"):
        FMU2Model(**_extracted(path, tmp_path / "x"))


def test_fmpy_stays_in_the_folder_of_a_library_that_cannot_be_loaded(
    fmu: FmuPaths, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    named = _extracted(fmu("Cart"), tmp_path)
    folder = tmp_path / "binaries" / fmpy.platform
    (folder / f"Cart{fmpy.sharedLibraryExtension}").write_bytes(b"none")
    with pytest.raises(Exception, match="Failed to load shared library"):
        FMU2Slave(**named)
    assert Path.cwd() == folder


def test_fmpy_takes_a_negative_status_for_a_success(fmu: FmuPaths) -> None:
    system = wired(x=(fmu("Hasty"), {"status": -1}))
    with system.start(stop_time=1.0, step_size=0.1) as run:
        run.fmu("x").doStep(0.0, 0.5)  # it refuses: 0.5 s are too long
        run.fmu("x").doStep(0.0, 0.1)


def test_fmpy_cannot_set_derivatives_of_inputs(component: FmuPaths) -> None:
    force = np.array([(0.0, 1.0), (1.0, 1.0)], dtype=[("time", float), ("x_force", float)])
    options = {"stop_time": 1.0, "set_input_derivatives": True}
    with pytest.raises(ValueError, match="Can only assign sequence of same size"):
        fmpy.simulate_fmu(str(component("Oscillator")), input=force, **options)


def test_fmpy_repeats_a_step_that_is_discarded(fmu: FmuPaths) -> None:
    """Without end: it is ended here after some of them."""
    times: list[float] = []

    def seen(time: float, _: object) -> bool:
        times.append(time)
        return len(times) < 5

    path = fmu("Hasty")
    with wired(x=path).start(stop_time=1.0, step_size=0.5) as run:
        options = {"fmi_type": "CoSimulation", "initialize": False, "terminate": False}
        fmpy.simulate_fmu(
            str(path), fmu_instance=run.fmu("x"), stop_time=1.0, output_interval=0.5, step_finished=seen, **options
        )
    assert times == [0.0] * 5


def test_cvode_of_fmpy_integrates_past_the_time_that_it_is_told() -> None:
    times: list[float] = []

    def ones(numbers: Any, count: int) -> None:
        np.ctypeslib.as_array(numbers, (count,))[:] = 1.0

    def nothing(*_: object) -> None:
        """No state to set, no indicator, no input."""

    solver = CVodeSolver(1, 0, ones, nothing, ones, nothing, ones, times.append, None, 0.0, relativeTolerance=1e-6)
    solver.step(0.0, 0.1)
    assert max(times) > 0.1
