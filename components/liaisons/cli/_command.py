"""How a command joins the command line."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from typing import TYPE_CHECKING

from liaisons.errors import LiaisonsError

if TYPE_CHECKING:
    Commands = argparse._SubParsersAction[argparse.ArgumentParser]  # noqa: SLF001 - it has no public name


def command(
    commands: Commands, name: str, action: Callable[[argparse.Namespace], int], text: str, examples: str
) -> argparse.ArgumentParser:
    """Add a command.

    :param action: does it and returns the exit status.
    :param text: one line.
    :param examples: lines of a shell.
    """
    lines = "\n".join(f"  {line}" for line in examples.strip().splitlines())
    parser = commands.add_parser(
        name,
        help=text,
        description=f"{text[0].upper()}{text[1:]}.",
        epilog=f"examples:\n{lines}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    # The same option stands before the command too; its value there must survive.
    parser.add_argument(
        "--debug", action="store_true", default=argparse.SUPPRESS, help="show where an error comes from"
    )
    parser.set_defaults(action=action)
    return parser


def add_unpacked_limit(parser: argparse.ArgumentParser) -> None:
    """Add the option that allows larger archives."""
    parser.add_argument(
        "--unpacked-limit",
        action=_Limit,
        metavar="BYTES",
        help="so much an FMU or SSP archive may take unpacked (default: 1 GiB, or $LIAISONS_UNPACKED_LIMIT)",
    )


class _Limit(argparse.Action):
    """Allow it in this process and in those that it starts."""

    def __call__(self, parser: argparse.ArgumentParser, _: object, value: object, *__: object) -> None:
        from liaisons.cosim.archive import LIMIT_VARIABLE, unpacked_limit

        os.environ[LIMIT_VARIABLE] = str(value)
        try:
            unpacked_limit()
        except LiaisonsError as error:
            parser.error(str(error).replace(LIMIT_VARIABLE, "--unpacked-limit"))
