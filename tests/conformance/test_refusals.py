"""Refusals end a run in every importer, with the FMU's words; see refusals.py, which prints the same as a table."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from functools import cache

import pytest
from refusals import CASES, MASTERS, Master, Outcome, cases, installed, run
from trial import COMPONENTS

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="each case runs in a fork")

# ecos looks at no status: it goes on to the end with what it has read last.
ENDS = {"fmpy": {"raises"}, "ours": {"raises"}, "libcosimpy": {"returns false", "aborts"}, "ecospy": {"goes on"}}


@pytest.fixture(scope="module")
def outcomes(fmu) -> Callable[[Master], dict[str, Outcome]]:
    """What a master makes of the cases that can be put to it."""

    @cache
    def ran(master: Master) -> dict[str, Outcome]:
        if not installed(master):
            pytest.skip(f"{master} is not installed")
        mine = [case for case in CASES if master in case.masters]
        tasks = [(case, fmu(case.component, master[-1])) for case in mine]
        return dict(zip([case.kind for case in mine], run(master, tasks, fmu("Ramp", "2")), strict=True))

    return ran


@pytest.mark.parametrize(
    ("case", "master"),
    [pytest.param(case, m, id=f"{case.kind}-{m}".replace(" ", "_")) for case in CASES for m in case.masters],
)
def test_a_refusal_ends_the_run_with_the_words_of_the_fmu(outcomes, case, master) -> None:
    outcome = outcomes(master)[case.kind]
    assert outcome.end in ENDS[master.split()[0]], outcome.printed
    assert re.search(case.words, outcome.message), outcome.printed
    if master == "fmpy 2":  # which tries again what was discarded
        assert outcome.statuses == case.statuses
        assert outcome.printed.count(outcome.message) == len(case.statuses)
    else:
        assert outcome.statuses[0] == case.statuses[0]


@pytest.mark.slow
@pytest.mark.parametrize("master", MASTERS)
@pytest.mark.parametrize("name", COMPONENTS)
def test_refusals_of_every_component_end_the_run(fmu, name, master) -> None:
    if not installed(master):
        pytest.skip(f"{master} is not installed")
    mine = [case for case in cases(name, fmu(name, master[-1])) if master in case.masters]
    found = run(master, [(case, fmu(name, master[-1])) for case in mine])
    for case, outcome in zip(mine, found, strict=True):
        assert outcome.end != "hangs", case
        if outcome.statuses:
            assert outcome.end in ENDS[master.split()[0]], (case, outcome.printed)
        if case.words:
            assert re.search(case.words, outcome.message), (case, outcome.printed)
