"""A host in C that loads the FMU where there is nothing else: no Python, no compiler, no environment."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from trial import Trial, every_component, every_version, rows, run

STEPS = 20  # of host.c


@pytest.fixture(scope="session")
def clean(tmp_path_factory, program) -> Callable[..., str]:
    """Run the host in a directory that is all there is: the host, the C library, the FMU's library and its plan."""
    root = tmp_path_factory.mktemp("root")
    entered = ["unshare", "--map-root-user", f"--root={root}"]
    if not shutil.which("unshare") or not shutil.which("ldd"):
        pytest.skip("unshare and ldd, which make a clean directory, are not installed")
    host = program("host")
    shutil.copy(host, root / "host")
    for library in re.findall(r"(/\S+)", subprocess.check_output(["ldd", host], text=True)):
        if Path(library).exists():
            (root / library[1:]).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(library, root / library[1:])
    if subprocess.run([*entered, "/host"], capture_output=True, check=False, env={}).stderr[:6] != b"usage:":
        pytest.skip("this user may not enter another root directory")

    def ran(trial: Trial, *command: str) -> str:
        for file in (trial.library, trial.plan):
            shutil.copy(file, root / file.name)
        return run(*entered, "/host", f"/{trial.library.name}", "/plan", *command, environment={})

    return ran


@every_version
@every_component
@pytest.mark.variants(quick=2, core="Pendulum-fmi2")
def test_life_in_a_clean_directory(clean, trial, name, version) -> None:
    """Load, step, save, restore, free; a fresh process goes on from the serialized state, to the last bit."""
    it = trial(name, version)
    life = clean(it, "life", f"/{name}{version}").splitlines()
    assert len(life) == 2 * STEPS
    assert np.all(np.isfinite(rows("\n".join(life))))
    assert clean(it, "resume", f"/{name}{version}").splitlines() == life[STEPS:]


@every_version
@every_component
@pytest.mark.variants(quick=2, core="Pendulum-fmi2")
def test_model_exchange_in_a_clean_directory(clean, trial, name, version) -> None:
    found = rows(clean(trial(name, version), "exchange"))
    assert found.shape[0] == 2 * STEPS
    assert np.all(np.isfinite(found))
