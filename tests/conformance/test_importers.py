"""Every FMU of the catalogue in other importers: libcosim (OSP), ecos, CasADi's DaeBuilder, and CVODE in fmpy.

The masters run in processes of their own, one for each tool and version, and report component by component.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import casadi as ca
import fmpy
import numpy as np
import pytest
from numpy.typing import NDArray
from trial import COMPONENTS, VERSIONS, Trial, Version, every_component, every_version, reals, run

from liaisons import cosim
from liaisons.mechanics import assemble

STEPS = 40

# A task is [name, path, names of outputs, their references, communication step].  The last one is done with each of the
# sources too, [name, path]: their y drives its torque, and what that is at the beginning of a step is held during it.
_LIBCOSIM = """
import json, sys
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

tasks, sources, (y, torque), steps = json.load(open(sys.argv[1]))

def simulate(fmus, outputs, step):
    execution = CosimExecution.from_step_size(round(step * 1e9))
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer)
    slaves = [execution.add_local_slave(CosimLocalSlave(path, f"it{i}")) for i, path in enumerate(fmus)]
    if len(fmus) == 2:
        assert execution.connect_real_variables(slaves[0], y, slaves[1], torque) == 0
    assert execution.step(steps)
    return observer.last_real_values(slaves[-1], outputs)

for name, path, _, references, step in tasks:
    print("result", name, json.dumps(simulate([path], references, step)), flush=True)
for name, source in sources:
    print("result", name, json.dumps(simulate([source, path], references, step)), flush=True)
"""

_ECOS = """
import ctypes, json, sys
from pathlib import Path

# ecos needs TBB; the wheel puts it where no loader looks.
ctypes.CDLL(str(Path(sys.prefix) / "lib" / "libtbb.so.12"), mode=ctypes.RTLD_GLOBAL)
from ecospy import EcosSimulation, EcosSimulationStructure

tasks, sources, _, steps = json.load(open(sys.argv[1]))

def simulate(fmus, outputs, step):
    with EcosSimulationStructure() as structure:
        for i, path in enumerate(fmus):
            structure.add_model(f"it{i}", path)
        if len(fmus) == 2:
            structure.make_real_connection("it0::y", "it1::theta_force")
        with EcosSimulation(structure=structure, step_size=step) as simulation:
            simulation.init()
            simulation.step(steps)
            return [simulation.get_real(f"it{len(fmus) - 1}::{name}") for name in outputs]

for name, path, names, _, step in tasks:
    print("result", name, json.dumps(simulate([path], names, step)), flush=True)
for name, source in sources:
    print("result", name, json.dumps(simulate([source, path], names, step)), flush=True)
"""
_SCRIPTS = {"libcosimpy": _LIBCOSIM, "ecospy": _ECOS}


def references(trial: Trial) -> dict[str, int]:
    """Value references by name."""
    return {variable.name: variable.valueReference for variable in trial.description.modelVariables}


def scalars(trial: Trial) -> list[str]:
    """Outputs that are no arrays, which these masters do not read.

    Without multipliers of a loop whose conditions depend on each other on the loop alone: rounding decides on them.
    """
    names = [variable.name for variable in reals(trial.description, "output") if not variable.shape]
    return [name for name in names if trial.description.modelName != "Bricard" or not name.startswith("lambda_")]


def simulate(trial: Trial, **options: Any) -> NDArray:
    """The outputs of fmpy at the end of the steps; its own options by name."""
    outputs = scalars(trial)
    result = fmpy.simulate_fmu(
        str(trial.folder),
        **{"stop_time": STEPS * trial.step, "output_interval": trial.step, "output": outputs} | options,
    )
    assert result["time"][-1] == pytest.approx(STEPS * trial.step)
    return np.array([result[name][-1] for name in outputs])


def scales(trial: Trial, values: NDArray) -> NDArray:
    """For each output the largest number of its unit, at least 1: a balance is small, not imprecise."""
    unit_of = {variable.name: variable.unit for variable in trial.description.modelVariables}
    units = [unit_of[name] for name in scalars(trial)]
    largest = {unit: max(1.0, *(abs(v) for u, v in zip(units, values, strict=True) if u == unit)) for unit in units}
    return np.array([largest[unit] for unit in units])


@pytest.fixture(scope="module")
def master(fmu, trial, tmp_path_factory) -> Callable[[str, Version], dict[str, NDArray]]:
    """Outputs at the end, by component, of all that a master gets through: ``master("ecospy", "2")``."""

    @cache
    def ran(module: str, version: Version) -> dict[str, NDArray]:
        if find_spec(module) is None:
            pytest.skip(f"{module} is not installed")
        if module == "ecospy" and not (Path(sys.prefix) / "lib" / "libtbb.so.12").exists():
            pytest.skip("TBB is not installed as a wheel")
        tasks = []
        for name in sorted(COMPONENTS, key="Pendulum".__eq__):  # the last one
            outputs, it = scalars(trial(name, version)), trial(name, version)
            places = [references(it)[output] for output in outputs]
            tasks.append([name, str(fmu(name, version)), outputs, places, it.step])
        sources = [[f"driven_by_{v}", str(fmu("Sinusoid", v))] for v in VERSIONS if v <= version]
        ends = references(trial("Sinusoid", "2"))["y"], references(trial("Pendulum", version))["theta_force"]
        file = tmp_path_factory.mktemp("tasks") / "tasks.json"
        file.write_text(json.dumps([tasks, sources, ends, STEPS]))
        lines = run(sys.executable, "-c", _SCRIPTS[module], file).splitlines()
        found = [line.split(" ", 2)[1:] for line in lines if line.startswith("result ")]  # among what they log
        return {name: np.array(json.loads(values)) for name, values in found}

    return ran


@pytest.mark.parametrize(
    ("module", "version"),
    [("libcosimpy", "2"), ("ecospy", "2"), ("ecospy", "3")],  # libcosim reads no FMI 3.0
)
@every_component
@pytest.mark.variants(core=0)
def test_masters_agree_with_fmpy(master, trial, name, module, version) -> None:
    it = trial(name, version)
    expected = simulate(it, fmi_type="CoSimulation")
    found = master(module, version)[name]
    # The same steps; times differ in their last digits, which a solver at 1e-8 does not see.
    np.testing.assert_array_less(np.abs(found - expected) / scales(it, expected), 1e-8)


@pytest.mark.parametrize(
    ("module", "version", "source"),
    [("libcosimpy", "2", "2"), ("ecospy", "2", "2"), ("ecospy", "3", "2"), ("ecospy", "3", "3")],
)
@pytest.mark.variants(core=0)
def test_masters_couple_two_fmus(master, trial, module, version, source) -> None:
    sinusoid, pendulum = trial("Sinusoid", source), trial("Pendulum", version)
    times = pendulum.step * np.arange(STEPS + 1)
    options = {"stop_time": times[-1], "output_interval": pendulum.step, "fmi_type": "CoSimulation"}
    signal = fmpy.simulate_fmu(str(sinusoid.folder), output=["y"], **options)
    force = np.array(list(zip(times, signal["y"], strict=True)), dtype=[("time", float), ("theta_force", float)])
    # Accelerations and forces follow the torque at once, and some masters set the one of the next step already.
    names = scalars(pendulum)
    states = [names.index(name) for name in ("theta", "theta_dot", "p_theta", "dissipated")]
    expected = simulate(pendulum, fmi_type="CoSimulation", input=force)[states]
    assert np.max(np.abs(expected - simulate(pendulum, fmi_type="CoSimulation")[states])) > 1e-3  # the torque is felt
    found = master(module, version)[f"driven_by_{source}"][states]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8)  # as above


@every_version
@every_component
def test_cvode_agrees_with_co_simulation(trial, name, version) -> None:
    it = trial(name, version)
    expected = simulate(it, fmi_type="CoSimulation")
    found = simulate(it, fmi_type="ModelExchange", solver="CVode", relative_tolerance=1e-11)
    # CVODE (BDF) adds up the errors of some 1000 steps; accelerations in a chain of ten links amplify them most.
    np.testing.assert_array_less(np.abs(found - expected) / scales(it, expected), 1e-5)


# ---- CasADi ------------------------------------------------------------------------------------------------------


def symbolic(name: str, path: Path) -> tuple[dict[str, ca.Function], list[NDArray], list[list[str]]]:
    """Our own functions of (t, x, u) in continuous time, rates "ode" and outputs "y"; x, u at the start; all names.

    Contacts are in the modes in which the FMU begins.
    """
    model = assemble(COMPONENTS[name])
    u0, k = (ca.DM([start for v in variables for start in v.starts]) for variables in (model.inputs, model.parameters))
    x0, m0 = model.start.call([ca.DM(0), u0, k])
    modes = [contact.variable("direction" if contact.friction else "closed") for contact in model.contacts]
    if modes:
        begun = cosim.simulate(path, stop_time=1e-9, step_size=1e-9, record=modes)
        for mode in modes:
            m0[model.memory.index(mode)] = begun[mode][0]
    arguments = t, x, u = ca.MX.sym("t"), ca.MX.sym("x", x0.numel()), ca.MX.sym("u", u0.numel())
    kept = model.project(t, x, u, k) if model.redundant and model.project else x
    (rates,) = model.derivatives.call([t, kept, u, k, m0][: model.derivatives.n_in()])
    (memory,) = model.remember.call([t, kept, u, k, m0])
    (calculated,) = model.outputs_function.call([t, kept, u, k, memory])
    if model.redundant:  # all is calculated on the constraints, to which the states return
        rates += RETURN * (kept - x)
        row = [v.name for v in model.outputs].index
        for i, state in enumerate(model.states):
            calculated[row(state.name)], calculated[row(state.derivative)] = x[i], rates[i]
    functions = {"ode": ca.Function("ode", arguments, [rates]), "y": ca.Function("y", arguments, [calculated])}
    shown = {v.name: v for v in model.outputs}
    names = [
        [element.name for v in variables for element in v.elements()]
        for variables in ([shown[state.name] for state in model.states], model.inputs, model.outputs)
    ]
    return functions, [np.array(x0).ravel(), np.array(u0).ravel()], names


RETURN = 20.0  # [1/s], of states of Model Exchange to redundant constraints
ROUNDING = {"CarAxis": 1e-11, "Bricard": 1e-6}


@every_version
@every_component
def test_casadi_imports_values_and_derivatives(trial, name, version, fmu) -> None:
    """Functions that DaeBuilder makes of the FMU, and their Jacobians by its derivatives, are those of our symbols."""
    it = trial(name, version)
    if any(variable.causality == "structuralParameter" for variable in it.description.modelVariables):
        pytest.skip("CasADi 3.8 reads no arrays whose size is a structural parameter")
    outputs = [v for v in it.description.modelVariables if v.causality == "output"]
    dae = ca.DaeBuilder(name, str(it.folder))
    ours, start, names = symbolic(name, fmu(name, "2"))
    x, u, y = ([our.index(v) for v in theirs] for our, theirs in zip(names, (dae.x(), dae.u(), dae.y()), strict=True))
    random = np.random.default_rng(1)
    off = 0.0 if name == "Bricard" else 1e-3  # off its loop the conditions nearly depend on each other
    state, inputs = (v + off * random.standard_normal(v.shape) for v in start)
    for result, chosen in (("ode", x), ("y", y)):
        if not chosen or (result == "y" and any(v.type in {"Boolean", "Int32", "Integer"} for v in outputs)):
            continue  # CasADi 3.8 reads all outputs as reals
        theirs = dae.create("theirs", ["t", "x", "u"], [result])
        found = values(theirs, state[x], inputs[u])
        expected = values(ours[result], state, inputs)
        everything = [0]
        # Derivatives of outputs where conditions are redundant: docs/reference/limits.md has what is off.
        compared = slice(1) if (name, result) == ("Bricard", "y") else slice(None)
        for a, b, columns in [*zip(found, expected, (everything, x, u), strict=True)][compared]:
            # The same expressions, rounded in another order: some units in the last place of the largest number.  In
            # those of the car axis stiff springs cancel, of loops the multipliers.
            tolerance = ROUNDING.get(name, 1e-13) * np.max(np.abs(b), initial=1.0)
            np.testing.assert_allclose(a, b[np.ix_(chosen, columns)], rtol=0, atol=tolerance)


def values(function: ca.Function, x: NDArray, u: NDArray) -> list[NDArray]:
    """What a function of (t, x, u) returns, and its Jacobians with respect to x and u, at some time."""
    arguments = [ca.DM(0.3), ca.DM(x), ca.DM(u)]
    (result,) = function.call(arguments)
    _, *jacobians = function.jacobian().call([*arguments, result])
    return [np.array(ca.densify(matrix)) for matrix in (result, *jacobians)]
