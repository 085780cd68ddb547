"""In a notebook a motion and a live page show themselves."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from liaisons import Result, System, build, show, simulate
from liaisons.errors import SimulationError
from liaisons.models import Constant, Pendulum
from liaisons.results import Picture

from .conftest import MECHANISMS, Fmu, Moved

EVIL = "</script></iframe><img src=x onerror=alert(1)>\"'&"


Parsed = Callable[[str], Any]


@dataclass(frozen=True)
class Balls:
    """A scene of balls, whose coordinates are all known."""

    names: tuple[str, ...]

    @property
    def picture(self) -> Picture:
        """One beside the other."""
        return Picture(tuple({"shape": "ball", "at": [name, 0.0, 0.0]} for name in self.names))

    def values(self, signals: Mapping[str, NDArray[np.float64]]) -> Mapping[str, NDArray[np.float64]]:
        """What is known."""
        return signals


def rolling(title: str = "a ball", end: float = 1.0, count: int = 1) -> Result:
    names, time = tuple(f"ball_{i}" for i in range(count)), np.linspace(0.0, 30.0, 301)
    values = np.linspace(np.zeros(count), np.full(count, end), 301).T.copy()
    return Result(title, time, names, values, dict.fromkeys(names, "m"), scene=Balls(names))


@pytest.mark.parametrize("name", MECHANISMS)
def test_every_motion_is_shown_and_is_small(name: str, moved: Moved, parsed: Parsed) -> None:
    html = moved(name)._repr_html_()
    (frame,), tags, _ = parsed(html)
    assert frame["sandbox"] == "allow-scripts"  # not allow-same-origin: it sees nothing of the notebook
    assert "table" in tags
    page = frame["srcdoc"]
    assert "default-src 'none'" in page
    assert '<canvas id="picture"' in page
    assert "src" not in frame
    assert len(html) <= 320_000


def test_a_long_motion_of_many_balls_is_shown_with_fewer_frames(parsed: Parsed) -> None:
    rates = []
    for count in (10, 400):
        (frame,), *_ = parsed(rolling(count=count)._repr_html_())
        page = frame["srcdoc"]
        assert len(escape(page)) <= 300_000
        rates.append(float(re.findall(r'"rate":([0-9.]+)', page)[0]))
        (frames,) = re.findall(r'"frames":(\d+)', page)
        assert (int(frames) - 1) / rates[-1] == pytest.approx(20, abs=1 / rates[-1])  # [s]
    assert rates[0] == 30
    assert 1 < rates[1] < 10


def test_what_is_not_simulated_has_no_motion(parsed: Parsed) -> None:
    run = rolling()
    table = replace(run, scene=None)
    assert parsed(table._repr_html_())[0] == []
    assert parsed(run._repr_html_())[0] != []
    begun = replace(run, time=run.time[:1].copy(), values=run.values[:, :1].copy())
    assert parsed(begun._repr_html_())[0] == []


def test_what_has_no_picture_is_a_table(fmu: Fmu, parsed: Parsed) -> None:
    frames, tags, text = parsed(simulate(fmu(Constant), stop_time=1.0, step_size=0.5)._repr_html_())
    assert (frames, "table" in tags, "cannot be shown" in "".join(text)) == ([], True, False)


def test_a_motion_that_cannot_be_shown_says_why(tmp_path: Path, shared_folder: Path, parsed: Parsed) -> None:
    frames, tags, text = parsed(rolling(end=np.nan)._repr_html_())
    assert (frames, "table" in tags) == ([], True)
    assert "The motion cannot be shown: a ball: ball_0 in its picture is not finite at t = 0 s" in "".join(text)
    path = tmp_path / "Pendulum.fmu"
    path.write_bytes(build(Pendulum, shared_folder).read_bytes())
    run = simulate(path, stop_time=0.2, step_size=0.1)
    path.unlink()
    frames, _, text = parsed(run._repr_html_())
    assert frames == []
    assert f"The motion cannot be shown: {path}" in "".join(text)


def test_names_never_become_markup(parsed: Parsed) -> None:
    (frame,), tags, _ = parsed(rolling(EVIL)._repr_html_())
    assert "img" not in tags
    page = frame["srcdoc"]
    assert "img" not in parsed(page)[1]
    assert "&lt;/script&gt;&lt;/iframe&gt;" in page


@pytest.mark.parametrize("subject", ["name", "class", "file"])
def test_a_component_shows_itself(
    subject: str, fmu: Fmu, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, parsed: Parsed
) -> None:
    path = fmu(Pendulum)
    monkeypatch.setenv("LIAISONS_FMUS", str(path.parent))
    monkeypatch.chdir(tmp_path)
    page = show({"name": "Pendulum", "class": Pendulum, "file": path}[subject], theta_0=1.25)
    assert (str(page), os.fspath(page), page.path) == ("Pendulum.html", "Pendulum.html", Path("Pendulum.html"))
    content = page.path.read_text(encoding="utf-8")
    assert '"start":1.25' in content
    (frame,), *_ = parsed(page._repr_html_())
    assert frame["sandbox"] == "allow-scripts"
    assert frame["srcdoc"] == content


@pytest.mark.variants(core=0)
def test_a_system_shows_itself(fmu: Fmu, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    system = System("two/swings")
    upper, lower = (system.add(name, fmu(Pendulum)) for name in ("upper", "lower"))
    system.connect(upper["bob"], lower["pivot"])
    assert str(show(system)) == "two_swings.html"
    assert show(system, tmp_path / "other.html").path.stat().st_size > 50_000
    with pytest.raises(SimulationError, match="two/swings: start values of a system are given where"):
        show(system, theta_0=1.0)
