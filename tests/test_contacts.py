"""What takes no unilateral liaisons and no dry friction says so, by their names, with what to do instead."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from liaisons import (
    ActiveCoordinate,
    Coordinate,
    LiaisonsError,
    Mechanism,
    Parameter,
    analysis,
    build,
    dry_friction,
    ensemble,
    gradient,
    hold,
    identify,
    modelica,
    plan,
    sensitivities,
    unilateral,
)
from liaisons.mechanics import Model, assemble
from liaisons.mechanics.model import Contact
from liaisons.models import Pendulum

T = np.linspace(0.0, 1.0, 5)
PATH: dict[str, np.ndarray] = dict.fromkeys(("x", "x_dot", "z", "z_dot"), 0 * T)
DATA = {"time": T, "z": 1 - T}


class Sledge(Mechanism):
    """Body on a belt that moves up and along."""

    mass = Parameter(2.0, "kg", "mass", above=0)
    grip = Parameter(0.5, "1", "coefficient of friction", minimum=0)
    x = Coordinate("m", "place of the sledge")
    z = Coordinate("m", "height of the sledge", start=1.0)
    belt = ActiveCoordinate("m", "way of the belt")
    floor = ActiveCoordinate("m", "height of the belt")

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared({"x": self.x, "z": self.z})

    @unilateral("m", "distance of sledge and belt")
    def gap(self) -> ca.SX:
        return self.z - self.floor

    @dry_friction("m/s", "sliding of the sledge on the belt", static="grip", normal="gap")
    def slip(self) -> ca.SX:
        return self.dot(self.x - self.belt)


@pytest.fixture(scope="module")
def model() -> Model:
    """A model that has a contact."""
    return replace(assemble(Pendulum), contacts=(Contact("gap"), Contact("slip", friction=True)))


@pytest.mark.parametrize(
    ("call", "remedy"),
    [
        (lambda: ensemble(Sledge, {}, stop_time=1, step_size=0.1), r"take sweep\(\)"),
        (lambda: sensitivities(Sledge, by="z_0", stop_time=1), "give its .fmu file"),
        (lambda: gradient(Sledge, lambda z: z["z"][-1], by="z_0", stop_time=1, record="z"), "give its .fmu file"),
        (lambda: identify(Sledge, DATA, unknown=["z_0"]), r"sweep\(\)"),
        (lambda: plan(Sledge, "floor", end={"z": 2.0}, duration=1.0), "simulate this one with that motion"),
        (lambda: hold(Sledge, {"z": 0.0}, "floor"), "simulate this one with that motion"),
        (lambda: modelica(Sledge), "import its FMU"),
        (lambda: analysis.equilibrium(Sledge), "describe the mechanism without them"),
        (lambda: analysis.normal_modes(Sledge), "describe the mechanism without them"),
        (lambda: analysis.flow(Sledge, 1.0), "describe the mechanism without them"),
        (lambda: analysis.stationary_path(Sledge, T, PATH), "describe the mechanism without them"),
        (lambda: analysis.vakonomic_equations(Sledge), "describe the mechanism without them"),
        (lambda: analysis.virial(Sledge, T, PATH), "describe the mechanism without them"),
        (lambda: analysis.similarity(Sledge), "describe the mechanism without them"),
        (lambda: analysis.noether(Sledge, lambda _: {"x": 1}), "describe the mechanism without them"),
        (lambda: analysis.cyclic_coordinates(Sledge), "describe the mechanism without them"),
    ],
)
def test_class_is_refused(call: Callable[[], Any], remedy: str) -> None:
    with pytest.raises(LiaisonsError, match=rf"^Sledge: .* unilateral .* \(gap, slip\); .*{remedy}") as error:
        call()
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("call", "remedy"),
    [
        (lambda model, folder: build(model, folder, backend="python"), "backend='native'"),
        (lambda model, _: sensitivities(model, by="theta_0", stop_time=1), "give its .fmu file"),
        (lambda model, _: identify(model, {"time": T, "theta": T}, unknown=["theta_0"]), r"sweep\(\)"),
    ],
)
def test_model_is_refused(call: Callable[[Model, Path], Any], remedy: str, model: Model, tmp_path: Path) -> None:
    with pytest.raises(LiaisonsError, match=rf"^Pendulum: .* unilateral .* \(gap, slip\); .*{remedy}"):
        call(model, tmp_path)
    assert not list(tmp_path.iterdir())
