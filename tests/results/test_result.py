"""Signals, files, figures."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.figure import Figure

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


def _drawn(figure: Figure) -> list[list[str]]:
    """Names in the legends, diagram by diagram."""
    legends = [axes.get_legend() for axes in figure.axes]
    return [[text.get_text() for text in legend.get_texts()] if legend else [] for legend in legends]


def test_plot_has_one_diagram_a_unit(result: Result, tmp_path: Path) -> None:
    path = tmp_path / "swing.svg"
    figure = result.plot(path=path)
    assert [axes.get_ylabel() for axes in figure.axes] == ["[rad]", "[m]", "", "[rad/s]"]
    assert _drawn(figure) == [["swing.theta", "swing.phi"], ["arm.x[1,2]"], ["plain"], ["swing.theta_dot"]]
    assert figure.axes[-1].get_xlabel() == "time [s]"
    np.testing.assert_array_equal(figure.axes[0].lines[1].get_ydata(), result["swing.phi"])
    assert path.read_text().startswith("<?xml")


@pytest.mark.parametrize("names", [("plain", "swing.phi"), (["plain", "swing.phi"],), (["plain"], "swing.phi")])
def test_plot_draws_what_is_named(result: Result, tmp_path: Path, names: Any) -> None:
    figure = result.plot(*names, path=tmp_path / "two.png")
    assert _drawn(figure) == [["plain"], ["swing.phi"]]
    with pytest.raises(SimulationError, match="no signal 'plan'"):
        result.plot("plan")
    assert [item.name for item in tmp_path.iterdir()] == ["two.png"]


@pytest.mark.parametrize("suffix", ["csv", "fmu"])
def test_plot_to_a_file_of_unknown_kind(result: Result, tmp_path: Path, suffix: str) -> None:
    with pytest.raises(SimulationError, match=rf"two\.{suffix}: .*'{suffix}' is not supported"):
        result.plot(path=tmp_path / f"two.{suffix}")
    assert list(tmp_path.iterdir()) == []


def test_legends_stand_beside_the_curves(result: Result, tmp_path: Path) -> None:
    figure = result.plot(path=tmp_path / "swing.png")
    width, height = figure.get_size_inches() * figure.dpi
    assert width == 1000
    for axes in figure.axes:
        legend = axes.get_legend()
        assert legend is not None
        box = legend.get_window_extent()
        assert axes.get_window_extent().x1 <= box.x0
        assert box.x1 <= width
        assert box.y1 <= height


def test_plot_draws_what_matters(tmp_path: Path) -> None:
    """A pendulum with all its variables: what stays 0, copies and what nobody asked for are left out."""
    t = np.linspace(0, 10, 201)
    wave = np.sin(3 * t)
    signals = {
        "q": (0.1 * wave, "rad"), "q_dot": (0.3 * np.cos(3 * t), "rad/s"), "q_ddot": (-0.9 * wave, "rad/s2"),
        "p_q": (0.3 * np.cos(3 * t), "kg.m2/s"), "q_force": (0 * t, "N.m"), "q_load": (0 * t, "N.m"),
        "s": (1 + 0.1 * wave, "m"), "s_force": (-9.8 - wave, "N"), "s_power": (wave, "W"),
        "again": (1 + 0.1 * wave, "m"),
        "kinetic_energy": (2 * wave**2, "J"), "potential_energy": (-540 - wave**2, "J"), "dissipated": (1e-5 * t, "J"),
        "balance": (1e-13 * wave, "J"), "level": (np.full_like(t, 0.9), "m"), "temperature": (293 + wave, "K"),
        "lost": (np.full_like(t, np.nan), "Pa"), "stays": (np.full_like(t, 5.0), "kg"),
    }  # fmt: skip
    values = np.array([values for values, _ in signals.values()])
    full = Result("all", t, tuple(signals), values, {name: unit for name, (_, unit) in signals.items()})
    drawn = _drawn(full.plot(path=tmp_path / "all.png"))
    assert drawn == [["q"], ["q_dot"], ["s", "level"], ["kinetic_energy"], ["temperature"], ["s_force"]]
    asked = ["stays", "balance", "q_load", "p_q", "lost", "q_ddot", "q_dot", "q"]  # more than six, zeros among them
    assert _drawn(full.plot(asked, path=tmp_path / "asked.png")) == [[name] for name in asked]


def test_plot_of_what_does_not_move(tmp_path: Path) -> None:
    time = np.arange(3.0)
    still = Result("still", time, ("y", "zero"), np.array([[2.0] * 3, [0.0] * 3]), {"y": "m", "zero": "m"})
    assert _drawn(still.plot(path=tmp_path / "still.png")) == [["y"]]
    zero = Result("zero", time, ("zero",), np.zeros((1, 3)), {"zero": "m"})
    assert _drawn(zero.plot(path=tmp_path / "zero.png")) == [["zero"]]
    empty = Result("empty", time, (), np.empty((0, 3)), {})
    assert _drawn(empty.plot(path=tmp_path / "empty.png")) == [[]]


def test_a_figure_is_seen_once(result: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    """By pyplot's window, or as what a cell of a notebook returns: that shows what pyplot knows, too."""
    monkeypatch.setattr("matplotlib.get_backend", lambda: "module://matplotlib_inline.backend_inline")
    result.plot()
    assert pyplot.get_fignums() == []
    monkeypatch.setattr("matplotlib.get_backend", lambda: "agg")
    figure = result.plot()
    assert [pyplot.figure(number) for number in pyplot.get_fignums()] == [figure]
    pyplot.close("all")


def test_a_result_is_a_container_of_names() -> None:
    names = ("theta[1]", "theta[2]", "energy")
    result = Result("chain", np.arange(2.0), names, np.arange(6.0).reshape(3, 2), dict.fromkeys(names, "rad"))
    assert list(result) == list(result.keys()) == ["theta", "energy"]
    assert len(result) == 2
    assert "theta" in result
    assert "theta[2]" in result
    assert "phi" not in result
    assert 0 not in result
    assert {name: values.shape for name, values in dict(result).items()} == {"theta": (2, 2), "energy": (2,)}
