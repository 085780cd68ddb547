"""Order and programs, without any FMU."""

from __future__ import annotations

from typing import Any

import pytest

from liaisons.cosim import VariableReference
from liaisons.cosim.structure import schedule

Feeds = dict[tuple[str, str], tuple[str, str]]
CHAIN: Feeds = {("b", "u"): ("a", "y"), ("c", "u"): ("b", "y")}
RING: Feeds = {("b", "u"): ("a", "y"), ("a", "u"): ("b", "y")}


def _always(_output: VariableReference, _input: VariableReference) -> bool:
    return True


def _never(_output: VariableReference, _input: VariableReference) -> bool:
    return False


def _program(text: str) -> list[Any]:
    actions: dict[str, schedule.Action] = {"set": "set", "step": "step", "get": "get"}
    return [(actions[word], name) for word, name in (item.split() for item in text.split(", "))]


@pytest.mark.parametrize("names", ["abc", "cba", "bca"])
def test_sources_come_before_what_they_feed(names: str) -> None:
    assert schedule.strong_components(names, CHAIN) == [["a"], ["b"], ["c"]]


def test_order_of_addition_decides_where_connections_do_not() -> None:
    assert schedule.strong_components(["z", "y", "x"], {}) == [["z"], ["y"], ["x"]]


def test_cycle_keeps_the_order_of_addition_between_its_source_and_its_sink() -> None:
    feeds = {**RING, ("a", "w"): ("source", "y"), ("sink", "u"): ("a", "y")}
    assert schedule.strong_components(["sink", "b", "a", "source"], feeds) == [["source"], ["b", "a"], ["sink"]]


def _of_b(output: VariableReference, _input: VariableReference) -> bool:
    return output[0] == "b"


@pytest.mark.parametrize(
    ("names", "feeds", "depends", "coupling", "newest", "program"),
    [
        # targets that extrapolate are stepped with the values at t
        ("abc", CHAIN, _always, "gauss-seidel", "", "step a, get a, step b, set b, get b, step c, set c, get c"),
        # those that want the newest values are set before their step, and not again
        ("abc", CHAIN, _always, "gauss-seidel", "bc", "step a, get a, set b, step b, get b, set c, step c, get c"),
        # all are stepped before anything is handed on
        ("abc", CHAIN, _always, "jacobi", "bc", "step a, step b, step c, get a, set b, get b, set c, get c"),
        # outputs that depend on inputs are read after these are new
        ("ab", RING, _of_b, "gauss-seidel", "", "step a, get a, step b, set b, get b, set a, get a"),
        # a loop of accelerations and forces is swept once
        ("ab", RING, _always, "gauss-seidel", "", "step a, step b, get b, set a, get a, set b, get b"),
        # a component may feed itself
        ("a", {("a", "u"): ("a", "y")}, _never, "gauss-seidel", "", "step a, get a, set a, get a"),
    ],
)
def test_operations_of_a_step(  # noqa: PLR0917 - a table
    names: str, feeds: Feeds, depends: schedule.Depends, coupling: schedule.Coupling, newest: str, program: str
) -> None:
    assert schedule.step_program(names, feeds, depends, coupling, newest) == _program(program)


@pytest.mark.parametrize("depends", [_always, _never])
def test_every_component_of_a_cycle_is_consistent_at_the_end(depends: schedule.Depends) -> None:
    program = schedule.consistent_program(["a", "b"], RING, depends)
    for name in ("a", "b"):
        assert program.index(("set", name)) < len(program) - 1 - program[::-1].index(("get", name))


def test_zigzag_through_two_components_is_followed_to_its_end() -> None:
    """a.y1 -> b.u1, b.y1 (of u1) -> a.u2, a.y2 (of u2) -> b.u2: b is to be set twice."""
    feeds: Feeds = {("b", "u1"): ("a", "y1"), ("a", "u2"): ("b", "y1"), ("b", "u2"): ("a", "y2")}

    def depends(output: VariableReference, input_: VariableReference) -> bool:
        return (output[1], input_[1]) in {("y1", "u1"), ("y2", "u2")} and output != ("a", "y1")

    assert schedule.consistent_program(["a", "b"], feeds, depends) == _program(
        "get a, set b, get b, set a, get a, set b, get b"
    )


def test_late_inputs_are_those_of_the_same_cycle_and_with_jacobi_all() -> None:
    assert schedule.late_inputs(["a", "b"], RING, "gauss-seidel") == [("a", "u")]
    assert schedule.late_inputs(["a"], {("a", "u"): ("a", "y")}, "gauss-seidel") == [("a", "u")]
    assert schedule.late_inputs(["a", "b", "c"], CHAIN, "gauss-seidel") == []
    assert schedule.late_inputs(["a", "b", "c"], CHAIN, "jacobi") == [("b", "u"), ("c", "u")]
    assert schedule.late_inputs(["a", "b"], RING, "implicit") == []


SHORT, LONG = "a.y b.u b.y a.u a.y", "a.y c.u c.y d.u d.y a.v a.y"


@pytest.mark.parametrize(
    ("independent", "loop"),
    [(None, SHORT), (("a", "u"), LONG), (("b", "u"), LONG), (("c", "u"), SHORT), (("a", "v"), SHORT)],
)
def test_algebraic_loops_are_shortest_cycles_of_direct_dependencies(
    independent: VariableReference | None, loop: str
) -> None:
    feeds = {("c", "u"): ("a", "y"), ("d", "u"): ("c", "y"), ("a", "v"): ("d", "y"), **RING}
    (seen,) = schedule.shortest_algebraic_loops(feeds, lambda _, input_: input_ != independent)
    assert " ".join(".".join(reference) for reference in seen) == loop
    assert schedule.shortest_algebraic_loops(feeds, lambda output, _: output[0] != "a") == []
    assert schedule.shortest_algebraic_loops(CHAIN, _always) == []
