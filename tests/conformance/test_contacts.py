"""Impacts between the communication points of other importers: none is lost, whatever the steps are.

Each runs in a process of its own: fmpy, libcosim (OSP), ecos, and containers of fmu-manipulation-toolbox in fmpy.
"""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from trial import every_version, run

from liaisons.models import BallRow, BeadOnSphere, BouncingBall, DryOscillator, StringPendulum

_FMPY = """
import json, sys
import fmpy

path, names, _, size, steps, options = json.loads(sys.argv[1])
options |= {"output": names, "record_events": False}
rows = fmpy.simulate_fmu(path, stop_time=size * steps, output_interval=size, **options)
print("result", json.dumps([float(rows[name][-1]) for name in names]))
"""

_LIBCOSIM = """
import json, sys
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

path, _, references, size, steps, _ = json.loads(sys.argv[1])
execution = CosimExecution.from_step_size(round(size * 1e9))
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
slave = execution.add_local_slave(CosimLocalSlave(path, "it"))
assert execution.step(steps)
reals = observer.last_real_values(slave, references[:-1])
print("result", json.dumps([*reals, *observer.last_integer_values(slave, references[-1:])]))
"""

_ECOS = """
import ctypes, json, sys
from pathlib import Path

ctypes.CDLL(str(Path(sys.prefix) / "lib" / "libtbb.so.12"), mode=ctypes.RTLD_GLOBAL)
from ecospy import EcosSimulation, EcosSimulationStructure

path, names, _, size, steps, _ = json.loads(sys.argv[1])
with EcosSimulationStructure() as structure:
    structure.add_model("it", path)
    with EcosSimulation(structure=structure, step_size=size) as simulation:
        simulation.init()
        simulation.step(steps)
        reals = [simulation.get_real(f"it::{name}") for name in names[:-1]]
        print("result", json.dumps([*reals, simulation.get_integer(f"it::{names[-1]}")]))
"""

_CONTAINER = """
import sys
from fmu_manipulation_toolbox.cli.fmucontainer import fmucontainer

fmucontainer()
"""

_SCRIPTS = {"fmpy": _FMPY, "libcosimpy": _LIBCOSIM, "ecospy": _ECOS}

KNOWN = ("height", "height_dot", "impact_loss")
NAMES = (*KNOWN, "gap_impacts")
STOP = 3.0
Options = dict[str, Any]
CO_SIMULATION: Options = {"fmi_type": "CoSimulation"}
EVENTS = CO_SIMULATION | {"early_return_allowed": True, "use_event_mode": True}

every_size = pytest.mark.parametrize("size", [1e-3, 1e-2, 0.1, 1.0])


def ends(script: str, path: Path, size: float, options: Options) -> list[float]:
    """What an importer reads at the end."""
    description = fmpy.read_model_description(str(path), validate=False)
    references = {v.name: v.valueReference for v in description.modelVariables}
    task = [str(path), NAMES, [references[name] for name in NAMES], size, round(STOP / size), options]
    lines = run(sys.executable, "-c", script, json.dumps(task)).splitlines()
    (line,) = (line for line in lines if line.startswith("result "))  # among what they log
    return json.loads(line.removeprefix("result "))


def check(found: Sequence[float]) -> None:
    """Six impacts have been before √(2h/g) (1 + 2e + ... + 2e⁶)."""
    expected = BouncingBall.exact(np.array([STOP]))
    np.testing.assert_allclose(found[:-1], [expected[name][0] for name in KNOWN], rtol=0, atol=1e-9)
    assert found[-1] == 6


@pytest.mark.slow
@every_size
@pytest.mark.parametrize(
    ("module", "version", "options"),
    [
        ("fmpy", "2", CO_SIMULATION),
        ("fmpy", "3", CO_SIMULATION),
        ("fmpy", "3", EVENTS),
        ("libcosimpy", "2", {}),  # which reads no FMI 3.0
        ("ecospy", "2", {}),
        ("ecospy", "3", {}),
    ],
)
def test_masters_lose_no_impact(fmu, module: str, version: str, options: Options, size: float) -> None:
    if find_spec(module) is None or (module == "ecospy" and not (Path(sys.prefix) / "lib" / "libtbb.so.12").exists()):
        pytest.skip(f"{module} or what it needs is not installed")
    check(ends(_SCRIPTS[module], fmu("BouncingBall", version), size, options))


@pytest.mark.slow
@every_size
@every_version
def test_container_loses_no_impact(fmu, tmp_path: Path, version: str, size: float) -> None:
    path = fmu("BouncingBall", version)
    shutil.copy(path, tmp_path)
    box = {"name": "box.fmu", "fmu": [path.name], "step_size": size, "auto_output": True, "auto_link": False}
    (tmp_path / "box.json").write_text(json.dumps(box))
    folder = ("-fmu-directory", tmp_path, "-container", "box.json", "-fmi", version)
    run(sys.executable, "-c", _CONTAINER, *folder)
    check(ends(_FMPY, tmp_path / "box.fmu", size, CO_SIMULATION | {"validate": False}))


CONTACTS: dict[str, tuple[Any, dict[str, Any], tuple[str, ...], list[int], int]] = {
    # Start values, what is known, impacts, and at most so many events in 4 s.
    "ball": (BouncingBall, {"bounce": 0.5}, ("height", "impact_loss"), [10], 24),
    "string": (StringPendulum, {"x_0": 0.0, "z_0": -1.0, "x_dot_0": 6.6}, ("x", "z", "impact_loss"), [2], 8),
    "bead": (BeadOnSphere, {}, ("x", "z", "x_dot", "z_dot"), [0], 4),
    "friction": (DryOscillator, {"mu_static": 0.05, "mu_sliding": 0.03}, ("x", "x_dot"), [], 8),
    "stick-slip": (DryOscillator, {"mu_static": 0.2, "belt_dot": 0.1, "x_0": 0.0}, ("x", "x_dot"), [], 8),
    "row": (BallRow, {"bounce": 0.6}, ("x",), [1, 0], 3),
}


@every_version
@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8, 1e-10])
@pytest.mark.parametrize("case", CONTACTS)
def test_cvode_follows_contacts(fmu, case: str, version: str, tolerance: float) -> None:
    """Its errors make no impacts, no further events of what opens or slips slowly, and no impulse that pulls."""
    component, start, names, impacts, events = CONTACTS[case]
    path = str(fmu(component.__name__, version))
    read = [v.name for v in fmpy.read_model_description(path, validate=False).modelVariables if v.causality == "output"]
    options: Options = {"fmi_type": "ModelExchange", "relative_tolerance": tolerance, "output_interval": 0.01}
    rows = fmpy.simulate_fmu(path, stop_time=4.0, start_values=start, output=read, **options)

    def columns(*endings: str) -> np.ndarray:
        wanted = [name for name in read if name.partition("[")[0].endswith(endings)]
        return np.column_stack([rows[name] for name in wanted]) if wanted else np.empty((len(rows), 0))

    assert len(rows) <= 401 + 2 * events
    assert np.all(np.diff(columns("gap_impulse", "slack_impulse"), axis=0) >= 0)
    assert np.all(np.diff(columns("impact_loss"), axis=0) >= 0)
    if tolerance <= 1e-8:  # bounces that are counted are higher than what others do not follow
        assert columns("_impacts")[-1].tolist() == impacts
    before_and_after = np.diff(rows["time"]) == 0
    exact = component.exact(rows["time"], **start)
    for name in names:
        values = np.column_stack([rows[n] for n in read if n.partition("[")[0] == name])
        off = np.abs(values - exact[name].reshape(values.shape))
        off[:-1][before_and_after] = off[1:][before_and_after] = 0  # at impacts
        # The errors of all steps, of which two tugs make more; loosely held, an overlap of 10 tolerances of the FMU.
        assert off.max() < 3e3 * tolerance + 4e-6, name
