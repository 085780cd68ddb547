"""Grids and random samples."""

import numpy as np
import pytest
from scipy import stats

from liaisons_tools.sweeps import SweepError, grid, sample, sweep


def test_the_last_name_of_a_grid_runs_fastest() -> None:
    cases = grid({"a": [1, 2], "b": [10.0, 20.0, 30.0]})
    assert cases["a"].tolist() == [1, 1, 1, 2, 2, 2]
    assert cases["b"].tolist() == [10, 20, 30, 10, 20, 30]
    assert grid({"a": 3.0})["a"].tolist() == [3.0]


def test_samples_repeat_with_their_seed_only() -> None:
    first, again, other = (sample(50, {"a": (0, 1), "b": (2, 3)}, seed=seed) for seed in (4, 4, 5))
    assert np.array_equal(first["b"], again["b"])
    assert not np.any(first["b"] == other["b"])
    assert first["a"].min() >= 0
    assert first["a"].max() <= 1
    assert 2 <= first["b"].min() <= first["b"].max() <= 3


def test_a_normal_distribution_is_one() -> None:
    values = sample(2000, {"a": stats.norm(5.0, 2.0)}, seed=0)["a"]
    # Kolmogorov and Smirnov: a right sample falls below this in one of a thousand cases, and the seed is fixed.
    assert stats.kstest(values, stats.norm(5.0, 2.0).cdf).pvalue > 1e-3


@pytest.mark.parametrize(
    ("make", "over", "message"),
    [
        (grid, {}, "nothing is varied"),
        (grid, {"a": []}, "a has values of shape"),
        (grid, {"a": [[1, 2]]}, "a has values of shape"),
        (grid, {"a": [1, np.nan]}, "a has values that are not finite"),
        (grid, {"a": ["x"]}, "a = "),
        (grid, {"a": np.arange(10_000.0), "b": np.arange(10_000.0)}, "100000000 cases are too many"),
        (lambda over: sweep("Pendulum", over, ["theta"]), {"mass": [1, 2], "length": [1]}, "mass 2, length 1"),
    ],
)
def test_misuse(make, over, message) -> None:
    with pytest.raises(SweepError, match=message):
        make(over)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"count": 0}, "count = 0"),
        ({"count": -3}, "count = -3"),
        ({"count": 2.5}, "count = 2.5"),
        ({"count": 10**30}, "too many"),
        ({"seed": -1}, "seed = -1"),
        ({"over": {}}, "nothing is varied"),
        ({"over": {"a": 7}}, "a = 7"),
        ({"over": {"a": (3, 0)}}, r"a = \(3, 0\); give \(low, high\) with low < high"),
        ({"over": {"a": (1, 1)}}, "low < high"),
        ({"over": {"a": (0, np.inf)}}, "not finite"),
    ],
)
def test_misuse_of_samples(changes, message) -> None:
    with pytest.raises(SweepError, match=message):
        sample(**{"count": 3, "over": {"a": (0, 1)}, "seed": 0} | changes)
