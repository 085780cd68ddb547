"""FMUs that crash do not take the process along, and are named."""

from __future__ import annotations

from pathlib import Path

import equations as equations_module
import fmpy
import pytest
from equations import equations
from making import FmuPaths, packed, wired

from liaisons.cosim import simulate
from liaisons.errors import SimulationError


@pytest.mark.parametrize(
    ("name", "starts", "words"),
    [
        ("Crashing", {}, r"loaded \(SIGABRT\)"),
        ("Crashing_at_once", {}, r"instantiated \(SIGSEGV\)"),
        ("Crashing_later", {"when": 1}, r"initialized \(SIGSEGV\)"),
        ("Crashing_later", {"when": 2}, r"stepped \(SIGSEGV\)"),
    ],
)
def test_fmu_that_crashes_at_the_begin(fmu: FmuPaths, name: str, starts: dict[str, int], words: str) -> None:
    system = wired(good=fmu("Cubic"), bad=(fmu(name), starts))
    with pytest.raises(SimulationError, match=rf"^bad: {name}\.fmu crashes when it is {words}; .* ask its maker$"):
        system.simulate(1.0, 0.1)


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
    ("code", "words"), [("raise(SIGILL);", r"instantiated \(SIGILL\)"), ("", r"initialized \(SIGSEGV\)")]
)
def test_fmu_of_fmi_3_that_crashes_at_the_begin(tmp_path: Path, code: str, words: str) -> None:
    packed(tmp_path, "Bad", _FMI_3.replace("@instantiate@", code), _DESCRIPTION, fmpy.platform_tuple)
    with pytest.raises(SimulationError, match=rf"^Bad: Bad\.fmu crashes when it is {words}"):
        simulate(tmp_path / "Bad.fmu", stop_time=1.0, step_size=0.1, k=[3.0, 4.0])


@pytest.mark.parametrize("status", [0, 1, 3])
@pytest.mark.parametrize(("place", "stage"), [("start", "instantiated"), ("event", "stepped")])
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
