"""Journals: files to which a sweep appends its finished cases, to go on from there after an interruption.

The first line identifies the sweep, every other one is a case, as JSON with a checksum.  A line that was not completed
is dropped, and its case simulated again.  The file itself is locked for one process at a time: a library's lock needs a
second file, which would stay.
"""

from __future__ import annotations

import json
import logging
import re
import sys
import time
import zlib
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from io import BufferedRandom
from pathlib import Path
from typing import Any, final

from liaisons.errors import JournalError, SweepError
from liaisons_tools.sweeps.study import Completed, Failure, Outcome, Outcomes

_logger = logging.getLogger("liaisons.sweeps")

_CHECK = re.compile(rb', "check": "([0-9a-f]{8})"}$')
_PATIENCE = 1.0  # [s] for the processes of a killed sweep to end: they have inherited its lock
_LOCKED_BYTE = 2**31 - 1  # on Windows: behind the content, for a locked byte cannot be read


@final
class Journal:
    """A journal as a context manager; its file is created if it does not exist.

    :param key: :meth:`liaisons_tools.sweeps.study.Study.journal_key` of the sweep.
    :param cases: number of cases.
    :param columns: number of measures of a case.
    :param retry: simulate again also the cases that the model has refused.
    :ivar done: cases that are not simulated again.
    :raises JournalError: if it belongs to another sweep, is in use by one, or is no journal.
    :raises SweepError: if it cannot be read or written.
    """

    def __init__(self, path: Path, key: str, cases: int, columns: int, *, retry: bool = False) -> None:
        self._path = path
        self._seed = zlib.crc32(key.encode())  # so that lines of other sweeps have wrong checksums
        self._cases, self._columns = cases, columns
        with ExitStack() as stack:
            try:
                self._file: BufferedRandom = stack.enter_context(path.open("a+b"))
                self._wait_for_lock()
                outcomes = self._read_outcomes(key)
            except OSError as error:
                words = f"cannot be used as a journal: {error.strerror or error}; choose another path"
                raise SweepError(f"{path}: {words}") from None
            stack.pop_all()
        self.done = {
            case: outcome
            for case, outcome in outcomes.items()
            if not isinstance(outcome, Failure) or (outcome.refused and not retry)
        }

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(OSError):  # as :meth:`add` has said
            self._file.close()

    def add(self, outcomes: Mapping[int, Outcome]) -> None:
        """Append the outcomes of cases.

        :raises SweepError: if the file takes no more.
        """
        try:
            self._write(b"".join(_checksummed_line(_case_record(*item), self._seed) for item in outcomes.items()))
        except OSError as error:
            raise SweepError(
                f"{self._path}: cannot be written: {error.strerror}; make room, and the sweep goes on from there"
            ) from None

    def _write(self, lines: bytes) -> None:
        """Append lines and flush the file."""
        self._file.write(lines)
        self._file.flush()

    def _wait_for_lock(self) -> None:
        """Lock the file, or raise a JournalError if another sweep does not release it in time."""
        end = time.monotonic() + _PATIENCE
        while not _try_to_lock(self._file):
            if time.monotonic() > end:
                raise JournalError(f"{self._path} is in use by another sweep; let that end, or choose another file")
            time.sleep(0.05)

    def _read_outcomes(self, key: str) -> Outcomes:
        """Remove an incomplete last line from the file, and return the outcomes in it."""
        self._file.seek(0)
        *lines, rest = self._file.read().split(b"\n")
        header = _checksummed_line({"liaisons sweep": key}, 0)
        if lines:
            self._check_header(lines[0], key)
        elif not header.startswith(rest):
            raise JournalError(f"{self._path} is no journal of a sweep; choose another file")
        outcomes: Outcomes = {}
        damaged: list[int] = []
        for number, line in enumerate(lines[1:], start=2):
            content = _checked_content(line, self._seed)
            if content is None:
                damaged.append(number)
            else:
                outcomes.update([self._parsed_outcome(content, number)])
        if damaged:
            shown = ", ".join(map(str, damaged[:5])) + (f" and {len(damaged) - 5} more" if len(damaged) > 5 else "")
            _logger.warning("%s: damaged lines are left out, and their cases done again: %s", self._path, shown)
        self._file.truncate(sum(len(line) + 1 for line in lines))
        if not lines:
            self._write(header)
        return outcomes

    def _check_header(self, line: bytes, key: str) -> None:
        """Raise a JournalError unless the first line identifies this sweep."""
        if not line.startswith(b'{"liaisons sweep": '):
            raise JournalError(f"{self._path} is no journal of a sweep; choose another file")
        content = _checked_content(line, 0)
        if content is None:
            raise JournalError(
                f"{self._path}: line 1, which names the sweep, is damaged or of an earlier release; "
                "choose another file, or delete it"
            )
        if content["liaisons sweep"] != key:
            raise JournalError(
                f"{self._path} is the journal of another sweep: its FMU, cases or settings differ; "
                "choose another file, or delete it"
            )

    def _parsed_outcome(self, content: Any, number: int) -> tuple[int, Outcome]:
        """Case and outcome of a line; a JournalError unless they are of this sweep."""
        match content:
            case {"case": int(case), **outcome} if 0 <= case < self._cases:
                match outcome:
                    case {"values": [*values]} if len(values) == self._columns and {*map(type, values)} <= {float}:
                        return case, Completed(tuple(values), tuple(map(str, outcome.get("warnings", []))))
                    case {"failure": str(reason)}:
                        return case, Failure(reason, refused=True)
                    case {"unfinished": str(reason)}:
                        return case, Failure(reason, refused=False)
        raise JournalError(
            f"{self._path}: line {number} is none of this sweep of {self._cases} cases; "
            "delete the line, and the sweep goes on"
        )


def _case_record(case: int, outcome: Outcome) -> dict[str, object]:
    """Content of the line of a case, as a dictionary for JSON."""
    if isinstance(outcome, Failure):
        return {"case": case, ("failure" if outcome.refused else "unfinished"): outcome.reason}
    warned = {"warnings": outcome.warnings} if outcome.warnings else {}
    return {"case": case, "values": outcome.values, **warned}


def _checksummed_line(content: dict[str, object], seed: int) -> bytes:
    """Line of a journal: content as JSON with a checksum."""
    text = json.dumps(content).encode()
    return text[:-1] + f', "check": "{zlib.crc32(text, seed):08x}"}}\n'.encode()


def _checked_content(line: bytes, seed: int) -> Any:
    """Content of a line of a journal; None if its checksum is wrong."""
    check = _CHECK.search(line)
    text = line[: check.start()] + b"}" if check else b""
    if check is None or zlib.crc32(text, seed) != int(check[1], 16):
        return None
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None


def _try_to_lock(file: BufferedRandom) -> bool:
    """Lock a file until it is closed or this process ends; return False if another process has locked it."""
    if sys.platform == "win32":
        import msvcrt

        file.seek(_LOCKED_BYTE)
        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True
    import fcntl

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        pass  # a file system without locks
    return True
