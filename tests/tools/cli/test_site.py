"""Pages of the site work as printed: Getting started, the component of its tutorial, all notebooks in empty folders."""

from __future__ import annotations

import json
import shlex
import subprocess
import sys
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from . import documents
from .conftest import Runs
from .documents import ROOT, VariableReference, blocks, cells, console, written

START = "docs/getting-started.md"
COMPONENT = "docs/tutorials/write-a-component.md"
NOTEBOOKS = [page for page in documents.PAGES if cells(page)]

_RUN = """
import json, sys
import nbclient, nbformat

cells = [nbformat.v4.new_code_cell(cell) for cell in json.load(sys.stdin)]
nbclient.NotebookClient(nbformat.v4.new_notebook(cells=cells), timeout=600).execute()
"""


def typed(command: str) -> str:
    """What is typed where nobody looks at a browser."""
    return f"{command} --no-open" if command.startswith("liaisons show") else command


@pytest.mark.slow
def test_getting_started(runs: Runs, tmp_path: Path) -> None:
    (script,) = blocks(START, "python")
    for command, printed in console(START):
        if command == "python pumped.py":
            exec(script, {})
        else:
            out = runs(*shlex.split(typed(command))[1:])
            assert printed in {"", out.replace(f"{tmp_path}/", "")}
    for made in ("Pendulum.png", "Pendulum.html", "pumped_swing.gif", "pumped.png"):
        assert (tmp_path / made).stat().st_size > 10_000


@pytest.mark.slow  # the site runs these cells, too
def test_the_component_of_the_tutorial(runs: Runs, tmp_path: Path) -> None:
    for name, content in written(COMPONENT).items():
        (tmp_path / name).write_text(content)
    component = (tmp_path / "turning_parabola.py").read_text()
    assert len([line for line in component.splitlines() if line.strip()]) <= 50  # about 40 lines, as promised

    for line in "".join(cells(COMPONENT)).splitlines():
        if line.startswith("!liaisons"):
            out = runs(*shlex.split(line)[1:])
            if "simulate" in line:  # the prescribed motion is a whole one: an angle that grows as its rate says
                shown = {row.split()[0]: row.split()[1:] for row in out.splitlines()}
                angle, rate = (float(shown[name][2]) for name in ("turn", "turn_dot"))
                assert angle == pytest.approx(4 * rate, rel=1e-5)  # six digits are printed
    assert (tmp_path / "TurningParabola.png").is_file()

    scope: dict[str, Any] = {}
    exec(next(cell for cell in cells(COMPONENT) if "plan(" in cell), scope)
    assert all(verdict.passed for verdict in scope["motion"].verify())

    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-W", "error", "test_turning_parabola.py"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert " passed" in done.stdout, done.stdout
    assert done.returncode == 0, done.stdout


@pytest.fixture(scope="module", params=["wheel", "editable"])
def place(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> VariableReference:
    """An empty folder and an environment, for all pages; commands that fail are errors."""
    folder = tmp_path_factory.mktemp(request.param)
    wheel = request.param == "wheel"
    empty = documents.empty_folder(folder) if wheel else documents.empty_folder_beside_a_clone(folder)
    return replace(empty, environment={**empty.environment, "IPYTHONDIR": str(ROOT / "docs" / "_ipython")})


@pytest.mark.slow
def test_getting_started_in_an_empty_folder(place: VariableReference) -> None:
    (script,) = blocks(START, "python")
    (place.folder / "pumped.py").write_text(script, encoding="utf-8")
    for command, printed in console(START):
        assert printed in {"", place.runs(typed(command))}


@pytest.mark.slow
@pytest.mark.parametrize("page", NOTEBOOKS)
def test_notebooks_in_an_empty_folder(page: str, place: VariableReference) -> None:
    editable = place.folder.name.startswith("editable")
    if editable and "tutorials" not in page:
        pytest.skip("tried with the wheel")
    masters = [module for module in ("ecospy", "libcosimpy") if module in "".join(cells(page))]
    needed = ["nbclient", "ipykernel", *masters]
    if missing := [module for module in needed if find_spec(module) is None]:
        pytest.skip(f"not installed: {', '.join(missing)}")
    ours = f"import liaisons; assert ({str(ROOT)!r} in liaisons.__file__) is {editable}"
    (place.folder / "run.py").write_text(_RUN)
    (place.folder / "cells.json").write_text(json.dumps([ours, *cells(page)]))
    place.runs("python run.py < cells.json")
