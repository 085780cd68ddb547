"""``liaisons new``: a package that publishes components."""

from __future__ import annotations

import keyword
import re
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from liaisons.errors import ProjectError
from liaisons_tools.cli._command import command

_TEMPLATE = Path(__file__).with_name("new_package")
"""The files of a package ``my_mechanics``, each with the suffix ``.in``."""
_OTHER_FOLDERS = ("dist", "figures", "fmus", "tests")
"""Folders beside the module."""


@command("""
    liaisons new my_mechanics
    liaisons check my_mechanics/my_mechanics/incline_block.py
    pip install --editable "./my_mechanics[test]"
    pytest my_mechanics
""")
def new(name: Annotated[str, typer.Argument(metavar="NAME", help="name of the module and of its new folder")]) -> int:
    """Write a package that publishes a component, with its closed form, tests, a scenario and a page."""
    if not re.fullmatch("[a-z]([a-z0-9_]*[a-z0-9])?", name):
        raise ProjectError(f"{name!r}: a package is called by small letters, digits and _, for example my_mechanics")
    folder = Path(name)
    if folder.exists():
        raise ProjectError(f"{folder}: it is there already; choose another name, or move it away")
    if keyword.iskeyword(name) or name in _OTHER_FOLDERS or find_spec(name):
        raise ProjectError(f"{name!r}: this name is taken in Python or in packages; choose another one")
    with TemporaryDirectory(dir=".", prefix=f".{name}-") as whole:
        for source in sorted(_TEMPLATE.rglob("*.in")):
            path = Path(whole, name, _text_for_package(str(source.relative_to(_TEMPLATE)), name).removesuffix(".in"))
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(_text_for_package(source.read_text(encoding="utf-8"), name), encoding="utf-8")
        Path(whole, name).rename(folder)
    for path in sorted(folder.rglob("*.*")):
        print(path)
    return 0


def _text_for_package(text: str, name: str) -> str:
    """Text of the template with the name of the package."""
    return text.replace("my_mechanics", name).replace("my-mechanics", name.replace("_", "-"))
