"""Verdicts and their table."""

import math

import pytest

from liaisons.check import Verdict, table, verdict
from liaisons.errors import ValidityError


@pytest.mark.parametrize(
    ("error", "passed"), [(0.0, True), (1e-7, True), (1.01e-7, False), (math.inf, False), (math.nan, False)]
)
def test_a_claim_holds_when_its_error_is_a_number_within_the_tolerance(error: float, passed: bool) -> None:
    assert verdict("theta is right", error=error, tolerance=1e-7).passed is passed


@pytest.mark.parametrize(("error", "tolerance"), [(-1e-9, 1e-7), (0.0, -1.0), (0.0, math.nan), (0.0, math.inf)])
def test_a_verdict_that_could_not_fail_is_refused(error: float, tolerance: float) -> None:
    with pytest.raises(ValidityError, match="'theta is right'"):
        verdict("theta is right", error=error, tolerance=tolerance)


def test_a_verdict_says_what_it_found() -> None:
    found = Verdict("theta is right", 2e-6, 1e-7, "rad")
    assert str(found) == "FAIL: theta is right: error 2e-06 rad, tolerance 1e-07 rad"


def test_table_aligns_verdicts_under_their_columns() -> None:
    lines = table([verdict("long claim", error=0.5, tolerance=1), verdict("short", error=2, tolerance=1)]).splitlines()
    assert [line.split() for line in lines[2:]] == [["long", "claim", "0.5", "1", "pass"], ["short", "2", "1", "FAIL"]]
    assert lines[0].index("error") == lines[2].index("0.5") == lines[3].index("2")
    assert all(line == line.rstrip() for line in lines)


def test_table_takes_columns_of_ones_own() -> None:
    row = {"scenario": "swing", **verdict("grows", error=0.5, tolerance=1).row(), "time": "3 s"}
    header, _, line = table([row]).splitlines()
    assert header.split() == ["scenario", "claim", "error", "tolerance", "verdict", "time"]
    assert line.split() == ["swing", "grows", "0.5", "1", "pass", "3", "s"]
    assert table([]) == ""
    assert table([{"name": "a longer text", "": "x"}], width=8).splitlines()[2:] == ["a       x", "longer", "text"]
