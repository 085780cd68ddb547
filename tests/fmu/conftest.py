"""FMUs of the components in handmade.py, built once for all tests of this folder."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))  # handmade.py and driver.py are no tests, but theirs

from driver import Library
from driver3 import Library3
from handmade import fall, kick, pendulum, ring

from liaisons.fmu import build


@pytest.fixture(scope="session")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("fmus")


@pytest.fixture(scope="session")
def pendulum_fmu(folder) -> Path:
    return build(pendulum(), folder, backend="native")


@pytest.fixture(scope="session")
def pendulum_library(pendulum_fmu) -> Library:
    return Library(pendulum_fmu)


@pytest.fixture(scope="session")
def fall_library(folder) -> Library:
    return Library(build(fall(), folder, backend="native"))


@pytest.fixture(scope="session")
def kick_library(folder) -> Library:
    return Library(build(kick(), folder, backend="native"))


@pytest.fixture(scope="session")
def pendulum3(folder) -> Library3:
    return Library3(build(pendulum(), folder, backend="native", fmi="3"))


@pytest.fixture(scope="session")
def fall3(folder) -> Library3:
    return Library3(build(fall(), folder, backend="native", fmi="3"))


@pytest.fixture(scope="session")
def kick3(folder) -> Library3:
    return Library3(build(kick(), folder, backend="native", fmi="3"))


@pytest.fixture(scope="session")
def ring_library(folder) -> Library:
    return Library(build(ring(3), folder, backend="native"))


@pytest.fixture(scope="session")
def ring3(folder) -> Library3:
    return Library3(build(ring(3), folder, backend="native", fmi="3"))
