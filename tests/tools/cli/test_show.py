"""``liaisons show`` without the compiler for WebAssembly; live pages are tried in ``tests/pages/pictures``."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

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
    assert "play(JSON.parse(" in (tmp_path / "Pendulum.html").read_text()
    still = (tmp_path / "Pendulum.html").read_bytes()
    runs("show", "Pendulum", "--set", "theta_0=1", "--input", "length=1 + 0.1*t", "--no-open")
    assert (tmp_path / "Pendulum.html").read_bytes() != still
    assert is_misuse(liaisons("show", "Pendulum", "Swing", "--input", "length=1"), "--input", "without --input")
