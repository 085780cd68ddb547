"""The page of all benchmarks, from what their scripts left behind."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from _measure import Section, claims, markdown

BEGIN, END = "<!-- measured: from here on by `python benchmarks` -->\n", "<!-- end of what is measured -->\n"


def page(template: str, sections: Mapping[str, Section], results: Path) -> str:
    """The page: what stands between its marks is replaced by the claims and a chapter for each section."""
    head, _, rest = template.partition(BEGIN)
    _, _, tail = rest.partition(END)
    machines = {section.machine for section in sections.values()}
    chapters = [_chapter(name, section, results, with_machine=len(machines) > 1) for name, section in sections.items()]
    summary = ["## What was asked", claims({name: section.rows for name, section in sections.items()})]
    if len(machines) == 1:
        summary.insert(0, f"Measured on: {machines.pop()}.")
    measured = "\n\n".join([*summary, *chapters])
    return f"{head}{BEGIN}\n{measured}\n\n{END}{tail}"


def _facts(section: Section) -> str:
    """When it was measured, and of what."""
    facts = [
        section.date,
        f"commit {section.commit}",
        f"{section.seconds:.0f} s",
        f"{section.busy:g} cores busy before",
    ]
    return ", ".join([*facts, *["quick: not to quote"] * section.quick])


def _chapter(name: str, section: Section, results: Path, *, with_machine: bool) -> str:
    diagrams = [path.name for path in sorted(results.glob(f"{name}*.png"))]
    pictures = [f"![{section.title}](results/{diagram})" for diagram in diagrams]
    machine = f", {section.machine}" if with_machine else ""
    heading = [f"## {name}", section.title, f"*{_facts(section)}{machine}*"]
    return "\n\n".join([*heading, *pictures])


def tables(name: str, section: Section) -> str:
    """All that a section measured, for a page of its own."""
    return f"# {name}\n\n{section.title}\n\n*{_facts(section)}, {section.machine}*\n\n{markdown(section.rows, '##')}\n"
