"""Misuse of the command line as such: one line, a hint, exit status 2."""

import subprocess
import sys

import pytest

from liaisons.errors import LiaisonsError
from liaisons.library import catalogue, catalogue_names
from liaisons.project import ProjectError

from .conftest import Cli, is_misuse


@pytest.mark.parametrize(
    ("words", "hints"),
    [
        ((), ["Missing command", "--help"]),
        (("lst",), ["'lst'", "Did you mean 'list'"]),
        (("build", "Pendlum"), ["'Pendlum'", "did you mean 'Pendulum'"]),
        (("build", "--backend", "nativ"), ["liaisons build: ", "'nativ'", "'auto', 'native', 'python'"]),
        (("build", "--fast"), ["liaisons build: ", "--fast", "liaisons build --help"]),
        (("sweep", "Pendulum", "--ovr=theta_0=0:1:3", "--keep", "theta"), ["liaisons sweep: ", "--ovr", "--over"]),
        (("simulate", "Pendulum", "theta_0=3"), ["liaisons simulate: ", "unexpected extra argument", "(theta_0=3)"]),
        (("run", "no_such_claim"), ["'no_such_claim'"]),
        (("run",), ["--all"]),
    ],
    ids=" ".join,
)
def test_misuse_is_one_line_with_a_hint(liaisons: Cli, words: tuple[str, ...], hints: list[str]) -> None:
    assert is_misuse(liaisons(*words), *hints)


@pytest.mark.parametrize("command", ["", "list", "build", "simulate", "sweep", "compare", "run", "check"])
def test_help_shows_examples(liaisons: Cli, command: str) -> None:
    reply = liaisons(*command.split(), "--help")
    assert reply.status == 0
    assert f"  liaisons {command}" in reply.out.split("examples:")[1]


def test_debug_lets_the_traceback_through(liaisons: Cli) -> None:
    for words in (("--debug", "build", "Pendlum"), ("build", "Pendlum", "--debug")):
        with pytest.raises(ProjectError) as caught:
            liaisons(*words)
        assert isinstance(caught.value, LiaisonsError)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("liaisons ", ["list", "build", "simulate", "sweep", "compare", "run", "check"]),
        ("liaisons build Pe", ["Pendulum", "PendulumChain"]),
        ("liaisons run pumped", ["pumped_swing"]),
        ("liaisons build --backend ", ["auto", "native", "python"]),
        ("liaisons simulate --st", ["--start", "--stop", "--step"]),
        ("liaisons simulate my_", []),  # a shell completes files where there is nothing
    ],
)
def test_what_the_tabulator_completes(
    liaisons: Cli, monkeypatch: pytest.MonkeyPatch, line: str, words: list[str]
) -> None:
    monkeypatch.setenv("_LIAISONS_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", line)
    monkeypatch.setenv("COMP_CWORD", str(line.count(" ")))
    assert liaisons().out.split() == words


def test_completion_knows_the_whole_catalogue() -> None:
    assert catalogue_names() == sorted(catalogue())


@pytest.mark.parametrize("words", [["--help"], ["simulate", "--help"], ["sweep", "--help"]])
def test_help_waits_for_nothing_heavy(words: list[str]) -> None:
    code = f"import sys; from liaisons.cli import main; main({words}); print(*sys.modules, file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert {"numpy", "scipy", "casadi", "fmpy", "matplotlib"}.isdisjoint(done.stderr.split())
