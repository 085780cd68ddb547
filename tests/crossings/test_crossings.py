"""Every cell of docs/crossings.toml: what works is compared with something else; what is refused raises its text."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import capabilities
import pytest
from capabilities import Workshop
from line_names import NAMES
from subjects import SUBJECTS

from crossing_table import REFUSED, Cell, Trial, cells, groups, page, trials
from liaisons import LiaisonsError
from liaisons_motion import analysis

SLOW = {"wasm", "live_page", "vector_environment"}
"""They build FMUs of their own, which take seconds each; quick tests try one of them, and what is refused."""
SLOW_AT_DEAD_POINTS = SLOW | {"event_mode", "without_arrays", "flatten", "adapted_steps", "jax", "modelica", "plan"}
SLOW_AT_DEAD_POINTS |= {"python_back_end", "ensemble", "isolated", "fmi_3_model_exchange", "watchdog", "holonomy"}
SLOW_AT_DEAD_POINTS |= {"dynamic_holonomy", "environment", "saved_state", "fmi_3_co_simulation", "sweep", "picture"}
"""There even what is refused takes an FMU of its own, or a way that ends late."""


def is_slow(cell: Cell) -> bool:
    """Whether a cell is tried by slow tests alone."""
    if cell.kind == "dead_point":
        return cell.capability in SLOW_AT_DEAD_POINTS
    return cell.capability in SLOW and cell.kind != "plain" and cell.verdict != REFUSED


def trial(cell: Cell) -> Callable[[Workshop, str], None]:
    """The function that tries a capability."""
    return getattr(capabilities, f"try_{cell.capability}")


@pytest.fixture(scope="module")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Workshop]:
    folder = tmp_path_factory.mktemp("crossings")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("LIAISONS_FMUS", str(folder / "fmus"))
        yield Workshop(folder)


@pytest.mark.parametrize(
    "cell",
    [
        pytest.param(cell, id=f"{cell.capability}-{cell.kind}", marks=[pytest.mark.slow] * slow)
        for cell in cells().values()
        if (cell.kind, cell.capability) not in trials()
        for slow in [is_slow(cell)]
    ],
)
def test_cell(cell: Cell, workshop: Workshop) -> None:
    if cell.verdict != REFUSED:
        trial(cell)(workshop, cell.kind)
        return
    with pytest.raises(LiaisonsError) as caught:
        trial(cell)(workshop, cell.kind)
    assert cell.remark in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("function", "line"),
    [
        pytest.param(name, line, id=f"{name}-{kind}", marks=[pytest.mark.slow] * is_slow(cells()[kind, name]))
        for (kind, name), lines in trials().items()
        for line in lines
    ],
)
def test_line(function: str, line: Trial) -> None:
    """What is refused may be refused when a quantity is evaluated."""
    assert f"{function}(" in line.call or f"{function}=" in line.call

    def result() -> Any:
        X = eval(line.call, NAMES)
        return X if line.holds or not hasattr(X, "evaluate") else X.evaluate()

    if line.holds:
        assert eval(line.holds, NAMES | {"X": result()})
        return
    with pytest.raises(LiaisonsError) as caught:
        result()
    assert line.against in str(caught.value)
    assert "\n" not in str(caught.value)


def test_every_function_of_analysis_is_there() -> None:
    functions = {name for name in analysis.__all__ if not isinstance(getattr(analysis, name), type)}
    assert functions == {*groups()["Analysis"]}


def test_the_table_has_every_kind_and_every_capability() -> None:
    assert {kind for kind, _ in cells()} == {*SUBJECTS}
    assert {capability for _, capability in cells()} == {name for group in groups().values() for name in group}
    text = page()
    assert all(cell.remark in text.replace("&#x27;", "'").replace("&quot;", '"') for cell in cells().values())
