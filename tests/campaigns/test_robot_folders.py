"""Files of robots in a folder against MuJoCo and Pinocchio: mass matrix and forces at twenty random states.

``LIAISONS_ROBOTS=FOLDER`` names the folder; ``python tests/kernel/language/robot_peers.py FILE...`` prints a table.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from robot_peers import DIGITS, distances, peer_of, read

FOLDER = Path(os.environ.get("LIAISONS_ROBOTS", Path(__file__).parents[1] / "kernel/language" / "robots"))

pytestmark = pytest.mark.slow


def files(folder: Path) -> list[Path]:
    """Files of robots; no parts of others, which have no bodies."""
    found = [*folder.rglob("*.urdf"), *(file for file in folder.rglob("*.xml") if b"<worldbody" in file.read_bytes())]
    return sorted(found)


@pytest.mark.parametrize("file", files(FOLDER), ids=lambda file: str(file.relative_to(FOLDER)))
@pytest.mark.variants(quick=None)
def test_a_file_moves_as_in_its_peer_or_is_refused_by_line(file: Path) -> None:
    pytest.importorskip("pinocchio" if file.suffix == ".urdf" else "mujoco")
    tree, refusal = read(file)
    if tree is None:
        assert re.search(r"line \d+: |<\w+>: it has no joint that moves", refusal), refusal
    else:
        assert max(distances(tree, peer_of(file, tree))) <= DIGITS
