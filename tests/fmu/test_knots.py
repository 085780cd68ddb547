"""Instants of knots: a step that may end early ends at each of them, from parameters and from a table in a file."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from driver import OK, Library

from liaisons.interface import MOST_KNOTS
from liaisons.models import PlannedMotion

INSTANTS = np.array([0.25, 0.5, 0.5, 1.25, 2.0])
"""One is a jump."""
TABLE = np.vstack([INSTANTS, INSTANTS**2, np.sin(INSTANTS), np.cos(INSTANTS)])


@pytest.mark.parametrize("place", ["parameters", "file"])
def test_steps_end_early_at_every_knot(library: Callable[..., Library], place: str, tmp_path: Path) -> None:
    planned, options = library(PlannedMotion, "fmi3"), {}
    if place == "file":
        bits = " ".join(struct.pack(">d", number).hex() for number in TABLE.ravel())
        (tmp_path / "starts.txt").write_text(f"t 0 {TABLE.size} {bits} table\n")
        options = {"token": f"{planned.token}-0123456789abcdef", "resources": tmp_path}
    instance = planned.instantiate(events=True, early=True, **options)
    assert instance.initialize() == OK
    if place == "parameters":
        padded = np.pad(TABLE, ((0, 0), (0, MOST_KNOTS - INSTANTS.size)))
        assert instance.set(dict(zip(("instant", "value", "rate", "acceleration"), padded, strict=True))) == OK
    assert instance.call("ExitInitializationMode") == OK
    first = instance.go_on()
    seen, now = [], 0.0
    assert first.next_time == INSTANTS[0]
    while now < 3.0:
        step = instance.advance(now, 3.0 - now)
        now = step.time
        if step.event:
            seen.append(now)
            assert instance.call("EnterEventMode") == OK
            instance.go_on()
    np.testing.assert_array_equal(seen, np.unique(INSTANTS))
