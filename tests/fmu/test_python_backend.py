"""The Python FMU through fmpy: accuracy, inputs inside a step, states, bad input, independence of liaisons.

Also its runs in the other two importers, and its agreement with the native FMU of the same component.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, Literal

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave, defaultCallbacks, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.validation import validate_fmu
from handmade import GRAVITY, breathing, driven, fall, kick, libration, pendulum, ring, rotation
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from liaisons.fmu import build
from liaisons.fmu.python_backend import python_members
from liaisons.mechanics import assemble
from liaisons.models import Sinusoid

GUID = "{00000000-0000-0000-0000-000000000001}"


# ---- instances ---------------------------------------------------------------------------------------------------


class Instance:
    """One instance in fmpy, by names; what it logs is kept."""

    def __init__(self, path: Path) -> None:
        description: Any = fmpy.read_model_description(path)
        self.references = {variable.name: variable.valueReference for variable in description.modelVariables}
        self.logged: list[tuple[int, str, str]] = []
        self.callbacks = fmi2CallbackFunctions()
        self.callbacks.logger = fmi2CallbackLoggerTYPE(self._log)
        self.callbacks.allocateMemory = defaultCallbacks.allocateMemory
        self.callbacks.freeMemory = defaultCallbacks.freeMemory
        self.fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=str(path.with_suffix("")),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName=description.modelName,
        )
        self.fmu.instantiate(callbacks=self.callbacks, loggingOn=True)

    def _log(self, _: object, __: bytes, status: int, category: bytes, message: bytes) -> None:
        self.logged.append((status, category.decode(), message.decode()))

    def initialize(self, tolerance: float | None = None, mode: int | None = None, **start: float) -> Instance:
        self.fmu.setupExperiment(tolerance=tolerance)
        if mode is not None:
            self.fmu.setInteger([self.references["input_reconstruction"]], [mode])
        self.set(**start)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        return self

    def set(self, **values: float) -> None:
        self.fmu.setReal([self.references[name] for name in values], list(values.values()))

    def get(self, *names: str) -> NDArray:
        return np.array(self.fmu.getReal([self.references[name] for name in names]))

    def everything(self) -> list[float]:
        settings = {"input_reconstruction", "symplectic_steps"}
        return self.fmu.getReal([r for name, r in self.references.items() if name not in settings])

    def step(self, t: float, size: float) -> None:
        self.fmu.doStep(t, size)

    def message(self, *words: str) -> None:
        """There is one new message, with all these words."""
        assert len(self.logged) == 1, self.logged
        for word in words:
            assert word in self.logged[0][2]
        self.logged.clear()


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """``fmus("HandPendulum")``, ``fmus("HandFall", "native")``: path of the FMU, which is unpacked beside the file."""
    directory = tmp_path_factory.mktemp("fmus")
    models = {model.name: model for model in (pendulum(), fall(), kick(), ring(3), assemble(Sinusoid))}

    @cache
    def built(name: str, backend: Literal["native", "python"] = "python") -> Path:
        path = build(models[name], directory, backend=backend)
        if not path.with_suffix("").exists():  # never over a library that is loaded: ("X") and ("X", "python") are one
            fmpy.extract(path, path.with_suffix(""))
        return path

    return built


@pytest.fixture
def instance(fmus: Callable[..., Path]) -> Iterator[Callable[..., Instance]]:
    made: list[Instance] = []

    def make(name: str = "HandPendulum", backend: str = "python") -> Instance:
        made.append(Instance(fmus(name, backend)))
        return made[-1]

    yield make
    for item in made:
        item.fmu.freeInstance()


def length(t: float) -> dict[str, float]:
    return dict(zip(("length", "length_dot", "length_ddot"), breathing(t), strict=True))


def run_pumped(item: Instance, mode: int, H: float, tolerance: float = 1e-13) -> NDArray:
    item.initialize(tolerance, mode, **length(0.0))
    for i in range(round(10 / H)):
        item.set(**length((i + 1) * H if mode == 2 else i * H))
        item.step(i * H, H)
    return item.get("theta", "p_theta")


# ---- the archive -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["HandPendulum", "HandFall", "HandKick", "Sinusoid"])
def test_validates(fmus: Callable[..., Path], name: str) -> None:
    assert validate_fmu(str(fmus(name))) == []


def members() -> dict[str, bytes]:
    return python_members(pendulum(), GUID)


def test_members() -> None:
    names = set(members())
    assert {"binaries/linux64/HandPendulum.so", "binaries/win64/HandPendulum.dll"} <= names
    assert {"resources/pythonfmu/fmi2slave.py", "resources/pythonfmu/LICENSE"} <= names
    assert "documentation/index.html" in names
    assert f"resources/{members()['resources/slavemodule.txt'].decode()}.py" in names


def test_same_model_same_bytes() -> None:
    code = """
import hashlib
from handmade import pendulum
from liaisons.fmu.python_backend import python_members
print(hashlib.sha256(repr(python_members(pendulum(), "{}")).encode()).hexdigest())
"""
    digests = set()
    for seed in ("1", "2"):  # of the order of Python's sets
        environment = os.environ | {"PYTHONHASHSEED": seed, "PYTHONPATH": os.pathsep.join(sys.path)}
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
        digests.add(done.stdout)
    assert len(digests) == 1


# ---- accuracy ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("H", [1.0, 0.1, 0.01])
@pytest.mark.parametrize(("theta_0", "rate"), [(0.1, 0.0), (2.0, 0.0), (0.0, 8.0)])
def test_elliptic_functions(instance: Callable[..., Instance], theta_0: float, rate: float, H: float) -> None:
    item = instance().initialize(1e-10, theta_0=theta_0, theta_dot_0=rate)
    error, balance = 0.0, 0.0
    for i in range(round(100 / H)):
        item.step(i * H, H)
        t = (i + 1) * H
        theta, energy_balance = item.get("theta", "energy_balance")
        exact, _ = rotation(t, rate) if rate else libration(t, theta_0)
        error = max(error, abs(theta - float(exact)))
        balance = max(balance, abs(energy_balance))
    assert error < 1e-7  # a thousand tolerances, over 50 periods or 120 turns
    assert balance < 10 * 1e-10 * 100 * (GRAVITY + rate**2 / 2)  # 10 tolerances, times the time, times the energy


def test_error_falls_with_the_tolerance(instance: Callable[..., Instance]) -> None:
    def error(tolerance: float) -> float:
        item = instance().initialize(tolerance, theta_0=2.0)
        for i in range(100):
            item.step(float(i), 1.0)
        return abs(item.get("theta")[0] - float(libration(100.0, 2.0)[0]))

    errors = np.array([error(10.0**-i) for i in (6, 8, 10, 12)])
    slopes = np.diff(np.log10(errors)) / -2
    assert np.all((slopes > 0.7) & (slopes < 1.3))  # proportional, but for the scatter of the step control
    assert error(1e-13) < 1e-9


def test_forces_and_friction(instance: Callable[..., Instance]) -> None:
    item = instance().initialize(1e-10, friction=0.3, theta_0=1.0, theta_force=0.75)
    for i in range(10):
        item.step(float(i), 1.0)

    def rates(_: float, y: NDArray) -> list[float]:
        theta, p, _, _ = y
        return [p, -GRAVITY * np.sin(theta) - 0.3 * p + 0.75, 0.75 * p, 0.3 * p**2]

    reference = solve_ivp(rates, (0, 10), [1.0, 0.0, 0.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    # The motion is stable: errors of 1e-10 a step do not grow.
    assert item.get("theta", "p_theta", "work", "dissipated") == pytest.approx(reference, abs=1e-8)
    assert abs(item.get("energy_balance")[0]) < 1e-8


def test_component_without_state(instance: Callable[..., Instance]) -> None:
    item = instance("Sinusoid").initialize(offset=2.0)
    for i in range(10):
        item.step(i * 0.1, 0.1)
    assert item.get("y", "y_dot", "y_ddot") == pytest.approx([2 + np.sin(1), np.cos(1), -np.sin(1)], abs=1e-15)


@pytest.mark.parametrize("H", [0.3, 0.5, 3.0])
def test_steps_end_at_events(instance: Callable[..., Instance], H: float) -> None:
    item = instance("HandKick").initialize(1e-6)
    for i in range(round(3 / H)):
        item.step(i * H, H)
    # The two pieces are straight lines, which any method finds up to rounding: an event that is missed would show.
    assert item.get("x")[0] == pytest.approx(3.0 + 2 * (3.0 - 1.0), abs=1e-14)


# ---- inputs inside a step ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("mode", "order"), [(1, 2.8), (2, 5.5)])
def test_order_of_the_input_reconstruction(instance: Callable[..., Instance], mode: int, order: float) -> None:
    sizes = np.array([0.4, 0.2, 0.1])
    pumped = driven([10.0], breathing)[:, -1]
    errors = [np.abs(run_pumped(instance(), mode, H) - pumped).max() for H in sizes]
    slope = np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    # Third order from the parabola, sixth from Hermite's polynomial; a little less where H is not small.
    assert slope > order
    if mode == 2:
        assert errors[-1] < 1e-9


def test_hold_ignores_the_rates(instance: Callable[..., Instance]) -> None:
    moving, still = (instance().initialize(1e-10, 0, length_dot=rate) for rate in (0.5, 0.0))
    for item in (moving, still):
        item.step(0.0, 0.1)
    # The work differs, and with it the internal steps: equal to the tolerance only.
    assert moving.get("theta", "p_theta") == pytest.approx(still.get("theta", "p_theta"), abs=1e-10)
    assert abs(moving.get("work")[0]) > 0.1


def test_inputs_read_back_as_they_were_set(instance: Callable[..., Instance]) -> None:
    item = instance().initialize(mode=1, length_dot=0.5)
    item.step(0.0, 0.1)
    assert item.get("length", "length_dot").tolist() == [1.0, 0.5]


def test_extrapolation_reaches_the_end_of_the_step(instance: Callable[..., Instance]) -> None:
    item = instance().initialize(mode=1, length=1.0, length_dot=0.5, length_ddot=0.2)
    item.step(0.0, 0.1)
    theta, theta_dot, energy = item.get("theta", "theta_dot", "energy")
    long, longer = 1.0 + 0.05 + 0.001, 0.5 + 0.02  # length and rate by the Taylor polynomial, at 0.1
    kinetic = (longer**2 + (long * theta_dot) ** 2) / 2
    assert energy == pytest.approx(kinetic - GRAVITY * long * np.cos(theta), abs=1e-14)  # rounding


@pytest.mark.parametrize("mode", [0, 1])
def test_jump_of_the_rate_books_its_work(instance: Callable[..., Instance], mode: int) -> None:
    item = instance().initialize(1e-10, mode, theta_0=1.0)
    item.step(0.0, 0.5)
    p, work = item.get("p_theta", "work")
    item.set(length_dot=-0.4)
    assert item.get("p_theta")[0] == p
    assert item.get("work")[0] - work == pytest.approx(0.4**2 / 2, abs=1e-14)  # m l'²/2, up to rounding


def test_energy_balance_through_jumps(instance: Callable[..., Instance]) -> None:
    item = instance().initialize(1e-10, 1, theta_0=1.0)
    for i in range(20):
        item.step(0.1 * i, 0.1)
        item.set(length=1.0 + 0.1 * (-1) ** i, length_dot=0.5 * (-1) ** i)
        assert abs(item.get("energy_balance")[0]) < 1e-8  # energies of some 10 J, 10 tolerances each second
    assert abs(item.get("work")[0]) > 0.1


def test_tunable_parameter_while_running(instance: Callable[..., Instance]) -> None:
    item = instance().initialize(1e-10, theta_0=1.0)
    item.step(0.0, 1.0)
    item.set(friction=1.0)
    for i in range(1, 20):
        item.step(float(i), 1.0)
    assert abs(item.get("theta")[0]) < 1e-3  # e^(-19/2) of the start
    assert abs(item.get("energy_balance")[0]) < 1e-8


def test_structural_sizes_can_be_read_and_not_set(instance: Callable[..., Instance]) -> None:
    item = instance("HandRing").initialize()
    size, mode = ([item.references[name]] for name in ("n", "input_reconstruction"))
    assert item.fmu.getInteger([*size, *mode]) == [3, 1]
    item.fmu.setInteger(size, [5])
    item.message("n = 5: it is no Integer variable that can be set")
    assert item.fmu.getInteger([*size, *mode]) == [3, 1]
    assert item.fmu.getInteger([99]) == [0]
    item.message("[99] some belong to no Integer variable")


# ---- states ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", [0, 1, 2])
def test_roll_back_is_exact(instance: Callable[..., Instance], mode: int) -> None:
    item = instance().initialize(1e-6, mode, theta_0=2.0, **length(0.0))
    for i in range(3):
        item.set(**length(0.1 * i))
        item.step(0.1 * i, 0.1)
    state = item.fmu.getFMUstate()
    text = item.fmu.serializeFMUstate(state)

    def go_on(other: Instance) -> list[list[float]]:
        found = [other.everything()]
        for i in range(3, 6):
            other.set(**length(0.1 * i + 0.03))
            other.step(0.1 * i, 0.1)
            found.append(other.everything())
        return found

    first = go_on(item)
    item.fmu.setFMUstate(state)
    assert go_on(item) == first
    item.fmu.freeFMUstate(state)

    fresh = instance()  # not even initialized, with another tolerance and mode
    copy = fresh.fmu.deSerializeFMUstate(text)
    fresh.fmu.setFMUstate(copy)
    assert go_on(fresh) == first
    assert fresh.fmu.getInteger([fresh.references["input_reconstruction"]]) == [mode]
    again = fresh.fmu.deSerializeFMUstate(text)
    assert fresh.fmu.serializeFMUstate(again) == text


def test_state_before_initialization(instance: Callable[..., Instance]) -> None:
    item = instance()
    item.set(theta_0=0.5)
    state = item.fmu.getFMUstate()
    item.initialize()
    item.step(0.0, 0.1)
    item.fmu.setFMUstate(state)
    item.set(theta_0=0.7)
    item.initialize()
    assert item.get("theta")[0] == 0.7
    assert not item.logged


def _edited(**changes: Any) -> Callable[[bytes], bytes]:
    """With other values, each of which may be a function of the old one, and the checksum that belongs to them."""

    def damage(content: bytes) -> bytes:
        state = json.loads(content[64:])
        state |= {name: change(state[name]) if callable(change) else change for name, change in changes.items()}
        return _sealed(json.dumps(state).encode())

    return damage


def _sealed(text: bytes) -> bytes:
    return hashlib.sha256(text).hexdigest().encode() + text


def _impossible() -> Iterator[tuple[str, Any]]:
    yield from ((name, [value]) for name in ("_t",) for value in (math.nan, math.inf, 1, "0", None, True))
    for name in ("_k", "_given", "_u", "_y", "_m", "_size"):
        yield name, 3.0  # would be put into all places
        yield name, lambda old: old[:-1]
        yield name, lambda old: [*old[:-1], math.nan]
        yield name, lambda old: [*old[:-1], math.inf]
        yield name, lambda old: [*old[:-1], [1.0]]
    yield "_size", lambda old: [0.0, *old[1:]]
    yield "_k", lambda old: [-1.0, *old[1:]]  # mass
    yield from (("_mode", value) for value in (-1, 3, 1.5, True, "1", 10**30))
    yield from (("_tolerance", value) for value in (0.0, -1.0, 1.0, math.nan, math.inf, 1))
    yield from ((name, value) for name in ("_started", "_jumped", "stepping") for value in (0, 2, "yes", None))
    yield "_started", False  # after initialization
    yield "_unusable", 0
    yield "more", 1


@pytest.mark.parametrize(
    "damage",
    [
        lambda text: text[:40],
        lambda text: text[:-1],
        lambda text: text.replace(b'"{', b'"{0'),
        lambda text: text.replace(b"0.", b"1.", 1),
        lambda _: b"3",
        lambda _: _sealed(b"3"),
        lambda _: _sealed(b"[" * 100_000),
        lambda _: _sealed(b"\xff"),
        lambda _: _sealed(b"{}"),
        lambda text: bytes(64) + text[64:],
        lambda text: text[64:],
        *(_edited(**{name: value}) for name, value in _impossible()),
    ],
)
def test_damaged_state_is_refused(instance: Callable[..., Instance], damage: Callable[[bytes], bytes]) -> None:
    item = instance().initialize()
    item.step(0.0, 0.1)
    before = item.everything()
    text = item.fmu.serializeFMUstate(item.fmu.getFMUstate())
    item.fmu.setFMUstate(item.fmu.deSerializeFMUstate(damage(text)))
    item.message("damaged", "another FMU")
    assert item.everything() == before


# ---- bad input ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"length": np.nan}, ["length = nan", "stays 1"]),
        ({"length_dot": 0.1, "theta_force": np.inf}, ["theta_force = inf", "stays 0"]),
        ({"mass": 2.0}, ["mass = 2", "fixed parameter"]),
        ({"energy": 2.0}, ["energy = 2", "it is calculated"]),
    ],
)
def test_refused_values_change_nothing_and_stop_one_step(
    instance: Callable[..., Instance], values: dict[str, float], words: list[str]
) -> None:
    item = instance().initialize(theta_0=1.0)
    item.step(0.0, 0.1)
    before = item.everything()
    item.set(**values)
    item.message(*words)
    assert item.everything() == before
    with pytest.raises(FMICallException, match="discard"):
        item.step(0.1, 0.1)
    item.message(*words)
    assert item.everything() == before
    item.step(0.1, 0.1)
    assert not item.logged


def test_a_good_value_makes_up_for_a_refused_one(instance: Callable[..., Instance]) -> None:
    item = instance().initialize()
    item.set(length=np.nan)
    item.set(length=1.1)
    item.step(0.0, 0.1)
    assert item.get("length")[0] == 1.1


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"mass": -1.0}, ["mass = -1", "must be > 0"]),
        ({"mass": 0.0}, ["mass = 0", "must be > 0"]),
        ({"friction": -0.1}, ["friction = -0.1", "must be >= 0"]),
        ({"length": -1.0}, ["length = -1", "must be > 0"]),
        ({"theta_dot_0": 1e308, "mass": 1e308}, ["initial state is not finite"]),
    ],
)
def test_bad_start(instance: Callable[..., Instance], values: dict[str, Any], words: list[str]) -> None:
    item = instance().initialize(**values)
    item.message(*words, "reset")
    assert np.isnan(item.get("theta", "energy")).all()
    for _ in range(2):  # it stays unusable
        with pytest.raises(FMICallException, match="discard"):
            item.step(0.0, 0.1)
        item.message(*words)
    item.fmu.reset()
    item.initialize(theta_0=0.3)
    item.step(0.0, 0.1)
    assert np.isfinite(item.everything()).all()
    assert not item.logged


@pytest.mark.parametrize("mode", [0, 1, 2])
def test_length_driven_through_zero(instance: Callable[..., Instance], mode: int) -> None:
    item = instance().initialize(1e-8, mode, theta_0=1.0)
    item.step(0.0, 0.1)
    good = item.everything()
    item.set(length=0.5 if mode == 1 else -0.5, length_dot=-2.1)
    with pytest.raises(FMICallException, match="discard"):
        item.step(0.1, 1.0)
    item.message("length = -0", "it must be > 0", "taken back")
    item.set(length=1.0, length_dot=0.0)
    assert item.everything() == good
    item.step(0.1, 0.1)
    assert np.isfinite(item.everything()).all()


def test_singularity_inside_a_step(instance: Callable[..., Instance]) -> None:
    item = instance("HandFall").initialize(1e-8)
    item.step(0.0, 1.0)
    good = item.everything()
    with pytest.raises(FMICallException, match="discard"):
        item.step(1.0, 1.0)
    assert "x must stay > 0" in item.logged[0][2]
    reached = float(item.logged[0][2].split("t = ")[1].split(" ")[0])
    assert reached == pytest.approx(np.pi / np.sqrt(8), abs=1e-5)  # the last 2e-5 of x take 1e-7 s
    item.message("taken back")
    assert item.everything() == good
    item.step(1.0, 0.05)


@pytest.mark.parametrize(
    ("t", "size", "words"),
    [
        (0.1, 0.0, ["step size = 0"]),
        (0.1, -0.1, ["step size = -0.1"]),
        (0.1, np.nan, ["step size = nan"]),
        (0.1, np.inf, ["step size = inf"]),
        (0.3, 0.1, ["step from t = 0.3", "the instance is at t = 0.1"]),
        (np.nan, 0.1, ["step from t = nan"]),
        (np.inf, 0.1, ["step from t = inf: it must be finite"]),
        (-np.inf, 0.1, ["step from t = -inf: it must be finite"]),
        (1e308, 1.0, ["step from t = 1e+308: the instance is at t = 0.1"]),
        (0.1, 1e-18, ["step from t = 0.1 of size 1e-18: it must end later"]),
    ],
)
def test_bad_step(instance: Callable[..., Instance], t: float, size: float, words: list[str]) -> None:
    item = instance().initialize()
    item.step(0.0, 0.1)
    before = item.everything()
    with pytest.raises(FMICallException, match="discard"):
        item.step(t, size)
    item.message(*words)
    assert item.everything() == before
    item.step(0.1, 0.1)


def test_the_same_step_is_an_error_in_the_log_the_second_time(instance: Callable[..., Instance]) -> None:
    """The wrapper knows Discard only."""
    item = instance().initialize(length=0.2, length_dot=-3.0)
    for size, expected in ((0.1, 2), (0.1, 3), (0.08, 2)):
        with pytest.raises(FMICallException, match="discard"):
            item.step(0.0, size)
        assert [entry[0] for entry in item.logged] == [expected]
        item.message("length = ", "it must be > 0")
    item.step(0.0, 0.05)


def test_numbers_that_are_not_finite_stop_the_next_step(instance: Callable[..., Instance]) -> None:
    item = instance().initialize(length_dot=10.0, length_ddot=1e308)
    assert np.isfinite(item.get("theta", "energy")).all()
    assert not item.logged
    item.get("theta", "power")
    item.message("power = inf at t = 0: it must be finite")
    with pytest.raises(FMICallException, match="discard"):
        item.step(0.0, 0.1)
    item.message("power = inf at t = 0")


def test_step_before_initialization(instance: Callable[..., Instance]) -> None:
    item = instance()
    with pytest.raises(FMICallException, match="discard"):
        item.step(0.0, 0.1)
    item.message("initialize the instance first")


@pytest.mark.parametrize("value", [-1, 3])
def test_unknown_reconstruction(instance: Callable[..., Instance], value: int) -> None:
    item = instance().initialize(mode=value)
    item.message(f"input_reconstruction = {value}", "0 (hold), 1 (extrapolate) or 2 (interpolate)")
    with pytest.raises(FMICallException, match="discard"):
        item.step(0.0, 0.1)
    item.logged.clear()
    item.step(0.0, 0.1)


def test_tolerance_out_of_range(instance: Callable[..., Instance]) -> None:
    item = instance().initialize(tolerance=1.0)
    item.message("tolerance = 1 is out of range, 0.01 is used")


def test_unknown_value_references(instance: Callable[..., Instance]) -> None:
    for reference in (1000, 0):
        item = instance().initialize()
        assert np.isnan(item.fmu.getReal([reference])[0])
        item.message(f"[{reference}] some belong to no Real variable")
        item.fmu.setReal([reference], [1.0])
        item.message(f"value reference {reference} = 1: it belongs to no Real variable")


# ---- the native FMU ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", [0, 1, 2])
def test_agrees_with_the_native_fmu(instance: Callable[..., Instance], mode: int) -> None:
    """Two code generators, two solvers, two runtimes; every variable, at each of the steps and after each setting."""

    def run(item: Instance) -> list[list[float]]:
        item.initialize(1e-11, mode, theta_0=1.0, theta_dot_0=0.5, friction=0.05, **length(0.0))
        found = [item.everything()]
        t = 0.0
        for i in range(20):
            item.set(**length(t + 0.1 if mode == 2 else t), theta_force=np.cos(t))
            found.append(item.everything())
            if i == 10:
                item.set(friction=0.2)
                found.append(item.everything())
            for size in (0.1, 1e-3):  # the second step without setting anything
                item.step(t, size)
                t += size
                found.append(item.everything())
            item.set(theta_force=0.1 * i)
            found.append(item.everything())
        return found

    python, native = (np.array(run(instance("HandPendulum", backend))) for backend in ("python", "native"))
    # Errors of 1e-11 a step and of 1e-12 from the accelerations at the ends of the quintic polynomials.
    assert python == pytest.approx(native, abs=1e-9)


# ---- life --------------------------------------------------------------------------------------------------------


def test_many_instances_of_several_fmus(instance: Callable[..., Instance]) -> None:
    # pythonfmu's wrapper drops one reference too many to the slave's module at each instantiation.
    items = [instance(name) for _ in range(100) for name in ("HandPendulum", "HandFall")]
    for item in items:
        item.initialize()
        item.step(0.0, 0.1)
    found = [item.everything() for item in items]
    assert found[0::2] == [found[0]] * 100
    assert found[1::2] == [found[1]] * 100
    assert not any(path.startswith(str(items[0].fmu.unzipDirectory)) for path in sys.path)


def test_runs_without_liaisons(fmus: Callable[..., Path]) -> None:
    """In a fresh interpreter that cannot import liaisons, and that ends without an error afterwards."""
    code = f"""
import sys
sys.modules["liaisons"] = None
import fmpy
result = fmpy.simulate_fmu({str(fmus("HandPendulum"))!r}, stop_time=1.0, output_interval=0.1, relative_tolerance=1e-10)
assert not any(name.split(".")[0] == "liaisons" for name in sys.modules if sys.modules[name])
import pythonfmu
assert "resources" in pythonfmu.__file__, pythonfmu.__file__
print(repr(float(result["theta"][-1])))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) == pytest.approx(float(libration(1.0, 0.1)[0]), abs=1e-9)  # ten tolerances


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("valgrind"), reason="valgrind is not installed")
def test_the_wrapper_lets_go_of_the_interpreter_before_its_memory_is_freed(fmus: Callable[..., Path]) -> None:
    code = f"import fmpy; fmpy.simulate_fmu({str(fmus('HandPendulum'))!r}, stop_time=0.1)"
    valgrind = ["valgrind", "--error-limit=no", sys.executable, "-c", code]
    done = subprocess.run(valgrind, capture_output=True, text=True, check=True)
    assert "ERROR SUMMARY" in done.stderr  # of CPython's and the loader's own, say
    assert "finalizePythonInterpreter" not in done.stderr


# ---- other importers ---------------------------------------------------------------------------------------------

_LIBCOSIM = """
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave
execution = CosimExecution.from_step_size(step_size=10_000_000)
index = execution.add_local_slave(CosimLocalSlave(fmu_path={path!r}, instance_name="pendulum"))
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
execution.simulate_until(target_time=10_000_000_000)
print("theta", repr(observer.last_real_values(index, [{reference}])[0]))
"""

_ECOS = """
from ecospy import EcosSimulation, EcosSimulationStructure
structure = EcosSimulationStructure()
structure.add_model("pendulum", {path!r})
simulation = EcosSimulation(structure=structure, step_size=0.01)
simulation.init()
simulation.step(1000)
print("theta", repr(simulation.get_real("pendulum::theta")))
simulation.terminate()
simulation.free()
"""


@pytest.mark.parametrize(("package", "code"), [("libcosimpy", _LIBCOSIM), ("ecospy", _ECOS)])
def test_other_importers(fmus: Callable[..., Path], package: str, code: str) -> None:
    pytest.importorskip("libcosimpy")  # the two come together, for the same machines
    variables = fmpy.read_model_description(fmus("HandPendulum")).modelVariables
    reference = next(v.valueReference for v in variables if v.name == "theta")
    libraries = Path(sys.prefix) / ("Library/bin" if os.name == "nt" else "lib")  # where the wheel tbb puts its own
    environment = os.environ | {"LD_LIBRARY_PATH": str(libraries)}
    script = code.format(path=str(fmus("HandPendulum")), reference=reference)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, (package, done.stderr)
    # Tolerance 1e-8 by default; small amplitude, so errors hardly grow over 10 s.
    theta = next(float(line.split()[1]) for line in done.stdout.splitlines() if line.startswith("theta "))
    assert theta == pytest.approx(float(libration(10.0, 0.1)[0]), abs=1e-7)
