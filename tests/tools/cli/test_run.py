"""``liaisons run`` and the scenario protocol; the scenarios here need no FMU."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from liaisons.scenario_files import read_gallery
from liaisons_tools.scenarios import names

from .conftest import COMMAND, Cli, Runs, begun, is_misuse

# Of each theme; building the site runs all, and fails where a claim does.
FIRST = {theme["scenarios"][0] for theme in read_gallery()["themes"].values()}

SCENARIO = '''\
"""Twice two is four.

More words, which are not the claim.
"""

from liaisons_tools.scenarios import panels, scenario, within


@scenario
def main(claim):
    panels(("arithmetic", "n", "2 n"))[0].plot([1, 2], [2, 4])
    claim("2 x 2 = 4", 2 * 2, 4, within(0, because="whole numbers"))
    claim("and so on", ERROR, 0, within(1e-3, because="some are not"))
'''


def write(path: Path, error: str = "1e-4") -> Path:
    path.write_text(SCENARIO.replace("ERROR", error))
    return path


def test_a_scenario_that_holds(runs: Runs, tmp_path: Path) -> None:
    out = runs("run", write(tmp_path / "arithmetic.py"))
    header, _, first, second = out.splitlines()[-4:]
    assert "arithmetic: Twice two is four." in out
    assert header.split() == ["scenario", "claim", "error", "tolerance", "verdict", "time"]
    assert first.startswith("arithmetic ")
    assert first.endswith(" s")
    assert second.split()[-3:] == ["0.0001", "0.001", "pass"]
    assert (tmp_path / "figures" / "arithmetic.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("error", ["2e-3", "float('nan')"])
def test_a_claim_that_fails_gives_status_1(liaisons: Cli, tmp_path: Path, error: str) -> None:
    reply = liaisons("run", write(tmp_path / "arithmetic.py", error), "--figures", tmp_path / "elsewhere")
    assert reply.status == 1
    assert "FAIL" in reply.out
    assert (tmp_path / "elsewhere" / "arithmetic.png").is_file()


def test_modules_beside_a_scenario_are_found_each_its_own(runs: Runs, liaisons: Cli, tmp_path: Path) -> None:
    """Two folders have a module of one name; a file called as one of Python's does not take its place."""
    for folder, error in (("one", "1e-4"), ("two", "2e-4")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "beside.py").write_text(f"error = {error}\n")
        (tmp_path / folder / "json.py").write_text("raise RuntimeError\n")
        text = SCENARIO.replace("ERROR", "error").replace("from liaisons", "from beside import error\nfrom liaisons")
        (tmp_path / folder / f"{folder}.py").write_text(text)
    out = runs("run", "one/one.py", "two/two.py", "one/one.py")
    errors = [line.split()[-3] for line in out.splitlines() if "and so on" in line]
    assert errors == ["0.0001", "0.0002", "0.0001"]
    (tmp_path / "leaves.py").write_text("import sys\nsys.exit(3)\n")
    assert is_misuse(liaisons("run", "leaves.py"), "leaves.py:2: SystemExit: 3")


def test_without_a_name_the_scenarios_are_listed(liaisons: Cli) -> None:
    reply = liaisons("run")
    assert reply.status == 0
    assert all(name in reply.out for name in FIRST)


def test_a_theme(liaisons: Cli, tmp_path: Path) -> None:
    (tmp_path / "scenarios").mkdir()
    write(tmp_path / "scenarios" / "first.py")
    write(tmp_path / "scenarios" / "second.py")
    reply = liaisons("run", "--theme", "own")
    assert reply.status == 0
    assert [line.split(":")[0] for line in reply.out.splitlines() if "Twice" in line] == ["first", "second"]
    assert is_misuse(liaisons("run", "--theme", "contact"), "no theme is called 'contact'; did you mean 'contacts'?")


def test_a_broken_scenario_does_not_hide_the_verdicts_of_the_others(liaisons: Cli, tmp_path: Path) -> None:
    broken = write(tmp_path / "broken.py", error="1 / 0")
    reply = liaisons("run", broken, write(tmp_path / "arithmetic.py"))
    assert reply.status == 1
    assert "error: ZeroDivisionError: division by zero" in reply.out
    assert reply.out.count("2 x 2 = 4") == 2  # what was claimed before the error is shown, too
    assert [line.split()[-1] for line in reply.out.splitlines() if "see its error" in line] == ["ERROR"]
    assert "and so on" in reply.out
    with pytest.raises(ZeroDivisionError):
        liaisons("run", broken, "--debug")


@pytest.mark.parametrize(
    ("old", "new", "hint"),
    [
        ("@scenario", "", "put @scenario before its main(claim)"),
        ('"""Twice', '"" and """Twice', "state its claim in the docstring"),
        ("@scenario\n", "@scenario\nclass main:\n    pass\n\n", "no function; decorate main(claim: Claims)"),
        ("some are not", 'some are not"))\n\nprint(("more', "arithmetic.py:9: main runs before what comes after it"),
        ("from liaisons_tools.scenarios import", "from liaisons_tools.scenarios import no_such_name,", "no_such_name"),
    ],
)
def test_a_file_that_is_no_scenario(liaisons: Cli, tmp_path: Path, old: str, new: str, hint: str) -> None:
    path = write(tmp_path / "arithmetic.py")
    path.write_text(path.read_text().replace(old, new))
    assert is_misuse(liaisons("run", path), "arithmetic.py", hint)


def test_a_scenario_that_claims_nothing_does_not_pass(liaisons: Cli, tmp_path: Path) -> None:
    path = tmp_path / "silent.py"
    path.write_text(
        '"""Nothing."""\n\nfrom liaisons.scenarios import *\n\n@scenario\ndef main(claim):\n    panels(("", "", ""))'
    )
    reply = liaisons("run", path)
    assert reply.status == 1
    assert "silent.py claims nothing" in reply.out


@pytest.mark.parametrize(
    "name", [name if name in FIRST else pytest.param(name, marks=pytest.mark.slow) for name in names()]
)
def test_the_claims_of_this_project_hold(runs: Runs, tmp_path: Path, name: str) -> None:
    runs("run", name, "--figures", tmp_path)
    assert (tmp_path / f"{name}.png").is_file()


@pytest.mark.parametrize(("error", "status"), [("0", 0), ("1", 1)])
def test_a_scenario_runs_as_a_script_too(tmp_path: Path, error: str, status: int) -> None:
    path = write(tmp_path / "arithmetic.py", error)
    done = subprocess.run([sys.executable, path.name], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == status, done.stderr
    assert "2 x 2 = 4" in done.stdout
    assert (tmp_path / "figures" / "arithmetic.png").is_file()


@pytest.mark.skipif(sys.platform == "win32", reason="a shell")
def test_a_job_in_the_background_of_a_shell_is_not_interrupted(tmp_path: Path) -> None:
    """The shell has it ignore interrupts, which are for what runs in the foreground."""
    path = write(tmp_path / "arithmetic.py", "0")
    signalling = "    import signal; signal.raise_signal(signal.SIGINT)\n    panels"
    path.write_text(path.read_text().replace("    panels", signalling))
    ignoring = ["sh", "-c", 'trap "" INT; exec "$@"', "sh", *COMMAND, "run", path.name]
    done = subprocess.run(ignoring, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.usefixtures("interruptible")
def test_an_interrupt_is_one_line_and_status_130(tmp_path: Path) -> None:
    path = tmp_path / "slow.py"
    path.write_text(
        SCENARIO.replace("    panels", "    import time; print('here', flush=True); time.sleep(60)\n    panels")
    )
    process = begun("run", path.name, folder=tmp_path)
    assert process.stdout is not None
    while process.stdout.readline() != b"here\n":  # the scenario has begun
        assert process.poll() is None
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert err == b"liaisons: interrupted\n"
    assert not (tmp_path / "figures" / "slow.png").exists()
