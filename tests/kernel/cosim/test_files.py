"""Files that are no FMU, or none that runs here; those of strangers are in hostile.py."""

from __future__ import annotations

import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy
import pytest
from making import FmuPaths, read, rewritten

from liaisons.cosim import System, simulate
from liaisons.errors import SimulationError

Change = Callable[[Callable[[str, bytes], tuple[str, bytes]]], Path]


@pytest.fixture
def changed(fmu: FmuPaths, tmp_path: Path) -> Change:
    """A copy of an FMU whose members are changed."""
    return lambda change: rewritten(fmu("Cubic"), tmp_path / "Changed.fmu", change)


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(SimulationError, match=r"^\S+Nowhere\.fmu: no such file; .*'liaisons build'$"):
        System("test").add("part", tmp_path / "Nowhere.fmu")


def test_file_is_read_again_when_it_has_changed(fmu: FmuPaths, tmp_path: Path) -> None:
    path = tmp_path / "Changing.fmu"
    shutil.copy(fmu("Cubic"), path)
    assert "y" in read(path).variables
    assert read(path) is read(path)
    shutil.copy(fmu("Spring"), path)
    assert "length" in read(path).variables


def test_other_platform_says_what_is_inside_and_what_to_do(changed: Change) -> None:
    path = changed(lambda name, data: ("binaries/mips-plan9/Cubic.so" if "binaries" in name else name, data))
    with pytest.raises(SimulationError, match=rf"{fmpy.platform}.*mips-plan9; compile its sources"):
        read(path)


@pytest.mark.parametrize(("file", "words"), [("", "empty"), ("y.so", "without Cubic")])
def test_platform_folder_without_its_library(changed: Change, file: str, words: str) -> None:
    path = changed(lambda name, data: (f"binaries/{fmpy.platform}/{file}" if "binaries" in name else name, data))
    with pytest.raises(SimulationError, match=rf"inside are: {fmpy.platform} \({words}"):
        read(path)


def test_file_may_be_inside_twice_if_it_is_the_same(changed: Change) -> None:
    path = changed(lambda name, data: (name, data))
    with zipfile.ZipFile(path, "a") as archive, pytest.warns(UserWarning, match="Duplicate name"):
        archive.writestr("modelDescription.xml", archive.read("modelDescription.xml"))
    assert simulate(path, stop_time=1.0, step_size=0.5)["y"].tolist() == [0.0, 0.125, 1.0]


def test_platform_may_be_named_by_its_tuple(changed: Change) -> None:
    path = changed(lambda name, data: (name.replace(f"/{fmpy.platform}/", f"/{fmpy.platform_tuple}/"), data))
    assert simulate(path, stop_time=2, step_size=2)["y"][-1] == 8.0  # exact: 2**3


def test_library_that_cannot_be_loaded_leaves_the_working_directory_alone(changed: Change) -> None:
    here = Path.cwd()
    path = changed(lambda name, data: (name, b"no library" if name.startswith("binaries/") else data))
    with pytest.raises(SimulationError, match=r"Changed: the library of Changed\.fmu cannot be loaded"):
        simulate(path, stop_time=1, step_size=1)
    assert Path.cwd() == here
