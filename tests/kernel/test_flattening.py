"""A system as one FMU: against the co-simulated system, and against the closed form."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from liaisons import System, flatten, operator, simulate
from liaisons.check import max_error
from liaisons.fmu import build
from liaisons.mechanics import assemble
from liaisons.models import DoublePendulum, Oscillator, OscillatorChain, Pendulum, Ramp, Sinusoid


@pytest.fixture(scope="module")
def pair(shared_folder: Path) -> System:
    pendulum = build(assemble(Pendulum), shared_folder)
    system = System("two pendulums")
    upper = system.add("upper", pendulum, theta_0=0.4)
    lower = system.add("lower", pendulum, theta_0=-0.2, mass=2.0)
    system.connect(upper["bob"], lower["pivot"])
    return system


def test_flattened_and_single_fmu(pair: System, shared_folder: Path, tmp_path: Path) -> None:
    run: dict[str, Any] = {"stop_time": 2.0, "tolerance": 1e-12}
    path = pair.flatten(tmp_path)
    assert path == tmp_path / "TwoPendulums.fmu"
    whole = simulate(path, step_size=0.04, **run)
    sine: dict[str, Any] = {"offset": 1.0, "amplitude": 0.1}
    moved: Any = {"upper.length": operator(build(assemble(Sinusoid), shared_folder), **sine)}  # a port with a dot
    pumped = simulate(path, step_size=0.04, **moved, **run)
    assert pumped["upper.length"] == pytest.approx(1 + 0.1 * np.sin(pumped.time), abs=1e-12)
    double = build(assemble(DoublePendulum), shared_folder)
    single = simulate(double, step_size=0.04, theta_1_0=0.4, theta_2_0=-0.2, mass_2=2.0, **run)
    # The same equations of motion: solver tolerance, amplification below 100.
    assert max_error(whole["upper.theta"], single["theta_1"]) <= 1e-10
    assert max_error(whole["lower.theta"], single["theta_2"]) <= 1e-10


@pytest.mark.parametrize("step_size", [0.1, 0.25])
def test_an_operator_inside_that_jumps_in_rate_is_booked(shared_folder: Path, tmp_path: Path, step_size: float) -> None:
    """The ramp starts at 0.5 s, at the end of a step or inside one: an impulse works m r'²/2 on the swing."""
    system = System("ramped")
    ramp = system.add("ramp", build(assemble(Ramp), shared_folder), offset=1.0, rate=0.2, start_time=0.55)
    swing = system.add("swing", build(assemble(Pendulum), shared_folder), theta_0=1.0, input_reconstruction=2)
    system.connect(ramp["y"], swing["length"])
    path = system.flatten(tmp_path)
    for start_time in (0.5, 0.55):
        starts: dict[str, Any] = {"ramp.start_time": start_time}
        result = simulate(path, stop_time=2.0, step_size=step_size, tolerance=1e-11, **starts)
        assert max_error(result["swing.energy_balance"], 0.0) <= 1e-9  # without the booking 0.02 J
        assert result["swing.length"][-1] == pytest.approx(1.0 + 0.2 * (2.0 - start_time), rel=1e-12)


def test_chain_keeps_its_size(shared_folder: Path, tmp_path: Path) -> None:
    system = System("pulled chain")
    chain = system.add("chain", build(assemble(OscillatorChain, 4), shared_folder / "n=4"), u_0=[0.1, 0.0, 0.0, 0.3])
    hand = system.add("hand", build(assemble(Oscillator), shared_folder), x_0=0.3)
    system.connect(chain["u[4]"], hand["support"])
    result = simulate(flatten(system, tmp_path), stop_time=2.0, step_size=0.1, tolerance=1e-11)
    assert result["chain.u[4]"][0] == 0.3
    energy = result["chain.energy"] + result["hand.energy"]
    assert np.ptp(energy) <= 1e-10  # nothing is lost between the two
