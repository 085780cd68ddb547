"""FMUs of the components in handmade.py, built once for all tests of this folder."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # handmade.py and driver.py are no tests, but theirs

from driver import Library
from handmade import fall, kick, pendulum, ring

from liaisons.fmu import build
from liaisons.fmu.layout import Fmi

MODELS = {"pendulum": pendulum, "fall": fall, "kick": kick, "ring": lambda: ring(3)}


@pytest.fixture(scope="session")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("fmus")


@pytest.fixture(scope="session")
def handmade(folder) -> Callable[[str, Fmi], Library]:
    """The library of a component for a version of FMI: ``handmade("pendulum", "2")``."""
    return cache(lambda name, fmi: Library(build(MODELS[name](), folder, backend="native", fmi=fmi)))


def _library(name: str, *versions: Fmi) -> Any:
    """A fixture; what asks for it runs for each of the versions."""

    @pytest.fixture(scope="session", params=versions, ids=[f"fmi{version}" for version in versions])
    def library(request, handmade) -> Library:
        return handmade(name, request.param)

    return library


pendulum_library, fall_library, kick_library, ring_library = (_library(name, "2", "3") for name in MODELS)
pendulum2, ring2 = (_library(name, "2") for name in ("pendulum", "ring"))
pendulum3, kick3, ring3 = (_library(name, "3") for name in ("pendulum", "kick", "ring"))


@pytest.fixture(scope="session")
def pendulum_fmu(pendulum2) -> Path:
    return pendulum2.path
