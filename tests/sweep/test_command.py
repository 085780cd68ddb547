"""``liaisons sweep``."""

from __future__ import annotations

from liaisons.cli import main


def test_misuse_on_the_command_line(pendulum, capsys) -> None:
    def words(*arguments: str) -> str:
        assert main(["sweep", str(pendulum), "--keep", "theta", "--stop", "0.1", *arguments]) == 2
        return capsys.readouterr().err

    assert "did you mean 'theta_0'" in words("--over", "theta0=1")
    assert "count = -1" in words("--random", "theta_0=0:1", "--samples", "-1")
    assert "needs --samples" in words("--random", "theta_0=0:1")
    assert "use one of them" in words("--random", "theta_0=0:1", "--over", "mass=1")
    assert "nothing is varied" in words()


def test_failing_cases_are_shown(pendulum, capsys) -> None:
    arguments = ["sweep", str(pendulum), "--keep", "theta", "--stop", "0.1", "--over", "mass=1,-1"]
    assert main(arguments) == 1
    assert "case 1 failed" in capsys.readouterr().out


def test_random_cases(pendulum, tmp_path) -> None:
    csv = tmp_path / "table.csv"
    random = ["--random", "theta_0=0:1", "--random", "mass=normal:1:0.1", "--samples", "5", "--latin-hypercube"]
    arguments = [str(pendulum), *random, "--keep", "theta:max", "--stop", "0.1", "--csv", str(csv)]
    assert main(["sweep", *arguments]) == 0
    assert len(csv.read_text(encoding="utf-8").splitlines()) == 7
    assert list(tmp_path.iterdir()) == [csv]  # the journal is gone


def test_a_system_of_a_python_file_and_of_an_archive(swing, tmp_path, capsys) -> None:
    file, archive = tmp_path / "my_system.py", tmp_path / "swing.ssp"
    swing.write_ssp(archive)
    lines = [f"system.add({n!r}, {str(c.fmu.path)!r})" for n, c in swing.components.items()]
    file.write_text("\n".join(["from liaisons import System", "system = System('swing')", *lines]), encoding="utf-8")
    arguments = ["--over", "bob.theta_0=0:1:3", "--keep", "bob.theta:max", "--stop", "0.1", "--step", "0.05"]
    for subject in (f"{file}:system", str(archive)):
        assert main(["sweep", subject, *arguments]) == 0
        assert "bob.theta:max [rad]" in capsys.readouterr().out
