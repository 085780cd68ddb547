"""What an FMU says while it runs, and the error that quotes it."""

from __future__ import annotations

import logging
from collections import deque
from typing import Literal, final

from liaisons.cosim.refusal import StatusError

WARNING, DISCARD, ERROR, FATAL = 1, 2, 3, 4

Action = Literal["set", "step", "get", "save", "restore", "derive", "shape", "slope"]
"""What a prepared call does; the last three: directional derivatives, derivatives of inputs and of outputs."""

COMPLAINTS = ("logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal")
"""The log categories that come with a status."""

_STATUS = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")

logger = logging.getLogger("liaisons.cosim")


@final
class Messages:
    """The last messages of one instance, and the worst status that it has returned.

    :param name: name of the component.
    """

    def __init__(self, name: str) -> None:
        self.worst = 0
        self._name = name
        self._messages: deque[tuple[int, str]] = deque(maxlen=20)

    def note(self, status: int, message: bytes | None) -> None:
        """Keep what the FMU logs; a new warning goes to the ``logging`` channel ``liaisons.cosim``, too."""
        entry = status, (message or b"").decode(errors="replace").strip()
        if entry not in self._messages:
            self._messages.append(entry)
            logger.log(logging.WARNING if status == WARNING else logging.DEBUG, "%s: %s", self._name, entry[1])

    def words(self) -> str:
        """The FMU's complaints, else the last thing it said."""
        complaints = dict.fromkeys(message for status, message in self._messages if status >= DISCARD)
        said = list(complaints) or [message for _, message in self._messages][-1:]
        return f": {'; '.join(said)}" if said else " without a message"

    def failure(self, function: str, status: int, about: str) -> StatusError:
        """The error for a status that is none of OK and Warning."""
        self.worst = max(self.worst, status)
        label = _STATUS[status] if status in range(len(_STATUS)) else str(status)
        words = self.words()
        # if the run goes on from a saved state, the next failure has words of its own
        self._messages = deque((entry for entry in self._messages if entry[0] < DISCARD), maxlen=20)
        return StatusError(f"{self._name}: {function}{about} returned {label}{words}", status)
