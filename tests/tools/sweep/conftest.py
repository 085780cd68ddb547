"""FMUs that several tests sweep over."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from liaisons import System
from liaisons.models import Pendulum, Sinusoid


@pytest.fixture(scope="session")
def pendulum(fmu) -> Path:
    return fmu(Pendulum)


@pytest.fixture(scope="session")
def swing(pendulum, fmu) -> System:
    """A pendulum whose length a Sinusoid moves."""
    system = System("swing")
    bob = system.add("bob", pendulum, theta_0=0.5)
    motor = system.add("motor", fmu(Sinusoid), offset=1.0, angular_frequency=6.0)
    system.connect(motor["y"], bob["length"])
    return system


@pytest.fixture(scope="session")
def client() -> Iterator[Any]:
    """Of a Dask cluster of two workers on this machine."""
    distributed = pytest.importorskip("distributed")
    options = {"n_workers": 2, "threads_per_worker": 1, "processes": True, "dashboard_address": ":0"}  # any free port
    with distributed.LocalCluster(**options) as cluster, distributed.Client(cluster) as client:
        yield client


@pytest.fixture(params=["here", "Dask"])
def where(request: pytest.FixtureRequest) -> dict[str, Any]:
    """By which processes a sweep is done: two of this machine, or those of a Dask cluster."""
    return {"workers": 2} if request.param == "here" else {"client": request.getfixturevalue("client")}
