"""FMUs that several tests sweep over."""

from __future__ import annotations

from pathlib import Path

import pytest

from liaisons import System, build
from liaisons.mechanics import assemble
from liaisons.models import Pendulum, Sinusoid


@pytest.fixture(scope="session")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("fmus")


@pytest.fixture(scope="session")
def pendulum(folder) -> Path:
    return build(assemble(Pendulum), folder, backend="native")


@pytest.fixture(scope="session")
def swing(pendulum, folder) -> System:
    """A pendulum whose length a Sinusoid moves."""
    system = System("swing")
    bob = system.add("bob", pendulum, theta_0=0.5)
    motor = system.add("motor", build(assemble(Sinusoid), folder, backend="native"), offset=1.0, angular_frequency=6.0)
    system.connect(motor["y"], bob["length"])
    return system
