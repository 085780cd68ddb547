"""What the README shows works as printed: here, in a clone, and from the wheel in an empty folder."""

from __future__ import annotations

import re
import runpy
import shlex
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import matplotlib.pyplot as plt
import numpy as np
import pytest
from PIL import Image

from liaisons.scenarios import names

from . import documents
from .conftest import Cli, Runs
from .documents import ROOT, blocks

# What stands for something else in a command.
MEANT = {"FMU": "fmus/Pendulum.fmu", "NAME": "free_fall"}

# Commands that are not run as they stand, and what is run in their place.
IN_PLACE = {
    "py -m venv .venv": "true",  # Windows
    ". .venv/bin/activate": ". .venv/bin/activate && liaisons list",
    "liaisons sweep": "liaisons sweep --help",  # a name, not a command
    "liaisons run --all": "true",  # see test_all_scenarios_from_the_wheel
    "lint-imports": "python -c 'from importlinter.cli import lint_imports_command as lint; lint()' --no-cache",
    "pytest tests/conformance": "python -m pytest --collect-only --quiet tests/conformance",
    "pytest tests/conformance -m slow": "python -m pytest --collect-only --quiet tests/conformance -m slow",
    # hours, and peers that are not here
    "pip install --editable '.[bench]' && python benchmarks": "python benchmarks --only '' --output page",
}
COMMANDS = documents.inline_commands("README.md")
OF_A_CLONE = r"\.venv|\. \.venv|pip|python|py |pytest|lint-imports"


def spelled(command: str) -> str:
    """A command of the README with what its capital words stand for."""
    return IN_PLACE.get(command) or re.sub(r"\b(FMU|NAME)\b", lambda word: MEANT[word[0]], command)


def python_block(word: str) -> str:
    """The block of Python with this word in it."""
    (block,) = [block for block in blocks("README.md", "python") if word in block]
    return block


def lines_of_python() -> str:
    """The block of the system, and the calls that the text says can follow."""
    calls = [call.replace("(...)", '("a.csv")') for call in documents.inline_python("README.md")]
    # pictures are shown in a window; a result has the signals that the text speaks of
    calls = [f"single.{call[7:]}" if call.startswith("result.") and '"theta"' in call else call for call in calls]
    before = ["import liaisons, matplotlib", "matplotlib.use('Agg')", "a = b = result", "result.to_csv('b.csv')"]
    single = "single = liaisons.simulate('Pendulum', stop_time=1.0)"
    return "\n".join([python_block("System("), *before, single, *calls, "assert result['lower.theta'][0] == -0.2"])


def write_files(folder: Path) -> None:
    """What the commands find where they are run: components and scenarios that the reader has written."""
    component, *_ = blocks("CONTRIBUTING.md", "python")
    (folder / "my_component.py").write_text(component, encoding="utf-8")
    (folder / "small_angle.py").write_text(python_block("@scenario"), encoding="utf-8")
    (folder / "lines.py").write_text(lines_of_python(), encoding="utf-8")
    (folder / "sweep.py").write_text(f"{python_block('sweep(')}\nassert table['x'].shape == (6,)\n", encoding="utf-8")


@pytest.mark.usefixtures("liaisons")
def test_the_lines_that_move(tmp_path: Path) -> None:
    exec(python_block("animate("), {})
    assert (tmp_path / "swing.gif").read_bytes()[:6] == b"GIF89a"
    assert (tmp_path / "pendulum.html").stat().st_size > 50_000


@pytest.mark.slow  # 271 frames
def test_the_first_image_is_made_by_the_command_beside_it(liaisons: Cli, tmp_path: Path) -> None:
    command, _ = documents.console("README.md")[0]
    assert liaisons(*shlex.split(command)[1:]).status == 0
    shown = ROOT / "docs" / "pumped_swing.gif"
    assert shown.stat().st_size <= 600_000
    with Image.open(shown) as committed, Image.open(tmp_path / "pumped_swing.gif") as made:
        frames: list[Any] = [committed, made]
        assert frames[0].n_frames == frames[1].n_frames
        assert committed.size == made.size
        for k in (0, frames[0].n_frames // 2, frames[0].n_frames - 1):
            pixels = []
            for image in frames:
                image.seek(k)
                pixels.append(np.asarray(image.convert("L"), dtype=float))
            assert np.mean(np.abs(pixels[0] - pixels[1])) < 0.5  # of 255; versions of matplotlib smooth differently


def test_the_readme_has_two_commands_first() -> None:
    main, test, *_ = blocks("README.md", "sh")
    assert main.count("\n") == test.count("\n") == 1
    *_, words = main.rpartition("liaisons ")
    assert words.split()[0] == "run"
    assert "pytest" in test


def go_through(folder: Path, runs: Callable[[str], str]) -> None:
    """Type everything, in the order of the page."""
    write_files(folder)
    for command, printed in documents.console("README.md"):
        assert printed in {"", runs(command).replace(f"{folder}/", "")}, command
    for script in ("lines.py", "sweep.py"):
        runs(f"python {script}")
    runs("liaisons run small_angle.py")
    ours = [command for command in COMMANDS if command.startswith("liaisons ")]
    assert len(ours) >= 7
    for command in ours:
        runs(spelled(command))
    for file in ("figures/small_angle.png", "Pendulum.png", "fmus/TurningParabola.fmu"):
        assert (folder / file).is_file()


def test_here(runs: Runs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What stands in the page, in this process."""
    monkeypatch.setattr(plt, "show", lambda: None)

    def here(command: str) -> str:
        program, *words = shlex.split(command)
        if program == "python":
            runpy.run_path(words[0])
            plt.close("all")
        return runs(*words) if program == "liaisons" else ""

    go_through(tmp_path, here)


@pytest.mark.slow
def test_in_a_clone(tmp_path: Path) -> None:
    """The commands as they stand; only what the new environment would download, it sees here."""
    place = documents.clone(tmp_path / "liaisons")
    main, test, *_ = blocks("README.md", "sh")
    make, *rest = main.split("&&")
    assert "venv" in place.runs(f"{make} && ls -a")
    documents.see_packages(place.folder / ".venv")
    assert "figure: scenarios/figures/pumped_swing.png" in place.runs("&&".join(rest))
    assert "tests collected" in place.runs(
        test.strip().replace(".venv/bin/pytest", ".venv/bin/python -m pytest --collect-only --quiet")
    )
    go_through(place.folder, place.runs)
    for command in COMMANDS:
        if re.match(OF_A_CLONE, command):
            place.runs(spelled(command))
    assert (place.folder / "page" / "README.md").is_file()


@pytest.mark.slow
def test_from_the_wheel_in_an_empty_folder(tmp_path: Path) -> None:
    place = documents.empty_folder(tmp_path)
    main, *_ = blocks("README.md", "sh")
    *_, run = main.strip().split("/")
    assert "figure: figures/pumped_swing.png" in place.runs(run)
    go_through(place.folder, place.runs)
    assert str(ROOT) not in place.runs("python -c 'import liaisons; print(liaisons.__file__)'")


@pytest.mark.slow
def test_all_scenarios_from_the_wheel(tmp_path: Path) -> None:
    place = documents.empty_folder(tmp_path)
    out = place.runs("liaisons run --all")
    figures = {line.removeprefix("figure: ") for line in out.splitlines() if line.startswith("figure: ")}
    assert figures == {f"figures/{name}.png" for name in names()}
    assert all((place.folder / figure).is_file() for figure in figures)
    assert sorted(path.name for path in place.folder.iterdir()) == ["figures", "fmus"]


@pytest.mark.slow
def test_the_whole_catalogue_from_the_wheel(tmp_path: Path) -> None:
    place = documents.empty_folder(tmp_path)
    built = place.runs("liaisons build").split()
    assert {Path(path).stem for path in built} == {
        line.split()[0] for line in place.runs("liaisons list").splitlines()[2:] if not line.startswith(" ")
    }


def test_the_wheel_has_the_scenarios_and_nothing_that_was_built(tmp_path: Path) -> None:
    with ZipFile(documents.wheel(tmp_path)) as archive:
        members = archive.namelist()
    inside = {Path(member).stem for member in members if member.startswith("liaisons/_scenarios/")}
    assert inside == set(names())
    assert not {Path(member).suffix for member in members} & {".fmu", ".png", ".pyc", ".so"}


def test_scenarios_of_the_package_are_found_behind_those_of_the_folder(
    liaisons: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As it is outside of a clone; figures land where we are."""
    shipped, own = tmp_path / "package", tmp_path / "scenarios"
    for folder in (shipped, own):
        folder.mkdir()
    shutil.copy(ROOT / "scenarios" / "free_fall.py", shipped / "twice.py")
    scenario = '"""Nothing is wrong."""\n\nfrom liaisons import *\n\n\n@scenario\ndef main(claim):\n'
    scenario += '    panels(("", "", ""))\n    claim("nothing", 0, 0, within(0, because="whole numbers"))\n'
    (shipped / "theirs.py").write_text(scenario)
    (own / "twice.py").write_text(scenario)
    monkeypatch.setattr("liaisons.project._root", Path)
    monkeypatch.setattr("liaisons.project._SHIPPED", shipped)
    assert names() == ["theirs", "twice"]
    reply = liaisons("run", "--all")
    assert reply.status == 0, reply.out + reply.err
    assert "figure: figures/theirs.png\n" in reply.out
    assert "figure: scenarios/figures/twice.png\n" in reply.out
    assert (tmp_path / "figures" / "theirs.png").is_file()
    assert (own / "figures" / "twice.png").is_file()
