"""``liaisons show``; live pages are tried in ``tests/pages/pictures``."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from liaisons import Result
from liaisons.base import compiler

from .conftest import Cli, Runs, is_misuse


def test_without_a_compiler_for_webassembly_the_motion_is_shown(
    runs: Runs, liaisons: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    monkeypatch.setitem(sys.modules, "ziglang", None)
    out = runs("show", "Pendulum", "--set", "theta_0=1")
    assert out.count("\n") == 1
    assert out.startswith(
        "page: Pendulum.html, a recorded motion; a live page needs a compiler: pip install 'liaisons[cross]' (100 MB"
    )
    assert opened == [(tmp_path / "Pendulum.html").as_uri()]
    assert '"frames":' in (tmp_path / "Pendulum.html").read_text()
    still = (tmp_path / "Pendulum.html").read_bytes()
    runs("show", "Pendulum", "--set", "theta_0=1", "--input", "length=1 + 0.1*t", "--no-open")
    assert (tmp_path / "Pendulum.html").read_bytes() != still
    assert is_misuse(liaisons("show", "Pendulum", "Swing", "--input", "length=1"), "--input", "without --input")


@pytest.mark.parametrize("command", ["show", "animate"])
def test_noisy_tables_are_smoothed(runs: Runs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str) -> None:
    """The length is 1 m, and noise of 1 cm; splines with knots 2 s apart pass through its mean."""
    lengths: list[Result] = []
    monkeypatch.setattr(Result, "animate", lambda result, *_, **__: lengths.append(result) or 1.0)
    monkeypatch.setitem(sys.modules, "ziglang", None)
    noise = 0.01 * np.random.default_rng(1).standard_normal(201)
    rows = [f"{0.05 * row:g},{1 + x:.9g}" for row, x in enumerate(noise)]
    (tmp_path / "length.csv").write_text("\n".join(["time,length", *rows]))
    words = [command, "Pendulum", "--input", "length.csv", *(("--no-open",) if command == "show" else ("-o", "p.html"))]
    runs(*words)
    runs(*words, "--smoothing", "2")
    rough, smooth = (np.std(result["length"]) for result in lengths)
    assert rough > 5e-3
    assert smooth < 3e-3  # some 9 numbers of 201: 0.01 sqrt(9 / 201) = 2.1e-3


@pytest.mark.skipif(compiler.zig_compiler() is None, reason="ziglang is missing")
def test_inputs_move_a_live_page_and_a_scenario_has_its_lesson(runs: Runs, liaisons: Cli, tmp_path: Path) -> None:
    options = ("--controls", "length,theta_0", "--plots", "theta", "--question", "Why?", "--no-open")
    assert runs("show", "Pendulum", "--input", "length=1 + 0.1*sin(6*t)", *options) == "page: Pendulum.html\n"
    page = (tmp_path / "Pendulum.html").read_text()
    assert '"controls":["length","theta_0"],"question":"Why?"' in page
    assert '"moves":{"length":["Table",' in page
    jumps = runs("show", "Pendulum", "--input", "theta_force=0.1*t", "--no-open")
    assert jumps == "page: Pendulum.html, a recorded motion\n"
    assert runs("show", "kapitza", "--no-open") == "page: kapitza.html\n"
    assert '"moves":{"pivot_z":["Sinusoid",' in (tmp_path / "kapitza.html").read_text()
    assert is_misuse(liaisons("show", "kepler", "--no-open"), "scenario kepler has no lesson", "kapitza")
