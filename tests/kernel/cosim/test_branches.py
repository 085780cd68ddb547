"""Two mechanisms at one point: a junction adds their forces, whatever the coupling."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from making import coupling_errors

from liaisons import System, simulate
from liaisons.cosim import Coupling
from liaisons.errors import ConnectError
from liaisons.results import Result

STOP, STEP = 1.0, 0.01


def branched() -> System:
    """Two pendulums of half a mass, which move alike, hang at the bob of a third one."""
    system = System("branched")
    upper, joint = system.add("upper", "Pendulum", theta_0=0.3), system.add("joint", "Junction")
    system.connect(upper["bob_x"], joint["x"])
    system.connect(upper["bob_z"], joint["z"])
    for name, point in (("left", "first"), ("right", "second")):
        half = system.add(name, "Pendulum", theta_0=-0.5, mass=0.5)
        system.connect(joint[point], half["pivot"])
    return system


@cache
def expected() -> np.ndarray:
    """The double pendulum, from one Lagrangian."""
    run = simulate("DoublePendulum", theta_1_0=0.3, theta_2_0=-0.5, stop_time=STOP, step_size=STEP, tolerance=1e-12)
    return np.array([run["theta_1"], run["theta_2"]])


def error(run: Result, every: int = 1) -> float:
    np.testing.assert_array_equal(run["left.theta"], run["right.theta"])
    return float(np.abs(np.array([run["upper.theta"], run["left.theta"]])[:, ::every] - expected()).max())


@pytest.mark.parametrize("coupling", ["implicit", "waveform"])
def test_two_halves_are_one_whole(coupling: Coupling) -> None:
    run = branched().simulate(STOP, STEP, coupling=coupling, tolerance=1e-10)
    assert error(run) < 1e-7
    assert error(run) < 10 * coupling_errors(run).sum()


def test_explicit_coupling_is_of_first_order() -> None:
    errors = [
        error(branched().simulate(STOP, STEP / n, coupling="gauss-seidel", tolerance=1e-10), n) for n in (1, 2, 4)
    ]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    np.testing.assert_allclose(orders, 1, rtol=0, atol=0.15)


@pytest.mark.slow
def test_flattened_it_has_no_coupling_error(tmp_path: Path) -> None:
    run = simulate(branched().flatten(tmp_path), stop_time=STOP, step_size=STEP, tolerance=1e-11)
    assert error(run) < 1e-8


def test_an_archive_has_it(tmp_path: Path) -> None:
    branched().write_ssp(tmp_path / "branched.ssp")
    assert error(System.from_ssp(tmp_path / "branched.ssp").simulate(STOP, STEP, tolerance=1e-10)) < 1e-7


def test_two_mechanisms_at_one_point_are_refused_with_the_cure() -> None:
    system = System("branched")
    upper, left, right = (system.add(name, "Pendulum") for name in ("upper", "left", "right"))
    system.connect(upper["bob"], left["pivot"])
    with pytest.raises(ConnectError, match="one source; where two mechanisms hang, a Junction adds their forces"):
        system.connect(upper["bob"], right["pivot"])
