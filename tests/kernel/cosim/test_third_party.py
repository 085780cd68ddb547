"""FMUs that tools of others have made, of FMI 2.0 and 3.0, in one system with ours."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from making import FmuPaths, read

from liaisons.check import slope
from liaisons.cosim import System

SPRING_2 = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Real

class Spring2(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.stretch, self.stiffness, self.force = 0.0, 2.0, 0.0
        self.register_variable(Real("stretch", causality=Fmi2Causality.input))
        self.register_variable(Real("stiffness", causality=Fmi2Causality.parameter))
        self.register_variable(Real("force", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.force = -self.stiffness * self.stretch
        return True
"""

SPRING_3 = """
from pythonfmu3 import Fmi3Causality, Fmi3Slave, Fmi3Variability, Float64

class Spring3(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time, self.stretch, self.stiffness, self.pull = 0.0, 0.0, 2.0, 0.0
        time = Float64("time", causality=Fmi3Causality.independent, variability=Fmi3Variability.continuous)
        self.register_variable(time)
        self.register_variable(Float64("stretch", causality=Fmi3Causality.input))
        tunable = Fmi3Variability.tunable
        self.register_variable(Float64("stiffness", causality=Fmi3Causality.parameter, variability=tunable))
        self.register_variable(Float64("pull", causality=Fmi3Causality.output))

    def do_step(self, current_time, step_size):
        self.pull = self.stiffness * self.stretch
        return True
"""


def _made(package: str, script: str, name: str, folder: Path) -> Path:
    pytest.importorskip(package)
    builder: Any = import_module(f"{package}.builder")
    (folder / f"{name}.py").write_text(script)
    return builder.FmuBuilder.build_FMU(folder / f"{name}.py", dest=folder)


def test_mass_of_ours_on_springs_of_others(component: FmuPaths, tmp_path: Path) -> None:
    two = _made("pythonfmu", SPRING_2, "spring2", tmp_path)
    three = _made("pythonfmu3", SPRING_3, "spring3", tmp_path)
    assert [read(path).version for path in (two, three)] == [2, 3]
    system = System("two springs")
    mass = system.add("mass", component("Oscillator"), stiffness=0.0, x_0=1.0, mass=2.0)
    for path, force, target in ((two, "force", "x_force"), (three, "pull", "x_load")):
        spring = system.add(path.stem, path, stiffness=3.0)
        system.connect(mass["x"], spring["stretch"])
        system.connect(spring[force], mass[target])

    def error(H: float) -> float:
        result = system.simulate(2.0, H)
        return float(np.max(np.abs(result["mass.x"] - np.cos(np.sqrt(3.0) * result.time))))  # (3 + 3) N/m on 2 kg

    sizes = (0.02, 0.01, 0.005)
    errors = [error(H) for H in sizes]
    # the springs hold what they were given: the force is late by a step, which is negative damping, κ H x'/2
    assert slope(sizes, errors) == pytest.approx(1.0, abs=0.1)
    assert errors[-1] < 0.05
