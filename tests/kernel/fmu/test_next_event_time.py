"""The next event, announced: in initialization, of a flattened system, in WebAssembly; of tables see test_table.py."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Literal

import casadi as ca
import numpy as np
import pytest

from liaisons import System, flatten
from liaisons.cosim import simulate
from liaisons.language import Operator, Parameter
from liaisons.models import Flywheel, SmoothStep


class Pulses(Operator):
    """1 in each second interval of some length, 0 in the others."""

    half = Parameter(0.15, "s", "length of an interval", above=0)

    def signal(self, t: ca.SX) -> ca.SX:
        return ca.fmod(ca.floor(t / self.half + 1e-9), 2)

    def events(self) -> list[ca.SX]:
        k = ca.floor(self.clock / self.half)
        return [i * self.half for i in (k, k + 1, k + 2)]


@pytest.mark.parametrize("target", ["fmi2", "fmi3", "python", "wasm"])
def test_from_initialization_on(library, target: str) -> None:
    instance = library(SmoothStep, target).initializing(start_time=0.25, duration=0.5)
    assert instance["next_event_time"] == 0.25
    instance.set(start_time=0.5)
    assert instance["next_event_time"] == 0.5
    instance.set(start_time=0.25)
    instance.exit_initialization()
    seen = [instance["next_event_time"]]
    for t in (0.0, 0.25, 0.5):
        instance.step(t, 0.25)
        seen.append(instance["next_event_time"])
    assert seen == [0.25, 0.75, 0.75, sys.float_info.max]


def test_recurring_events_in_a_flattened_system_with_states(
    fmu, backend: Literal["native", "python"], tmp_path: Path
) -> None:
    """A wheel of 1 kg m2 under a torque that comes and goes: its momentum is the integral."""
    system = System("pulsed wheel")
    wheel = system.add("wheel", fmu(Flywheel), inertia=1.0, angle_dot_0=0.0)
    system.connect(system.add("torque", fmu(Pulses))["y"], wheel["angle_force"])
    path = flatten(system, tmp_path / "Wheel.fmu", components={"Pulses": Pulses}, backend=backend)
    names = ["next_event_time", "wheel.p_angle"]
    result = simulate(path, stop_time=1.0, step_size=0.1, record=names)
    t = result.time
    instants = 0.15 * np.arange(20)
    expected = [instants[instants > x + 1e-12][0] for x in t]
    np.testing.assert_allclose(result["next_event_time"], expected, rtol=1e-15)
    on = np.clip(t[:, None] - instants[1::2], 0, 0.15).sum(axis=1)
    np.testing.assert_allclose(result["wheel.p_angle"], on, rtol=0, atol=1e-8)  # tolerance of the solver
