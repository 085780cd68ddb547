"""Lives of mechanisms with contacts at random: none hangs, penetrates, gains energy or is refused; see contacts.c."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest
from seeds import KINDS, built, lives

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the program needs POSIX")

# Processor time of a call that takes some hundred events: a hundred times as much as the longest of 100 000 lives.
LONGEST = 1.0


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    return cache(lambda name: built(KINDS[name], tmp_path_factory.mktemp("bodies")))


@pytest.mark.parametrize("name", KINDS)
def test_some_lives(fmu, program, name: str) -> None:
    found = lives(name, fmu(name), program("contacts"), [*range(150), 202, 363, 778, 959])
    assert {life.seed: (life.faults, life.said) for life in found if life.faults or life.status > 1} == {}
    assert max(life.longest_call for life in found) < LONGEST


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_many_lives(fmu, program, name: str) -> None:
    found = lives(name, fmu(name), program("contacts"), range(1000, 15300))
    assert {life.seed: (life.faults, life.said) for life in found if life.faults or life.status > 1} == {}
    assert max(life.longest_call for life in found) < LONGEST
