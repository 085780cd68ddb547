"""The command line: ``liaisons list | build | simulate | sweep | compare | run | check``."""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

from liaisons import __version__
from liaisons.cli._encoding import tolerate_encodings
from liaisons.errors import LiaisonsError, suggestion
from liaisons.processes import orderly_end

_EXAMPLES = """\
examples:
  liaisons list                                   what there is
  liaisons run pumped_swing                       a claim, its FMUs, its verdict, its figure
  liaisons run --all
  liaisons build Pendulum                         writes fmus/Pendulum.fmu
  liaisons build my_component.py                  ... from a file of yours
  liaisons simulate Pendulum --set theta_0=3 --stop 20 --plot
  liaisons sweep Pendulum --over theta_0=0.1:3:50 --keep theta:max
  liaisons compare mine.csv theirs.csv            differences, signal by signal
  liaisons check fmus/Pendulum.fmu                validators and invariants, for any FMU

'liaisons COMMAND --help' shows more. Tab completion: eval "$(liaisons --completions)"
"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command.

    :param argv: the words after ``liaisons``; those of the process unless given.
    :returns: exit status: 0 done, 1 a claim or check failed, 2 it could not be done, 130 interrupted, 143 terminated.
    """
    tolerate_encodings()
    try:
        with orderly_end():
            return _perform(_parser().parse_args(argv))
    except KeyboardInterrupt:
        print("liaisons: interrupted", file=sys.stderr)
        return 130


def _perform(arguments: argparse.Namespace) -> int:
    try:
        status: int = arguments.action(arguments)
        sys.stdout.flush()  # a closed pipe must show here, not at exit
        return status
    except BrokenPipeError:  # 'liaisons list | head'
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except (LiaisonsError, OSError) as error:
        if arguments.debug:
            raise
        print(f"liaisons: error: {_one_line(error)}", file=sys.stderr)
        return 2


class _Parser(argparse.ArgumentParser):
    """Reports misuse in one line with the nearest match."""

    def parse_known_args(self, *words: Any, **namespace: Any) -> tuple[Any, list[str]]:
        """As argparse does, but what a command does not know is its own error, not that of the whole."""
        found, unknown = super().parse_known_args(*words, **namespace)
        if unknown:
            word = unknown[0].partition("=")[0]
            options = [option for action in self._actions for option in action.option_strings if len(option) > 2]
            more = suggestion(word, options) if word.startswith("-") else "; it is one word too many"
            self.error(f"{word!r} is not known{more}")
        return found, unknown

    def error(self, message: str) -> NoReturn:
        match = re.search(r"invalid choice: '(.*)' \(choose from (.*)\)", message)
        if match:
            choices = re.findall(r"[\w-]+", match[2])
            message = f"{match[1]!r} is not known{suggestion(match[1], choices)}"
        self.exit(2, f"{self.prog}: error: {message} ({self.prog} --help shows examples)\n")


class _Completions(argparse.Action):
    """Print what makes the words after ``liaisons`` complete in bash and zsh."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from liaisons.library import catalogue
        from liaisons.scenarios import names

        words = ["list", "build", "simulate", "sweep", "compare", "run", "check", *catalogue(), *names()]
        print(f"complete -o default -W '{' '.join(words)}' liaisons")
        parser.exit()


def _parser() -> argparse.ArgumentParser:
    # Imported here, where an interrupt is caught: NumPy takes a while.
    from liaisons.cli import check, compare, components, run, simulate, sweep

    parser = _Parser(
        prog="liaisons",
        description="From one Lagrangian with active constraints to verified FMUs.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"liaisons {__version__}")
    parser.add_argument("--debug", action="store_true", help="show where an error comes from")
    parser.add_argument("--completions", action=_Completions, nargs=0, help="print the tab completion for bash")
    commands = parser.add_subparsers(required=True, metavar="COMMAND", dest="command")
    for module in (components, simulate, sweep, compare, run, check):
        module.register(commands)
    return parser


def _one_line(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return str(error)
