"""The command line as a function: words in, exit status and text out."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from liaisons.cli import main

BEAD = '''\
"""Two components of a user."""

import casadi as ca

from liaisons import Coordinate, Mechanism, Operator, Parameter


class Straight(Mechanism, abstract=True):
    """What moves along a line."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    x = Coordinate("m", "position", start_rate=1.0)

    def kinetic_energy(self):
        return self.mass / 2 * self.dot(self.x) ** 2


class Bead(Straight):
    """Bead on a straight wire, free of forces."""


class Parabola(Operator):
    """Square of time: y = t²."""

    def signal(self, t):
        return t**2
'''


class Reply(NamedTuple):
    """What a command left behind."""

    status: int
    out: str
    err: str


Cli = Callable[..., Reply]


@pytest.fixture
def liaisons(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Cli:
    """Run ``liaisons WORDS`` in a directory of its own, where FMUs land too."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("LIAISONS_FMUS", str(tmp_path / "fmus"))

    def run(*words: str | Path) -> Reply:
        try:
            status = main([str(word) for word in words])
        except SystemExit as leave:  # how argparse ends
            status = int(leave.code or 0)
        captured = capsys.readouterr()
        return Reply(status, captured.out, captured.err)

    return run


@pytest.fixture
def bead(tmp_path: Path) -> Path:
    """A file of a user with a mechanism ``Bead`` and an operator ``Parabola``."""
    path = tmp_path / "bead.py"
    path.write_text(BEAD)
    return path


def is_misuse(reply: Reply, *words: str) -> bool:
    """Exit status 2 and one line, without traceback, that holds all the words."""
    return reply.status == 2 and reply.err.count("\n") == 1 and all(word in reply.err for word in words)
