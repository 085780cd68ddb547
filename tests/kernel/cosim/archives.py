"""``python tests/kernel/cosim/archives.py FOLDER ...``: what becomes of SSP archives that others have made.

Prints a row for each ``.ssp`` below the folders, and for each ``.ssd`` that lies there unpacked, with what stands
beside it.  Whether a structure is valid is said by the schemas that ``pyssp_standard`` has.  Each archive is simulated
by ``liaisons simulate``, a process that is ended if it takes too long.
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from functools import cache
from importlib.resources import files
from pathlib import Path
from xml.etree.ElementTree import ParseError

from xmlschema import XMLSchema, XMLSchemaException

SECONDS = 120.0
_PACKED = {".ssp", ".ssd"}


def main(folders: list[str]) -> None:
    """Print the table."""
    print("| archive | valid | outcome |\n|---|---|---|")  # noqa: T201
    for folder in map(Path, folders):
        for path in sorted(path for path in folder.rglob("*") if path.suffix.lower() in _PACKED and path.is_file()):
            with tempfile.TemporaryDirectory() as name:
                archive = path if path.suffix.lower() == ".ssp" else packed(path, Path(name))
                print(f"| {path.relative_to(folder)} | {valid(archive)} | {outcome(archive)} |", flush=True)  # noqa: T201


def packed(structure: Path, folder: Path) -> Path:
    """The archive of an unpacked structure and what lies beside it."""
    beside = (path for path in structure.parent.rglob("*") if path.is_file() and path.suffix.lower() not in _PACKED)
    with zipfile.ZipFile(folder / f"{structure.parent.name}.ssp", "w") as archive:
        archive.write(structure, "SystemStructure.ssd")
        for path in beside:
            archive.write(path, path.relative_to(structure.parent))
    return folder / f"{structure.parent.name}.ssp"


def valid(archive: Path) -> str:
    """``yes``, or what the schemas say of the files that the archive consists of."""
    with tempfile.TemporaryDirectory() as name, zipfile.ZipFile(archive) as opened:
        complaints = (
            f"{file}: {complaint}" for file in opened.namelist() for complaint in _complaints(opened, file, Path(name))
        )
        return next(complaints, "yes")


def _complaints(archive: zipfile.ZipFile, file: str, folder: Path) -> Iterator[str]:
    kind = _SCHEMAS.get(Path(file).suffix)
    if kind is None:
        return
    path = Path(archive.extract(file, folder))
    try:
        later = b'version="2.0"' in path.read_bytes()
        _schema(kind, later=later).validate(path)
    except (XMLSchemaException, ParseError) as error:
        yield _short(getattr(error, "reason", None) or str(error))


_SCHEMAS = {".ssd": "Description", ".ssv": "ParameterValues", ".ssm": "ParameterMapping"}


@cache
def _schema(kind: str, *, later: bool) -> XMLSchema:
    folder = files("pyssp_standard") / "resources" / ("ssp2" if later else "")
    return XMLSchema(str(folder / f"SystemStructure{kind}.xsd"))


def outcome(archive: Path) -> str:
    """What ``liaisons simulate`` ends with."""
    code = "from liaisons_tools.cli import main; raise SystemExit(main())"
    command = [sys.executable, "-c", code, "simulate", str(archive)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=False)
    except subprocess.TimeoutExpired:
        return f"longer than {SECONDS:g} s"
    said = [line for line in done.stderr.splitlines() if line.strip()]
    if done.returncode:
        return _short(said[-1].removeprefix("liaisons: error: ").replace(f"{archive}: ", "") if said else "crashed")
    notes = f", {len(said)} notes" if said else ""
    return f"runs: {len(re.findall(r'^[^ ]+  ', done.stdout, re.MULTILINE)) - 2} signals{notes}"


def _short(words: str) -> str:
    line = " ".join(words.split()).replace("|", "/")
    return line if len(line) <= 160 else f"{line[:159]}…"


if __name__ == "__main__":
    main(sys.argv[1:])
