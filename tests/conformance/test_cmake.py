"""The sources of our FMUs in a build of another make: the project that FMPy makes of an FMU."""

from __future__ import annotations

import shutil
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.util import create_cmake_project
from trial import Version, every_version, run

from liaisons.base import compiler

# With inputs; without states; with arrays in FMI 3.0.
COMPONENTS = ["Pendulum", *(pytest.param(name, marks=pytest.mark.slow) for name in ("SmoothStep", "OscillatorChain"))]


@every_version
@pytest.mark.parametrize("name", COMPONENTS)
@pytest.mark.variants(core=0)
def test_project_of_fmpy_builds_a_library_that_works(fmu, tmp_path: Path, name: str, version: Version) -> None:
    """It defines macros that are called like types of FMUs, and compiles with the headers that FMPy has."""
    cmake = shutil.which("cmake")
    if cmake is None or not compiler.system_compiler():
        pytest.skip("cmake and a C compiler are not installed")
    path = fmu(name, version)
    project, build = tmp_path / "project", tmp_path / "build"
    project.mkdir()
    create_cmake_project(str(path), str(project))
    shutil.rmtree(project / "binaries")  # what is used below is compiled anew
    run(cmake, "-S", project, "-B", build)
    run(cmake, "--build", build)
    made = project / f"{name}.fmu"
    expected, found = (fmpy.simulate_fmu(str(it), stop_time=1.0, output_interval=0.1) for it in (path, made))
    assert found.dtype == expected.dtype
    for variable in expected.dtype.names or ():
        # the same C with other flags: sums may be rounded otherwise
        np.testing.assert_allclose(found[variable], expected[variable], rtol=1e-9, atol=1e-9)
