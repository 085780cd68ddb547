"""What the README shows works as printed: here, in a clone, and from the wheel in an empty folder."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
import pytest
import typer.main
from PIL import Image

from liaisons.models import Pendulum
from liaisons.scenario_files import scenario_files
from liaisons_tools.cli import main as command_line
from liaisons_tools.cli._command import application
from liaisons_tools.scenarios import names

from . import documents
from .conftest import Cli
from .documents import ROOT, blocks


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


@pytest.mark.variants(core=0)
def test_the_readme_identifies_a_pendulum(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    times = np.arange(100) / 20
    degrees = np.degrees(Pendulum.exact(times, length=1.2, theta_0=0.3)["theta"]) + np.tile([0.1, -0.1], 50)
    np.savetxt(
        tmp_path / "measured.csv", np.transpose([times, degrees]), delimiter=",", header="time,theta [deg]", comments=""
    )
    monkeypatch.chdir(tmp_path)
    namespace: dict[str, Any] = {}
    exec("".join(blocks("README.md", "python")), namespace)
    assert namespace["fit"].values["length"] == pytest.approx(1.2, rel=1e-3)
    assert (tmp_path / "fit.png").is_file()


LINKS = [
    (page, target)
    for page in documents.PAGES
    for target in re.findall(r"\]\((?!http|#)([^)\s]+)\)", (ROOT / page).read_text(encoding="utf-8"))
]


@pytest.mark.variants(quick=None)
@pytest.mark.parametrize(("page", "target"), LINKS)
def test_links_between_files_lead_somewhere(page: str, target: str) -> None:
    """As one reads them in the repository; those of the site are seen to when it is built."""
    file = ROOT / page / ".." / target.partition("#")[0]
    generated = {f"docs/reference/{name}.md" for name in ("commands", "catalogue", "crossings", "texts")}
    generated |= {f"docs/gallery/{name}.md" for name in scenario_files()}
    assert file.resolve().exists() or str(file.resolve().relative_to(ROOT)) in generated


@pytest.mark.parametrize("page", [page for page in documents.PAGES if documents.inline_commands(page)])
def test_commands_in_the_text_are_there(page: str) -> None:
    """Each that is more than a name is understood, option by option."""
    for command in documents.inline_commands(page):
        name, *words = shlex.split(command)[1:]
        assert command_line([name, "--help"]) == 0
        if words:
            typer.main.get_command(application).commands[name].make_context(name, words)  # type: ignore[attr-defined]


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
    for command, printed in documents.console("README.md"):
        assert printed in {"", place.runs(command)}
    place.runs("python -c 'from importlinter.cli import lint_imports_command as lint; lint()' --no-cache")
    place.runs("python -m pytest --collect-only --quiet tests/conformance -m slow")
    place.runs("python benchmarks --only '' --output page")  # hours, and peers that are not here
    assert (place.folder / "page" / "README.md").is_file()


@pytest.mark.slow
def test_from_the_wheel_in_an_empty_folder(tmp_path: Path) -> None:
    place = documents.empty_folder(tmp_path)
    main, *_ = blocks("README.md", "sh")
    *_, run = main.strip().split("/")
    assert "figure: figures/pumped_swing.png" in place.runs(run)
    for command, printed in documents.console("README.md"):
        assert printed in {"", place.runs(command)}
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
        line.split()[0] for line in place.runs("liaisons list all").splitlines()[2:] if not line.startswith(" ")
    }


def test_the_wheel_has_the_scenarios_and_nothing_that_was_built(tmp_path: Path) -> None:
    with ZipFile(documents.wheel(tmp_path)) as archive:
        members = archive.namelist()
    inside = {Path(member).stem for member in members if member.startswith("liaisons/_scenarios/")}
    assert inside == {*names(), "gallery"}
    assert "liaisons_pages/companion/texts.toml" in members
    assert not {Path(member).suffix for member in members} & {".fmu", ".png", ".pyc", ".so"}


def test_scenarios_of_the_package_are_found_behind_those_of_the_folder(
    liaisons: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As it is outside of a clone; figures land where we are."""
    shipped, own = tmp_path / "package", tmp_path / "scenarios"
    for folder in (shipped, own):
        folder.mkdir()
    shutil.copy(ROOT / "scenarios" / "free_fall.py", shipped / "twice.py")
    scenario = '"""Nothing is wrong."""\n\nfrom liaisons_tools.scenarios import *\n\n\n@scenario\ndef main(claim):\n'
    scenario += '    panels(("", "", ""))\n    claim("nothing", 0, 0, within(0, because="whole numbers"))\n'
    (shipped / "theirs.py").write_text(scenario)
    (shipped / "gallery.toml").write_text("[themes]\n")
    (own / "twice.py").write_text(scenario)
    for name in ("_OURS", "_SHIPPED"):
        monkeypatch.setattr(f"liaisons.scenario_files.{name}", shipped)
    assert names() == ["theirs", "twice"]
    reply = liaisons("run", "--all")
    assert reply.status == 0, reply.out + reply.err
    assert "figure: figures/theirs.png\n" in reply.out
    assert "figure: scenarios/figures/twice.png\n" in reply.out
    assert (tmp_path / "figures" / "theirs.png").is_file()
    assert (own / "figures" / "twice.png").is_file()
