"""The protocol of instances, as each implementation holds it, in this process or in its own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from ctypes import Array, c_double
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from making import FmuPaths, exchange_only
from numpy.testing import assert_allclose

from liaisons import Signal, sampled, simulate
from liaisons.cosim import Call, SystemComponent, extract_fmus, make_instance
from liaisons.cosim.instances import isolation
from liaisons.errors import SimulationError

H = 0.1
FMUS = {"2": "Pendulum", "3": "fmi3/Pendulum", "2 in Python": "python/Pendulum"}
EQUATIONS = {"equations 2": "Pendulum", "equations 3": "fmi3/Pendulum"}
KINDS = [f"{kind}{apart}" for kind in (*FMUS, *EQUATIONS, "function") for apart in ("", ", apart")]


@dataclass(frozen=True)
class Kind:
    """An implementation, and the variables by which it is tried."""

    name: str
    part: SystemComponent
    folder: Path
    isolated: float
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    starts: dict[str, Any]


@dataclass(frozen=True)
class Held:
    """An instance with its prepared calls and their buffers."""

    instance: Any
    given: Array[c_double]
    seen: Array[c_double]
    time: c_double
    set: Call
    get: Call
    step: Call
    save: Call
    restore: Call

    def initialize(self, kind: Kind, **starts: Any) -> None:
        self.instance.initialize(kind.starts | starts, 1e-9, 0.0, 10.0)

    def read(self) -> list[float]:
        """What is seen now."""
        self.get.perform("")
        return list(self.seen)

    def run(self, forces: Sequence[float], begin: int = 0) -> list[list[float]]:
        """What is seen after each step of H with an input."""
        found = []
        for k, force in enumerate(forces, start=begin):
            self.given[0], self.time.value = force, k * H
            self.set.perform("")
            self.step.perform("")
            found.append(self.read())
        return found


def accumulate(state: float, u: float, time: float) -> tuple[tuple[float, float], float]:
    return (state + u, time), state + u


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest, component: FmuPaths, tmp_path: Path) -> Kind:
    name, apart = request.param.removesuffix(", apart"), request.param.endswith("apart")
    if apart and isolation() is None:
        pytest.skip("isolation needs Linux")
    limit = 60.0 * apart
    if name == "function":
        function = sampled(accumulate, period=H, reads=["u", "time"], writes=["sum", "last"], state=0.5)
        return Kind(
            name, SystemComponent.read("it", function, {}), tmp_path, limit, ("u",), ("sum", "last"), {"u": 0.0}
        )
    path = exchange_only(component(EQUATIONS[name]), tmp_path) if name in EQUATIONS else component(FMUS[name])
    part = SystemComponent.read("it", path, {})
    folder = extract_fmus([part.fmu], tmp_path / "extracted")[part.fmu.path]
    return Kind(name, part, folder, limit, ("theta_force",), ("theta", "theta_dot"), {"theta_0": 0.5})


@contextmanager
def made(kind: Kind) -> Iterator[Held]:
    """An instance before its initialization."""
    variables = kind.part.fmu.variables
    with make_instance("it", kind.part.fmu, kind.folder, isolated=kind.isolated) as instance:
        given, seen, time = (c_double * 1)(), (c_double * len(kind.outputs))(), c_double()
        yield Held(
            instance,
            given,
            seen,
            time,
            instance.setter([variables[name] for name in kind.inputs], given),
            instance.getter([variables[name] for name in kind.outputs], seen),
            instance.stepper(time, c_double(H)),
            *instance.save_and_restore_calls(),
        )


@contextmanager
def begun(kind: Kind, **starts: Any) -> Iterator[Held]:
    """An instance at t = 0, before its first step."""
    with made(kind) as held:
        held.initialize(kind, **starts)
        held.instance.exit_initialization()
        yield held


FORCES = [0.4, 0.4, -0.3, 0.7, 0.4]
LATER = [0.4, 0.4, 0.1]  # where a force is held, solvers of equations go on with what they know
ALLOWED = {
    "made": ("set", "get", "save"),
    "initializing": ("set", "get", "save"),
    "running": ("set", "get", "save", "step", "get", "restore", "set", "save", "step", "restore", "step", "get"),
}
"""Calls that every instance takes, in this order, by its state."""


@pytest.mark.parametrize("state", ALLOWED)
@pytest.mark.variants(quick=None, core=12)
def test_what_is_allowed_when(kind: Kind, state: str) -> None:
    with made(kind) as held:
        if state != "made":
            held.initialize(kind)
        if state == "running":
            held.instance.exit_initialization()
        for name in ALLOWED[state]:
            getattr(held, name).perform("")


@pytest.mark.variants(quick=None, core=12)
def test_a_run_is_that_of_simulate(kind: Kind) -> None:
    """Inputs are held over steps; the function adds them up, the pendulum is where a whole run says."""
    with begun(kind) as held:
        first, found = held.read(), held.run(FORCES)
    if kind.part.fmu.function:
        assert first == [0.5, 0.0]
        assert_allclose(found, np.transpose([0.5 + np.cumsum(FORCES), np.arange(5) * H]), rtol=1e-14)
        return
    assert first == [0.5, 0.0]
    jumping = Signal(lambda t: FORCES[min(int(t / H + 1e-9), 4)], breaks=[H * k for k in range(1, 5)])
    options: dict[str, Any] = {"stop_time": 0.5, "step_size": H, "tolerance": 1e-9, "inputs": {"theta_force": jumping}}
    expected = simulate(kind.part.fmu.path, theta_0=0.5, **options)
    # Both within the solver's tolerance, 1e-9, over half a second.
    assert_allclose(found, np.transpose([expected[name][1:] for name in kind.outputs]), rtol=0, atol=1e-8)


@pytest.mark.variants(quick=None, core=12)
def test_saved_states_are_exact_and_independent(kind: Kind) -> None:
    with begun(kind) as held, begun(kind) as other:
        save, restore = held.instance.save_and_restore_calls()
        held.save.perform("")
        begin = held.read()
        first = held.run(FORCES)
        save.perform("")
        later = held.run(LATER, begin=5)
        for _ in range(2):
            restore.perform("")
            assert held.read() == first[-1]
            assert held.run(LATER, begin=5) == later
            held.restore.perform("")
            assert held.read() == begin
            assert held.run(FORCES) == first
        assert other.run(FORCES + LATER) == first + later  # it knows nothing of the first, nor of saving


@pytest.mark.variants(quick=None, core=12)
def test_another_run_begins_where_the_caller_has_gone_back_to(kind: Kind) -> None:
    name, value = next(iter(kind.starts)), 0.25
    with made(kind) as held:
        held.save.perform("")
        held.initialize(kind)
        held.instance.exit_initialization()
        first = held.run(FORCES)
        held.restore.perform("")
        held.initialize(kind, **{name: value})
        held.instance.exit_initialization()
        again = held.run(FORCES)
    with begun(kind) as fresh:
        assert fresh.run(FORCES) == first
    with made(kind) as assigned:
        assigned.initialize(kind)
        assigned.instance.assign(name, value)
        assigned.instance.exit_initialization()
        assert assigned.run(FORCES) == again
    assert again != first or kind.part.fmu.function  # what the function starts from is its own


@pytest.mark.variants(quick=None, core=12)
def test_errors_name_the_instance_and_what_was_tried(kind: Kind) -> None:
    is_function, version = kind.part.fmu.function is not None, kind.part.fmu.version
    with made(kind) as held:
        held.initialize(kind, **({"u": np.nan} if is_function else {"mass": -1.0}))
        words = r"it: accumulate returns \[nan, 0\.0\] at t = 0 s, expected 2 finite numbers"
        if not is_function:
            words = (
                rf"it: fmi{version}ExitInitializationMode returned (Error|Fatal): .*mass = -1 at t = 0: it must be > 0"
            )
        with pytest.raises(SimulationError, match=f"^{words}"):
            held.instance.exit_initialization()
    with begun(kind) as held:
        held.given[0] = np.nan
        words = "it: accumulate returns " if is_function else rf"it: fmi{version}(Set|DoStep)\w* now returned \w+: "
        tried = held.set
        if is_function or kind.name == "2 in Python":  # these read what they are given when they step
            held.set.perform("")
            tried = held.step
        with pytest.raises(SimulationError, match=f"^{words}"):
            tried.perform(" now")
        held.instance.close()
        held.instance.close()  # safe to repeat, after an error, too


@pytest.mark.variants(quick=None, core=12)
def test_derivatives_are_slopes_or_are_not_offered(kind: Kind) -> None:
    """By central differences, whose error is that of rounding over their size, 1e-16 / 1e-6, and its square."""
    fmu, (known,), unknowns = kind.part.fmu, kind.inputs, ("theta_ddot", "theta")
    assert fmu.provides_directional_derivatives == (kind.name in {"2", "3", "equations 2", "equations 3"})
    if not fmu.provides_directional_derivatives:
        return
    values, seed, h = (c_double * 2)(), (c_double * 1)(2.0), 1e-6
    with begun(kind) as held:
        of = [fmu.variables[name] for name in unknowns]
        held.run(FORCES)
        held.instance.directional_derivatives(of, [fmu.variables[known]], seed, values).perform("")
        read, found = held.instance.getter(of, buffer := (c_double * 2)()), []
        for force in (FORCES[-1] + h, FORCES[-1] - h):
            held.given[0] = force
            held.set.perform("")
            read.perform("")
            found.append(np.array(buffer))
    assert_allclose(list(values), 2.0 * (found[0] - found[1]) / (2 * h), rtol=1e-8, atol=1e-9)
    assert values[0] != 0.0


def test_apart_it_gives_the_same_bits(kind: Kind) -> None:
    if not kind.isolated:
        with begun(kind) as here, begun(replace(kind, isolated=60.0 if isolation() else 0.0)) as there:
            assert here.run(FORCES) == there.run(FORCES)
