"""The command line as a function: words in, exit status and text out."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from liaisons import Result
from liaisons_tools.cli import main

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
Runs = Callable[..., str]
Simulated = Callable[..., Result]


@pytest.fixture
def liaisons(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Cli:
    """Run ``liaisons WORDS`` in a directory of its own, where FMUs land too."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("LIAISONS_FMUS", raising=False)

    def run(*words: str | Path) -> Reply:
        try:
            status = main([str(word) for word in words])
        except SystemExit as leave:  # how completion ends
            status = int(leave.code or 0)
        captured = capsys.readouterr()
        return Reply(status, captured.out, captured.err)

    return run


@pytest.fixture
def runs(liaisons: Cli) -> Runs:
    """Run a command that succeeds; what it prints."""

    def run(*words: str | Path) -> str:
        reply = liaisons(*words)
        assert reply.status == 0, reply.out + reply.err
        return reply.out

    return run


@pytest.fixture
def simulated(runs: Runs, tmp_path: Path) -> Simulated:
    """The result of ``liaisons simulate WORDS``, by a file."""

    def run(*words: str | Path) -> Result:
        runs("simulate", *words, "--csv", "out.csv")
        return Result.from_csv(tmp_path / "out.csv")

    return run


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the FMUs land that several tests of a file use, built once."""
    return tmp_path_factory.mktemp("fmus")


@pytest.fixture
def shared_fmus(liaisons: Cli, fmus: Path, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: ARG001 - it comes first
    """Let ``liaisons`` put FMUs there."""
    monkeypatch.setenv("LIAISONS_FMUS", str(fmus))


@pytest.fixture
def bead(tmp_path: Path) -> Path:
    """A file of a user with a mechanism ``Bead`` and an operator ``Parabola``."""
    path = tmp_path / "bead.py"
    path.write_text(BEAD)
    return path


COMMAND = [sys.executable, "-c", "from liaisons_tools.cli import main; raise SystemExit(main())"]
"""``liaisons`` as a process of its own."""


def begun(*words: str, folder: Path, **environment: str) -> subprocess.Popen[bytes]:
    """It has begun, in a folder; who waits for it reads what it says."""
    return subprocess.Popen(
        [*COMMAND, *words], cwd=folder, env=os.environ | environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


def is_misuse(reply: Reply, *words: str) -> bool:
    """Exit status 2 and one line, without traceback, that holds all the words."""
    return reply.status == 2 and reply.err.count("\n") == 1 and all(word in reply.err for word in words)
