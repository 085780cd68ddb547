"""Differences of two results."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from liaisons.check import compare
from liaisons.cosim import Result
from liaisons.errors import ValidityError


def _sine(step: float, stop: float = 2.0, *, rate: bool = True, off: float = 0.0, title: str = "sine") -> Result:
    time = np.linspace(0, round(stop / step) * step, round(stop / step) + 1)
    columns = {"x": np.sin(time) + off} | ({"x_dot": np.cos(time)} if rate else {})
    return Result(title, time, tuple(columns), np.array(list(columns.values())), {"x": "m", "x_dot": "m/s"})


def test_same_points_are_compared_as_they_are() -> None:
    coarse, fine = _sine(0.5), _sine(0.25, off=1e-3)
    comparison = compare(coarse, fine)
    np.testing.assert_array_equal(comparison.times, coarse.time)
    assert comparison["x"].method == "same points"
    assert comparison["x_dot"].maximum == 0.0
    # one rounding of numbers of the size of 1
    assert comparison["x"].maximum == pytest.approx(1e-3, abs=3e-16)
    assert comparison["x"].rms == pytest.approx(1e-3, abs=3e-16)
    assert comparison["x"].relative == pytest.approx(1e-3 / np.max(np.abs(coarse["x"])), rel=1e-14)
    assert comparison.relative == comparison["x"].relative  # the worst of both


def test_where_the_largest_difference_is() -> None:
    one = _sine(0.5)
    for point, error in ((3, 2.0), (1, np.nan)):
        values = one.values.copy()
        values[0, point] += error
        changed = compare(one, replace(one, values=values))["x"]
        assert (changed.at, changed.maximum) == (point / 2, pytest.approx(error, abs=1e-15, nan_ok=True))


def test_strings_are_the_same_or_not() -> None:
    """What was said last, where times lie between those of a result."""
    texts, values = {"mode": ("rest", "slip")}, np.array([[0, 0, 1, 1, 0.0]])
    one = Result("one", np.arange(5.0), ("mode",), values, {"mode": ""}, texts=texts)
    other = replace(one, values=np.array([[0, 0, 1, 0, 0.0]]))
    assert compare(one, one)["mode"].maximum == 0.0
    assert (compare(one, other)["mode"].maximum, compare(one, other)["mode"].at) == (1.0, 3.0)
    between = replace(one, time=np.arange(5) + 0.5)
    assert (compare(one, between)["mode"].maximum, compare(one, between)["mode"].at) == (1.0, 2.0)


def test_beside_0_there_is_no_difference_or_an_infinite_one() -> None:
    one = _sine(0.5)
    still = replace(one, values=0 * one.values)
    assert (compare(still, still)["x"].relative, compare(still, one)["x"].relative) == (0.0, np.inf)


@pytest.mark.parametrize(("rate", "order", "method"), [(True, 4, "Hermite"), (False, 2, "linear")])
def test_order_of_interpolation(rate: bool, order: int, method: str) -> None:
    errors = [compare(_sine(h, rate=rate), _sine(h * 2 / 3, rate=rate))["x"] for h in (0.2, 0.1)]
    assert {error.method for error in errors} == {method}
    # the leading term of the error; the next one is smaller by h² or h, a tenth at most
    assert np.log2(errors[0].maximum / errors[1].maximum) == pytest.approx(order, abs=0.2)


def test_only_common_time_and_common_signals() -> None:
    one, other = _sine(0.5, stop=1.0), _sine(0.5, stop=2.0, rate=False)
    comparison = compare(one, other)
    np.testing.assert_array_equal(comparison.times, one.time)
    assert [d.name for d in comparison.differences] == ["x"]
    assert comparison.only_first == ("x_dot",)
    assert "only in sine: x_dot" in str(comparison)


def test_arrays_are_one_row_and_keep_their_rates() -> None:
    def row(step: float) -> Result:
        time = np.linspace(0, round(1 / step) * step, round(1 / step) + 1)
        waves = np.array([np.sin(k * time) for k in (1, 2)] + [k * np.cos(k * time) for k in (1, 2)])
        return Result("row", time, ("q[1]", "q[2]", "q_dot[1]", "q_dot[2]"), waves, {})

    comparison = compare(row(0.1), row(0.04))
    assert len(comparison.times) >= 31  # those of both
    assert [(d.name, d.method) for d in comparison.differences] == [("q", "Hermite"), ("q_dot", "linear")]
    # error of cubic Hermite interpolation: h⁴/384 times the fourth derivative, 16
    assert 0 < comparison["q"].maximum <= 0.1**4 / 384 * 16


def test_table_names_signal_unit_and_method() -> None:
    text = str(compare(_sine(0.5, title="mine"), _sine(0.3, title="theirs")))
    header, names, _, first, second, *rest = text.splitlines()
    assert "mine and theirs" in header
    assert names.split()[:2] == ["signal", "unit"]
    assert first.split()[:2] == ["x", "m"]
    assert second.endswith("linear")
    assert rest == ["linear: interpolated by straight lines, since its rate was not recorded with it"]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"names": ("y",)}, "sine and other have no signal in common"),
        ({"units": {"x": "kg"}}, "x is in m in sine, in kg in other; convert one"),
        ({"time": np.arange(5) + 3.0}, r"sine \(t = 0 to 2 s\) and other \(3 to 7 s\) have no time in common"),
        ({"time": np.empty(0)}, "the result of other has cases and no time"),
    ],
)
def test_what_cannot_be_compared(changes: dict[str, Any], words: str) -> None:
    one = _sine(0.5, rate=False)
    with pytest.raises(ValidityError, match=words):
        compare(one, replace(one, title="other", **changes))
    with pytest.raises(ValidityError, match="'z' was not compared; compared: x"):
        compare(one, one)["z"]
