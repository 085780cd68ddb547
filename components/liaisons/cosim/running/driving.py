"""The loop over time of a run, and policies of its steps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple, Protocol

from liaisons.cosim.running.kernel import Happening, Kernel
from liaisons.errors import RefusedError


class NextSteps(NamedTuple):
    """Steps that are made next.

    :param ends: their ends [s]; none if the next step crosses a break.
    :param target: instant to which they lead [s].
    :param in_result: whether what they reach is in the result.
    """

    ends: Sequence[float]
    target: float
    in_result: bool = True


class Pace(Protocol):
    """How far steps go.

    :ivar repeats: whether steps may be taken back.
    """

    repeats: bool

    def next_steps(self) -> NextSteps | None:
        """The next steps up to a break; None at the end."""
        ...

    def crossed(self, at_target: bool) -> None:
        """Hear that a break was crossed."""
        ...

    def reached(self, count: int) -> None:
        """Hear how many steps were made, of those that are not taken back."""
        ...

    def accepts(self, steps: NextSteps, refusal: RefusedError | None) -> bool:
        """Whether steps are kept; else shorter ones are made from the same state.

        :param refusal: why they were refused, if they were.
        :raises RefusedError: if none is short enough.
        """
        ...


def drive(kernel: Kernel, pace: Pace, happening: Happening | None = None) -> Iterator[float]:
    """Step as a pace says, over breaks and what happens between them; yields instants that are reached [s]."""
    advance = kernel.advance if happening is None else happening.advance
    while (steps := pace.next_steps()) is not None:
        if not steps.ends:
            pace.crossed(kernel.cross_next_break(steps.target, in_result=steps.in_result))
        elif not pace.repeats:
            pace.reached(advance(steps.ends, in_result=steps.in_result))
        else:
            before = kernel.save()
            if not pace.accepts(steps, kernel.attempt(steps.ends)):
                kernel.moments.restore(before)
        yield kernel.recorder.end
