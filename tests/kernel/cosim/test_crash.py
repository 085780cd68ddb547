"""FMUs of others that crash, return what is no success, or say what harms a terminal: they are named."""

from __future__ import annotations

import logging
import subprocess
import sys
from pathlib import Path
from typing import Any

import equations as equations_module
import fmpy
import pytest
from equations import equations
from making import FmuPaths, packed, wired

from liaisons.cosim import simulate
from liaisons.errors import SimulationError
from liaisons.results import IncompleteError


@pytest.mark.parametrize(
    ("name", "starts", "words"),
    [
        ("Crashing", {}, r"instantiated \(SIGABRT\)"),
        ("Crashing_at_once", {}, r"instantiated \(SIGSEGV\)"),
        ("Crashing_later", {"when": 1}, r"initialized \(SIGSEGV\)"),
        ("Crashing_later", {"when": 2}, r"stepped \(SIGSEGV\)"),
    ],
)
def test_fmu_that_crashes_at_the_begin(fmu: FmuPaths, name: str, starts: dict[str, int], words: str) -> None:
    system = wired(good=fmu("Cubic"), bad=(fmu(name), starts))
    with pytest.raises(SimulationError, match=rf"^bad: {name}\.fmu crashes when it is {words}; .* ask its maker$"):
        system.simulate(1.0, 0.1)


@pytest.mark.parametrize(
    ("name", "when", "stage"), [("Crashing_at_once", 0, "instantiated"), ("Crashing_later", 2, "stepped")]
)
def test_crash_where_processes_cannot_be_forked(
    fmu: FmuPaths, monkeypatch: pytest.MonkeyPatch, name: str, when: int, stage: str
) -> None:
    monkeypatch.setattr("liaisons.cosim.instances.isolation", lambda: None)
    starts: dict[str, Any] = {"when": when} if when else {}
    with pytest.raises(SimulationError, match=rf"crashes when it is {stage} \(SIGSEGV\)"):
        simulate(fmu(name), stop_time=1.0, step_size=0.5, **starts)


def test_fmu_that_would_crash_with_other_start_values_runs(fmu: FmuPaths) -> None:
    assert simulate(fmu("Crashing_later"), stop_time=1.0, step_size=0.5)["x"].tolist() == [0.0, 0.0, 0.0]


_FMI_3 = """
#include <signal.h>
#include "fmi3Functions.h"
fmi3Instance fmi3InstantiateCoSimulation(fmi3String a, fmi3String b, fmi3String c, fmi3Boolean d, fmi3Boolean e,
    fmi3Boolean f, fmi3Boolean g, const fmi3ValueReference h[], size_t i, fmi3InstanceEnvironment j,
    fmi3LogMessageCallback k, fmi3IntermediateUpdateCallback l) { @instantiate@ return &raise; }
fmi3Status fmi3SetFloat64(fmi3Instance a, const fmi3ValueReference b[], size_t c, const fmi3Float64 d[], size_t e) {
    if (c != 1 || e != 2 || d[1] != 4.0) raise(SIGFPE);
    return fmi3OK; }
fmi3Status fmi3EnterInitializationMode(fmi3Instance a, fmi3Boolean b, fmi3Float64 c, fmi3Float64 d, fmi3Boolean e,
    fmi3Float64 f) { return fmi3OK; }
fmi3Status fmi3ExitInitializationMode(fmi3Instance a) { raise(SIGSEGV); return fmi3OK; }
"""

_DESCRIPTION = """<?xml version="1.0"?>
<fmiModelDescription fmiVersion="3.0" modelName="Bad" instantiationToken="{}">
<CoSimulation modelIdentifier="Bad"/>
<ModelVariables><Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
<Float64 name="k" valueReference="1" causality="parameter" variability="fixed" start="0 0">
<Dimension start="2"/></Float64>
</ModelVariables><ModelStructure/></fmiModelDescription>"""


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("raise(SIGILL);", r"instantiated \(SIGILL\)"),
        ("raise(SIGRTMIN + 6);", r"instantiated \(signal \d+\)"),  # has no name
        ("", r"initialized \(SIGSEGV\)"),
    ],
)
def test_fmu_of_fmi_3_that_crashes_at_the_begin(tmp_path: Path, code: str, words: str) -> None:
    packed(tmp_path, "Bad", _FMI_3.replace("@instantiate@", code), _DESCRIPTION, fmpy.platform_tuple)
    with pytest.raises(SimulationError, match=rf"^Bad: Bad\.fmu crashes when it is {words}"):
        simulate(tmp_path / "Bad.fmu", stop_time=1.0, step_size=0.1, k=[3.0, 4.0])


@pytest.mark.parametrize("status", [0, 1, 3])
@pytest.mark.parametrize(("place", "stage"), [("start", "instantiated"), ("event", "initialized")])
def test_fmu_that_ends_its_process_at_the_begin(tmp_path: Path, status: int, place: str, stage: str) -> None:
    """With whatever exit status: it would end ours."""
    code = {place: f"exit({status});"}
    words = rf"^x: x\.fmu crashes when it is {stage} \(exit status {status}\); .* ask its maker$"
    with pytest.raises(SimulationError, match=words):
        simulate(equations(tmp_path, 1, 0, **code), stop_time=1.0, step_size=0.1)


@pytest.mark.parametrize("name", ["fmi2Terminate", "fmi2FreeInstance"])
def test_fmu_that_cannot_be_released(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """The run is complete by then."""
    code = equations_module._CODE.replace(f" {name}(", f" {name}_gone(")
    monkeypatch.setattr(equations_module, "_CODE", code)
    result = simulate(equations(tmp_path, 1, rates="f[0] = 1;"), stop_time=1.0, step_size=0.1)
    assert result["x0"][-1] == pytest.approx(1.0)
    assert any("cannot be released" in text and name in text for text in result.warnings)


# ---- statuses: whatever is none of FMI is no success


@pytest.mark.usefixtures("either_loop")
@pytest.mark.parametrize("status", [-1, -2, -(2**31), 3, 6, 101, 103, 2**31 - 1])
@pytest.mark.parametrize("apart", [False, True])
def test_of_a_step_alone(fmu: FmuPaths, status: int, apart: bool) -> None:
    with pytest.raises(IncompleteError, match=r"^Hasty: fmi2DoStep from t = 0 s to t = 0\.2 s returned") as it:
        simulate(fmu("Hasty"), stop_time=1.0, step_size=0.2, status=status, isolated=apart)
    assert it.value.result.time.tolist() == [0.0]


@pytest.mark.parametrize("status", [-1, -2, 3, 103])
@pytest.mark.parametrize("apart", [False, True])
def test_of_a_coupled_step(fmu: FmuPaths, status: int, apart: bool) -> None:
    bad = fmu("Hasty"), {"status": status, "isolated": apart}
    system = wired("mass.q -> buffer.length", mass=(fmu("Cart"), {"q_0": 1.0}), buffer=fmu("Buffer"), bad=bad)
    with pytest.raises(IncompleteError, match=r"^bad: fmi2DoStep from t = 0 s to t = 0\.2 s returned"):
        system.simulate(1.0, 0.2, coupling="implicit")


@pytest.mark.usefixtures("either_loop")
@pytest.mark.parametrize("apart", [False, True])
def test_of_equations_alone(tmp_path: Path, apart: bool) -> None:
    fmu = equations(tmp_path, 1, rates="f[0] = 1; if (t > 0.45) return 3;")
    with pytest.raises(IncompleteError, match=r"x: fmi2GetDerivatives at t = \S+ s returned Error") as it:
        simulate(fmu, stop_time=1.0, step_size=0.2, isolated=apart)
    assert it.value.result.time[-1] == pytest.approx(0.4)


@pytest.mark.parametrize("apart", [False, True])
def test_of_equations_in_a_coupled_step(tmp_path: Path, apart: bool) -> None:
    """Their derivatives are refused from t = 0.45 s on."""
    fmu = equations(tmp_path, 1, rates="f[0] = u; if (t > 0.45) return 3;", output="y = x[0];")
    system = wired("a.y -> b.u", a=(fmu, {"isolated": apart}), b=fmu)
    system.connect(system.parts["b"]["y"], system.parts["a"]["u"])
    with pytest.raises(SimulationError, match=r"[ab]: fmi2GetDerivatives at t = \S+ s returned Error") as it:
        system.simulate(1.0, 0.2, coupling="implicit")
    assert isinstance(it.value, IncompleteError)
    assert it.value.result.time[-1] == pytest.approx(0.4)


# ---- words: they do no harm in a terminal and fill no screen

_LIAISONS = [sys.executable, "-c", "from liaisons_tools.cli import main; raise SystemExit(main())"]


def test_no_control_characters_reach_the_terminal(fmu: FmuPaths) -> None:
    """Warnings, an error of 10 MB, and names with the one-letter form of an escape sequence, which XML allows."""
    command = [*_LIAISONS, "simulate", str(fmu("Loud")), "--stop", "1", "--step", "0.1"]
    done = subprocess.run(command, capture_output=True, timeout=60, check=False)
    assert done.returncode == 2
    for text in (done.stdout.decode(), done.stderr.decode()):
        assert all(line.isprintable() for line in text.splitlines())
        assert 100 < len(text) < 5000


def test_warnings_have_an_end(fmu: FmuPaths, caplog: pytest.LogCaptureFixture) -> None:
    with pytest.raises(SimulationError):
        simulate(fmu("Loud"), stop_time=1.0, step_size=1e-3)
    warnings = [record for record in caplog.records if record.levelno == logging.WARNING]
    assert len(warnings) == 100
    assert warnings[-1].message.endswith("; further warnings from it are not shown")


def test_what_is_not_finite_is_said_once_a_variable(fmu: FmuPaths, caplog: pytest.LogCaptureFixture) -> None:
    simulate(fmu("Endless"), stop_time=1.0, step_size=0.125)
    assert [record.message for record in caplog.records] == [
        "Endless: x is nan at t = 0.5 s, and not finite at 5 of 9 points",
        "Endless: y is -inf at t = 0.75 s, and not finite at 1 of 9 points",
    ]
