"""Components by name, file and class, wherever an FMU is taken; whose FMU lies where."""

from __future__ import annotations

import inspect
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
import pytest

from liaisons import System, build, derive, ensemble, fmu_path, grid, simulate, start, sweep
from liaisons.cosim import Settings
from liaisons.errors import LiaisonsError, ProjectError
from liaisons.library import fmu_file, variables
from liaisons.library.unchanged import is_unchanged
from liaisons.mechanics import assemble
from liaisons.models import Constant, Pendulum, PendulumChain

OWN = '''\
"""A component of a user."""

import casadi as ca

from liaisons import Coordinate, Mechanism, Parameter


class {name}(Mechanism):
    """Bead on a straight wire, free of forces."""

    mass = Parameter({mass}, "kg", "mass", above=0)
    x = Coordinate("m", "position", start_rate=1.0)

    def kinetic_energy(self):
        return self.mass / 2 * self.dot(self.x) ** 2
'''


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where FMUs land; the working directory is beside it."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("LIAISONS_FMUS", str(tmp_path / "fmus"))
    return tmp_path / "fmus"


@pytest.fixture
def own(tmp_path: Path) -> Callable[..., Path]:
    """Write a file with a component of this name."""

    def write(file: str, name: str, mass: float = 1.0) -> Path:
        path = tmp_path / file
        path.parent.mkdir(exist_ok=True)
        path.write_text(OWN.format(name=name, mass=mass))
        os.utime(path, (0, mass))  # what was compiled before is not taken for this
        return path

    return write


@pytest.mark.parametrize("target", ["Constant", Constant, Path("Constant"), "fmus/Constant.fmu"])
def test_a_component_stands_for_its_fmu(target: Any, folder: Path) -> None:
    run: dict[str, Any] = {"stop_time": 0.2, "step_size": 0.1}
    assert build("Constant") == folder / "Constant.fmu"
    np.testing.assert_array_equal(simulate(target, **run, value=2.0)["y"], [2.0, 2.0, 2.0])
    system = System("one")
    assert system.add("source", target).fmu.path.resolve() == folder / "Constant.fmu"
    table = sweep(target, grid({"value": [1.0, 3.0]}), keep="y", workers=1, **run)
    np.testing.assert_array_equal(table["y"], [1.0, 3.0])
    assert [path.name for path in folder.rglob("*.fmu")] == ["Constant.fmu"]


def test_a_file_of_a_user_stands_for_its_component(own: Callable[..., Path], folder: Path) -> None:
    file = own("bead.py", "Bead")
    for target in ("bead.py", file, "bead.py:Bead"):
        assert simulate(target, stop_time=1.0, step_size=0.5)["x"][-1] == pytest.approx(1.0)
        assert build(target, "elsewhere", fmi="3") == Path("elsewhere/fmi3/Bead.fmu")
        assert fmu_path(target) == folder / "Bead.fmu"


def test_ensembles_take_names() -> None:
    values = {"theta_0": [0.1, 0.2], "length.amplitude": 0.1}
    run: dict[str, Any] = {"stop_time": 1.0, "step_size": 0.01, "estimate": False}
    by_name = ensemble("Pendulum", values, operators={"length": "Sinusoid"}, record="theta", **run)
    assert by_name.names == ("theta",)
    assert by_name.title == "Pendulum"


def test_a_run_of_a_system_takes_settings_by_position() -> None:
    system = System("one")
    system.add("source", "Ramp", rate=2.0)
    settings: Any = 0.2, 0.1
    with start(system, *settings) as run:
        run.step()
        assert run.time == pytest.approx(0.1)
        run.step()
        assert run["source.y"] == pytest.approx(0.4)
        with pytest.raises(LiaisonsError, match=r"0\.2"):
            run.step()


def test_a_system_of_names_is_flattened_and_read_again(tmp_path: Path) -> None:
    system = System("two sources")
    system.add("one", "Constant", value=1.0)
    system.add("other", Constant, value=2.0)
    assert system.flatten().is_file()
    system.write_ssp("two.ssp")
    again = System.from_ssp("two.ssp")
    assert isinstance(again, System)
    assert again.simulate(1.0, 0.5)["other.y"][-1] == 2.0
    for word in ("two.ssp", tmp_path / "two.ssp"):
        with pytest.raises(ProjectError, match=r"two\.ssp is the archive of a whole system; .*from_ssp"):
            simulate(word)


@pytest.mark.parametrize("call", [simulate, lambda t: System("s").add("a", t), lambda t: sweep(t, {"x": [1]}, "y")])
@pytest.mark.parametrize(
    ("target", "words"),
    [
        ("Pendlum", "'Pendlum' is neither a file nor a component; did you mean 'Pendulum'"),
        ("pendulum", "did you mean 'Pendulum'"),
        ("none.py", "none.py: no such file"),
        ("none.fmu", "none.fmu: no such file; check the path, or build it"),
        (5, "5 is neither an FMU nor a component; give the path of an FMU, or the name"),
        (None, "None is neither an FMU nor a component"),
        (b"Pendulum", "b'Pendulum' is neither an FMU nor a component"),
        (int, "the class int is not a component; derive one"),
    ],
)
def test_what_is_neither_is_one_line(call: Callable[[Any], object], target: Any, words: str) -> None:
    with pytest.raises(LiaisonsError, match=words) as caught:
        call(target)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("call", [build, derive, lambda t: ensemble(t, {}, stop_time=1, step_size=0.1)])
def test_an_fmu_is_no_component(call: Callable[[str], object]) -> None:
    with pytest.raises(ProjectError, match=r"^it\.fmu is not a component; give the file or class that this FMU"):
        call("it.fmu")


def test_models_are_built_and_are_no_fmus(folder: Path) -> None:
    model = assemble(PendulumChain, 2)
    assert build(model) == folder / "PendulumChain.fmu"
    with pytest.raises(ProjectError, match="is neither an FMU nor a component"):
        simulate(model)  # type: ignore[arg-type]


def test_the_catalogue_keeps_its_names(own: Callable[..., Path], folder: Path) -> None:
    before = fmu_path("Pendulum").read_bytes()
    file = own("mine.py", "Pendulum")
    taken = r"mine\.py:Pendulum: .*Pendulum\.fmu is the FMU of the catalogue's component of this name; rename the class"
    for call in (fmu_path, build, simulate, lambda t: build(t, folder), lambda t: build(t, fmi="3")):
        with pytest.raises(ProjectError, match=taken):
            call(file)
    assert (folder / "Pendulum.fmu").read_bytes() == before
    assert build(file, "elsewhere").is_file()  # where a user says so

    class Pendulum(Constant):
        """Another one."""

    for target, origin in ((Pendulum, r"test_library\.py:.*Pendulum"), (assemble(Pendulum), "the model Pendulum")):
        with pytest.raises(ProjectError, match=rf"{origin}: .* is the FMU of the catalogue's component of this name"):
            build(target)
    assert (folder / "Pendulum.fmu").read_bytes() == before


def test_two_files_with_one_name_do_not_take_turns(own: Callable[..., Path]) -> None:
    first, second = own("bead.py", "Bead"), own("other/bead.py", "Bead", mass=2.0)
    before = fmu_path(first).read_bytes()
    with pytest.raises(ProjectError, match=r"other/bead\.py:Bead: .*Bead\.fmu is the FMU of .*bead\.py:Bead; rename"):
        fmu_path(second)
    assert fmu_path(first).read_bytes() == before
    own("bead.py", "Bead", mass=3.0)  # an edit is no other component
    assert fmu_path(first).read_bytes() != before
    assert fmu_path(Pendulum) == fmu_path("Pendulum")


@pytest.mark.parametrize("function", [simulate, start, sweep, System.simulate, System.start, System.add])
def test_help_says_what_is_taken(function: Callable[..., object]) -> None:
    """Each argument by name, typed settings among them; and that a subject may be a name."""
    arguments = [name for name in inspect.signature(function).parameters if name != "self"]
    settings = inspect.get_annotations(Settings) if "settings" in arguments else {}
    text = inspect.getdoc(function) or ""
    said = set(re.findall(r":param (\w+):", text))
    if re.search(r":(func|meth):`(liaisons\.)?simulate`", text):
        said |= {*re.findall(r":param (\w+):", f"{simulate.__doc__} {System.simulate.__doc__}")}
    assert {*arguments, *settings} - {"settings"} <= said
    assert function in {System.simulate, System.start} or re.search(r"by its name\b.*, file or class", text)


@pytest.mark.parametrize(
    ("version", "entry"),
    [
        ("2.0", '<ScalarVariable name="k" causality="parameter" valueReference="0"><Real start="2"/></ScalarVariable>'),
        ("3.0", '<Float64 name="k" causality="parameter" valueReference="0" start="2"/>'),
    ],
)
def test_variables_of_a_file_complete(tmp_path: Path, version: str, entry: str) -> None:
    with ZipFile(tmp_path / "x.fmu", "w") as archive:
        head = f'<fmiModelDescription fmiVersion="{version}"><ModelVariables>'
        archive.writestr("modelDescription.xml", f"{head}{entry}</ModelVariables></fmiModelDescription>")
    assert variables(str(tmp_path / "x.fmu")) == [("k", "parameter", "2")]
    assert ("theta_0", "parameter", f"{Pendulum.theta.start:g}") in variables("Pendulum")
    (tmp_path / "x.fmu").write_bytes(b"no archive")
    for nothing in (str(tmp_path / "x.fmu"), str(tmp_path), "", "Pendulim", "mine.py"):
        assert variables(nothing) == []


def test_an_fmu_of_the_catalogue_that_has_not_changed_is_taken_as_it_is(monkeypatch) -> None:
    path = fmu_path("Pendulum")
    built: list[object] = []
    monkeypatch.setattr("liaisons.library.fmus.fmu_path", lambda target: built.append(target) or path)
    assert fmu_file("Pendulum") == path
    assert built == []
    os.utime(path, ns=(1, 1))  # another file of this name
    assert fmu_file("Pendulum") == path
    assert built == ["Pendulum"]


def test_an_fmu_is_looked_at_anew_where_sources_have_changed(monkeypatch) -> None:
    path = fmu_path("Pendulum")
    assert is_unchanged(path)
    monkeypatch.setenv("CPATH", "/elsewhere")
    assert not is_unchanged(path)
    monkeypatch.delenv("CPATH")
    monkeypatch.setattr("liaisons.library.unchanged._sources", lambda: "others")
    assert not is_unchanged(path)
    path.unlink()
    assert not is_unchanged(path)


def test_fmus_with_sizes_are_not_noted() -> None:
    assert not is_unchanged(fmu_path(PendulumChain, n=2))
    assert is_unchanged(fmu_path(Constant))
