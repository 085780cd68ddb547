"""Files that are no FMU, or none that runs here."""

from __future__ import annotations

import os
import re
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy
import pytest

from liaisons.cosim import System, simulate
from liaisons.cosim.description import read
from liaisons.errors import SimulationError

FmuPaths = Callable[[str], Path]


def _changed(source: Path, target: Path, change: Callable[[str, bytes], tuple[str, bytes] | None]) -> Path:
    """A copy of an archive whose members are changed; None leaves one out."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            member = change(name, old.read(name))
            if member is not None:
                new.writestr(*member)
    return target


def _message(path: Path) -> str:
    with pytest.raises(SimulationError) as caught:
        System("test").add("part", path)
    message = str(caught.value)
    assert str(path) in message
    assert "\n" not in message
    return message


def test_missing_file(tmp_path: Path) -> None:
    assert "no such file" in _message(tmp_path / "Nowhere.fmu")


def test_directory(tmp_path: Path) -> None:
    assert "is a directory" in _message(tmp_path)


def test_truncated_file(fmu: FmuPaths, tmp_path: Path) -> None:
    path = tmp_path / "Half.fmu"
    path.write_bytes(fmu("Cubic").read_bytes()[:2000])
    assert "truncated" in _message(path)


def test_archive_without_model_description(tmp_path: Path) -> None:
    path = tmp_path / "Other.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("readme.txt", "no FMU")
    assert "no modelDescription.xml" in _message(path)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (b"</fmiModelDescription>", b"", "modelDescription.xml cannot be read"),
        (b"CoSimulation", b"ModelExchange", "model exchange only"),
    ],
)
def test_description_that_will_not_do(fmu: FmuPaths, tmp_path: Path, old: bytes, new: bytes, words: str) -> None:
    def change(name: str, data: bytes) -> tuple[str, bytes]:
        return name, data.replace(old, new) if name == "modelDescription.xml" else data

    assert words in _message(_changed(fmu("Cubic"), tmp_path / "Changed.fmu", change))


@pytest.mark.parametrize("version", ["1.0", "4.0"])
def test_other_versions_are_named(tmp_path: Path, version: str) -> None:
    path = tmp_path / "Other.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(
            "modelDescription.xml",
            f'<fmiModelDescription fmiVersion="{version}" modelName="Other" guid="1"><ModelVariables/>'
            "</fmiModelDescription>",
        )
    assert f"FMI {version}; only co-simulation FMUs of FMI 2.0 and 3.0" in _message(path)


TWO = (
    '<fmiModelDescription fmiVersion="2.0" modelName="x" {}><CoSimulation modelIdentifier="x"/>{}</fmiModelDescription>'
)
THREE = TWO.replace("2.0", "3.0")
SCALAR = '<ModelVariables><ScalarVariable name="x" valueReference="one"><Real/></ScalarVariable></ModelVariables>'
FLOAT = '<ModelVariables><Float64 valueReference="1"/></ModelVariables>'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<html/>", "its root is not fmiModelDescription"),
        (TWO.format("", "<ModelVariables/>"), "fmiModelDescription has no 'guid'"),
        (TWO.format('guid="1"', SCALAR), "invalid literal for int.*'one'"),
        (THREE.format("", ""), "fmiModelDescription has no 'instantiationToken'"),
        (THREE.format('instantiationToken="1"', FLOAT), "no attribute 'name'"),
    ],
)
def test_description_with_a_gap(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "Gap.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", text)
    assert re.search(f"modelDescription.xml cannot be read: .*{words}", _message(path))


def test_file_is_read_again_when_it_has_changed(fmu: FmuPaths, tmp_path: Path) -> None:
    path = tmp_path / "Changing.fmu"
    shutil.copy(fmu("Cubic"), path)
    assert "y" in read(path).variables
    assert read(path) is read(path)
    shutil.copy(fmu("Spring"), path)
    assert "length" in read(path).variables


def test_other_platform_says_what_is_inside_and_what_to_do(fmu: FmuPaths, tmp_path: Path) -> None:
    def change(name: str, data: bytes) -> tuple[str, bytes]:
        return ("binaries/mips-plan9/Cubic.so" if name.startswith("binaries/") else name), data

    message = _message(_changed(fmu("Cubic"), tmp_path / "Elsewhere.fmu", change))
    assert "mips-plan9" in message
    assert fmpy.platform in message
    assert "compile its sources" in message


def test_platform_may_be_named_by_its_tuple(fmu: FmuPaths, tmp_path: Path) -> None:
    def change(name: str, data: bytes) -> tuple[str, bytes]:
        return name.replace(f"binaries/{fmpy.platform}/", f"binaries/{fmpy.platform_tuple}/"), data

    path = _changed(fmu("Cubic"), tmp_path / "Tuple.fmu", change)
    assert simulate(path, stop_time=2, step_size=2)["y"][-1] == 8.0  # exact: 2**3


def test_library_that_cannot_be_loaded_leaves_the_working_directory_alone(fmu: FmuPaths, tmp_path: Path) -> None:
    def change(name: str, data: bytes) -> tuple[str, bytes]:
        return name, b"no library" if name.startswith("binaries/") else data

    here = Path.cwd()
    path = _changed(fmu("Cubic"), tmp_path / "Broken.fmu", change)
    with pytest.raises(SimulationError, match=r"Broken: the library of Broken\.fmu cannot be loaded"):
        simulate(path, stop_time=1, step_size=1)
    assert Path.cwd() == here


def test_damaged_member_is_found_when_it_is_extracted(fmu: FmuPaths, tmp_path: Path) -> None:
    path = tmp_path / "Damaged.fmu"
    shutil.copy(fmu("Cubic"), path)
    with path.open("r+b") as file:  # the library lies uncompressed in the middle of the archive
        file.seek(path.stat().st_size // 2)
        byte = file.read(1)
        file.seek(-1, os.SEEK_CUR)
        file.write(bytes([byte[0] ^ 0xFF]))
    with pytest.raises(SimulationError, match=r"damaged \(.*binaries"):
        simulate(path, stop_time=1, step_size=1)
