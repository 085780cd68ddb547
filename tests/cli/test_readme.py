"""What the README shows works as printed."""

from pathlib import Path

import pytest

from .conftest import Cli, blocks


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
    exec(system.replace("stop_time=10", "stop_time=1"), names)
    assert names["result"]["lower.theta"][0] == -0.2  # type: ignore[index]


@pytest.mark.usefixtures("liaisons")
def test_the_sweep_of_the_readme() -> None:
    (sweep,) = [block for block in blocks("README.md", "python") if "sweep(" in block]
    names: dict[str, object] = {}
    exec(sweep, names)
    assert len(names["table"]) == 6  # type: ignore[arg-type]


def test_the_readme_has_two_commands_first() -> None:
    main, test, *_ = blocks("README.md", "sh")
    assert main.count("\n") == test.count("\n") == 1
    *_, words = main.rpartition("liaisons ")
    assert words.split()[0] == "run"
    assert "pytest" in test
