"""What README and CONTRIBUTING show works as printed."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from .conftest import Cli

ROOT = Path(__file__).resolve().parents[2]


def blocks(document: str, language: str) -> list[str]:
    """The fenced blocks of a document in one language."""
    return re.findall(
        rf"^```{language}\n(.*?)^```", (ROOT / document).read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE
    )


def test_the_component_of_the_contributing_guide(liaisons: Cli, tmp_path: Path) -> None:
    component, test = blocks("CONTRIBUTING.md", "python")
    (tmp_path / "turning_parabola.py").write_text(component)
    (tmp_path / "test_turning_parabola.py").write_text(test)
    assert len([line for line in component.splitlines() if line.strip()]) <= 50  # about 40 lines, as promised

    (commands,) = [block for block in blocks("CONTRIBUTING.md", "console") if "turning_parabola" in block]
    for line in commands.splitlines():
        reply = liaisons(*line.removeprefix("$ liaisons ").split())
        assert reply.status == 0, reply.out + reply.err
    assert (tmp_path / "TurningParabola.png").is_file()

    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-W", "error", test_file := "test_turning_parabola.py"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert "1 passed" in done.stdout, f"{test_file}: {done.stdout}"


def test_the_scenario_of_the_readme(liaisons: Cli, tmp_path: Path) -> None:
    (scenario,) = [block for block in blocks("README.md", "python") if "run_scenario" in block]
    (tmp_path / "small_angle.py").write_text(scenario)
    reply = liaisons("run", "small_angle.py")
    assert reply.status == 0, reply.out + reply.err
    assert (tmp_path / "figures" / "small_angle.png").is_file()


@pytest.mark.usefixtures("liaisons")
def test_the_system_of_the_readme() -> None:
    (system,) = [block for block in blocks("README.md", "python") if "System(" in block]
    names: dict[str, object] = {}
    exec(system.replace("stop_time=60", "stop_time=1"), names)
    assert names["result"]["swing.theta"][0] == 0.05  # type: ignore[index]


def test_the_readme_has_two_commands_first() -> None:
    main, test, *_ = blocks("README.md", "sh")
    assert main.count("\n") == test.count("\n") == 1
    *_, words = main.rpartition("liaisons ")
    assert words.split()[0] == "run"
    assert "pytest" in test
