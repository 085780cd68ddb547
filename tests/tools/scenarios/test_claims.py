"""Claims by numbers whose difference is known, and figures of which the legends are looked at."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
from PIL import Image

from liaisons import LiaisonsError, Result, Verdict
from liaisons_tools.scenarios import Claims, dots, panels, within
from liaisons_tools.scenarios.drawing import save, save_panel

EMPTY = Result("empty", np.ones(1), (), np.ones((0, 1)), {})
BOUND = within(1e-3, "m", because="as the test says")


def judged(claim: Callable[[Claims], object]) -> Verdict:
    claims = Claims()
    claim(claims)
    (verdict,) = claims.verdicts
    return verdict


@pytest.mark.parametrize(
    ("claim", "error"),
    [
        (lambda claim: claim("", [1.0, 2.5], [1.0, 2.0], BOUND), 0.5),
        (lambda claim: claim("", [[1.0, 2.0], [1.0, 4.0]], [1.0, 2.0], BOUND), 2.0),
        (lambda claim: claim("", 3 + 4j, 0.0, BOUND), 5.0),
        (lambda claim: claim("", True, False, BOUND), 1.0),
        (lambda claim: claim("", {"x": [1.0], "y": [2.0]}, {"x": 1.5, "y": 2.25}, BOUND), 0.5),
        (lambda claim: claim("", {"x": [1.0], "y": [2.0]}, {"x": 1.5, "y": 2.25}, BOUND, names="y"), 0.25),
        (lambda claim: claim("", [1.0, np.nan], 1.0, BOUND), np.nan),
        (lambda claim: claim("", {"x": [np.nan], "y": [2.0]}, {"x": 1.0, "y": 0.0}, BOUND), np.nan),
        (lambda claim: claim.below("", [1.0, 2.5], 2.0, BOUND), 0.5),
        (lambda claim: claim.below("", [1.0, 1.5], 2.0, BOUND), 0.0),
        (lambda claim: claim.below("", [1.0, np.nan], 2.0, BOUND), np.nan),
        (lambda claim: claim.order("", [1.0, 2.0, 4.0], [3.0, 12.0, 48.0], 2.5, BOUND), 0.5),
    ],
)
def test_the_error_of_a_claim(claim: Callable[[Claims], object], error: float) -> None:
    verdict = judged(claim)
    assert verdict.error == pytest.approx(error, rel=1e-15, nan_ok=True)
    assert (verdict.tolerance, verdict.unit, verdict.reason) == (1e-3, "m", "as the test says")


def test_the_energy_that_is_nearest_to_its_bound_counts() -> None:
    def run(balance: float, kinetic: float, prefix: str = "") -> Result:
        values = np.array([[0.0, balance, 0.0], [kinetic, 0.0, 2 * kinetic]])
        return Result(
            "a", np.array([0.0, 1.0, 5.0]), (f"{prefix}energy_balance", f"{prefix}kinetic_energy"), values, {}
        )

    runs = run(-2e-9, 30.0), run(1e-9, 0.1, "swing.")
    verdict = judged(lambda claim: claim.energy("", *runs, tolerance=1e-8))
    assert (verdict.error, verdict.unit) == (1e-9, "J")
    assert verdict.tolerance == pytest.approx(10 * 1e-8 * 0.1 * 5.0, rel=1e-14)


@pytest.mark.parametrize(
    ("claim", "words"),
    [
        (lambda claim: claim("it grows", 1.0, 1.0, 1e-3), r"'it grows': 0.001 is no bound; give within\("),
        (lambda claim: claim("it grows", "fast", 1.0, BOUND), "'it grows': 'fast' are no numbers"),
        (lambda claim: claim("it grows", [[1.0], [1.0, 2.0]], 1.0, BOUND), "'it grows': .* are no numbers"),
        (lambda claim: claim("it grows", [1.0, 2.0], [1.0, 2.0, 3.0], BOUND), r"shapes \(2,\) and \(3,\)"),
        (lambda claim: claim("it grows", 1.0, [1.0, 2.0], BOUND), r"shapes \(\) and \(2,\)"),
        (lambda claim: claim("it grows", [], 0.0, BOUND), r"shapes \(0,\) and"),
        (lambda claim: claim("it grows", 1.0, {"x": 1.0}, BOUND), "'it grows': 1.0 has no signal 'x'"),
        (lambda claim: claim.energy("it grows", EMPTY, tolerance=1.0), "record it"),
        (lambda _: within(1e-3, because=""), "say why, in words"),
        (lambda _: within("small", because="it is"), "within: tolerance = 'small'"),  # type: ignore[arg-type]
        (lambda _: panels(("title", "x")), r"\('title', 'x'\) names no panel"),
        (lambda _: panels(("title", "x", "y"), mosaic="ab"), "the mosaic 'ab' has to show each of the panels 'a'"),
    ],
)  # fmt: skip
def test_misuse_is_one_line(claim: Callable[[Claims], object], words: str) -> None:
    with pytest.raises(LiaisonsError, match=words) as caught:
        claim(Claims())
    assert "\n" not in str(caught.value)


@pytest.fixture(autouse=True)
def closed() -> Iterator[None]:
    plt.switch_backend("Agg")
    yield
    plt.close("all")


def legends() -> list[list[str]]:
    found: list[Any] = [*plt.gcf().legends, *(axis.get_legend() for axis in plt.gcf().axes)]
    return [[text.get_text() for text in legend.get_texts()] for legend in found if legend]


def test_each_panel_has_its_labels_and_a_legend_below(tmp_path: Path) -> None:
    left, right, space = panels(("l", "x [m]", "y [m]"), ("r", "t [s]", "y [m]"), ("s", "x", "y", "z"), mosaic="ac;bc")
    left.plot([0, 1], [1, 0], label="FMU")
    dots(left, np.arange(100), np.arange(100), label="exact")
    right.plot([0, 1], [1, 0], label="FMU")
    save(tmp_path / "figure.png")
    assert (left.get_title(), right.get_xlabel(), left.get_ylabel(), space.get_zlabel()) == ("l", "t [s]", "y [m]", "z")
    assert len(left.lines[1].get_xdata()) == 50  # every second
    assert legends() == [["FMU", "exact"], ["FMU"]]
    assert all(axis.get_legend().get_window_extent().y1 < axis.bbox.y0 for axis in (left, right))
    assert (tmp_path / "figure.png").is_file()


def test_panels_with_the_same_labels_share_a_legend(tmp_path: Path) -> None:
    for axis in panels(("l", "x", "y"), ("r", "x", "y")):
        axis.plot([0, 1], [1, 0], label="FMU")
    save(tmp_path / "figure.png")
    assert legends() == [["FMU"]]


def test_a_scenario_draws(tmp_path: Path) -> None:
    with pytest.raises(LiaisonsError, match="silent draws nothing"):
        save(tmp_path / "silent.png")


@pytest.mark.parametrize("number", range(3))
def test_a_thumbnail_shows_one_panel_of_a_figure_with_one_in_space(number: int, tmp_path: Path) -> None:
    flat, _, spatial = panels(("flat", "x", "y"), ("empty", "x", "y"), ("in space", "x", "y", "z"))
    flat.plot([0, 1], [1, 2])
    spatial.plot([0, 1], [1, 2], [2, 3])
    save_panel(tmp_path / "small.png", number)
    with Image.open(tmp_path / "small.png") as picture:
        assert 100 < picture.width < 600  # of three panels: 1350
