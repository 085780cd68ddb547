"""``liaisons build``."""

import os
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from fmpy import read_model_description
from fmpy.validation import validate_fmu

from liaisons.errors import ProjectError
from liaisons.library import catalogue, catalogue_names, fmu_path

from .conftest import COMMAND, Cli, Runs, is_misuse
from .documents import ROOT

NOT_IN_PYTHON = {
    "BallRow",
    "BeadOnSphere",
    "BouncingBall",
    "DryOscillator",
    "ForceRegulator",
    "Pid",
    "Regulator",
    "StringPendulum",
}
"""Components with contacts, and those that take samples."""


@pytest.mark.parametrize(("backend", "file"), [("native", "Bead.fmu"), ("python", "python/Bead.fmu")])
def test_a_file_of_a_user(runs: Runs, bead: Path, backend: str, file: str) -> None:
    fmu = Path("fmus", file)  # where we are, and not where the package is
    assert Path(runs("build", f"{bead}:Bead", "--backend", backend).strip()) == fmu
    assert read_model_description(fmu).modelName == "Bead"
    assert validate_fmu(str(fmu)) == []


def test_all_components_of_a_file_go_where_output_says(runs: Runs, bead: Path, tmp_path: Path) -> None:
    runs("build", bead, "--backend", "python", "--output", "out")
    assert sorted(path.name for path in tmp_path.rglob("*.fmu")) == ["Bead.fmu", "Parabola.fmu"]
    assert len(list((tmp_path / "out").rglob("*.fmu"))) == 2


@pytest.mark.variants(core=0)
def test_many_are_built_on_all_cores_and_named_in_order(
    liaisons: Cli, runs: Runs, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    names = ["SmoothStep", "Constant", "Ramp", "Sinusoid", "Flywheel", "FourierSeries", "Pendulum", "Oscillator"]
    assert [Path(line).stem for line in runs("build", *names, "--backend", "python").splitlines()] == names
    (tmp_path / "fmus" / "python" / "Ramp.fmu").unlink()
    (tmp_path / "fmus" / "python" / "Ramp.fmu").mkdir()  # cannot be written there
    reply = liaisons("build", *names, "--backend", "python")
    assert is_misuse(reply, "Ramp.fmu")
    assert [Path(line).stem for line in reply.out.splitlines()] == names[:2]  # nor a thread that reports an error


@pytest.mark.variants(core=0)
def test_what_a_back_end_cannot_do_is_left_out_with_a_line_at_the_end(
    liaisons: Cli, declare: Callable[[str], int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    declare('components = ["Constant", "DryOscillator", "Pid", "Ramp", "BouncingBall"]')
    reply = liaisons("build", "--backend", "python")
    assert (reply.status, reply.out) == (0, "fmus/python/Constant.fmu\nfmus/python/Ramp.fmu\n".replace("/", os.sep))
    dry, pid, ball = reply.err.splitlines()
    assert pid == "left out: Pid: FMUs in Python take no samples; take backend='native'"
    assert dry.startswith("left out: DryOscillator: the Python back end takes no unilateral liaisons and no dry")
    assert dry.endswith("(slip); take backend='native'")
    assert "BouncingBall" in ball
    assert liaisons("build", "Constant", "BouncingBall", "--backend", "python").status == 2  # it has been named


def test_another_size_has_a_folder_of_its_own(runs: Runs) -> None:
    chain = Path("fmus", "n=3", "OscillatorChain.fmu")
    assert runs("build", "OscillatorChain", "--size", "n=3").strip() == str(chain)
    built = chain.stat().st_mtime_ns
    shown = runs("simulate", "OscillatorChain", "--size", "n=3", "--stop", "0.1")
    assert ("\nu[3] " in shown, "\nu[4] " in shown) == (True, False)
    assert "\nu[4] " in runs("simulate", "OscillatorChain", "--stop", "0.1")
    runs("animate", "OscillatorChain", "--size", "n=3", "--stop", "0.1", "--output", "chain.png")
    assert chain.stat().st_mtime_ns == built


def test_both_versions(runs: Runs, bead: Path) -> None:
    fmus = [Path("fmus", "Bead.fmu"), Path("fmus", "fmi3", "Bead.fmu")]
    printed = runs("build", f"{bead}:Bead", "--backend", "native", "--fmi", "both").splitlines()
    assert [Path(line) for line in printed] == fmus
    assert [read_model_description(fmu).fmiVersion for fmu in fmus] == ["2.0", "3.0"]


def test_no_name_builds_what_is_declared(runs: Runs, declare: Callable[[str], int], tmp_path: Path) -> None:
    declare('components = ["Constant", "Flywheel"]')
    runs("build", "--backend", "python")
    assert sorted(path.name for path in tmp_path.rglob("*.fmu")) == ["Constant.fmu", "Flywheel.fmu"]


@pytest.fixture
def declare(tmp_path: Path) -> Callable[[str], int]:
    """Write a declaration: ``fmus/fmus.toml`` of the working directory."""
    (tmp_path / "fmus").mkdir()
    return (tmp_path / "fmus" / "fmus.toml").write_text


def test_without_a_declaration_the_catalogue_is_built(runs: Runs, monkeypatch: pytest.MonkeyPatch) -> None:
    built: list[str] = []
    monkeypatch.setattr("os.cpu_count", lambda: 1)  # all in this process, where nothing is built
    monkeypatch.setattr("liaisons.fmu.build", lambda model, *_, **__: built.append(model.name) or Path(model.name))
    assert runs("build").split() == built == list(catalogue())


@pytest.mark.parametrize("text", ["components = [", "names = []", "components = 3"])
def test_a_bad_declaration_file(liaisons: Cli, declare: Callable[[str], int], text: str) -> None:
    declare(text)
    assert is_misuse(liaisons("build"), "fmus.toml", "components = [")


def test_this_project_builds_its_whole_catalogue(liaisons: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    assert liaisons("list").out.startswith(liaisons("list", "all").out)  # scenarios follow


def test_an_interrupt_leaves_nothing(
    liaisons: Cli, bead: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("zipfile.ZipFile.writestr", interrupted)
    reply = liaisons("build", bead, "--backend", "python")
    assert (reply.status, reply.err) == (130, "liaisons: interrupted\n")
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == [bead]


def test_fmu_path_builds_what_is_missing_and_keeps_what_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bead: Path
) -> None:
    monkeypatch.setenv("LIAISONS_FMUS", str(tmp_path))
    path = fmu_path("Constant", "python")
    before = path.stat()
    assert path == tmp_path / "python" / "Constant.fmu"
    assert fmu_path("Constant", "python").stat().st_mtime_ns == before.st_mtime_ns
    path.write_bytes(path.read_bytes()[:1000])  # truncated: built again
    assert validate_fmu(str(fmu_path("Constant", "python"))) == []
    with pytest.raises(ProjectError, match=r"several components; name one: .*bead\.py:Bead, .*bead\.py:Parabola"):
        fmu_path(str(bead))


@pytest.mark.variants(core=0)
def test_without_a_compiler_the_main_road_is_python_and_one_line_says_how_to_get_native(
    tmp_path: Path, bead: Path
) -> None:
    """A fresh process whose search path has no compiler, and no ziglang to import."""
    code = (
        "import sys; sys.modules['ziglang'] = None\n"
        f"from liaisons.cli import main; raise SystemExit(main(['build', {str(bead) + ':Bead'!r}, 'BouncingBall', "
        "'--output', 'out']))"
    )
    words, environment = [sys.executable, "-c", code], os.environ | {"PATH": ""}
    done = subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert (tmp_path / "out" / "python" / "Bead.fmu").is_file()
    warning, left_out = done.stderr.splitlines()
    assert "BouncingBall: the Python back end takes no" in left_out
    assert left_out.endswith("native FMUs take them: pip install 'liaisons[cross]'")
    assert "no C compiler is found: pip install 'liaisons[cross]'" in warning
    assert done.stdout.count("\n") == 1


def test_a_component_of_ones_own_does_not_take_the_place_of_another(liaisons: Cli, bead: Path, tmp_path: Path) -> None:
    own = tmp_path / "own.py"
    own.write_text(bead.read_text().replace("class Bead", "class Constant").replace("class Parabola", "class Square"))
    assert liaisons("build", "Constant", "--backend", "python").status == 0
    assert is_misuse(liaisons("build", own), "own.py:Constant", "the catalogue's component of this name", "rename")
    (tmp_path / "fmus/python/Constant.fmu").unlink()
    other = tmp_path / "other.py"
    other.write_text(bead.read_text())
    assert is_misuse(liaisons("build", bead, other, "--output", "out"), "other.py:Bead", "FMU of", "bead.py:Bead")
    assert list(tmp_path.rglob("*.fmu")) == []
    assert liaisons("build", f"{own}:Constant", "--backend", "python", "--output", "out").status == 0


@pytest.mark.variants(core=0)
def test_in_an_empty_folder_ones_own_component_takes_the_name(bead: Path, tmp_path: Path) -> None:
    """In processes of their own, in which nothing is reserved; built once more it is the same."""
    own = tmp_path / "own.py"
    own.write_text(bead.read_text().replace("class Bead", "class Constant").replace("class Parabola", "class Square"))
    command = [*COMMAND, "build", f"{own}:Constant", "--backend", "python"]
    for _ in range(2):
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
        assert (
            "own.py:Constant: the bare name Constant is the catalogue's; this one is meant by its file" in done.stderr
        )
    assert b"free of forces" in zipfile.ZipFile(tmp_path / "fmus/python/Constant.fmu").read("modelDescription.xml")


@pytest.mark.slow
@pytest.mark.parametrize(("backend", "left_out"), [("python", NOT_IN_PYTHON), ("native", set())])
def test_the_whole_catalogue_is_built_or_left_out_by_name(
    liaisons: Cli, tmp_path: Path, backend: str, left_out: set[str]
) -> None:
    """With the Python back end as on a machine without a compiler."""
    reply = liaisons("build", "--backend", backend)
    assert reply.status == 0
    assert {line.split(": ")[1] for line in reply.err.splitlines() if line.startswith("left out: ")} == left_out
    built = reply.out.splitlines()
    assert {Path(line).stem for line in built} == catalogue_names() - left_out
    assert all((tmp_path / line).is_file() for line in built)
