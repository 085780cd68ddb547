"""What FMUs of others say and put out: it does no harm in a terminal, fills no screen, and not-a-numbers are seen."""

from __future__ import annotations

import logging
import subprocess
import sys

import pytest
from making import FmuPaths

from liaisons import simulate
from liaisons.errors import SimulationError

_LIAISONS = [sys.executable, "-c", "from liaisons.cli import main; raise SystemExit(main())"]


def test_no_control_characters_reach_the_terminal(fmu: FmuPaths) -> None:
    """Warnings, an error of 10 MB, and names with the one-letter form of an escape sequence, which XML allows."""
    command = [*_LIAISONS, "simulate", str(fmu("Loud")), "--stop", "1", "--step", "0.1"]
    done = subprocess.run(command, capture_output=True, timeout=60, check=False)
    assert done.returncode == 2
    for text in (done.stdout.decode(), done.stderr.decode()):
        assert all(line.isprintable() for line in text.splitlines())
        assert 100 < len(text) < 5000


def test_warnings_have_an_end(fmu: FmuPaths, caplog: pytest.LogCaptureFixture) -> None:
    with pytest.raises(SimulationError):
        simulate(fmu("Loud"), stop_time=1.0, step_size=1e-3)
    warnings = [record for record in caplog.records if record.levelno == logging.WARNING]
    assert len(warnings) == 100
    assert warnings[-1].message.endswith("; further warnings of it are not shown")


def test_what_is_not_finite_is_said_once_a_variable(fmu: FmuPaths, caplog: pytest.LogCaptureFixture) -> None:
    simulate(fmu("Endless"), stop_time=1.0, step_size=0.125)
    assert [record.message for record in caplog.records] == [
        "Endless: x is nan at t = 0.5 s, and not finite at 5 of 9 points",
        "Endless: y is -inf at t = 0.75 s, and not finite at 1 of 9 points",
    ]
