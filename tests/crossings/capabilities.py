"""What each capability does with a subject, compared with how the subject moves.

Bounds: FMUs integrate at 1e-10, which motions of two seconds amplify less than a hundredfold; what goes from one FMU to
another is interpolated at steps of 50 ms, of sixth order; importers integrate Model Exchange at the same tolerance, and
the errors of their steps add up.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import Any

import casadi as ca
import fmpy
import numpy as np
import pytest
from _browser import BROWSER, browser, opened, preset
from driver import CO_SIMULATION, OK, Instance, Library
from fmpy.fmi1 import FMICallException
from making import exchange_only, lying
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from subjects import LEAN, SAMPLE, STEP, STOP, SUBJECTS, Buffered, Hoist, Rods, Row, Signals, Subject, T, shaken_mass
from wasm_driver import WasmLibrary

from liaisons import (
    System,
    Verdict,
    build,
    check_fmu,
    ensemble,
    equations,
    gradient,
    identify,
    linearize,
    modelica,
    sensitivities,
    show,
    simulate,
    sweep,
)
from liaisons.cosim import Result
from liaisons.errors import SimulationError
from liaisons.language import Component
from liaisons.library import fmu_file
from liaisons_motion.jax import motion
from liaisons_pages.pictures import picture_frames

PUSHED = ("mass", "Pendulum", "second", "ball")  # parts of systems that are acted on
IMPORTER = 2e-6  # CVODE of FMPy: the errors of its steps add up
WITHIN_A_STEP = 1e-5  # a rate of 0.3 m/s taken up within h = 8 ms: 0.3 h²/12, and what the motion makes of it
RUN: dict[str, Any] = {"stop_time": STOP, "step_size": STEP, "tolerance": 1e-10}


class Workshop:
    """FMUs of subjects, each built once.

    :param folder: for them.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._made: dict[tuple[str, ...], Any] = {}

    def made(self, kind: str) -> Any:
        """Class, file or system that stands for a kind."""
        subject = SUBJECTS[kind]
        if subject.component is not None:
            return subject.component
        assert subject.put_together is not None
        if (kind,) not in self._made:
            folder = self.folder / kind
            folder.mkdir(exist_ok=True)
            self._made[kind,] = subject.put_together(folder)
        return self._made[kind,]

    def fmu(self, kind: str, **form: Any) -> Path:
        """The FMU of a kind in one of the forms of :func:`liaisons.build`."""
        key = ("FMU", kind, *map(str, form.items()))
        if key not in self._made:
            made = self.made(kind)
            if kind == "flattened" and form:
                self._made[key] = shaken_mass(self.folder).flatten(self.folder / kind, **form)
                return self._made[key]
            self._made[key] = made if isinstance(made, Path) and not form else build(made, self.folder / kind, **form)
        return self._made[key]

    def system(self, kind: str, **options: Any) -> tuple[System, str]:
        """A system of the subject and its operators, and what stands before the names of its signals."""
        made, subject = self.made(kind), SUBJECTS[kind]
        system = System(kind)
        if isinstance(made, System):
            for name, part in made.with_start_values(subject.start_values).parts.items():
                system.add(name, part.fmu.path, start_values=part.starts, **options)
            system.join(made.connections)
            return system, ""
        system.add("it", self.fmu(kind), start_values={**subject.start_values, **subject.operators}, **options)
        return system, "it."


def follows(signals: Mapping[str, Any] | Result, exact: Signals, bound: float, before: str = "") -> None:
    """Each signal is what it should be, relative to its size, or to 1."""
    for name, values in exact.items():
        error = np.max(np.abs(np.asarray(signals[before + name]) - values))
        assert error <= bound * max(1.0, float(np.max(np.abs(values)))), f"{before + name} is off by {error:.2g}"


def starts_by_name(path: Path, values: Mapping[str, Any]) -> dict[str, Any]:
    """Start values as FMPy takes them: of arrays all elements, or one by one, as the FMU has them."""
    variables = {v.name: v for v in fmpy.read_model_description(str(path)).modelVariables}
    found: dict[str, Any] = {}
    for name, value in values.items():
        array, _, index = name.partition("[")
        if name in variables:
            found[name] = value
        elif index:
            whole = found.setdefault(array, np.array((variables[array].start or "0").split(), dtype=float))
            whole[int(index[:-1]) - 1] = value
        else:
            found |= {f"{name}[{i}]": element for i, element in enumerate(value, start=1)}
    return found


def by_fmpy(workshop: Workshop, kind: str, form: Mapping[str, Any], bound: float, **options: Any) -> None:
    """FMPy steps or integrates the FMU."""
    subject, path = SUBJECTS[kind], workshop.fmu(kind, **form)
    settings: dict[str, Any] = {"stop_time": STOP, "output_interval": STEP, "relative_tolerance": 1e-10} | options
    if subject.ramps:
        begins = {ramp.begin for ramp in subject.ramps.values() if ramp.begin}
        times = np.sort(np.r_[0.0, STOP, [*begins], [*begins]])
        columns: dict[str, Any] = {"time": times}
        for name, ramp in subject.ramps.items():
            rates = np.where(times >= ramp.begin, ramp.rate, 0.0)
            rates[np.searchsorted(times, ramp.begin)] *= ramp.begin == 0  # the first of a repeated instant is before it
            columns |= {name: [ramp(t)[0] for t in times], f"{name}_dot": rates, f"{name}_ddot": 0 * times}
        settings["input"] = np.array([*zip(*columns.values(), strict=True)], [(name, float) for name in columns])
    starts = starts_by_name(path, subject.start_values)
    names = [v.name for v in fmpy.read_model_description(str(path)).modelVariables]
    wanted = [name if name in names else name.partition("[")[0] for name in subject.signals()]
    said: list[str] = []
    settings["logger"] = lambda *call: said.append(call[-1].decode())
    try:
        run = fmpy.simulate_fmu(str(path), start_values=starts, output=wanted, **settings)
    except FMICallException as refusal:
        raise SimulationError(said[-1]) from refusal
    rows = {round(t, 9): i for i, t in enumerate(run["time"])}  # the last of several at one instant
    found = {}
    for name, column in zip(subject.signals(), wanted, strict=True):
        values = run[column][[rows[round(t, 9)] for t in T]]
        found[name] = values[:, int(name.partition("[")[2][:-1]) - 1] if values.ndim == 2 else values
    follows(found, subject.signals(), bound)


def by_liaisons(kind: str, path: Path, bound: float) -> None:
    """Our own importer runs the FMU, its operators beside it."""
    subject = SUBJECTS[kind]
    follows(simulate(path, **RUN, start_values={**subject.start_values, **subject.operators}), subject.signals(), bound)


def try_fmi_2_co_simulation(workshop: Workshop, kind: str) -> None:
    if SUBJECTS[kind].component is None:  # FMPy wants functions that this FMU does not have
        by_liaisons(kind, workshop.fmu(kind), SUBJECTS[kind].bound)
    else:
        by_fmpy(workshop, kind, {}, SUBJECTS[kind].bound, fmi_type="CoSimulation")


def try_fmi_3_co_simulation(workshop: Workshop, kind: str) -> None:
    by_fmpy(workshop, kind, {"fmi": "3"}, SUBJECTS[kind].bound, fmi_type="CoSimulation")


def exchange(workshop: Workshop, kind: str, form: Mapping[str, Any]) -> None:
    """By FMPy; where inputs move, which FMPy holds within its steps, by DOP853."""
    if SUBJECTS[kind].component is None or SUBJECTS[kind].ramps:
        path = workshop.fmu(kind, **form)
        folder = path.parent / "exchange"
        folder.mkdir(exist_ok=True)
        by_liaisons(kind, exchange_only(path, folder), SUBJECTS[kind].bound)
    else:
        by_fmpy(workshop, kind, form, IMPORTER, fmi_type="ModelExchange")


def try_fmi_2_model_exchange(workshop: Workshop, kind: str) -> None:
    exchange(workshop, kind, {})


def try_fmi_3_model_exchange(workshop: Workshop, kind: str) -> None:
    exchange(workshop, kind, {"fmi": "3"})


def try_event_mode(workshop: Workshop, kind: str) -> None:
    options = {"use_event_mode": True, "early_return_allowed": True}
    by_fmpy(workshop, kind, {"fmi": "3"}, SUBJECTS[kind].bound, fmi_type="CoSimulation", **options)


def try_without_arrays(workshop: Workshop, kind: str) -> None:
    by_fmpy(workshop, kind, {"fmi": "3", "arrays": False}, SUBJECTS[kind].bound, fmi_type="CoSimulation")


def try_python_back_end(workshop: Workshop, kind: str) -> None:
    if np.isfinite(SUBJECTS[kind].dead_point):  # of a discarded step FMPy makes an end, and shows no message of it
        by_liaisons(kind, workshop.fmu(kind, backend="python"), SUBJECTS[kind].bound)
    else:
        by_fmpy(workshop, kind, {"backend": "python"}, SUBJECTS[kind].bound, fmi_type="CoSimulation")


# ---- systems -----------------------------------------------------------------------------------------------------


def try_ssp(workshop: Workshop, kind: str) -> None:
    system, before = workshop.system(kind)
    path = workshop.folder / f"{kind}.ssp"
    system.write_ssp(path)
    follows(System.from_ssp(path).simulate(**RUN), SUBJECTS[kind].signals(), SUBJECTS[kind].bound, before)


def try_flatten(workshop: Workshop, kind: str) -> None:
    system, before = workshop.system(kind)
    own = {c.__name__: c for c in (Row, Hoist, Buffered, Rods) if SUBJECTS[kind].component is c} or None
    path = system.flatten(workshop.folder / "flat" / kind, components=own)
    follows(simulate(path, **RUN), SUBJECTS[kind].signals(), SUBJECTS[kind].bound, before)


def try_isolated(workshop: Workshop, kind: str) -> None:
    system, before = workshop.system(kind, isolated=True)
    follows(system.simulate(**RUN), SUBJECTS[kind].signals(), SUBJECTS[kind].bound, before)


def try_adapted_steps(workshop: Workshop, kind: str) -> None:
    system, before = workshop.system(kind)
    result = system.simulate(**RUN, error_tolerance=1e-9)
    ends = (
        np.isclose(result.time / SAMPLE, np.round(result.time / SAMPLE), rtol=1e-9) if kind == "held" else slice(None)
    )
    exact = SUBJECTS[kind].signals(result.time[ends])
    follows({before + name: result[before + name][ends] for name in exact}, exact, SUBJECTS[kind].bound, before)


def try_start(workshop: Workshop, kind: str) -> None:
    """Step by step as at once, again from a saved state, and anew from another start value."""
    (system, before), subject = workshop.system(kind), SUBJECTS[kind]
    whole, (by, value) = system.simulate(**RUN), subject.by
    with system.start(**RUN) as run:
        state = run.save()
        for k in range(1, len(T)):
            run.step()
            state = run.save() if k == len(T) // 2 else state
        stepped = run.result
        assert {name: [*stepped[name]] for name in whole.names} == {name: [*whole[name]] for name in whole.names}
        run.restore(state)
        while run.time < STOP - STEP / 2:
            run.step()
        again = run.result
        assert {name: [*again[name]] for name in whole.names} == {name: [*whole[name]] for name in whole.names}
        run.reset({before + by: 1.01 * value})
        while run.time < STOP - STEP / 2:
            run.step()
        follows(run.result, subject.signals(T, **{by: 1.01 * value}), subject.bound, before)


def try_verify(workshop: Workshop, kind: str) -> None:
    """Errors of a coarse run are what half the steps change, or twice that: those of first order are halved.

    Errors that are far below the tolerance are those of FMUs, whose own steps may be the same.
    """
    (system, before), subject = workshop.system(kind), SUBJECTS[kind]
    result = system.simulate(stop_time=STOP, step_size=2 * STEP, tolerance=1e-5, verify=True)
    for name, exact in subject.signals(T[::2]).items():
        error, change = np.max(np.abs(result[before + name] - exact)), np.max(result.error(before + name))
        assert error <= 2.2 * change + 1e-10 * max(1.0, np.max(np.abs(exact))), f"{name} is off by {error:.2g}"


def try_watchdog(workshop: Workshop, kind: str) -> None:
    """Silent where all is right, though it is not recorded; told by the name of each FMU that has an account."""
    system, before = workshop.system(kind)
    other, has_account = System(kind), list[str]()
    (folder := workshop.folder / f"{kind} watched").mkdir()
    for name, part in system.parts.items():
        path = part.fmu.path
        for balance in (variable for variable in part.fmu.variables if variable.endswith("energy_balance")):
            path = lying(path, folder / path.name, balance, balance.replace("energy_balance", "kinetic_energy"))
            has_account.append(name)
        other.add(name, path, start_values=part.starts)
    other.join(system.connections)
    settings: dict[str, Any] = RUN | {"record": [before + next(iter(SUBJECTS[kind].signals()))]}
    right, wrong = (
        [warning for warning in one.simulate(**settings).warnings if "energy account does not close" in warning]
        for one in (system, other)
    )
    assert right == []
    assert [warning.partition(":")[0] for warning in wrong] == has_account


def subject_and_values(workshop: Workshop, kind: str) -> tuple[Any, dict[str, Any]]:
    """What a function of one subject takes: a class, a file or a system, and its start values."""
    subject, made = SUBJECTS[kind], workshop.made(kind)
    starts = {name: value for name, value in subject.starts.items() if np.ndim(value) == 0}
    arrays = {name: value for name, value in subject.starts.items() if np.ndim(value)}
    return made, starts | {f"{name}[{i}]": x for name, value in arrays.items() for i, x in enumerate(value, start=1)}


def refuse_failed(failures: Mapping[int, str]) -> None:
    """Raise what the first of the cases or members has failed by."""
    for reason in failures.values():
        raise SimulationError(reason)


def try_sweep(workshop: Workshop, kind: str) -> None:
    system, before = workshop.system(kind)
    (by, value), subject = SUBJECTS[kind].by, SUBJECTS[kind]
    cases = value * np.array([1.0, 1.01])
    name = next(iter(subject.signals()))
    swept = sweep(system, {before + by: cases}, before + name, workers=1, **RUN)
    refuse_failed(swept.failures)
    exact = [subject.signals(**{by: case})[name][-1] for case in cases]
    follows({name: swept[before + name]}, {name: np.array(exact)}, SUBJECTS[kind].bound)


def try_ensemble(workshop: Workshop, kind: str) -> None:
    subject, (made, starts) = SUBJECTS[kind], subject_and_values(workshop, kind)
    by, value = subject.by
    cases = value * np.array([1.0, 1.01])
    start_values = starts | {by: cases}
    operators = at_operators(subject)
    start_values |= {name: operators.pop(name) for name in [*operators] if name != "operators"}
    record = [*subject.signals()]
    found = ensemble(made, start_values, **operators, stop_time=STOP, step_size=0.01, samples=40, record=record)
    refuse_failed(found.failures)
    for k, case in enumerate(cases):
        follows(
            {name: found[name][:, k] for name in record},
            subject.signals(found.time, **{by: case}),
            SUBJECTS[kind].bound,
        )


def _task(workshop: Workshop, kind: str) -> tuple[dict[str, Any], Callable[[float], list[float]]]:
    """Settings of an environment, and its act as a function of time: that of the closed form."""
    subject, (made, starts) = SUBJECTS[kind], subject_and_values(workshop, kind)
    acts: dict[str, Callable[[float], float]] = {}
    for name, ramp in subject.ramps.items():
        acts[f"{name}_dot"] = lambda t, ramp=ramp: ramp(t)[1]
        starts |= {name: ramp.offset, f"{name}_dot": ramp(0.0)[1]}
    if not acts:
        systems = made.parts if isinstance(made, System) else {}
        path = next((part.fmu.path for name, part in systems.items() if name in PUSHED), None)
        before = next((f"{name}." for name in systems if name in PUSHED), "")
        path = path or workshop.fmu(kind)
        inputs = {v.name: v for v in fmpy.read_model_description(str(path)).modelVariables if v.causality == "input"}
        name = next(n for end in ("_force", "_dot", "") for n in inputs if n.partition("[")[0].endswith(end))
        value = subject.start_values.get(name, float(inputs[name].start or 0.0))
        acts[before + name] = lambda _, value=value: value
    settings = {
        "subject": made,
        "observe": [*subject.signals()],
        "act": dict.fromkeys(acts, (-1.0, 1.0)),
        "reward": "0",
        "step_size": STEP,
        "start_values": starts,
    }
    return settings, lambda t: [act(t) for act in acts.values()]


def try_environment(workshop: Workshop, kind: str) -> None:
    from liaisons_motion.gymnasium import Environment

    subject, (settings, act) = SUBJECTS[kind], _task(workshop, kind)
    by, value = subject.by
    if not isinstance(settings["subject"], System):
        settings["subject"] = workshop.fmu(kind)  # built once
    environment = Environment(**settings)
    rows = [environment.reset(options={by: value})[0]]
    for t in T[:-1]:
        observation, *_, information = environment.step(act(t))
        if "failure" in information:
            raise SimulationError(information["failure"])
        rows.append(observation)
    environment.close()
    follows(
        dict(zip(settings["observe"], np.transpose(rows)[:, 1:], strict=True)), subject.signals(T[1:]), subject.bound
    )


def try_vector_environment(workshop: Workshop, kind: str) -> None:
    from liaisons_motion.gymnasium import VectorEnvironment

    subject, (settings, act) = SUBJECTS[kind], _task(workshop, kind)
    by, value = subject.by
    names, times = [*settings["observe"], by], SAMPLE * np.arange(1, 201)
    settings |= {"observe": names, "randomize": {by: (value, 1.01 * value)}, "step_size": SAMPLE}
    copies = VectorEnvironment(num_envs=2, **settings)
    rows = [copies.reset(seed=0)[0]]
    for t in times:
        observation, _, ended, _, information = copies.step([act(t - SAMPLE)] * 2)
        if information["failure"].any():
            assert t - SAMPLE < subject.dead_point <= t, f"it fails at t = {t:g}"
            assert np.all(ended)
            break
        rows.append(observation)
    times, (*signals, draws) = times[: len(rows) - 1], np.transpose(rows)
    for k in range(2):
        found = {name: values[k, 1:] for name, values in zip(names[:-1], signals, strict=True)}
        follows(found, subject.signals(times, **{by: draws[k, 0]}), subject.bound)


# ---- derivatives -------------------------------------------------------------------------------------------------


def slopes(subject: Subject, name: str) -> NDArray:
    """Derivative of a signal by :attr:`Subject.by`, by differences of fourth order of the closed form."""
    by, value = subject.by
    h = 1e-3 * value
    shifted = [subject.signals(T, **{by: value + k * h})[name] for k in (-2, -1, 1, 2)]
    return (shifted[0] - 8 * shifted[1] + 8 * shifted[2] - shifted[3]) / (12 * h)


def differences(subject: Subject) -> float:
    """Bound of errors of derivatives: of fourth order here, of steps of 1e-3; and what ten runs may be off."""
    return max(1e-7, 10 * subject.bound)


def at_operators(subject: Subject) -> dict[str, Any]:
    """Operators as what differentiates takes them: their parameters are values of the motion."""
    values = {}
    for name, ramp in subject.ramps.items():
        values |= {f"{name}.offset": ramp.offset, f"{name}.rate": ramp.rate, f"{name}.start_time": ramp.begin}
    return {"operators": dict.fromkeys(subject.ramps, "Ramp")} | values


def try_sensitivities(workshop: Workshop, kind: str) -> None:
    """Derivatives by one value, where they are numbers: beside an event they are none."""
    subject, (made, starts) = SUBJECTS[kind], subject_and_values(workshop, kind)
    name, (by, value) = next(iter(subject.signals())), subject.by
    found = sensitivities(made, by, times=T, record=name, start_values=starts | {by: value}, **at_operators(subject))
    derivatives = found.derivative(name, by)
    numbers = np.isfinite(derivatives)
    assert np.mean(numbers) > 0.9
    assert derivatives[numbers] == pytest.approx(slopes(subject, name)[numbers], abs=differences(subject))


def try_gradient(workshop: Workshop, kind: str) -> None:
    """Of the sum of squares of a signal, at times that are not beside an event."""
    subject, (made, starts) = SUBJECTS[kind], subject_and_values(workshop, kind)
    name, (by, value) = next(iter(subject.signals())), subject.by
    options = {"times": T[::2], "record": name, "start_values": starts | {by: value}, **at_operators(subject)}
    found = gradient(made, lambda signals: ca.sumsqr(signals[name]), by, **options)
    assert found[by] == pytest.approx(
        2 * slopes(subject, name)[::2] @ subject.signals()[name][::2], abs=len(T) * differences(subject)
    )


def try_jax(workshop: Workshop, kind: str) -> None:
    import jax
    from jax.errors import JaxRuntimeError

    jax.config.update("jax_enable_x64", True)
    subject, (made, starts) = SUBJECTS[kind], subject_and_values(workshop, kind)
    name, (by, value) = next(iter(subject.signals())), subject.by
    run = motion(made, T, record=name, **starts, **at_operators(subject))
    try:
        found = jax.grad(lambda x: run({by: x})[name][-1])(value)
    except JaxRuntimeError as refusal:  # of a function that it has called back
        raise SimulationError(str(refusal).splitlines()[-1]) from refusal
    assert float(found) == pytest.approx(slopes(subject, name)[-1], abs=differences(subject))


# Of the pendulum hanging down: -m g l M_11/det M, with the moments about its axes.
ARM, ACROSS, BOTH = 2e-3 + 0.3 * 0.1**2 + 0.075 * 0.25**2 + 1e-6, 1e-4 + 0.075 * 0.15**2, 0.075 * 0.25 * 0.15
FURUTA = -0.075 * 9.81 * 0.15 * ARM / (ARM * ACROSS - BOTH**2)

LINEAR: dict[str, tuple[str, str, float, dict[str, float]]] = {
    # derivative of an output (or rate of a state) by a state or input, by hand, at a point
    "plain": ("theta_ddot", "theta", -9.81 * np.cos(0.7), {"theta_0": 0.7}),
    "jumps": ("x_ddot", "x", -1.0, {}),
    "constraints": ("rod_force", "rod_ddot", 1.0, {}),
    "dead_point": ("pull_force", "pull_ddot", 0.0, {"pull": 2.1}),
    "non_holonomic": ("x_ddot", "x", -2 / 3, {}),
    "orientation": ("omega_x", "H_x", 0.1, {}),
    "linkage": ("swing_ddot", "swing", FURUTA, {"swing_0": 0.0, "turn_dot_0": 0.0}),
    "arrays": ("x_ddot[2]", "x[2]", -2.0, {}),
    "chain": ("u_ddot[2]", "u[2]", -2.0, {}),
    "chain_contacts": ("u_ddot[2]", "u[2]", -2.0, {}),
    "friction": ("x_ddot", "p_x", -0.4, {"damping": 0.4}),
    "unilateral": ("gap_force", "table_ddot", 1.0, {"height_0": 0.0}),
    "dry_friction": ("x_ddot", "x", -10.0, {}),
    "internal_states": ("q_ddot", "xi", -0.5, {"q_dot_0": 0.5}),
    "prescribed_only": ("angle_force", "angle_ddot", 2.0, {}),
    "operator": ("y", "crouch_3", 0.1, {}),
    "regulator": ("y", "value", 1.0, {}),
    "foreign_model_exchange": ("f1", "x0", -1.0, {}),
    "flattened": ("mass.x_ddot", "mass.x", -1.0, {}),
}


def try_linearize(workshop: Workshop, kind: str) -> None:
    output, by, expected, at = LINEAR.get(kind, ("", "", 0.0, {}))
    linear = linearize(workshop.made(kind), at, outputs=output or None)
    matrix, names = (linear.C, linear.states) if by in linear.states else (linear.D, linear.inputs)
    assert matrix[0, names.index(by)] == pytest.approx(expected, abs=1e-9)


def try_identify(workshop: Workshop, kind: str) -> None:
    """The value is what the closed form was calculated with."""
    subject, (made, starts) = SUBJECTS[kind], subject_and_values(workshop, kind)
    name, (by, value) = next(iter(subject.signals())), subject.by
    data, start_values = {"time": T, name: subject.signals()[name]}, starts | {by: 0.97 * value}
    fit = identify(made, data, unknown=[by], noise=1e-6, start_values=start_values, **at_operators(subject))
    assert fit.values[by] == pytest.approx(value, rel=1e-6)


IMPULSE, INSTANT = 1e-3, 1e-7  # [N.s], and a step in which forces change momenta by a thousandth of it at most

JUMPS: dict[str, tuple[str, str, float]] = {
    # port, what jumps, and its jump by a unit of the impulse that the port hands on, by Newton's law
    "plain": ("theta", "p_theta", -1.0),
    "jumps": ("x", "x_dot", -1.0),
    "constraints": ("x", "x_dot", -(1 - LEAN**2)),  # along the circle
    "dead_point": ("u", "u_dot", -1 / 3),
    "non_holonomic": ("x", "x_dot", -2 / 3),  # across the velocity (1, 1, 1), whose size is kept
    "linkage": ("swing", "p_swing", -1.0),
    "arrays": ("x[2]", "x_dot[2]", -0.5),
    "chain": ("u[2]", "u_dot[2]", -1.0),
    "chain_contacts": ("u[2]", "u_dot[2]", -1.0),
    "friction": ("x", "x_dot", -1.0),
    "unilateral": ("height", "height_dot", -1.0),
    "dry_friction": ("x", "x_dot", -1.0),
    "internal_states": ("q", "q_dot", -1.0),
    "system": ("mass.x", "mass.x_dot", -1.0),
    "two_way": ("second.x", "second.x_dot", -1.0),
    "collision": ("ball.height", "ball.height_dot", -10.0),
    "held": ("Pendulum.theta", "Pendulum.p_theta", -1.0),
    "flattened": ("mass.x", "mass.x_dot", -1.0),
}


def try_impulses(workshop: Workshop, kind: str) -> None:
    """An impulse that another FMU hands on through a port, in a short step."""
    port, jumping, expected = JUMPS.get(kind, ("y", "y", 0.0))
    system, before = workshop.system(kind)
    base, bracket, index = port.partition("[")
    impulse = f"{before}{base}_impulse{bracket}{index}"
    with system.start(stop_time=2 * INSTANT, step_size=INSTANT, tolerance=1e-10) as run:
        run.step()
        value = run[before + jumping]
        run.step({impulse: IMPULSE})
        jump = run[before + jumping] - value
    assert jump == pytest.approx(expected * IMPULSE, abs=2e-6)


# ---- text and pictures -------------------------------------------------------------------------------------------


def try_check(workshop: Workshop, kind: str) -> None:
    verdicts = [report for report in check_fmu(fmu_file(workshop.made(kind))) if isinstance(report, Verdict)]
    assert verdicts
    assert [verdict.claim for verdict in verdicts if not verdict.passed] == []


EQUATIONS = {  # a line of each, by hand
    "plain": "p_θ = m l (l θ̇ + ẋₚ cos θ + żₚ sin θ)",
    "jumps": "λ_support = −K (x − support)",
    "constraints": "rod = √(x² + y² + (z − h)²)",
    "dead_point": "0 = z² + (x − pull)² − rod²",
    "non_holonomic": "0 = ½ m (ẋ² + ẏ² + ż²) − (3/2) · E_thermal",
    "orientation": "J_w φ̇₁ ωₓ",
    "linkage": "ṗ_turn = Q_turn − F_turn",
    "arrays": "ẋ₂ = p_x,2/m₂",
    "chain": "V = ½ κ (u − jointₓ)²",
    "chain_contacts": "gap = room − u",
    "friction": "D = ½ m γ ẋ²",
    "unilateral": "gap = height − table",
    "dry_friction": "slip = ẋ − belt˙",
    "internal_states": "ξ̇ = (m q̇² − E_thermal)/Q",
    "prescribed_only": "Θ_angle,angle = m reach²",
    "operator": "crouch˙₃ = rate · (crouch₂ − crouch₃)",
    "regulator": "value˙ = rate",
    "sampled": "filtered",
    "system": "ẋ_mass = p_x,mass/m_mass",
    "two_way": "ẋ_second = p_x,second/m_second",
    "collision": "ẋ_table = p_x,table/m_table",
    "held": "ẋ",
}


def try_equations(workshop: Workshop, kind: str) -> None:
    text = equations(workshop.made(kind)).text(400)
    assert EQUATIONS[kind] in text, text


def try_modelica(workshop: Workshop, kind: str) -> None:
    """Compiled and simulated by rumoca."""
    rumoca = pytest.importorskip("rumoca")
    subject, made = SUBJECTS[kind], workshop.made(kind)
    if isinstance(made, System):
        name = made.name.title().replace(" ", "")
        text, model = modelica(made.with_start_values(subject.start_values)), f"{name}System.{name}"
    else:
        text, model = modelica(made), "Test"
        text += in_test_model(made, subject)
    settings = rumoca.SimConfig(solver="rk-like", rtol=1e-11, atol=1e-11)
    loaded = rumoca.Session().loads(text, model=model, filename="text.mo")
    try:
        run = loaded.simulate((0.0, STOP), dt=STEP, config=settings)
    except rumoca.SimulationError as stop:
        raise SimulationError(f"the solver of the Modelica tool stops: {' '.join(str(stop).split())}") from stop
    rows = np.searchsorted(run.time, T + 1e-9) - 1
    assert np.asarray(run.time)[rows] == pytest.approx(T, abs=1e-9)
    names = {
        name: next((n for n in (name, f"m.{name}", f"m.{_TRIPLE.get(name)}") if n in run.names), "")
        for name in subject.signals()
    }
    exact = {name: x for name, x in subject.signals().items() if names[name]}
    assert exact
    follows({name: np.asarray(run[names[name]])[rows] for name in exact}, exact, SUBJECTS[kind].bound)


_TRIPLE = {"y": "y[1]", "y_dot": "y[2]", "y_ddot": "y[3]"}


def in_test_model(component: type[Component], subject: Subject) -> str:
    """A model with the component in it, its values set and its coordinates moved."""
    modified: dict[str, Any] = {
        f"u_{item.name}": f"{{{item.start}, 0, 0}}" for item in getattr(component, "actives", ())
    }
    for name, x in subject.start_values.items():
        array = name.partition("[")[0]
        modified[array] = f"cat(1, {{{x}}}, zeros(9))" if array != name else f"{{{x[0]}, {x[1]}}}" if np.ndim(x) else x
    for name, (offset, rate, begin) in subject.ramps.items():
        moved = f"{{{offset} + {rate}*(time - {begin}), {rate}, 0}}"
        modified[f"u_{name}"] = f"if time >= {begin} then {moved} else {{{offset}, 0, 0}}" if begin else moved
    values = ", ".join(f"{name}={x}" for name, x in modified.items())
    return f"model Test\n  {component.__name__}.Signals m({values});\nend Test;\n"


PATHS: dict[str, Callable[[Signals], Any]] = {  # of a point, or of an axis, in each picture
    "plain": lambda s: (np.sin(s["theta"]), 0, -np.cos(s["theta"])),
    "jumps": lambda s: (s["x"], 0, 0),
    "constraints": lambda s: (s["x"], 0, s["z"]),
    "non_holonomic": lambda s: (s["x"], s["y"], s["z"]),
    "orientation": lambda s: Rotation.from_quat(np.transpose([s[f"q_{i}"] for i in "xyzw"])).as_matrix()[:, :, 2].T,
    "linkage": lambda s: (
        0.25 * np.cos(s["turn"]) - 0.15 * np.sin(s["swing"]) * np.sin(s["turn"]),
        0.25 * np.sin(s["turn"]) + 0.15 * np.sin(s["swing"]) * np.cos(s["turn"]),
        -0.15 * np.cos(s["swing"]),
    ),
    "arrays": lambda s: (s["x[1]"], 0, 0),
    "chain": lambda s: (s["u[5]"] + 4.5, 0, 0),
    "chain_contacts": lambda s: (s["u[3]"] + 2.5, 0, 0),
    "friction": lambda s: (s["x"], 0, 0),
    "unilateral": lambda s: (0, 0, s["height"] + 0.05),
    "dry_friction": lambda s: (s["x"], 0, 0.2),
    "internal_states": lambda s: (s["q"], 0, 0),
    "prescribed_only": lambda _: (1 + 0.3 * T) * (np.cos(0.2 + 0.4 * T), 0 * T, np.sin(0.2 + 0.4 * T)),
    "system": lambda s: (s["mass.x"], 0, 0),
    "two_way": lambda s: (s["second.x"], 0, 0),
    "collision": lambda s: (0, 0, s["ball.height"] + 0.05),
    "held": lambda s: (s["Pendulum.pivot_x"] + np.sin(s["Pendulum.theta"]), 0, -np.cos(s["Pendulum.theta"])),
    "flattened": lambda s: (s["mass.x"], 0, 0),
}


def try_picture(workshop: Workshop, kind: str) -> None:
    system, _ = workshop.system(kind)
    result = system.simulate(**RUN)
    path = workshop.folder / f"{kind}.html"
    result.animate(path)
    assert b"canvas" in path.read_bytes()
    assert result.scene is not None
    drawn = picture_frames(
        result.scene.picture,
        T,
        result.scene.values(dict(zip(result.names, result.values, strict=True))).__getitem__,
        title=kind,
    )
    expected = np.stack(np.broadcast_arrays(*PATHS[kind](SUBJECTS[kind].signals())), axis=-1)
    moving = [points for shape in drawn.shapes for points in np.moveaxis(shape.points, 1, 0)]
    moving += [axis for shape in drawn.shapes if shape.axes is not None for axis in np.moveaxis(shape.axes, 1, 0)]
    assert min(np.max(np.abs(points - expected)) for points in moving) <= SUBJECTS[kind].bound


def try_live_page(workshop: Workshop, kind: str) -> None:
    """In a browser, where the page's own operators move the coordinates, from rest within a step of 8 ms."""
    if BROWSER is None or find_spec("ziglang") is None:
        pytest.skip("chromium (or google-chrome) or ziglang is missing")
    made, subject = workshop.made(kind), SUBJECTS[kind]
    path = workshop.folder / f"{kind} live.html"
    starts, bound = subject.start_values, subject.bound
    if subject.ramps:
        starts = {name: x for name, x in starts.items() if not name.endswith("_dot_0")}
        starts, bound = starts | {name: ramp.offset for name, ramp in subject.ramps.items()}, WITHIN_A_STEP
    if isinstance(made, System):
        show(made.with_start_values(starts), path=path)
    else:
        show(made, path=path, start_values=starts)
    with browser() as found, opened(found, path) as live:
        reached: dict[str, float] = {}
        begins = sorted({0.0, STOP, *(ramp.begin for ramp in subject.ramps.values())})
        for begin, end in pairwise(begins):
            for name, ramp in subject.ramps.items():
                if ramp.begin == begin:
                    preset(live, name, "Ramp", rate=ramp.rate)
            reached = live.run_for(end - begin)
            if "cannot be kept" in (said := live.text("#said")):
                raise SimulationError(said)
        assert live.complaints == []
        exact = subject.signals(np.array([0.0, live.time]))
    shown = {name: x for name, x in exact.items() if name in reached}
    assert shown
    follows({name: reached[name] for name in shown}, {name: x[-1] for name, x in shown.items()}, bound)


# ---- stepped call by call ----------------------------------------------------------------------------------------


def begun(library: Library, kind: str, **options: bool) -> Instance:
    """An instance of FMI 3.0 at the start of its motion."""
    subject = SUBJECTS[kind]
    instance = library.initializing(CO_SIMULATION, tolerance=1e-10, options=options)
    instance.set(starts_by_name(library.path, subject.start_values))
    move(instance, subject, 0.0)
    instance.exit_initialization()
    return instance


def move(instance: Instance, subject: Subject, t: float) -> None:
    for name, ramp in subject.ramps.items():
        triple = ramp(t + 1e-9)  # at a jump the rate after it
        instance.set({f"{name}{dots}": value for dots, value in zip(("", "_dot", "_ddot"), triple, strict=True)})


def read(instance: Instance, kind: str) -> dict[str, float]:
    found = {}
    for name in SUBJECTS[kind].signals():
        array, _, index = name.partition("[")
        is_whole = name in instance.library.references
        found[name] = float(instance.get(name if is_whole else array)[0 if is_whole else int(index[:-1]) - 1])
    return found


def try_wasm(workshop: Workshop, kind: str) -> None:
    if find_spec("ziglang") is None:
        pytest.skip("ziglang is not installed")
    instance = begun(WasmLibrary(workshop.fmu(kind, platforms="wasm", fmi="3")), kind)
    for k, t in enumerate(T[:-1], start=1):
        move(instance, SUBJECTS[kind], t)
        if (step := instance.advance(t, STEP)).status != OK:
            raise SimulationError(instance.messages[-1])
        assert step.time == pytest.approx(t + STEP)
        follows(
            read(instance, kind), {name: x[k] for name, x in SUBJECTS[kind].signals().items()}, SUBJECTS[kind].bound
        )


def advance_to(instance: Instance, t: float, end: float) -> Iterator[float]:
    """Steps to a communication point, and the instants at which the instance is in event mode on the way."""
    while t < end:
        step = instance.advance(t, end - t)
        if step.status != OK:
            raise SimulationError(instance.messages[-1])
        t = step.time if step.early else end
        if step.event:
            instance.do("EnterEventMode")
            yield t
            instance.go_on()


def try_saved_state(workshop: Workshop, kind: str) -> None:
    """In event mode at the first event, or half way; what goes on in a new instance has the same bits."""
    library, options = Library(workshop.fmu(kind, fmi="3")), {"events": True, "early": True}
    instance, saved = begun(library, kind, **options), (0.0, b"")
    instance.go_on()
    values, exact = [], SUBJECTS[kind].signals()
    for k, (t, end) in enumerate(pairwise(T), start=1):
        move(instance, SUBJECTS[kind], t)
        if t == STOP / 2 and not saved[1]:
            instance.do("EnterEventMode")
            saved = t, instance.serialize()
            instance.go_on()
        for instant in advance_to(instance, t, end):
            saved = saved if saved[1] else (instant, instance.serialize())
        values.append(read(instance, kind))
        follows(values[-1], {name: x[k] for name, x in exact.items()}, SUBJECTS[kind].bound)
    instant, content = saved
    other = library.restored(content, CO_SIMULATION, **options)
    other.go_on()
    again = []
    first = int(np.searchsorted(T, instant + 1e-12))
    for t, end in pairwise([instant, *T[first:]]):
        if t != instant or t in T:
            move(other, SUBJECTS[kind], t)
        for _ in advance_to(other, t, end):
            pass
        again.append(read(other, kind))
    assert again == values[first - 1 :]
