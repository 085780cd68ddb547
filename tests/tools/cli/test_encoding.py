"""What terminals and pipes of other encodings and widths are shown."""

import os
import subprocess
import sys
import unicodedata
from pathlib import Path

import pytest

from liaisons_tools.cli._encoding import ascii_text

from .conftest import COMMAND, Cli
from .test_run import write


def spoken(*words: str | Path, **environment: str) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run([*COMMAND, *map(str, words)], env=os.environ | environment, capture_output=True, check=False)


@pytest.mark.parametrize(
    "environment",
    [
        {"PYTHONIOENCODING": "cp1252"},
        {"PYTHONIOENCODING": "ascii"},
        {"PYTHONIOENCODING": "cp850:strict"},
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        {"LC_ALL": "C"},
    ],
    ids=lambda e: " ".join(e.values()),
)
@pytest.mark.variants(core=0)
def test_list_in_other_encodings(environment: dict[str, str]) -> None:
    done = spoken("list", **environment)
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"r(theta)" in done.stdout or "r(θ)".encode() in done.stdout


@pytest.mark.variants(core=0)
def test_a_claim_and_an_error_in_other_encodings(tmp_path: Path) -> None:
    path = write(tmp_path / "arithmetic.py")
    path.write_text(path.read_text(encoding="utf-8").replace("Twice", "σ̇ → ∂λ ≤ 2π√l: twice"), encoding="utf-8")
    done = spoken("run", path, PYTHONIOENCODING="ascii")
    assert done.returncode == 0
    assert b"arithmetic: sigma -> dlambda <= 2pisqrtl: twice two is four." in done.stdout
    assert b"'sigma.py'" not in (wrong := spoken("list", "σ.py", PYTHONIOENCODING="ascii")).stderr
    assert wrong.stderr == b"liaisons: error: sigma.py: no such file\n"


@pytest.mark.variants(core=0)
def test_what_the_user_has_asked_for_is_kept() -> None:
    assert b"r(?)" in spoken("list", PYTHONIOENCODING="ascii:replace").stdout


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("φ² ≤ 2π√(l/g)", "phi2 <= 2pisqrt(l/g)"),
        ("Σ Θ₁₂ σ̈", "sum Theta12 sigma"),
        ("naïve – ½ · ∞", "naive - 1/2 * inf"),
        ("\udcff 日", "? ?"),
    ],
)
def test_ascii(text: str, shown: str) -> None:
    assert ascii_text(text) == shown


def test_every_character_has_some_ascii() -> None:
    for number in range(sys.maxunicode + 1):
        if number % 7 == 0 or number < 0x3000:
            assert ascii_text(chr(number)).isascii()
    assert all(ascii_text(c) != "?" for c in map(chr, range(0x391, 0x3C9)) if unicodedata.category(c)[0] == "L")


@pytest.mark.parametrize("columns", [None, "90", "250"])
def test_list_fits(liaisons: Cli, monkeypatch: pytest.MonkeyPatch, columns: str | None) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    if columns:
        monkeypatch.setenv("COLUMNS", columns)
    lines = liaisons("list").out.splitlines()
    assert max(map(len, lines)) <= int(columns or 100)
    broken = [line for line in lines if line.startswith(" ")]
    assert bool(broken) == (columns != "250")
    assert "point O inside it." in " ".join(" ".join(lines).split())
