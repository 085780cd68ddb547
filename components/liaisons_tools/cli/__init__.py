"""The command line, ``liaisons list``, ``liaisons equations``, ``liaisons simulate``, ..."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module

from liaisons.base.logs import collected_warnings, logger
from liaisons.base.processes import orderly_end
from liaisons.errors import LiaisonsError
from liaisons_tools.cli._encoding import tolerate_encodings

_MODULES = (
    *("components", "text", "equations", "simulate", "pictures", "plan"),
    *("identify", "sweep", "compare", "run", "check", "new"),
)
"""Modules with commands, in the order of the help."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command of the command line.

    :param argv: the words after ``liaisons``; those of the process unless given.
    :returns: exit status: 0 done, 1 a claim or check failed, 2 it could not be done, 130 interrupted, 143 terminated.
    """
    tolerate_encodings()
    words = list(sys.argv[1:] if argv is None else argv)
    debug = "--debug" in words  # before the command and behind it
    try:
        with orderly_end(), _print_warnings_at_the_end():
            status, error = _perform([word for word in words if word != "--debug"], debug=debug)
    except KeyboardInterrupt:
        status, error = 130, "liaisons: interrupted"
    if error:
        print(error, file=sys.stderr)
    return status


@contextmanager
def _print_warnings_at_the_end() -> Iterator[None]:
    """Print the warnings of simulations at the end of the context, before the line of an error."""
    nowhere = logging.NullHandler()  # else Python prints each at once
    logger.logger.addHandler(nowhere)
    with collected_warnings() as warned:
        try:
            yield
        finally:
            logger.logger.removeHandler(nowhere)
            for text in warned.texts:
                print(f"warning: {text}", file=sys.stderr)


def _perform(arguments: list[str], *, debug: bool) -> tuple[int, str]:
    """Run a command; return its exit status and the line of its error, empty if it succeeded."""
    # Imported here, where an interrupt is caught.
    from typer import TyperException

    from liaisons_tools.cli._command import application

    # One command needs its own module; help, and what is misspelt, all of them.
    modules = arguments[:1] if arguments[:1] and arguments[0] in _MODULES else _MODULES
    order = [import_module(f"liaisons_tools.cli.{name}").__name__ for name in modules]
    order += sorted({command.callback.__module__ for command in application.registered_commands if command.callback})
    application.registered_commands.sort(key=lambda command: order.index(getattr(command.callback, "__module__", "")))

    try:
        status: int = application(arguments, prog_name="liaisons", obj=debug, standalone_mode=False)
    except TyperException as misuse:
        program = getattr(getattr(misuse, "ctx", None), "command_path", "liaisons")
        words = misuse.format_message().replace("Value error, ", "")  # Pydantic's way to begin
        return misuse.exit_code, f"{program}: error: {words} ({program} --help shows examples)"
    except (LiaisonsError, OSError) as error:
        if debug:
            raise
        return 2, f"liaisons: error: {_message(error)}"
    if status == 130:  # what Typer makes of an interrupt
        raise KeyboardInterrupt
    return status, ""


def _message(error: Exception) -> str:
    """Message of an error on one line, with the file of an OSError."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    return str(error)
