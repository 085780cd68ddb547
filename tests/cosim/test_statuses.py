"""What an FMU returns is a status of FMI; whatever else it is, it is no success."""

from __future__ import annotations

from pathlib import Path

import pytest
from equations import equations
from making import FmuPaths, wired

from liaisons import simulate
from liaisons.errors import SimulationError
from liaisons.results import IncompleteError


@pytest.mark.usefixtures("either_loop")
@pytest.mark.parametrize("status", [-1, -2, -(2**31), 3, 6, 101, 103, 2**31 - 1])
@pytest.mark.parametrize("isolated", [False, True])
def test_of_a_step_alone(fmu: FmuPaths, status: int, isolated: bool) -> None:
    with pytest.raises(IncompleteError, match=r"^Hasty: fmi2DoStep from t = 0 s to t = 0\.2 s returned") as it:
        simulate(fmu("Hasty"), stop_time=1.0, step_size=0.2, status=status, isolated=isolated)
    assert it.value.result.time.tolist() == [0.0]


@pytest.mark.parametrize("status", [-1, -2, 3, 103])
@pytest.mark.parametrize("isolated", [False, True])
def test_of_a_coupled_step(fmu: FmuPaths, status: int, isolated: bool) -> None:
    bad = fmu("Hasty"), {"status": status, "isolated": isolated}
    system = wired("mass.q -> buffer.length", mass=(fmu("Cart"), {"q_0": 1.0}), buffer=fmu("Buffer"), bad=bad)
    with pytest.raises(IncompleteError, match=r"^bad: fmi2DoStep from t = 0 s to t = 0\.2 s returned"):
        system.simulate(1.0, 0.2, coupling="implicit")


@pytest.mark.usefixtures("either_loop")
@pytest.mark.parametrize("isolated", [False, True])
def test_of_equations_alone(tmp_path: Path, isolated: bool) -> None:
    fmu = equations(tmp_path, 1, rates="f[0] = 1; if (t > 0.45) return 3;")
    with pytest.raises(IncompleteError, match=r"x: fmi2GetDerivatives at t = \S+ s returned Error") as it:
        simulate(fmu, stop_time=1.0, step_size=0.2, isolated=isolated)
    assert it.value.result.time[-1] == pytest.approx(0.4)


@pytest.mark.parametrize("isolated", [False, True])
def test_of_equations_in_a_coupled_step(tmp_path: Path, isolated: bool) -> None:
    """Their derivatives are refused from t = 0.45 s on."""
    fmu = equations(tmp_path, 1, rates="f[0] = u; if (t > 0.45) return 3;", output="y = x[0];")
    system = wired("a.y -> b.u", a=(fmu, {"isolated": isolated}), b=fmu)
    system.connect(system.parts["b"]["y"], system.parts["a"]["u"])
    with pytest.raises(SimulationError, match=r"[ab]: fmi2GetDerivatives at t = \S+ s returned Error") as it:
        system.simulate(1.0, 0.2, coupling="implicit")
    assert isinstance(it.value, IncompleteError)
    assert it.value.result.time[-1] == pytest.approx(0.4)
