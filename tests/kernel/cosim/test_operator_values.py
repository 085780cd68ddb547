"""An operator as the value of a coordinate: the same numbers as of the system that it stands for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from making import FmuPaths

from liaisons import LiaisonsError, System, operator, simulate
from liaisons.cosim import IncompleteError

LENGTH: dict[str, Any] = {"offset": 1.0, "amplitude": 0.1, "angular_frequency": 2.0}
SPAN: dict[str, Any] = {"stop_time": 1.0, "step_size": 0.1, "tolerance": 1e-10}


@pytest.fixture
def pendulum(component: FmuPaths) -> Path:
    return component("Pendulum")


@pytest.fixture
def sinusoid(component: FmuPaths) -> Path:
    return component("Sinusoid")


@pytest.mark.parametrize("own", [{}, {"input_reconstruction": 0}, {"input_reconstruction": 2}])
def test_it_is_the_system_of_both(pendulum: Path, sinusoid: Path, own: dict[str, Any]) -> None:
    system = System("pumped")
    swing = system.add("swing", pendulum, theta_0=0.5, **own)
    system.connect(system.add("motor", sinusoid, **LENGTH)["y"], swing["length"])
    expected = system.simulate(**SPAN)
    length = operator(sinusoid, **LENGTH)
    found = simulate(pendulum, theta_0=0.5, length=length, **own, **SPAN)
    assert f"swing.{found.names[0]}" == expected.names[0]
    assert {name: found.units[name] for name in found.names} == {n: expected.units[f"swing.{n}"] for n in found.names}
    for name in found.names:
        assert np.array_equal(found[name], expected[f"swing.{name}"]), name


def test_the_rest_is_that_of_a_single_fmu(pendulum: Path, sinusoid: Path) -> None:
    length, driven = operator(sinusoid, **LENGTH), {"pivot_x": lambda t: 0.01 * t}
    found = simulate(pendulum, length=length, record=["theta", "pivot_x"], inputs=driven)
    usual = simulate(pendulum)
    assert np.array_equal(found.time, usual.time)
    assert found.names == ("theta", "pivot_x")
    assert np.array_equal(found["pivot_x"], 0.01 * found.time)
    times = [0.0, 0.3, 1.0]
    assert simulate(pendulum, length=length, times=times).time.tolist() == times


def test_what_there_is_of_a_run_that_fails_has_its_own_names(pendulum: Path, sinusoid: Path) -> None:
    falling = operator(sinusoid, offset=0.5, amplitude=-1.0, angular_frequency=1.0)  # the length reaches 0
    with pytest.raises(IncompleteError, match="length") as caught:
        simulate(pendulum, theta_0=0.0, length=falling, **SPAN)  # at rest: a swing would be infinitely fast there
    assert 0 < caught.value.result["theta"].size < 11


def test_it_has_to_fit(pendulum: Path, sinusoid: Path) -> None:
    with pytest.raises(LiaisonsError, match="mass"):
        simulate(pendulum, mass=operator(sinusoid), **SPAN)
