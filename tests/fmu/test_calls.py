"""Which call is refused as out of turn: exactly those that tests/conformance/calls.txt has of the standard."""

from __future__ import annotations

import ctypes as c
from pathlib import Path

import pytest
from driver import CO_SIMULATION, DISCARD, ERROR, MODEL_EXCHANGE, OK, SIGNATURES, TYPES, Instance, Library

NUMBERS = {c.c_size_t, c.c_double, c.c_bool, c.c_uint, c.c_int}
COLUMNS = {MODEL_EXCHANGE: "CIZETU", CO_SIMULATION: "CIZSEgsU"}
HARMLESS = {"FreeFMUState", "SetDebugLogging"}
"""NULL is nothing to free, and 1 category that is NULL is refused where it is in turn."""


def standard() -> dict[str, dict[str, str]]:
    """By the name of a function and the kind of an instance: a letter for each of the columns."""
    found: dict[str, dict[str, str]] = {}
    for line in (Path(__file__).parents[1] / "conformance" / "calls.txt").read_text().splitlines():
        if not line.startswith("fmi"):
            continue
        name, *letters = line.split()
        types, ways = ([*TYPES, "Binary"] if "{Type}" in name else [""]), (["Get", "Set"] if "{Way}" in name else [""])
        for full in (name.replace("{Type}", kind).replace("{Way}", way) for kind in types for way in ways):
            found[full] = {MODEL_EXCHANGE: "".join(letters[:6]), CO_SIMULATION: "".join(letters[6:])}
    return found


STANDARD = standard()


def nothing(kind: object) -> object:
    """An argument: NULL, or a number."""
    return c.c_size_t(1) if kind is c.c_size_t else 0 if kind in NUMBERS else None


def out_of_turn(instance: Instance, function: str) -> bool:
    """Call it with NULL for all its pointers, which is refused anyway; whether that is because it is out of turn."""
    types = SIGNATURES[instance.library.fmi][function]
    instance.messages.clear()
    status = instance.invoke(function, *map(nothing, types))
    assert status in (DISCARD, ERROR) or function in HARMLESS or set(types) <= NUMBERS
    start = f"{instance.library.full(function)} must not be called"
    return any(message.startswith(start) for message in instance.messages)


def expected(library: Library, kind: str, column: str) -> dict[str, bool]:
    place = COLUMNS[kind].index(column)
    rows = {library.full(function): function for function in SIGNATURES[library.fmi]}
    return {function: STANDARD[name][kind][place] == "." for name, function in rows.items()}


def at(library: Library, kind: str, column: str) -> Instance:
    """An instance in some phase; one for co-simulation handles events where there are some."""
    events = {"events": kind == CO_SIMULATION and library.fmi == "3"}
    instance = library.instantiate(kind, **events)
    if column == "C":
        assert instance.call("EnterConfigurationMode") == OK
    elif column != "I":
        assert instance.initialize() == OK
        if column != "Z":
            assert instance.call("ExitInitializationMode") == OK
        if column == "T" or (column == "S" and library.fmi == "3"):
            instance.go_on()
        if column == "U":
            assert instance.call("Terminate") == OK
    return instance


def test_every_function_of_the_standard_is_in_the_table(ring_library) -> None:
    known = {ring_library.full(function) for function in SIGNATURES[ring_library.fmi]}
    assert {name for name in STANDARD if name[:4] == f"fmi{ring_library.fmi}"} == known


@pytest.mark.parametrize(
    ("kind", "column"), [(k, c) for k, columns in COLUMNS.items() for c in columns if c not in "gs"]
)
def test_calls_in_every_phase(ring_library, kind, column) -> None:
    if ring_library.fmi == "2" and (column == "C" or kind + column == CO_SIMULATION + "E"):
        return  # there is no such phase
    found = {f: out_of_turn(at(ring_library, kind, column), f) for f in SIGNATURES[ring_library.fmi]}
    assert found == expected(ring_library, kind, column)


@pytest.mark.parametrize("column", ["g", "s"])
def test_calls_inside_a_step(ring3, column) -> None:
    found = {}

    def observer(instance: Instance, _: float) -> None:
        found.update({function: out_of_turn(instance, function) for function in SIGNATURES["3"]})

    instance = ring3.start(options={"observer": observer, "wanted": ["force"] if column == "s" else []})
    assert instance.step(0.0, 0.1) == OK
    assert found == expected(ring3, CO_SIMULATION, column)


def test_without_event_mode_there_is_none(ring3) -> None:
    instance = ring3.start()
    assert instance.call("EnterEventMode") == ERROR
    message = "fmi3EnterEventMode must not be called: this instance is one for co-simulation without event mode"
    assert instance.messages == [message]
