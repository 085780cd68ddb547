"""Misuse of the command line as such: one line, a hint, exit status 2."""

import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from liaisons import System
from liaisons.errors import LiaisonsError, ProjectError
from liaisons.library import catalogue, catalogue_names

from .conftest import Cli, is_misuse

TOO_LARGE = ["points", " signals at each", "of memory are free", "larger steps"]
MISUSE = {
    "": ["Missing command", "--help"],
    "lst": ["'lst'", "Did you mean 'list'"],
    "list nowhere.py": ["nowhere.py", "no such file"],
    "list bead.py:Bed": ["bead.py", "'Bed'", "did you mean 'Bead'"],
    "build Pendlum": ["'Pendlum'", "did you mean 'Pendulum'"],
    "build bead.py Pendlum": ["'Pendlum'", "did you mean 'Pendulum'"],
    "build --backend nativ": ["liaisons build: ", "'nativ'", "'auto', 'native', 'python'"],
    "build --fast": ["liaisons build: ", "--fast", "liaisons build --help"],
    "build bead.py --backend python --output file": ["file"],
    "build bead.py:Bead --backend python --fmi 3": ["FMI 2.0", "native"],
    "build Pendulum --modelica --fmi 3": ["--fmi", "of FMUs", "omit --modelica"],
    "build Pendulum --standard-library": ["--modelica"],
    "sweep Pendulum --ovr=theta_0=0:1:3 --keep theta": ["liaisons sweep: ", "--ovr", "--over"],
    "run --theme contact": ["did you mean 'contacts'?"],
    "run no_such_claim": ["'no_such_claim'"],
    "check text.fmu": ["text.fmu", "no archive at all"],
    "compare one.csv none.csv": ["none.csv", "No such file"],
    "compare one.csv text.fmu": ["text.fmu", "not a result"],
    "compare one.csv none.parquet": ["none.parquet"],
    "compare one.csv one.csv --tolerance -1": ["--tolerance", "-1"],
    "compare one.csv one.csv --tolerance nan": ["--tolerance", "nan"],
    "compare one.csv one.csv --tolerance inf": ["--tolerance", "inf"],
    "compare one.csv one.csv --tolerance little": ["--tolerance", "little"],
    "simulate Pendlum": ["'Pendlum'", "did you mean 'Pendulum'"],
    "simulate Pendulum theta_0=3": ["liaisons simulate: ", "unexpected extra argument", "(theta_0=3)"],
    "simulate nowhere.fmu": ["nowhere.fmu", "no such file"],
    "simulate nowhere.ssp": ["nowhere.ssp", "no such file"],
    "simulate Pendulum --set theta_0": ["'theta_0'", "NAME=VALUE"],
    "simulate Pendulum --set thta_0=1": ["'thta_0'", "did you mean 'theta_0'"],
    "simulate Pendulum --set theta_0=much": ["theta_0", "'much'", "number"],
    "simulate Pendulum --set theta_0=nan": ["theta_0", "nan", "finite"],
    "simulate Pendulum --set energy=1": ["energy", "cannot be set"],
    "simulate Pendulum --set mass=-1": ["mass", "-1", "> 0"],
    "simulate Pendulum --set length_dot=-1 --stop 3 --step 3": ["length"],
    "simulate Pendulum --step 0": ["step_size = 0", "> 0"],
    "simulate Pendulum --stop -1": ["stop_time = -1"],
    "simulate Pendulum --step small": ["'small'", "--help"],
    "simulate Pendulum --record thta": ["'thta'", "did you mean 'theta'"],
    "simulate Pendulum --stop 1e300": ["step_size = ", "smaller than the rounding of times"],
    "simulate Pendulum --step 1e-300": ["step_size = ", "smaller than the rounding of times"],
    "simulate Pendulum --step 1e-10": TOO_LARGE,
    "simulate Pendulum --stop 1e9": TOO_LARGE,
    "simulate Pendulum --stop=1e308 --start=-1e308 --step=1e296": TOO_LARGE,
    "simulate Pendulum --input lenght=1": ["no input 'lenght'", "did you mean 'length'"],
    "simulate Pendulum --input 'length=1 + sn(t)'": ["--input length: ", "at character 5", "did you mean 'sin'"],
    "simulate Pendulum --input theta=t": ["Pendulum.theta", "'output'"],
    "simulate Pendulum --input theta_0=t": ["theta_0", "'parameter'", "--set"],
    "simulate Pendulum --input length=1 --input length=2": ["length is given twice"],
    "simulate Pendulum --input length=1+t --input length_dot=1": ["length_dot", "driven twice"],
    "simulate Pendulum --input length=1-t --stop 3 --step 0.5": ["length"],
    "simulate Pendulum --input length=sqrt(t-1)": ["'length'", "t = 0 s", "has no value there"],
    "simulate Pendulum --input length=sqrt(t)": ["'length'", "inf", "finite"],
    "simulate Pendulum --input nowhere.csv": ["nowhere.csv", "No such file"],
    "simulate Pendulum --input length=one.csv": ["--input one.csv"],
    "simulate Pendulum --input one.csv": ["one.csv", "from 0 to 1 s", "0 to 10 s", "--stop"],
    "simulate Pendulum --input one.csv --start=-1 --stop 1": ["one.csv", "from 0 to 1 s", "-1 to 1 s"],
    "simulate Pendulum --input one.csv --join cubic --stop 1": ["'cubic'", "'pchip'"],
    "simulate Pendulum --input wrong.csv": ["no input 'lenght'", "did you mean 'length'"],
    "simulate pair.ssp --set swin.theta_0=1": ["swin.theta_0", "did you mean 'swing'"],
    "simulate pair.ssp --input swin.pivot_x=t": ["'swin'", "did you mean 'swing'"],
    "simulate pair.ssp --input pivot_x=t": ["'pivot_x'", "COMPONENT.NAME"],
    "simulate pair.ssp --input swing.length=t": ["swing.length", "motor.y already"],
}
UNWRITABLE = {"no/folder.png": "No such file", "folder": "Is a directory", "text.fmu/in.png": "Not a directory"}


@pytest.fixture
def files(shared_fmus: None, bead: Path, tmp_path: Path) -> list[Path]:  # noqa: ARG001 - they go elsewhere
    """What there is in the folder."""
    (tmp_path / "folder").mkdir()
    for name in ("text.fmu", "file"):
        (tmp_path / name).write_text("no archive, no table")
    (tmp_path / "one.csv").write_text("time,length\n0,1\n1,1\n")
    (tmp_path / "wrong.csv").write_text("t,lenght\n0,1\n10,1\n")
    pair = System("pair")
    motor, swing = pair.add("motor", "Sinusoid", offset=1.0), pair.add("swing", "Pendulum")
    pair.connect(motor["y"], swing["length"])
    pair.write_ssp(tmp_path / "pair.ssp", stop_time=1.0, step_size=0.1)
    return sorted(tmp_path.rglob("*"))


@pytest.mark.parametrize(("words", "hints"), MISUSE.items(), ids=MISUSE)
def test_misuse_is_one_line_with_a_hint(
    liaisons: Cli, tmp_path: Path, files: list[Path], words: str, hints: list[str]
) -> None:
    reply = liaisons(*shlex.split(words))
    assert is_misuse(reply, *hints), reply.err
    assert sorted(path for path in tmp_path.rglob("*") if "__pycache__" not in path.parts) == files


@pytest.mark.parametrize("option", ["--csv", "--parquet", "--plot"])
@pytest.mark.parametrize("path", UNWRITABLE)
@pytest.mark.usefixtures("files")
def test_what_cannot_be_written_is_noticed_before_the_run(
    liaisons: Cli, monkeypatch: pytest.MonkeyPatch, option: str, path: str
) -> None:
    monkeypatch.delattr("liaisons.cosim.running.run.Run.start")
    assert is_misuse(liaisons("simulate", "Pendulum", option, path), path, UNWRITABLE[path], "choose another path")


def test_a_figure_of_an_unknown_kind_is_noticed_before_the_run(
    liaisons: Cli, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, files: list[Path]
) -> None:
    monkeypatch.delattr("liaisons.cosim.running.run.Run.start")
    assert is_misuse(liaisons("simulate", "Pendulum", "--plot", "figure.doc"), "figure.doc", "png")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert is_misuse(liaisons("simulate", "Pendulum", "--parquet", "table.parquet"), "liaisons[parquet]")
    assert sorted(tmp_path.rglob("*")) == files


@pytest.mark.parametrize(
    "command",
    ["", "list", "build", "text", "equations", "simulate", "plan", "identify", "sweep", "compare", "run", "check"],
)
def test_help_shows_examples(liaisons: Cli, command: str) -> None:
    reply = liaisons(*command.split(), "--help")
    assert reply.status == 0
    assert f"  liaisons {command}" in reply.out.split("examples:")[1]


def test_equations_are_printed_in_one_form(liaisons: Cli) -> None:
    assert liaisons("equations", "Pendulum", "--part", "momenta").out.startswith("Momenta (K eq. 78, M eq. 10): p")
    assert r"\begin{align*}" in liaisons("equations", "Pendulum", "--part", "momenta", "--latex").out
    assert liaisons("equations", "Pendulum", "--part", "momenta", "--html").out.startswith("<!DOCTYPE html>")
    assert liaisons("equations", "Sinusoid", "--modelica").out.count("package Sinusoid") == 1
    assert is_misuse(liaisons("equations", "Pendulum", "--html", "--latex"), "--text")
    assert is_misuse(liaisons("equations", "Pendulum", "--modelica", "--part", "motion"), "without --part")
    assert is_misuse(liaisons("equations", "Pendulum", "--modelica", "--fix", "length"), "and --fix")
    assert is_misuse(liaisons("equations", "Pendulum", "--fix", "lenght"), "did you mean 'length'?")
    fixed = liaisons("equations", "Pendulum", "--part", "accelerations", "--fix", "pivot_x,pivot_z,length").out
    assert fixed.endswith("θ̈ = −η θ̇ − g sin θ/l\n")
    assert is_misuse(liaisons("equations", "Pendulum", "--part", "momentum"), "did you mean 'momenta'?")
    assert is_misuse(liaisons("equations", "Pendulim"), "did you mean 'Pendulum'?")


def test_debug_lets_the_traceback_through(liaisons: Cli) -> None:
    for words in (("--debug", "build", "Pendlum"), ("build", "Pendlum", "--debug")):
        with pytest.raises(ProjectError) as caught:
            liaisons(*words)
        assert isinstance(caught.value, LiaisonsError)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (
            "liaisons ",
            [
                "list",
                "build",
                "text",
                "equations",
                "simulate",
                "animate",
                "show",
                "plan",
                "identify",
                "sweep",
                "compare",
                "run",
                "check",
                "new",
            ],
        ),
        ("liaisons build Pe", ["Pendulum", "PendulumChain"]),
        ("liaisons run pumped", ["pumped_swing"]),
        ("liaisons text K16", ["K16", *(f"K16{i}" for i in range(6))]),
        ("liaisons text M8", ["M8", "M8.1", "M8.2", "M8.3", "M8.4"]),
        ("liaisons build --backend ", ["auto", "native", "python"]),
        ("liaisons simulate --st", ["--start", "--stop", "--step"]),
        ("liaisons simulate Pendulum --set leng", ["length=1", "length_dot=0", "length_ddot=0"]),
        ("liaisons simulate Pendulum --record theta,tens", ["theta,tension"]),
        ("liaisons simulate --set leng", []),
        ("liaisons simulate nowhere.fmu --record th", []),
        ("liaisons simulate my_", []),  # a shell completes files where there is nothing
    ],
)
def test_what_the_tabulator_completes(
    liaisons: Cli, monkeypatch: pytest.MonkeyPatch, line: str, words: list[str]
) -> None:
    monkeypatch.setenv("_LIAISONS_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", line)
    monkeypatch.setenv("COMP_CWORD", str(line.count(" ")))
    assert liaisons().out.split() == words


def test_completion_knows_the_whole_catalogue() -> None:
    assert catalogue_names() == catalogue().keys()


@pytest.mark.parametrize("words", [["--help"], ["simulate", "--help"], ["sweep", "--help"]])
def test_help_waits_for_nothing_heavy(words: list[str]) -> None:
    code = f"import sys; from liaisons_tools.cli import main; main({words}); print(*sys.modules, file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert {"numpy", "scipy", "casadi", "fmpy", "matplotlib"}.isdisjoint(done.stderr.split())
