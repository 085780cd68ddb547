"""Which call is refused as out of turn: exactly those that calls.txt has of the standard."""

from __future__ import annotations

import ctypes as c
from collections.abc import Callable
from functools import cache

import pytest
from driver import CO_SIMULATION, DISCARD, ERROR, MODEL_EXCHANGE, SIGNATURES, Instance, Library
from trial import every_version, standard_calls

NUMBERS = {c.c_size_t, c.c_double, c.c_bool, c.c_uint, c.c_int}
COLUMNS = {MODEL_EXCHANGE: "CIZETU", CO_SIMULATION: "CIZSEgsU"}
STANDARD = standard_calls()
HARMLESS = {"FreeFMUState", "SetDebugLogging"}
"""NULL is nothing to free, and 1 category that is NULL is refused where it is in turn."""


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
    place, which = COLUMNS[kind].index(column), [*COLUMNS].index(kind)
    rows = {library.full(function): function for function in SIGNATURES[library.fmi]}
    return {function: STANDARD[name][which][place] == "." for name, function in rows.items()}


@pytest.fixture(scope="module")
def library(fmu) -> Callable[[str], Library]:
    """A chain, which has structural sizes and inputs."""
    return cache(lambda version: Library(fmu("PendulumChain", version)))


def at(library: Library, kind: str, column: str) -> Instance:
    """An instance in some phase; one for co-simulation handles events where there are some."""
    events = {"events": kind == CO_SIMULATION and library.fmi == "3"}
    instance = library.instantiate(kind, **events)
    if column == "C":
        instance.do("EnterConfigurationMode")
    elif column != "I":
        instance.initialize()
        if column != "Z":
            instance.exit_initialization()
        if column == "T" or (column == "S" and library.fmi == "3"):
            instance.go_on()
        if column == "U":
            instance.do("Terminate")
    return instance


@every_version
def test_every_function_of_the_standard_is_in_the_table(library, version) -> None:
    known = {library(version).full(function) for function in SIGNATURES[version]}
    assert {name for name in STANDARD if name[:4] == f"fmi{version}"} == known


@every_version
@pytest.mark.parametrize(
    ("kind", "column"), [(k, c) for k, columns in COLUMNS.items() for c in columns if c not in "gs"]
)
def test_calls_in_every_phase(library, version, kind, column) -> None:
    if version == "2" and (column == "C" or kind + column == CO_SIMULATION + "E"):
        return  # there is no such phase
    found = {f: out_of_turn(at(library(version), kind, column), f) for f in SIGNATURES[version]}
    assert found == expected(library(version), kind, column)


@pytest.mark.parametrize("column", ["g", "s"])
def test_calls_inside_a_step(library, column) -> None:
    found = {}

    def observer(instance: Instance, _: float) -> None:
        found.update({function: out_of_turn(instance, function) for function in SIGNATURES["3"]})

    three = library("3")
    inputs = [v.name for v in three.description.modelVariables if v.causality == "input"]
    instance = three.start(options={"observer": observer, "wanted": inputs if column == "s" else []})
    instance.step(0.0, 0.1)
    assert found == expected(three, CO_SIMULATION, column)


def test_without_event_mode_there_is_none(library) -> None:
    instance = library("3").start()
    message = "{} must not be called: this instance is one for co-simulation without event mode"
    instance.refuse(message, "EnterEventMode")
