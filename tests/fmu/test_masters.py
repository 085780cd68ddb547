"""The FMUs in other importers, each in a process of its own: libcosim (OSP) and ecos, beside fmpy."""

from __future__ import annotations

import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import fmpy
import numpy as np
import pytest
from driver import OK

STEP, STEPS = 0.01, 300
START = {"theta_0": 2.0, "friction": 0.1}

# A kick's x drives the pendulum's torque: x of the beginning of a step is held during it (Jacobi).
_LIBCOSIM = """
import json, sys
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

pendulum, kick, references, start, size, steps = json.loads(sys.argv[1])
execution = CosimExecution.from_step_size(size * 1e9)
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
slaves = [execution.add_local_slave(CosimLocalSlave(path, name)) for path, name in ((pendulum, "p"), (kick, "k"))]
assert slaves == [0, 1], slaves
for name, value in start.items():
    assert execution.real_initial_value(0, references[name], value)
assert execution.connect_real_variables(1, references["x"], 0, references["theta_force"]) == 0
assert execution.step(steps)
print("result", json.dumps(observer.last_real_values(0, [references["theta"], references["p_theta"]])))
"""

_ECOS = """
import ctypes, json, sys
from pathlib import Path

# ecos needs TBB; the wheel puts it where no loader looks.
ctypes.CDLL(str(Path(sys.prefix) / "lib" / "libtbb.so.12"), mode=ctypes.RTLD_GLOBAL)
from ecospy import EcosSimulation, EcosSimulationStructure

pendulum, kick, references, start, size, steps = json.loads(sys.argv[1])
with EcosSimulationStructure() as structure:
    structure.add_model("p", pendulum)
    structure.add_model("k", kick)
    structure.make_real_connection("k::x", "p::theta_force")
    structure.add_parameter_set("start", {f"p::{name}": value for name, value in start.items()})
    with EcosSimulation(structure=structure, step_size=size) as simulation:
        simulation.init(parameter_set="start")
        simulation.step(steps)
        print("result", json.dumps([simulation.get_real(f"p::{name}") for name in ("theta", "p_theta")]))
"""


@pytest.fixture(scope="module")
def expected(pendulum_library, kick_library) -> np.ndarray:
    """The same Jacobi scheme, call by call."""
    pendulum, kick = pendulum_library.start(**START), kick_library.start()
    for i in range(STEPS):
        assert pendulum.set(theta_force=kick["x"]) == OK
        assert pendulum.step(i * STEP, STEP) == OK
        assert kick.step(i * STEP, STEP) == OK
    return pendulum.get("theta", "p_theta")


@pytest.mark.parametrize(("module", "script"), [("libcosimpy", _LIBCOSIM), ("ecospy", _ECOS)])
def test_other_masters_agree(module, script, pendulum_library, kick_library, expected) -> None:
    if find_spec(module) is None:
        pytest.skip(f"{module} is not installed")
    if module == "ecospy" and not (Path(sys.prefix) / "lib" / "libtbb.so.12").exists():
        pytest.skip("TBB is not installed as a wheel")
    references = kick_library.references | pendulum_library.references
    task = json.dumps([str(pendulum_library.path), str(kick_library.path), references, START, STEP, STEPS])
    ended = subprocess.run([sys.executable, "-c", script, task], capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr + ended.stdout
    (line,) = (line for line in ended.stdout.splitlines() if line.startswith("result "))  # among what they log
    found = json.loads(line.removeprefix("result "))
    # The same calls; times differ in their last digits, which a solver at 1e-8 does not see.
    np.testing.assert_allclose(found, expected, atol=1e-8)


def test_fmpy_agrees(pendulum_library) -> None:
    result = fmpy.simulate_fmu(
        str(pendulum_library.path),
        stop_time=STEP * STEPS,
        output_interval=STEP,
        start_values=START,
        output=["theta", "p_theta"],
    )
    instance = pendulum_library.start(**START)
    for i in range(STEPS):
        assert instance.step(i * STEP, STEP) == OK
    np.testing.assert_allclose(
        [result["theta"][-1], result["p_theta"][-1]], instance.get("theta", "p_theta"), atol=1e-8
    )
