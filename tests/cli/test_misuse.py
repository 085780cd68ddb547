"""Misuse of the command line as such: one line, a hint, exit status 2."""

import pytest

from liaisons.errors import LiaisonsError
from liaisons.project import ProjectError

from .conftest import Cli, is_misuse


@pytest.mark.parametrize(
    ("words", "hints"),
    [
        ((), ["COMMAND", "--help"]),
        (("lst",), ["'lst'", "did you mean 'list'"]),
        (("build", "Pendlum"), ["'Pendlum'", "did you mean 'Pendulum'"]),
        (("build", "--backend", "nativ"), ["'nativ'", "did you mean 'native'"]),
        (("build", "--fast"), ["liaisons build: ", "'--fast'", "known: --backend"]),
        (
            ("sweep", "Pendulum", "--ovr=theta_0=0:1:3", "--keep", "theta"),
            ["liaisons sweep: ", "did you mean '--over'"],
        ),
        (("simulate", "Pendulum", "theta_0=3"), ["liaisons simulate: ", "'theta_0'", "one word too many"]),
        (("run", "no_such_claim"), ["'no_such_claim'"]),
        (("run",), ["--all"]),
    ],
    ids=" ".join,
)
def test_misuse_is_one_line_with_a_hint(liaisons: Cli, words: tuple[str, ...], hints: list[str]) -> None:
    assert is_misuse(liaisons(*words), *hints)


@pytest.mark.parametrize("command", ["", "list", "build", "simulate", "run", "check"])
def test_help_shows_examples(liaisons: Cli, command: str) -> None:
    reply = liaisons(*command.split(), "--help")
    assert reply.status == 0
    assert f"  liaisons {command}" in reply.out.split("examples:")[1]


def test_debug_lets_the_traceback_through(liaisons: Cli) -> None:
    for words in (("--debug", "build", "Pendlum"), ("build", "Pendlum", "--debug")):
        with pytest.raises(ProjectError) as caught:
            liaisons(*words)
        assert isinstance(caught.value, LiaisonsError)


def test_completions_hold_commands_components_and_scenarios(liaisons: Cli) -> None:
    words = liaisons("--completions").out.split("'")[1].split()
    assert {"build", "Pendulum", "pumped_swing"} <= set(words)
