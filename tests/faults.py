"""Plant the faults of faults.toml again: whether the tests that are named there notice as many as it says.

    python tests/faults.py TOOL [PACKAGE...]

TOOL is a Python program that plants random faults into files, one at a time, and runs tests:
``TOOL FILE... --tests "..." --count N --seed N``; its last line is "N of M caught".
"""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]


def entries() -> list[dict[str, Any]]:
    """The entries of faults.toml, with their files relative to the repository, alphabetically for each pattern."""
    found = tomllib.loads((ROOT / "tests/faults.toml").read_text(encoding="utf-8"))["faults"]
    for entry in found:
        entry["files"] = [  # in another order a seed chooses other faults
            name
            for pattern in entry["files"]
            for name in sorted(path.relative_to(ROOT).as_posix() for path in ROOT.glob(pattern))
        ]
    return found


def main(tool: str, *packages: str) -> int:
    """Plant those of some packages, ``cosim`` or ``cosim/coupling``, or all; 1 if less is caught than the file says."""
    fewer = 0
    for entry in entries():
        if not packages or {entry["package"], entry["package"].partition("/")[0]} & {*packages}:
            options = [
                "--tests",
                " ".join(entry["tests"]),
                "--count",
                str(entry["count"]),
                "--seed",
                str(entry["seed"]),
            ]
            command = [sys.executable, tool, *entry["files"], *options]
            printed = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False, cwd=ROOT).stdout
            sys.stdout.write(printed)
            caught = printed.split("\n")[-2].split()[0] if " caught" in printed else "0"
            fewer += int(caught) < entry["caught"]
    return int(fewer > 0)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
