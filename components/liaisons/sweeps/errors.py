"""What can be wrong with a sweep as a whole; what goes wrong in one case is recorded in the table."""

from liaisons.errors import LiaisonsError


class SweepError(LiaisonsError):
    """A sweep cannot be done as it was asked for."""


class JournalError(SweepError):
    """A journal belongs to another sweep, or is no journal."""
