"""Portable SSP archives in other masters: libcosim (OSP), ecos, fmpy."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from making import FmuPaths, wired
from masters import MASTERS, SWEEPS, Values, compared, elsewhere, jacobi
from schemas import validated

import liaisons
from liaisons import System
from liaisons.cosim import SystemDocument, checked_simulation
from liaisons.scenario_files import scenario_files
from liaisons_exchange.ssp import Form
from liaisons_tools.scenarios import execute, load, names

H, STEPS = 0.01, 20
# the length of a pendulum, or of a swing, keeps its start value where fmpy sets 0 before the first step
NEVER_ZERO = {"length", "rope"}


@pytest.fixture
def pumped(component: FmuPaths) -> System:
    """A swing whose length a signal drives: connections go one way."""
    swing = component("Pendulum"), {"theta_0": 0.05, "input_reconstruction": 1}
    operator = component("Sinusoid"), {"offset": 1.0, "amplitude": 0.1, "angular_frequency": 6.26}
    return wired("operator.y -> swing.length", swing=swing, operator=operator)


@pytest.fixture
def double(component: FmuPaths) -> System:
    """A pendulum hung on a pendulum: an algebraic loop of accelerations and forces."""
    upper, lower = {"theta_0": 0.3, "mass": 5.0}, {"theta_0": 0.5, "mass": 2.5}
    path = component("Pendulum")
    return wired("upper.bob -> lower.pivot", upper=(path, upper), lower=(path, lower))


@pytest.fixture
def chain(component: FmuPaths) -> System:
    """Oscillators, each hung on the one before."""
    masses = {f"mass{i}": (component("Oscillator"), {"x_0": 0.1 * i}) for i in range(4)}
    return wired(*(f"{one}.x -> {other}.support" for one, other in pairwise(masses)), **masses)


@pytest.fixture
def in_python(component: FmuPaths) -> System:
    """Two FMUs of one file and one GUID, which differ by start values only."""
    shaft = component("python/Flywheel"), {"angle_dot_0": 0.5, "input_reconstruction": 0}
    wheel = component("python/Flywheel"), {"inertia": 2.0, "angle_0": 0.5}
    brake = component("Sinusoid"), {"amplitude": 0.3}
    return wired("brake.y -> shaft.angle_load", shaft=shaft, wheel=wheel, brake=brake)


def _agree(found: Values, expected: Values, bound: float = 1e-12) -> None:
    for name, value in expected.items():
        # the very same calls; only the times are sums of steps there, and products here
        assert found[name] == pytest.approx(value, rel=bound, abs=bound), name


def _check(master: str, system: System, folder: Path) -> None:
    first = 0.0 if master == "fmpy" else None
    sweeps = SWEEPS[master](len(system.parts))
    expected = jacobi(system, folder, size=H, steps=STEPS, first=first, kept=NEVER_ZERO, sweeps=sweeps)
    # Each correction of an extrapolated table is an impact: rounding of a gap, 1e-16 m, at 1e-6 m/s is 1e-10 s.
    contacts = any(name.endswith("_impacts") for part in system.parts.values() for name in part.fmu.variables)
    _agree(elsewhere(master, system, folder, size=H, steps=STEPS), expected, 1e-9 if contacts else 1e-12)


@pytest.mark.parametrize("master", MASTERS)
@pytest.mark.parametrize("name", ["pumped", "double", "chain", "in_python"])
def test_other_masters_take_it_as_it_is(master: str, name: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    """FMPy passes over parameter sets: the start values in the FMUs count."""
    _check(master, request.getfixturevalue(name), tmp_path)


def test_a_loop_is_solved_at_the_start(double: System, tmp_path: Path) -> None:
    """At rest (m₁ + m₂) α₁ + m₂ c α₂ = -(m₁ + m₂) g sin θ₁ and c α₁ + α₂ = -g sin θ₂, where c = cos(θ₁ - θ₂)."""
    c = np.cos(0.3 - 0.5)
    exact = np.linalg.solve([[7.5, 2.5 * c], [c, 1.0]], -9.81 * np.array([7.5 * np.sin(0.3), np.sin(0.5)]))
    accelerations = [("upper", "theta_ddot"), ("lower", "theta_ddot")]
    start = elsewhere("ecospy", double, tmp_path, size=H, steps=0, also=accelerations)
    # the fixed point of an iteration that ends at 1e-10
    assert [start[".".join(place)] for place in accelerations] == pytest.approx(exact, abs=1e-9)


@pytest.mark.parametrize("master", ["libcosimpy", "ecospy"])
def test_a_loop_that_is_solved_at_the_start_leaves_the_first_step_right(
    master: str, double: System, tmp_path: Path
) -> None:
    angles = elsewhere(master, double, tmp_path, size=H, steps=1)
    result = double.simulate(H, H)
    for name in ("upper.theta", "lower.theta"):
        # held forces have changed by H² at the end, for all was at rest: H⁴ of the angle, some 10 s⁻⁴
        assert angles[name] == pytest.approx(float(result[name][-1]), abs=10 * H**4)


@pytest.mark.parametrize("master", ["libcosimpy", "ecospy"])
def test_where_nothing_goes_back_they_give_our_jacobi_numbers(master: str, pumped: System, tmp_path: Path) -> None:
    result = pumped.simulate(H * STEPS, H, coupling="jacobi")
    expected = {".".join(place): float(result[".".join(place)][-1]) for place in compared(pumped)}
    _agree(elsewhere(master, pumped, tmp_path, size=H, steps=STEPS), expected)


class _FoundError(Exception):
    """A scenario begins to simulate a system, the argument."""


@pytest.fixture
def found(monkeypatch: pytest.MonkeyPatch, shared_folder: Path, tmp_path: Path) -> Callable[[str], System]:
    """The first system that a scenario simulates."""

    def stop(document: SystemDocument, *span: float | None, **options: Any) -> object:
        if document.single and len(document.parts) == 1:
            return checked_simulation(document, *span, **options)
        raise _FoundError(System.from_document(document))

    def stop_sweep(system: System, *_: object, **__: object) -> None:
        raise _FoundError(system)

    def find(name: str) -> System:
        with monkeypatch.context() as patch:
            patch.setattr("liaisons.cosim.system.checked_simulation", stop)
            patch.setattr(liaisons, "sweep", stop_sweep, raising=False)
            with pytest.raises(_FoundError) as caught:
                execute(load(name), tmp_path, debug=True)
        return caught.value.args[0]

    monkeypatch.setenv("LIAISONS_FMUS", str(shared_folder))
    return find


QUICK = {"coupled_pendulums", "driven_hoop", "hoop_and_flywheel"}
SCENARIOS = [
    pytest.param(name, marks=[] if name in QUICK else [pytest.mark.slow])
    for name in names()
    if re.search(r"System\(|operator\(", scenario_files()[name].read_text(encoding="utf-8"))
]


@pytest.mark.parametrize("name", SCENARIOS)
@pytest.mark.variants(core=0)
def test_the_system_of_every_scenario(name: str, found: Callable[[str], System], tmp_path: Path) -> None:
    system = found(name)
    for form in get_args(Form):
        assert validated(system, tmp_path / form, form, stop_time=1.0, step_size=H) > 0
    for master in MASTERS:
        folder = tmp_path / master
        folder.mkdir()
        _check(master, system, folder)
