"""Plant the faults of frozen_faults.json, which are text, so that they survive when files move.

    python tests/frozen_faults.py plant [PACKAGE...] [--marks "not slow"]
    python tests/frozen_faults.py freeze TOOL

Each fault replaces a piece of text that stands once in its file, or, where the file has moved, once in components/.  It
goes into a copy of the tracked files; a fault is noticed when one of its tests fails.  ``freeze`` writes down the
faults that faults.toml chooses by its seeds; TOOL is the program that chooses them (see faults.py).
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import pytest

from faults import ROOT, entries

FROZEN = Path(__file__).with_suffix(".json")
SECONDS = 600.0  # for the tests of one fault: a hang is noticed


@dataclass(frozen=True)
class Fault:
    """Replacement of a piece of text, and the tests that should notice it."""

    package: str
    file: str
    old: str
    new: str
    tests: list[str]


def main() -> int:
    """Freeze, or plant; 1 if a fault cannot be planted any more."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    freezing = commands.add_parser("freeze")
    freezing.add_argument("tool", type=Path)
    freezing.set_defaults(run=lambda options: freeze(options.tool))
    planting = commands.add_parser("plant")
    planting.add_argument("packages", nargs="*")
    planting.add_argument("--marks", default="not slow", help="which of the tests run")
    planting.set_defaults(run=lambda options: plant({*options.packages}, options.marks))
    options = parser.parse_args()
    return options.run(options)


def freeze(tool: Path) -> int:
    """Write down the faults that faults.toml chooses."""
    specification = importlib.util.spec_from_file_location("tool", tool)
    assert specification is not None
    assert specification.loader is not None
    module: Any = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    frozen = [asdict(fault) for entry in entries() for fault in chosen_faults(entry, module.faults, module.readable)]
    FROZEN.write_text(json.dumps(frozen, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    print(f"{len(frozen)} faults: {FROZEN.relative_to(ROOT)}")
    return 0


def chosen_faults(
    entry: dict[str, Any],
    changes_of: Callable[[Path], list[tuple[int, int, str]]],
    readable: Callable[[Path, str], bool],
) -> Iterator[Fault]:
    """Yield the faults of an entry of faults.toml, in the order in which its seed chooses them."""
    candidates = [(name, *change) for name in entry["files"] for change in changes_of(ROOT / name)]
    left = entry["count"]
    for name, begin, end, new in random.Random(entry["seed"]).sample(candidates, len(candidates)):
        text = (ROOT / name).read_text(encoding="utf-8")
        if left and readable(ROOT / name, text[:begin] + new + text[end:]):
            left -= 1
            first, last = unique_lines(text, begin, end)
            changed = text[first:begin] + new + text[end:last]
            yield Fault(entry["package"], name, text[first:last], changed, entry["tests"])


def unique_lines(text: str, begin: int, end: int) -> tuple[int, int]:
    """Begin and end of the fewest whole lines about a change that stand once in the text."""
    first, last = text.rfind("\n", 0, begin) + 1, text.find("\n", end)
    while text.count(text[first:last]) > 1:
        first, last = text.rfind("\n", 0, max(first - 1, 0)) + 1, text.find("\n", last + 1)
    return first, last


def plant(packages: set[str], marks: str) -> int:
    """Plant the faults of some packages, or all, one at a time; print those that no test notices."""
    faults = [Fault(**fault) for fault in json.loads(FROZEN.read_text(encoding="utf-8"))]
    faults = [fault for fault in faults if not packages or {fault.package, fault.package.partition("/")[0]} & packages]
    noticed = lost = 0
    with tempfile.TemporaryDirectory(prefix="faults") as folder:
        copy = copied_tree(Path(folder) / "tree")
        for fault in faults:
            path = path_of(fault, copy)
            if path is None:
                lost += 1
                print(f"LOST      {fault.file}\n    - {fault.old.strip()}", flush=True)
                continue
            text = path.read_text(encoding="utf-8")
            path.write_text(text.replace(fault.old, fault.new), encoding="utf-8")
            caught = any_fails(copy, fault.tests, marks)
            path.write_text(text, encoding="utf-8")
            noticed += caught
            word = "caught" if caught else "SURVIVES"
            print(f"{word:9} {path.relative_to(copy)}", *([] if caught else [difference(fault)]), sep="\n", flush=True)
    print(f"{noticed} of {len(faults)} noticed; {lost} have no place any more")
    return int(lost > 0)


def copied_tree(copy: Path) -> Path:
    """Folder with a copy of the tracked files."""
    listed = subprocess.run(["git", "ls-files", "-z"], capture_output=True, check=True, text=True, cwd=ROOT).stdout
    for name in filter(None, listed.split("\0")):
        if (ROOT / name).is_file():
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, copy / name)
    return copy


def path_of(fault: Fault, tree: Path) -> Path | None:
    """The file of a tree where the text of a fault stands once; None if there is none, or several."""
    own = tree / fault.file
    files = [own] if own.is_file() and fault.old in own.read_text(encoding="utf-8") else source_files(tree)
    places = [path for path in files if path.read_text(encoding="utf-8").count(fault.old) == 1]
    return places[0] if len(places) == 1 else None


def source_files(tree: Path) -> list[Path]:
    """Files of a tree into which faults are planted."""
    return [path for path in (tree / "components").rglob("*") if path.suffix in {".py", ".c", ".h", ".js"}]


def any_fails(copy: Path, tests: list[str], marks: str) -> bool:
    """Whether a test fails, or hangs."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-m", marks, "-p", "no:cacheprovider", "--tb=no", *tests]
    environment = os.environ | {
        "PYTHONPATH": str(copy / "components"),
        "XDG_CACHE_HOME": str(copy.parent / "cache"),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    try:
        ended = subprocess.run(command, cwd=copy, env=environment, capture_output=True, timeout=SECONDS, check=False)
    except subprocess.TimeoutExpired:
        return True
    return ended.returncode not in {0, pytest.ExitCode.NO_TESTS_COLLECTED}


def difference(fault: Fault) -> str:
    """The lines of a fault, before and after."""
    return f"    - {fault.old.strip()}\n    + {fault.new.strip()}"


if __name__ == "__main__":
    sys.exit(main())
