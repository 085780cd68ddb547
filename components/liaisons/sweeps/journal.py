"""What is done of a sweep, in a file that is only appended to: whoever is interrupted goes on from there.

The first line says which sweep it is, every other one is a finished case, as JSON.  What is half written when the
machine stops, is dropped and done again.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping
from contextlib import suppress
from io import TextIOWrapper
from pathlib import Path
from typing import Any, final

from liaisons.sweeps.errors import JournalError, SweepError
from liaisons.sweeps.session import Outcome

_logger = logging.getLogger("liaisons.sweeps")


@final
class Journal:
    """A context manager that opens the file for appending; it is created if need be.

    :param key: :meth:`liaisons.sweeps.plan.Plan.key` of the sweep.
    :param columns: so many numbers are kept of a case.
    :ivar done: the cases that are in it.
    :raises JournalError: if it belongs to another sweep, or the file is no journal.
    :raises SweepError: if it cannot be read or written.
    """

    def __init__(self, path: Path, key: str, columns: int) -> None:
        self._path = path
        self.done: dict[int, Outcome] = {}
        header = json.dumps({"liaisons sweep": key})
        try:
            lines = path.read_bytes().split(b"\n") if path.exists() else [b""]
            if lines[:-1]:
                self._check(_read(lines[0]), key)
            for line in lines[1:-1]:
                self._take(_read(line), columns)
            whole = sum(len(line) + 1 for line in lines[:-1])
            if lines[-1] and whole == 0 and not header.encode().startswith(lines[-1]):
                raise JournalError(f"{path} is no journal of a sweep; choose another file")
            self._file: TextIOWrapper = path.open("a", encoding="utf-8")
            self._file.truncate(whole)
            if not whole:
                self._write(header + "\n")
        except OSError as error:
            raise SweepError(f"{path}: cannot be used as a journal: {error.strerror}; choose another path") from None

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(OSError):  # what could not be written still cannot
            self._file.close()

    def add(self, outcomes: Mapping[int, Outcome]) -> None:
        """Write down finished cases.

        :raises SweepError: if the file takes no more.
        """
        self.done |= outcomes
        lines = (
            json.dumps({"case": case, ("failure" if isinstance(outcome, str) else "values"): outcome})
            for case, outcome in outcomes.items()
        )
        try:
            self._write("".join(f"{line}\n" for line in lines))
        except OSError as error:
            raise SweepError(
                f"{self._path}: cannot be written: {error.strerror}; make room, and the sweep goes on from there"
            ) from None

    def _write(self, text: str) -> None:
        self._file.write(text)
        self._file.flush()

    def _check(self, header: Any, key: str) -> None:
        if not isinstance(header, dict) or "liaisons sweep" not in header:
            raise JournalError(f"{self._path} is no journal of a sweep; choose another file")
        if header["liaisons sweep"] != key:
            raise JournalError(
                f"{self._path} is the journal of another sweep: its FMU, cases or settings differ; "
                "choose another file, or delete it"
            )

    def _take(self, line: Any, columns: int) -> None:
        match line:
            case {"case": int(case), "values": [*values]} if len(values) == columns:
                self.done[case] = tuple(map(float, values))
            case {"case": int(case), "failure": str(words)}:
                self.done[case] = words
            case _:
                _logger.warning("%s: a damaged line is left out, and its case done again", self._path)


def _read(line: bytes) -> Any:
    try:
        return json.loads(line)
    except ValueError:
        return None
