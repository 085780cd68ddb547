"""The component that CONTRIBUTING takes a newcomer through builds, runs and holds as printed."""

import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from .conftest import Cli
from .documents import blocks


def test_the_component_of_the_contributing_guide(liaisons: Cli, tmp_path: Path) -> None:
    component, test = blocks("CONTRIBUTING.md", "python")
    (tmp_path / "turning_parabola.py").write_text(component)
    (tmp_path / "test_turning_parabola.py").write_text(test)
    assert len([line for line in component.splitlines() if line.strip()]) <= 50  # about 40 lines, as promised

    (commands,) = [block for block in blocks("CONTRIBUTING.md", "console") if "turning_parabola" in block]
    for line in commands.splitlines():
        reply = liaisons(*shlex.split(line.removeprefix("$ liaisons ")))
        assert reply.status == 0, reply.out + reply.err
        if "simulate" in line:  # the prescribed motion is a whole one: an angle that grows as its rate says
            shown = {row.split()[0]: row.split()[1:] for row in reply.out.splitlines()}
            angle, rate = (float(shown[name][2]) for name in ("turn", "turn_dot"))
            assert angle == pytest.approx(4 * rate, rel=1e-5)  # six digits are printed
    assert (tmp_path / "TurningParabola.png").is_file()

    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-W", "error", "test_turning_parabola.py"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert "1 passed" in done.stdout, done.stdout
