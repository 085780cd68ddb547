"""The catalogue as a package: its table of entry points, the names that type checkers know, and its older name."""

from __future__ import annotations

import ast
import subprocess
import sys
import tomllib
from importlib import import_module
from importlib.metadata import distribution
from pathlib import Path

import pytest

import liaisons_catalogue
from liaisons.base.published import own_distribution
from liaisons.library import catalogue, catalogue_names

FOLDER = Path(liaisons_catalogue.__file__).parent
ROOT = FOLDER.parents[1]
NAMES = {
    (path.stem, node.name)
    for path in FOLDER.glob("[!_]*.py")
    for node in ast.parse(path.read_text(encoding="utf-8")).body
    if isinstance(node, (ast.ClassDef, ast.FunctionDef)) and not node.name.startswith("_")
}
"""Public classes and functions of each file."""


def test_every_component_is_in_the_table() -> None:
    pyproject = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    table = pyproject["project"]["entry-points"]["liaisons.components"]
    values = [getattr(import_module(f"liaisons_catalogue.{file}"), name) for file, name in sorted(NAMES)]
    components = [value for value in values if isinstance(value, type) and not getattr(value, "is_abstract", True)]
    assert table == {c.__name__: f"{c.__module__}:{c.__name__}" for c in components}
    assert catalogue_names() == catalogue().keys() == table.keys()


def test_a_clone_is_described_as_its_installation_is() -> None:
    """It needs none: what FMUs say of author and licence is read from pyproject.toml."""
    clone, installed = own_distribution(), distribution("liaisons")
    for key in ("Name", "Author", "License-Expression"):
        assert clone.metadata[key] == installed.metadata[key]
    texts = [[file.read_text() for file in each.files or () if file.name == "LICENSE"] for each in (clone, installed)]
    assert texts[0] == texts[1] == [(ROOT / "LICENSE").read_text(encoding="utf-8")]


def test_type_checkers_know_the_catalogue() -> None:
    stub = ast.parse((FOLDER / "__init__.pyi").read_text(encoding="utf-8")).body
    assert {(n.module, a.name) for n in stub if isinstance(n, ast.ImportFrom) for a in n.names} == NAMES


def test_the_older_name_is_the_same_module() -> None:
    code = """
from liaisons.models.solutions import linear
import liaisons.models.pictures.swing, liaisons.models.regulator as regulator, liaisons_catalogue.regulator as own
import liaisons_catalogue.pictures.swing, liaisons_catalogue.solutions.linear
assert regulator is own and own.__spec__.name == own.__name__ == "liaisons_catalogue.regulator"
assert linear is liaisons_catalogue.solutions.linear
assert liaisons.models.pictures.swing is liaisons_catalogue.pictures.swing
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_what_the_catalogue_does_not_have_is_refused_by_the_older_name() -> None:
    with pytest.raises(ModuleNotFoundError, match=r"No module named 'liaisons\.models\.nothing'"):
        import_module("liaisons.models.nothing")
