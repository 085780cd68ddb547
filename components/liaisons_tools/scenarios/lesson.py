"""What a scenario teaches: a question, a live page to try, a prediction, and what comes out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, final

from liaisons import LivePage, show
from liaisons.base.project import ProjectError
from liaisons.errors import suggestion
from liaisons.scenario_files import scenario_files
from liaisons_tools.scenarios.running import load


@final
@dataclass(frozen=True)
class Lesson:
    """A question about a scenario's mechanism; a scenario's function ``lesson`` returns it.

    :param subject: component of the live page.
    :param question: what is asked, in one sentence.
    :param predict: what to guess before anything is moved.
    :param try_out: what to do on the page.
    :param answer: what comes out, and why.
    :param controls: names of what can be changed on the page.
    :param plots: names of the signals that are plotted.
    :param start_values: of the component, operators among them.
    """

    subject: str
    question: str
    predict: str
    try_out: str
    answer: str
    controls: Sequence[str]
    plots: Sequence[str]
    start_values: Mapping[str, Any] = field(default_factory=dict[str, Any])

    def show(self, path: Path | str | None = None) -> LivePage:
        """Write the live page; see :func:`liaisons.show`."""
        return show(
            self.subject,
            path=path,
            start_values=self.start_values,
            controls=self.controls,
            plots=self.plots,
            question=self.question,
        )


def load_lesson(name: str) -> Lesson:
    """Return the lesson of a scenario.

    :raises ProjectError: if there is no such scenario, or it has none.
    """
    make = load(name).main.__globals__.get("lesson")
    if make is None:
        raise ProjectError(f"scenario {name} has no lesson{suggestion(name, lessons())}; `liaisons run {name}` runs it")
    return make()


def lessons() -> list[str]:
    """Names of the scenarios that have a lesson."""
    return [name for name, path in scenario_files().items() if "\ndef lesson() -> Lesson:\n" in path.read_text("utf-8")]
