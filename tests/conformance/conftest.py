"""The FMUs of the catalogue, built once, and the C programs that they are put through."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "kernel/fmu"))  # driver.py and
sys.path.insert(0, str(Path(__file__).parent))  # trial.py are no tests, but theirs

from trial import COMPONENTS, SOURCES, Trial, Version, compile_program, unpack

from liaisons.fmu import build
from liaisons.mechanics import assemble


@pytest.fixture(scope="session")
def fmu(shared_folder: Path) -> Callable[[str, Version], Path]:
    """The FMU of a component for a version of FMI, built once: ``fmu("Pendulum", "2")``."""

    @cache
    def built(name: str, version: Version) -> Path:
        return build(assemble(COMPONENTS[name]), shared_folder, backend="native", fmi=version)

    return built


@pytest.fixture(scope="session")
def trial(fmu, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, Version], Trial]:
    """An FMU of the catalogue, unpacked: ``trial("Pendulum", "2")``."""

    @cache
    def unpacked(name: str, version: Version) -> Trial:
        return unpack(fmu(name, version), tmp_path_factory.mktemp(name))

    return unpacked


@pytest.fixture(scope="session")
def program(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """One of our C programs, ``program("host")``, perhaps with more flags for the compiler."""
    directory = tmp_path_factory.mktemp("programs")

    @cache
    def compiled(name: str, *flags: str) -> Path:
        output = directory / "".join(c if c.isalnum() else "_" for c in name + "".join(flags))
        return compile_program([SOURCES / f"{name}.c", SOURCES / "fmu.c"], output, flags)

    return compiled
