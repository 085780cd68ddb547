"""FMUs of the components in handmade.py and of the catalogue, each built and loaded once."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # handmade.py and driver.py are no tests, but theirs
sys.path.append(str(Path(__file__).parents[3] / "benchmarks"))  # stiff_problems.py

from driver import Library
from handmade import fall, kick, pendulum, ring
from wasm_driver import WasmLibrary

from liaisons.fmu import build
from liaisons.mechanics import Model, assemble

TARGETS: dict[str, dict[str, Any]] = {
    "fmi2": {"backend": "native"},
    "fmi3": {"backend": "native", "fmi": "3"},
    "python": {"backend": "python"},
    "wasm": {"fmi": "3", "platforms": "wasm"},
}
MODELS = {"pendulum": pendulum, "fall": fall, "kick": kick, "ring": lambda: ring(3)}


@pytest.fixture(params=range(3))
def mode(request) -> int:
    """Each input_reconstruction."""
    return request.param


@pytest.fixture(params=["fmi2", "python"])
def target(request) -> str:
    """Both back ends."""
    return request.param


@pytest.fixture(scope="session")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("fmus")


@pytest.fixture(scope="session")
def handmade(folder) -> Callable[[str, str], Library]:
    """The library of a component of handmade.py: ``handmade("pendulum", "fmi2")``."""
    return cache(lambda name, target: _loaded(MODELS[name](), folder, target))


@pytest.fixture(scope="session")
def library(shared_folder) -> Callable[..., Library]:
    """That of one of the catalogue: ``library(Swing)``, ``library(Swing, "fmi3")``."""
    return cache(lambda component, target="fmi2": _loaded(assemble(component), shared_folder, target))


def _loaded(model: Model, folder: Path, target: str) -> Library:
    if target == "wasm":  # apart from FMUs of which others expect no component
        return WasmLibrary(build(model, folder / "wasm", **TARGETS[target]))
    return Library(build(model, folder, **TARGETS[target]))


def _library(name: str, *targets: str) -> Any:
    """A fixture; what asks for it runs for each of the targets."""

    @pytest.fixture(scope="session", params=targets)
    def found(request, handmade) -> Library:
        return handmade(name, request.param)

    return found


pendulum_library, fall_library, kick_library, ring_library = (_library(name, "fmi2", "fmi3", "wasm") for name in MODELS)
every_pendulum, every_fall, every_kick, every_ring = (_library(name, "fmi2", "fmi3", "python") for name in MODELS)
native_pendulum = _library("pendulum", "fmi2", "fmi3")
pendulum2, ring2 = (_library(name, "fmi2") for name in ("pendulum", "ring"))
pendulum3, kick3, ring3 = (_library(name, "fmi3") for name in ("pendulum", "kick", "ring"))


@pytest.fixture(scope="session")
def pendulum_fmu(pendulum2) -> Path:
    return pendulum2.path
