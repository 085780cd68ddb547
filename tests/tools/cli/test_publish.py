"""``liaisons new``, and components and scenarios that installed packages publish."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib import import_module, invalidate_caches
from pathlib import Path

import pytest

from liaisons import System, __version__, check_component, equations, modelica, operator, simulate
from liaisons.base.published import published_components
from liaisons.errors import ProjectError
from liaisons.fmu.origin import provenance
from liaisons.library import component_names, components, variables
from liaisons.mechanics import assemble
from liaisons.models import Oscillator

from . import documents
from .conftest import Cli, Runs, is_misuse

Install = Callable[..., None]

LINE = """
from liaisons import Coordinate, Mechanism, Parameter


class Line(Mechanism, abstract=True):
    mass = Parameter(1.0, "kg", "mass", above=0)
    x = Coordinate("m", "position", start_rate=1.0)

    def kinetic_energy(self):
        return self.mass / 2 * self.dot(self.x) ** 2


class {name}(Line):
    '''One of {module}.'''
"""


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """Install a module, by what pip would write for it: its name, entry points, and content unless it is there."""
    folder, before = tmp_path / "site-packages", set(sys.modules)
    monkeypatch.syspath_prepend(str(folder))

    def write(package: str, entry_points: dict[str, str], content: str | None = None) -> None:
        about = folder / f"{package}-1.0.dist-info"
        about.mkdir(parents=True)
        (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
        lines = "".join(f"{name} = {value}\n" for name, value in entry_points.items())
        (about / "entry_points.txt").write_text(f"[liaisons.components]\n{lines}")
        if content is not None:
            (folder / f"{package}.py").write_text(content)
        monkeypatch.delitem(sys.modules, package, raising=False)  # of another test
        invalidate_caches()
        published_components.cache_clear()

    yield write
    published_components.cache_clear()
    for name in set(sys.modules) - before:
        if (getattr(sys.modules[name], "__file__", None) or "").startswith(str(folder)):
            del sys.modules[name]


@pytest.fixture
def ramps(runs: Runs, install: Install, tmp_path: Path) -> Path:
    """A package of ``liaisons new``, installed; the folder of its module."""
    runs("new", "my_ramps")
    (tmp_path / "site-packages").mkdir()
    (tmp_path / "my_ramps" / "my_ramps").rename(tmp_path / "site-packages" / "my_ramps")
    install("my-ramps", {"InclineBlock": "my_ramps.incline_block:InclineBlock"})
    return tmp_path / "site-packages" / "my_ramps"


# ---- new -----------------------------------------------------------------------------------------------------------


def test_new_writes_a_package_of_this_name(runs: Runs, tmp_path: Path) -> None:
    written = runs("new", "a_b2").split()
    assert "a_b2/a_b2/scenarios/held_block.py" in written
    assert all((tmp_path / path).is_file() for path in written)
    assert [path.name for path in tmp_path.iterdir()] == ["a_b2"]
    texts = [(tmp_path / path).read_text(encoding="utf-8") for path in written]
    assert not any("my_mechanics" in text or "my-mechanics" in text for text in texts)
    assert 'name = "a-b2"' in (tmp_path / "a_b2" / "pyproject.toml").read_text()


def test_the_component_of_new_passes_its_check(runs: Runs) -> None:
    [path] = [path for path in runs("new", "my_ramps").split() if path.endswith("/incline_block.py")]
    examination = check_component(path)
    assert examination.passed, [str(verdict) for verdict in examination.verdicts]
    claims = {verdict.claim for verdict in examination.verdicts}
    assert {"docstring: s'' = g sin α - X'' cos α", "path is what exact says, at 4 sets of values"} <= claims


@pytest.mark.parametrize(
    "name", ["My_Ramps", "my-ramps", "2_ramps", "_ramps", "ramps_", "my ramps", "../ramps", "ramps.py", "é"]
)
def test_new_refuses_what_names_no_module(liaisons: Cli, tmp_path: Path, name: str) -> None:
    assert is_misuse(liaisons("new", name), repr(name), "small letters")
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("name", ["class", "statistics", "numpy", "liaisons", "tests", "fmus"])
def test_new_refuses_names_that_are_taken(liaisons: Cli, tmp_path: Path, name: str) -> None:
    assert is_misuse(liaisons("new", name), name, "taken", "choose another")
    assert not [*tmp_path.iterdir()]


def test_new_leaves_a_folder_alone(liaisons: Cli, tmp_path: Path) -> None:
    (tmp_path / "ramps").mkdir()
    assert is_misuse(liaisons("new", "ramps"), "ramps: ", "choose another name")
    assert not [*(tmp_path / "ramps").iterdir()]


def test_new_leaves_nothing_where_it_fails(liaisons: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write, count = Path.write_text, 0

    def fail(path: Path, *arguments: str, **options: str) -> int:
        nonlocal count
        count += 1
        if count == 4:
            raise OSError(28, "No space left on device", str(path))
        return write(path, *arguments, **options)

    monkeypatch.setattr(Path, "write_text", fail)
    assert is_misuse(liaisons("new", "ramps"), "No space left")
    assert count == 4
    assert not [*tmp_path.iterdir()]


# ---- what is published ---------------------------------------------------------------------------------------------


def test_what_is_published_is_found_by_every_command(ramps: Path, runs: Runs, tmp_path: Path) -> None:
    assert "InclineBlock" in component_names()
    assert "my_ramps" not in sys.modules  # completion loads nothing
    out = runs("list")
    assert out.index("SmoothStep") < out.index("\nOf the package my-ramps:\n") < out.index("\nInclineBlock  path")
    assert out.index("Of the package my-ramps: liaisons run --theme my-ramps\n") < out.index("\nheld_block  A wedge")
    assert "InclineBlock" in runs("list", "InclineBlock")
    assert "s̈ = g sin α − Ẍ cos α" in runs("equations", "InclineBlock")
    assert runs("build", "InclineBlock") == "fmus/InclineBlock.fmu\n"
    assert "path" in runs("simulate", "my-ramps:InclineBlock", "--input", "wedge_x=t**2", "--stop", "1")
    assert ("mass", "parameter", "1") in variables("InclineBlock")
    a = 9.81 * 0.5463024898437905  # g tan α
    run = simulate("InclineBlock", stop_time=1.0, inputs={"wedge_x": lambda t: (a * t**2 / 2, a * t, a)})
    assert abs(run["path"]).max() < 1e-7
    assert "motion" in equations("InclineBlock").parts
    assert components("InclineBlock") == [import_module("my_ramps").InclineBlock]
    out = runs("run", "--theme", "my-ramps")
    assert "figure: figures/held_block.png" in out
    assert (tmp_path / "figures" / "held_block.png").is_file()
    assert not (ramps / "scenarios" / "figures").exists()


@pytest.mark.usefixtures("ramps")
def test_systems_of_published_components_are_flattened_and_written_as_modelica() -> None:
    system = System("moved")
    system.add("block", "InclineBlock", wedge_x=operator("Sinusoid"))
    assert "X_block = y_block_wedge_x" in str(equations(system))
    assert "connect(block_wedge_x.flange, block.flange_wedge_x);" in modelica(system)


def test_scenario_whose_name_is_taken_is_called_by_its_package(ramps: Path, runs: Runs) -> None:
    held = ramps / "scenarios" / "held_block.py"
    held.rename(held.with_name("free_fall.py"))
    out = runs("list")
    assert "\nmy-ramps:free_fall  A wedge" in out
    assert "\nfree_fall " in out


@pytest.mark.usefixtures("ramps")
def test_unknown_names_suggest_published_ones(liaisons: Cli) -> None:
    assert is_misuse(liaisons("simulate", "InclinedBlock"), "did you mean 'InclineBlock'?")
    assert is_misuse(liaisons("run", "held_blok"), "did you mean 'held_block'?")


def test_equal_names_of_two_packages_are_told_apart(install: Install, liaisons: Cli, runs: Runs) -> None:
    for module in ("first", "second"):
        install(module, {"Bead": f"{module}:Bead"}, LINE.format(name="Bead", module=module))
    assert is_misuse(liaisons("simulate", "Bead"), "several packages", "first:Bead, second:Bead")
    assert "One of second" in runs("list", "second:Bead")
    reply = liaisons("list")
    assert reply.status == 0
    assert "\nBead  x" in reply.out
    assert "warning: package second: its Bead is second:Bead; others have this name\n" in reply.err


def test_a_broken_package_is_named_and_left_out(install: Install, liaisons: Cli, tmp_path: Path) -> None:
    install("leaves", {"Leaves": "leaves:Leaves"}, "import sys\nsys.exit(3)\n")
    install("broken", {}, "")
    (tmp_path / "site-packages/broken-1.0.dist-info/entry_points.txt").write_text("[liaisons.components]\nno value\n")
    install("sound", {"Sound": "sound:Sound"}, LINE.format(name="Sound", module="sound"))
    reply = liaisons("list")
    assert reply.status == 0
    assert "Pendulum" in reply.out
    assert "One of sound" in reply.out
    left_out = "package leaves: the entry point Leaves = 'leaves:Leaves' cannot be loaded: SystemExit: 3"
    assert f"left out: {left_out}" in reply.err
    assert "package broken: left out: its entry_points.txt is broken" in reply.err
    assert is_misuse(liaisons("build", "Leaves"), left_out)


def test_the_catalogue_keeps_its_names(install: Install, liaisons: Cli, runs: Runs) -> None:
    install("other", {"Pendulum": "other:Pendulum"}, LINE.format(name="Pendulum", module="other"))
    assert "pivot" in runs("list", "Pendulum")
    assert "One of other" in runs("list", "other:Pendulum")
    runs("build", "Pendulum", "--backend", "python")
    assert is_misuse(liaisons("build", "other:Pendulum"), "other.py:Pendulum", "rename the class")
    assert "package other: its Pendulum is other:Pendulum; others have this name" in liaisons("list").err


@pytest.mark.parametrize(
    ("value", "content", "words"),
    [
        ("broken:Bead", "import nowhere_to_be_found\n", ["'broken:Bead' cannot be loaded", "nowhere_to_be_found"]),
        ("broken:Bead", "def f(:\n", ["cannot be loaded", "SyntaxError"]),
        ("broken:Bead", "raise RuntimeError('two\\nlines')\n", ["cannot be loaded", "RuntimeError"]),
        ("broken:Beat", LINE.format(name="Bead", module="broken"), ["cannot be loaded", "no attribute 'Beat'"]),
        ("no.such.module:Bead", "", ["cannot be loaded", "No module named 'no'"]),
        ("broken", LINE.format(name="Bead", module="broken"), ["publish a Mechanism or Operator"]),
        ("broken:Line", LINE.format(name="Bead", module="broken"), ["publish a Mechanism or Operator"]),
        ("broken:Ring", LINE.format(name="Ring", module="broken"), ["by the name of its class"]),
        ("broken:Bead", LINE.format(name="Bead", module="broken").replace('"kg"', '"kilo"'), ["'kilo'"]),
        ("-:-", "", ["cannot be loaded"]),
    ],
    ids=[
        "import",
        "syntax",
        "lines",
        "attribute",
        "module",
        "a module",
        "abstract",
        "name",
        "declaration",
        "malformed",
    ],
)
def test_what_cannot_be_loaded_is_named_and_left_out(
    install: Install, liaisons: Cli, value: str, content: str, words: list[str]
) -> None:
    install("broken", {"Bead": value}, content)
    label = f"package broken: the entry point Bead = {value!r}"
    for command in ("simulate Bead", "build Bead", "equations broken:Bead"):
        assert is_misuse(liaisons(*shlex.split(command)), label, *words)
    with pytest.raises(ProjectError, match="package broken"):
        simulate("Bead")
    assert variables("Bead") == []  # completion is silent
    reply = liaisons("list")
    assert reply.status == 0
    assert "warning: left out: " + label in reply.err
    assert reply.err.count("\n") == 1


@pytest.mark.parametrize(
    ("about", "expected"),
    [
        ("Author: A. & B.\nLicense-Expression: MIT\nLicense: no more\n", {"author": "A. & B.", "license": "MIT"}),
        ("Author-email: A <a@b.org>\nLicense: free\n", {"author": "A <a@b.org>", "license": "free"}),
        ("", {}),
    ],
)
def test_an_fmu_has_author_version_and_licence_of_its_package(
    install: Install, tmp_path: Path, about: str, expected: dict[str, str]
) -> None:
    """Of a package that publishes another class of the same module, too."""
    install("lines", {"Bead": "lines.lines:Bead"})
    install("others", {"Ring": "others:Ring"})
    with (tmp_path / "site-packages" / "lines-1.0.dist-info" / "METADATA").open("a") as file:
        file.write(about)
    bead = assemble(Oscillator)
    for module in ("lines.lines", "lines", "lines.more"):
        assert provenance(replace(bead, module=module)) == {"version": "1.0"} | expected
    assert provenance(replace(bead, module="linesmen")) == {}
    assert provenance(bead)["author"] == "the liaisons authors"


# ---- as a user does it ---------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_new_package_from_its_wheel(tmp_path: Path) -> None:
    place = documents.empty_folder(tmp_path)
    place.runs("liaisons new my_mechanics")
    place.runs("python -m pip wheel --quiet --no-deps --no-build-isolation --wheel-dir dist ./my_mechanics")
    place.runs("mv my_mechanics/tests tests && rm -r my_mechanics")  # nothing but what is installed
    place.runs("python -m pip install --quiet --no-deps dist/*.whl")
    assert "InclineBlock" in place.runs("liaisons list")
    for command, _ in documents.console("components/liaisons_tools/cli/new_package/README.md.in"):
        if command.startswith("liaisons"):
            place.runs(command)
    assert (place.folder / "figures" / "held_block.png").is_file()
    assert "13 passed" in place.runs("python -m pytest -q tests")
    assert f"liaisons {__version__}\n" == place.runs("liaisons --version")
