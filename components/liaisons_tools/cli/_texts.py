"""Numbers of the two texts as arguments of commands."""

from __future__ import annotations

import typer

from liaisons.library import component_names
from liaisons_pages.companion import Entry, entries_of, is_text_number


def requested_scenarios(name: str) -> list[str]:
    """Scenarios that verify the equation or section of this number in the texts; else the name itself.

    :raises BadParameter: if no scenario verifies it.
    """
    if not is_text_number(name):
        return [name]
    chosen = entries_of(name)
    scenarios = dict.fromkeys(scenario for entry in chosen for scenario in entry.scenarios)
    if not scenarios:
        tests = [verification_command(check) for entry in chosen for check in entry.by]
        raise typer.BadParameter(f"{name}: no scenario verifies it{f'; {tests[0]} does' if tests else ''}")
    return list(scenarios)


def requested_component(name: str) -> tuple[str, str | None]:
    """Component and part of its equations that have a number of the texts; any other name, and None.

    :raises BadParameter: if no component has it.
    """
    if not is_text_number(name):
        return name, None
    for entry in entries_of(name):
        if component := next(iter(entry_components(entry)), "Pendulum" if entry.part else ""):
            return component, entry.part or None
    raise typer.BadParameter(f"{name}: no component has it; `liaisons text {name}` says where it lives")


def entry_components(entry: Entry) -> list[str]:
    """Components of the catalogue that have a number of the texts."""
    names = set(component_names())
    return [name for name in dict.fromkeys(item.partition(".")[0] for item in entry.lives) if name in names]


def verification_command(check: str) -> str:
    """Shell command that repeats a check: a scenario, or a test in a clone of the repository."""
    file, separator, name = check.partition("::")
    return f"pytest tests/{file}.py::{name}" if separator else f"liaisons run {check}"
