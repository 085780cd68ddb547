"""Portable SSP archives in other masters, each in a process of its own: libcosim (OSP), ecos, fmpy."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from ctypes import c_double
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp

from liaisons.cosim import System
from liaisons.cosim.instances import make
from liaisons.fmu import build
from liaisons.models import Oscillator, Pendulum, Sinusoid

H, STEPS = 0.01, 100

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
from pathlib import Path

# ecos needs TBB; the wheel puts it where no loader looks.
ctypes.CDLL(str(Path(sys.prefix) / "lib" / "libtbb.so.12"), mode=ctypes.RTLD_GLOBAL)
from ecospy import EcosSimulation

path, size, steps, wanted = json.loads(sys.argv[1])
with EcosSimulation(ssp_path=path, step_size=size) as simulation:
    simulation.init(parameter_set="initialValues")
    simulation.step(steps)
    print("result", json.dumps([simulation.get_real(f"{c}::{v}") for c, v, _ in wanted]))
"""


@pytest.fixture(scope="module")
def component(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    directory = tmp_path_factory.mktemp("components")
    models = {"Oscillator": Oscillator, "Pendulum": Pendulum, "Sinusoid": Sinusoid}
    return lambda name: build(models[name].model(), directory, backend="native")


@pytest.fixture
def pumped(component: Callable[[str], Path]) -> System:
    """A swing whose length a signal drives: connections go one way."""
    system = System("pumped swing")
    swing = system.add("swing", component("Pendulum"), theta_0=0.05, input_reconstruction=1)
    motor = system.add("operator", component("Sinusoid"), offset=1.0, amplitude=0.1, angular_frequency=6.26)
    system.connect(motor["y"], swing["length"])
    return system


@pytest.fixture
def double(component: Callable[[str], Path]) -> System:
    """A pendulum hung on a pendulum: an algebraic loop of accelerations and forces."""
    system = System("double pendulum")
    upper = system.add("upper", component("Pendulum"), theta_0=0.3, mass=5.0)
    lower = system.add("lower", component("Pendulum"), theta_0=0.3, mass=0.5)
    system.connect(upper["bob"], lower["pivot"])
    return system


@pytest.fixture
def chain(component: Callable[[str], Path]) -> System:
    """Oscillators, each hung on the one before."""
    system = System("chain")
    masses = [system.add(f"mass{i}", component("Oscillator"), x_0=0.1 * i) for i in range(4)]
    for one, other in pairwise(masses):
        system.connect(one["x"], other["support"])
    return system


Read = Callable[[str, str], float]


@contextmanager
def _jacobi(system: System, folder: Path, *, first: float | None = None) -> Iterator[Read]:
    """Jacobi's scheme call by call: all step, all are read, all are set; reads what stands there at the end.

    :param first: what connected inputs hold during the first step, in place of the outputs at the start.
    """
    links = list(system._links.values())
    with ExitStack() as stack:
        instances = {}
        for name, part in system._components.items():
            fmpy.extract(part.fmu.path, folder / name)
            instance = instances[name] = stack.enter_context(make(name, part.fmu, folder / name))
            instance.setup(None, 0.0, H * STEPS)
            for variable, value in part.starts.items():
                instance.assign(variable, value)
            instance.enter_initialization()

        def read(owner: str, variable: str) -> float:
            buffer = (c_double * 1)()
            assert not instances[owner].getter([system._components[owner].fmu.variables[variable]], buffer)()
            return buffer[0]

        def hand_on(value: float | None = None) -> None:
            values = [read(*link.source.place) if value is None else value for link in links]
            for link, given in zip(links, values, strict=True):
                buffer = (c_double * 1)(given)
                assert not instances[link.target.component.name].setter([link.target.variable], buffer)()

        for _ in range(len(instances) if first is None else 0):
            hand_on()
        for instance in instances.values():
            instance.exit_initialization()
        hand_on(first)
        time, size = c_double(), c_double(H)
        steppers = [instance.stepper(time, size) for instance in instances.values()]
        for step in range(STEPS):
            time.value = step * H
            assert not any(stepper() for stepper in steppers)
            hand_on()
        yield read


def _states(system: System) -> list[tuple[str, str]]:
    """What no input enters directly, so that it does not matter whether it is read before inputs are set, or after."""
    parts = system._components.values()
    return [(c.name, v) for c in parts for v in ("theta", "p_theta", "x", "p_x") if v in c.fmu.variables]


def _in(module: str, system: System, folder: Path) -> list[float]:
    """States at the end, in another master."""
    if find_spec(module) is None:
        pytest.skip(f"{module} is not installed")
    if module == "ecospy" and not (Path(sys.prefix) / "lib" / "libtbb.so.12").exists():
        pytest.skip("TBB is not installed as a wheel")
    path = folder / "system.ssp"
    system.write_ssp(path, stop_time=H * STEPS, step_size=H)
    wanted = [(c, v, system._components[c].fmu.variables[v].reference) for c, v in _states(system)]
    command = [sys.executable, "-c", _LIBCOSIM if module == "libcosimpy" else _ECOS]
    task = json.dumps([str(path), H, STEPS, wanted])
    ended = subprocess.run([*command, task], capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr + ended.stdout
    (line,) = (line for line in ended.stdout.splitlines() if line.startswith("result "))  # among what they log
    return json.loads(line.removeprefix("result "))


@pytest.mark.parametrize("module", ["libcosimpy", "ecospy"])
@pytest.mark.parametrize("name", ["pumped", "double", "chain"])
def test_other_masters_take_it_as_it_is(module: str, name: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    system: System = request.getfixturevalue(name)
    found = _in(module, system, tmp_path)
    with _jacobi(system, tmp_path) as read:
        expected = [read(*place) for place in _states(system)]
    # the very same calls; only the times are sums of steps there, and products here
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("module", ["libcosimpy", "ecospy"])
def test_where_nothing_goes_back_they_give_our_jacobi_numbers(module: str, pumped: System, tmp_path: Path) -> None:
    found = _in(module, pumped, tmp_path)
    result = pumped.simulate(H * STEPS, H, coupling="jacobi")
    expected = [result[f"{component}.{variable}"][-1] for component, variable in _states(pumped)]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


def test_fmpy_takes_it_as_it_is(component: Callable[[str], Path], tmp_path: Path) -> None:
    """It passes over parameter sets, and begins with 0 on every connected input."""
    system = System("defaults")
    upper, lower = system.add("upper", component("Pendulum")), system.add("lower", component("Pendulum"))
    system.connect(upper["bob"], lower["pivot"])
    system.write_ssp(tmp_path / "system.ssp")
    result = simulate_ssp(str(tmp_path / "system.ssp"), stop_time=(STEPS - 0.5) * H, step_size=H)
    assert len(result) == STEPS
    with _jacobi(system, tmp_path, first=0.0) as read:
        expected = [read(*place) for place in _states(system)]
    found = [result[".".join(place)][-1] for place in _states(system)]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)  # the same calls but for times, as above
