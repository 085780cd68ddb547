"""Signals, files, figures."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest

from liaisons.cosim import Result
from liaisons.errors import SimulationError


@pytest.fixture
def result() -> Result:
    time = np.arange(4) / 3  # no finite decimal fractions
    names = ("swing.theta", "swing.theta_dot", "arm.x[1,2]", "plain", "swing.phi")
    units: dict[str, str] = dict(zip(names, ("rad", "rad/s", "m", "", "rad"), strict=True))
    return Result("a swing", time, names, np.vstack([np.sin(time + k) for k in range(5)]), units)


def test_signals_by_name(result: Result) -> None:
    np.testing.assert_array_equal(result["swing.theta_dot"], np.sin(result.time + 1))
    assert result.units["arm.x[1,2]"] == "m"


def test_unknown_signal_is_answered_with_the_nearest(result: Result) -> None:
    with pytest.raises(SimulationError, match=r"a swing has no signal 'swing\.tetha'; did you mean 'swing\.theta'"):
        result["swing.tetha"]


def test_nothing_can_be_changed(result: Result) -> None:
    with pytest.raises(ValueError, match="read-only"):
        result["plain"][0] = 1.0
    with pytest.raises(TypeError):
        result.units["plain"] = "m"  # type: ignore[index]
    with pytest.raises(dataclasses.FrozenInstanceError):
        result.title = "another"  # type: ignore[misc]


def test_repr_is_one_line_that_says_what_is_inside(result: Result) -> None:
    assert repr(result) == (
        "<Result of a swing: 4 points, t = 0 to 1 s, 5 signals: swing.theta [rad], swing.theta_dot [rad/s], "
        "arm.x[1,2] [m], plain, swing.phi [rad]>"
    )


def test_csv_gives_back_the_same_doubles(result: Result, tmp_path: Path) -> None:
    path = tmp_path / "swing.csv"
    result.to_csv(path)
    again = Result.from_csv(path)
    np.testing.assert_array_equal(again.time, result.time)
    np.testing.assert_array_equal(again.values, result.values)
    assert (again.names, dict(again.units)) == (result.names, dict(result.units))
    assert [item.name for item in tmp_path.iterdir()] == ["swing.csv"]


def test_parquet_gives_back_the_same_doubles_and_units(result: Result, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    path = tmp_path / "swing.parquet"
    result.to_parquet(path)
    again = Result.from_parquet(path)
    np.testing.assert_array_equal(again.time, result.time)
    np.testing.assert_array_equal(again.values, result.values)
    assert (again.title, again.names, dict(again.units)) == (result.title, result.names, dict(result.units))
    assert [item.name for item in tmp_path.iterdir()] == ["swing.parquet"]
    with pytest.raises(SimulationError, match=r"none\.parquet: cannot be read as Parquet: No such file"):
        Result.from_parquet(tmp_path / "none.parquet")
    path.write_text("no parquet")
    with pytest.raises(SimulationError, match=r"swing\.parquet: cannot be read as Parquet"):
        Result.from_parquet(path)


def test_parquet_without_pyarrow_says_what_to_install(
    result: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(SimulationError, match=r"Parquet needs PyArrow; pip install 'liaisons\[parquet\]'"):
        result.to_parquet(tmp_path / "swing.parquet")


def test_extreme_doubles_survive_csv(tmp_path: Path) -> None:
    values = np.array([[5e-324, -0.0, 1.7976931348623157e308, np.nan, -np.inf, 0.1 + 0.2]])
    Result("extreme", np.arange(6.0), ("x",), values, {"x": ""}).to_csv(tmp_path / "x.csv")
    again = Result.from_csv(tmp_path / "x.csv").values
    assert again.tobytes() == values.tobytes()


def test_csv_of_another_tool(tmp_path: Path) -> None:
    path = tmp_path / "reference.csv"
    path.write_text('"time","h","v"\n0,1,0\n0.5,0.5,-4.9\n')
    result = Result.from_csv(path)
    np.testing.assert_array_equal(result["v"], [0, -4.9])
    assert dict(result.units) == {"h": "", "v": ""}


def test_csv_is_readable_elsewhere(tmp_path: Path) -> None:
    path = tmp_path / "plain.csv"
    Result("plain", np.arange(3.0), ("x", "y"), np.arange(6.0).reshape(2, 3), {"x": "m", "y": ""}).to_csv(path)
    assert path.read_text().splitlines()[:2] == ["time,x,y", "# s,m,"]
    table = np.genfromtxt(path, delimiter=",", names=True)
    np.testing.assert_array_equal(table["y"], [3.0, 4.0, 5.0])


@pytest.mark.parametrize("where", ["missing/swing.png", "occupied"])
def test_file_that_cannot_be_written_is_named_and_leaves_nothing(result: Result, tmp_path: Path, where: str) -> None:
    (tmp_path / "occupied").mkdir()
    with pytest.raises(SimulationError, match=rf"{where}: cannot be written: .*; choose another path"):
        result.to_csv(tmp_path / where)
    with pytest.raises(SimulationError, match=rf"{where}: cannot be written"):
        result.plot(path=tmp_path / where)
    assert [item.name for item in tmp_path.iterdir()] == ["occupied"]


def test_failure_in_mid_file_keeps_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "old.csv"
    path.write_text("old")
    torn = Result("torn", np.arange(3.0), ("x",), np.zeros((1, 3)), {"y": "m"})  # no unit for x: fails while writing
    with pytest.raises(KeyError):
        torn.to_csv(path)
    assert path.read_text() == "old"
    assert [item.name for item in tmp_path.iterdir()] == ["old.csv"]


@pytest.mark.parametrize(
    "text", ["", "time,x\n", "time,x\n# s,m\n0,1,2\n", "time,x\n# s,m\n0,high\n", "time,x,x\n0,1,2\n", "x"]
)
def test_csv_of_another_kind_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "other.csv"
    path.write_text(text)
    with pytest.raises(SimulationError, match="not a result that to_csv has written"):
        Result.from_csv(path)


def test_plot_has_one_diagram_a_unit(result: Result, tmp_path: Path) -> None:
    path = tmp_path / "swing.svg"
    figure = result.plot(path=path)
    assert [axes.get_ylabel() for axes in figure.axes] == [
        "[rad]",
        "swing.theta_dot [rad/s]",
        "arm.x[1,2] [m]",
        "plain",
    ]
    assert figure.axes[-1].get_xlabel() == "time [s]"
    np.testing.assert_array_equal(figure.axes[0].lines[1].get_ydata(), result["swing.phi"])
    assert path.read_text().startswith("<?xml")


def test_plot_draws_what_is_named(result: Result, tmp_path: Path) -> None:
    figure = result.plot("plain", "swing.phi", path=tmp_path / "two.png")
    assert [axes.get_ylabel() for axes in figure.axes] == ["plain", "swing.phi [rad]"]
    with pytest.raises(SimulationError, match="no signal 'plan'"):
        result.plot("plan")
    with pytest.raises(SimulationError, match=r"two\.csv: .*'csv' is not supported"):
        result.plot(path=tmp_path / "two.csv")
