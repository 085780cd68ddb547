"""Each FMU against the reference results that it carries: fmpy runs it, and the numbers agree."""

from __future__ import annotations

import csv
import io
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest
from trial import COMPONENTS, every_component, every_version

from liaisons.mechanics import assemble

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"

pytestmark = pytest.mark.slow


def table(path: Path, file: str) -> tuple[list[str], np.ndarray]:
    """Names of the columns, and the numbers; an array of FMI 3.0 has several in a cell."""
    with zipfile.ZipFile(path) as archive:
        text = archive.read(f"{FOLDER}/{file}").decode()
    head, *rows = csv.reader(io.StringIO(text))
    return head, np.array([[float(number) for cell in row for number in cell.split()] for row in rows])


def starts(path: Path, file: str) -> dict[str, float]:
    """The parameter set."""
    with zipfile.ZipFile(path) as archive:
        root = ElementTree.fromstring(archive.read(f"{FOLDER}/{file}"))
    return {p.attrib["name"]: float(p[0].attrib["value"]) for p in root.iter() if p.tag.endswith("}Parameter")}


def related(path: Path) -> dict[str, str]:
    """Files by their roles."""
    with zipfile.ZipFile(path) as archive:
        root = ElementTree.fromstring(archive.read(f"{FOLDER}/fmi-ls-manifest.xml"))
    return {element.attrib["role"]: element.attrib["source"] for element in root}


@every_version
@every_component
def test_fmu_agrees_with_its_own_reference_results(name: str, version: str, fmu) -> None:
    path = fmu(name, version)
    files = related(path)
    if assemble(COMPONENTS[name]).contacts:  # nothing that goes through them is independent of the FMU
        assert "result" not in files
        return
    head, expected = table(path, files["result"])
    moved: dict[str, Any] = {}
    if "testcase" in files:
        names, rows = table(path, files["testcase"])
        moved["input"] = np.array([tuple(row) for row in rows], dtype=[(column, float) for column in names])
    experiment = assemble(COMPONENTS[name]).experiment
    result = fmpy.simulate_fmu(
        str(path),
        output=head[1:],
        output_interval=experiment.stop_time / 100,
        fmi_type="CoSimulation",
        start_values=starts(path, files["parameter"]) if "parameter" in files else {},
        **moved,
    )
    computed = np.hstack([np.reshape(result[column], (len(result), -1)) for column in head])
    assert computed.shape == expected.shape
    np.testing.assert_allclose(computed[:, 0], expected[:, 0], rtol=1e-8, atol=1e-12)
    for k in range(1, expected.shape[1]):
        size = max(np.max(np.abs(expected[:, k])), 1e-6)
        # The FMU keeps 0.02 of its tolerance of 1e-8 in each of some hundred steps; the table has nine digits.
        np.testing.assert_allclose(computed[:, k] / size, expected[:, k] / size, rtol=0, atol=1e-7)
