"""``liaisons sweep``."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np
import pytest

from liaisons_tools.cli import main
from liaisons_tools.sweeps.study import Completed, Failure

BAD_VALUES = [
    "theta_0=",
    "=1",
    "theta_0",
    "theta_0=0:1:0",
    "theta_0=0:1:-3",
    "theta_0=0:1:x",
    "theta_0=0:1:10000000000",
]
BAD_DISTRIBUTIONS = ["3:0", "1:1", "nan:1", "0:inf", "normal:1:0", "normal:1:-1", "normal:0:inf", "1"]
MISUSE = {
    "": "nothing is varied",
    "--over theta0=1": "did you mean 'theta_0'",
    "--over theta_0=1 --samples 3": "--samples and --seed need --random",
    "--over theta_0=1 --seed 3": "need --random",
    "--over theta_0=1 --over theta_0=2": "theta_0 is varied twice",
    "--over theta_0=1 --set theta_0=2": "'theta_0' is varied, and set",
    "--over theta_0=1 --keep energy,": "no signal is named",
    "--over theta_0=1 --workers 0": "workers = 0",
    "--over theta_0=1 --workers 2 --dask tcp://x:1": "leave it out on a Dask cluster",
    "--over theta_0=1 --dask ''": "no Dask scheduler",
    "--over theta_0=1 --time-limit -1": "time_limit = -1",
    "--over theta_0=1 --time-limit nan": "time_limit = nan",
    "--over theta_0=1 --retry": "retry needs the journal",
    "--over theta_0=1 --plot table.film": "no figure ends so",
    "--over theta_0=1 --csv .": "Is a directory; choose another path",
    "--over theta_0=1 --csv both --journal both": "cannot be the table and the journal",
    "--over theta_0=1 --csv nowhere/table.csv": "No such file or directory; choose another path",
    "--over mass=1:2:1000000 --over theta_0=0:1:1000000": "cases are too many",
    "--random theta_0=0:1": "needs --samples",
    "--random theta_0=0:1 --samples -1": "count = -1",
    "--random theta_0=0:1 --over mass=1": "use one of them",
    "--random mass=1:2 --samples 1000000000000": "1000000000000 cases are too many",
    **{f"--over {values}": "a count of 1 at least" for values in BAD_VALUES},
    **{f"--samples 3 --random theta_0={values}": "low < high" for values in BAD_DISTRIBUTIONS},
}


@pytest.mark.parametrize("words", MISUSE)
def test_misuse_is_one_line(pendulum, tmp_path, monkeypatch, capsys, words) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["sweep", str(pendulum), "--keep", "theta", "--stop", "0.1", *shlex.split(words)]) == 2
    error = capsys.readouterr().err
    assert MISUSE[words] in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_values_are_spaced_evenly_from_first_to_last(pendulum, tmp_path) -> None:
    words = "--over theta_0=0:1:3 --keep theta --stop 0.1 --csv"
    assert main(["sweep", str(pendulum), *words.split(), str(tmp_path / "table.csv")]) == 0
    table = np.genfromtxt(tmp_path / "table.csv", delimiter=",", skip_header=1)
    assert table[:, 0].tolist() == [0, 0.5, 1]


def test_the_help_says_whom_to_trust(capsys) -> None:
    assert main(["sweep", "--help"]) == 0
    assert "Take files only from people you trust" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("end", [KeyboardInterrupt, SystemExit])
def test_an_interrupt_says_what_is_kept(pendulum, tmp_path, capsys, monkeypatch, end) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise end

    monkeypatch.setattr(import_module("liaisons_tools.sweeps.sweeping"), "simulate_locally", interrupted)
    arguments = ["sweep", str(pendulum), "--keep", "theta", "--over", "theta_0=1"]
    for more, words in (
        (["--csv", str(tmp_path / "t.csv")], "t.csv.journal has what is done"),
        ([], "nothing is kept"),
    ):
        if end is KeyboardInterrupt:
            assert main([*arguments, *more]) == 130
        else:  # how a command ends that is terminated
            with pytest.raises(SystemExit):
                main([*arguments, *more])
        assert words in capsys.readouterr().err


def test_failing_cases_are_shown(pendulum, capsys) -> None:
    arguments = ["sweep", str(pendulum), "--keep", "theta", "--stop", "0.1", "--over", "mass=1,-1"]
    assert main(arguments) == 1
    assert "case 1 failed" in capsys.readouterr().out


def test_what_is_not_finished_is_left_to_the_next_start(pendulum, tmp_path, capsys, monkeypatch) -> None:
    csv = tmp_path / "table.csv"
    outcomes: list[Any] = [Failure("took too long", refused=False), Completed((1.0,))]

    def simulate(_plan: object, cases: list[int], _count: int, deliver: Callable[..., None], time_limit: float) -> None:
        assert time_limit == 3.0
        deliver(dict.fromkeys(cases, outcomes.pop(0)))

    monkeypatch.setattr(import_module("liaisons_tools.sweeps.sweeping"), "simulate_locally", simulate)
    command = ["sweep", str(pendulum), "--keep", "theta", "--over", "theta_0=1", "--csv", str(csv), "--time-limit", "3"]
    assert main(command) == 1
    said = capsys.readouterr().out
    assert "case 0 not finished: took too long" in said
    assert "1 of 1 cases not finished; the same command tries them again" in said
    assert sorted(tmp_path.iterdir()) == [csv, tmp_path / "table.csv.journal"]
    assert main(command) == 0
    assert list(tmp_path.iterdir()) == [csv]


def test_random_cases(pendulum, tmp_path) -> None:
    figure = tmp_path / "table.png"
    csv = tmp_path / "table.csv"
    random = ["--random", "theta_0=0:1", "--random", "mass=normal:1:0.1", "--samples", "5"]
    arguments = [str(pendulum), *random, "--keep", "theta:max", "--stop", "0.1", "--csv", str(csv)]
    assert main(["sweep", *arguments, "--plot", str(figure)]) == 0
    assert figure.read_bytes().startswith(b"\x89PNG")
    figure.unlink()
    assert len(csv.read_text(encoding="utf-8").splitlines()) == 8  # names, units, the title, five cases
    assert list(tmp_path.iterdir()) == [csv]  # the journal is gone


def test_a_system_of_a_python_file_and_of_an_archive(swing, tmp_path, capsys) -> None:
    file, archive = tmp_path / "my_system.py", tmp_path / "swing.ssp"
    swing.write_ssp(archive)
    lines = [f"system.add({n!r}, {str(c.fmu.path)!r})" for n, c in swing.parts.items()]
    file.write_text("\n".join(["from liaisons import System", "system = System('swing')", *lines]), encoding="utf-8")
    arguments = ["--over", "bob.theta_0=0:1:3", "--keep", "bob.theta:max", "--stop", "0.1", "--step", "0.05"]
    for subject in (f"{file}:system", str(archive)):
        assert main(["sweep", subject, *arguments]) == 0
        assert "bob.theta:max [rad]" in capsys.readouterr().out
        assert main(["simulate", subject, *arguments[-4:], "--record", "bob.theta"]) == 0
        assert "bob.theta  rad" in capsys.readouterr().out
    assert main(["simulate", f"{file}:system", *arguments[-4:], "--set", "bob.theta_0=1"]) == 2
    assert "start values of a system are given where its FMUs are added" in capsys.readouterr().err
