"""Signals, files, figures, notebooks, data frames."""

from __future__ import annotations

import copy
import dataclasses
import pickle
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.figure import Figure

from liaisons.errors import SimulationError
from liaisons.results import Result

HOSTILE = "</script><img onerror=alert(1)>"


@pytest.fixture
def result() -> Result:
    time = np.arange(4) / 3  # no finite decimal fractions
    names = ("swing.theta", "swing.theta_dot", "arm.x[1,2]", "plain", "swing.phi")
    units: dict[str, str] = dict(zip(names, ("rad", "rad/s", "m", "", "rad"), strict=True))
    return Result("a swing", time, names, np.vstack([np.sin(time + k) for k in range(5)]), units)


@pytest.fixture
def cases() -> Result:
    """As of a sweep whose second case has failed."""
    names, values = ("mass", "theta", "all"), np.array([[1.0, 2.0, 1 / 3], [0.1, np.nan, -0.2], [3.0, np.nan, 4.0]])
    units: dict[str, str] = dict(zip(names, ("kg", "rad", ""), strict=True))
    return Result("a sweep", np.empty(0), names, values, units, failures={1: "mass = 2, too much"}, unfinished=(1,))


@pytest.fixture
def both() -> Result:
    """As of an ensemble whose third case leaves its domain on the way."""
    values = np.arange(24.0).reshape(3, 4, 2) / 7
    values[:, 2:, 1] = np.nan
    names = ("x[1]", "x[2]", "e")
    units: dict[str, str] = dict(zip(names, ("m", "m", "J"), strict=True))
    return Result("an ensemble", np.arange(4) / 3, names, values, units, failures={1: "r must stay > 0"})


@pytest.fixture
def coupled(result: Result) -> Result:
    """As of a verified simulation of which there is something to say."""
    errors, coupling_error = np.arange(20.0).reshape(5, 4) / 3e9, np.array([0, 1e-5, 1 / 3, 2e-9])
    warnings = ('a "quote", and \\ a comma,', "σ: a = b # no comment", "line\nbreak")
    return dataclasses.replace(result, title="a: b", errors=errors, coupling_error=coupling_error, warnings=warnings)


@pytest.fixture
def estimated(both: Result) -> Result:
    """As of an ensemble with an estimate."""
    return dataclasses.replace(both, errors=np.arange(6.0).reshape(3, 2) / 7e9)


def content(result: Result) -> tuple[Any, ...]:
    """All that a file keeps, the numbers bit by bit."""
    arrays = (result.time, result.values, result.errors, result.coupling_error)
    bits = (None if array is None else (array.shape, array.tobytes()) for array in arrays)
    named = (result.title, result.names, result.warnings, dict(result.units), dict(result.failures))
    return *bits, *named, list(result.index)


def test_signals_by_name(result: Result) -> None:
    np.testing.assert_array_equal(result["swing.theta_dot"], np.sin(result.time + 1))
    assert result.units["arm.x[1,2]"] == "m"
    with pytest.raises(SimulationError, match=r"a swing has no signal 'swing\.tetha'; did you mean 'swing\.theta'"):
        result["swing.tetha"]
    with pytest.raises(KeyError, match=r"^the result of a swing has no signal"):
        result["no"]
    assert result.get("no") is None
    assert result.get(3, default=1) == 1  # type: ignore[arg-type]
    np.testing.assert_array_equal(result.get("swing.phi"), result["swing.phi"])


def test_axes_tell_a_simulation_a_sweep_and_an_ensemble_apart(result: Result, cases: Result, both: Result) -> None:
    assert [one.kind for one in (result, cases, both)] == ["simulation", "sweep", "ensemble"]
    assert [list(one.index) for one in (result, cases, both)] == [["time"], ["case"], ["time", "case"]]


def test_nothing_can_be_changed(result: Result) -> None:
    with pytest.raises(ValueError, match="read-only"):
        result["plain"][0] = 1.0
    with pytest.raises(TypeError):
        result.units["plain"] = "m"  # type: ignore[index]
    with pytest.raises(dataclasses.FrozenInstanceError):
        result.title = "another"  # type: ignore[misc]


def test_copies_and_pickles_say_the_same(result: Result, cases: Result, both: Result) -> None:
    for one in (result, cases, both):
        for same in (pickle.loads(pickle.dumps(one)), copy.deepcopy(one)):
            assert repr(same) == repr(one)
            assert all(np.array_equal(same[name], one[name], equal_nan=True) for name in one.names)
            assert (same.units, same.failures, same.index.keys()) == (one.units, one.failures, one.index.keys())
            with pytest.raises(ValueError, match="read-only"):
                same[one.names[0]][0] = 1.0


def test_repr_is_one_line_that_says_what_is_inside(result: Result, cases: Result, both: Result) -> None:
    assert repr(result) == (
        "<Result of a swing: 4 points, t = 0 to 1 s, 5 signals: swing.theta [rad], swing.theta_dot [rad/s], "
        "arm.x[1,2] [m], plain, swing.phi [rad]>"
    )
    assert repr(cases) == "<Result of a sweep: 3 cases, 1 failed, 3 signals: mass [kg], theta [rad], all>"
    assert repr(both) == (
        "<Result of an ensemble: 4 points, t = 0 to 1 s, 2 cases, 1 failed, 3 signals: x (2) [m], e [J]>"
    )


def test_a_result_is_a_container_of_names(both: Result) -> None:
    assert list(both) == list(both.keys()) == ["x", "e"]
    assert (len(both), "x" in both, "x[2]" in both, "y" in both, 0 in both) == (2, True, True, False, False)
    assert {name: values.shape for name, values in dict(both).items()} == {"x": (4, 2, 2), "e": (4, 2)}
    np.testing.assert_array_equal(both["x"][..., 1], both["x[2]"])


def test_cases_are_counted(cases: Result) -> None:
    assert list(cases.index["case"]) == [0, 1, 2]
    with pytest.raises(SimulationError, match=r"no signal 'thet'; did you mean 'theta'.*in keep="):
        cases["thet"]


@pytest.mark.parametrize("kind", ["csv", "parquet"])
@pytest.mark.parametrize("name", ["result", "cases", "both", "coupled", "estimated"])
def test_files_give_back_the_same_doubles(kind: str, name: str, tmp_path: Path, request: Any) -> None:
    written: Result = request.getfixturevalue(name)
    path = tmp_path / f"some.{kind}"
    getattr(written, f"to_{kind}")(path)
    again: Result = getattr(Result, f"from_{kind}")(path)
    assert content(written) == content(again)
    assert [item.name for item in tmp_path.iterdir()] == [path.name]


def test_parquet_that_is_none(tmp_path: Path, result: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SimulationError, match=r"none\.parquet: cannot be read as Parquet: No such file"):
        Result.from_parquet(tmp_path / "none.parquet")
    path = tmp_path / "swing.parquet"
    path.write_text("no parquet")
    with pytest.raises(SimulationError, match=r"swing\.parquet: cannot be read as Parquet"):
        Result.from_parquet(path)
    pytest.importorskip("pandas").DataFrame().to_parquet(path)
    with pytest.raises(SimulationError, match="not a result that to_parquet has written"):
        Result.from_parquet(path)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(SimulationError, match=r"Parquet needs PyArrow; pip install 'liaisons\[parquet\]'"):
        result.to_parquet(path)


def test_extreme_doubles_and_a_signal_that_is_called_failure_survive_csv(tmp_path: Path) -> None:
    extreme = [5e-324, -0.0, 1.7976931348623157e308, np.nan, -np.inf, 0.1 + 0.2]
    values = np.array([extreme, np.arange(6.0)])
    result = Result("failing", np.arange(6.0), ("x", "failure"), values, {"x": "m", "failure": ""})
    result.to_csv(tmp_path / "x.csv")
    assert content(result) == content(Result.from_csv(tmp_path / "x.csv"))


def test_csv_is_that_of_other_tools(tmp_path: Path, cases: Result) -> None:
    path = tmp_path / "plain.csv"
    path.write_text('"time","h","v"\n0,1,0\n0.5,0.5,-4.9\n')
    np.testing.assert_array_equal(Result.from_csv(path)["v"], [0, -4.9])
    assert dict(Result.from_csv(path).units) == {"h": "", "v": ""}
    plain = Result("plain", np.arange(3.0), ("x", "y"), np.arange(6.0).reshape(2, 3), {"x": "m", "y": ""})
    dataclasses.replace(plain, warnings=("a, b",)).to_csv(path)
    assert path.read_text().splitlines()[:2] == ["time,x,y", "# s,m,"]
    assert Result.from_csv(path).title == "plain"
    np.testing.assert_array_equal(np.genfromtxt(path, delimiter=",", names=True)["y"], [3.0, 4.0, 5.0])
    cases.to_csv(path)
    written = path.read_text().splitlines()
    assert written[1:3] == ["# kg,rad,,", "# title: a sweep"]
    assert written[3:5] == ["1.0,0.1,3.0,", '2.0,nan,nan,"mass = 2, too much"']


def test_what_a_file_says_of_itself_does_not_disturb_other_readers(coupled: Result, tmp_path: Path) -> None:
    path = tmp_path / "coupled.csv"
    coupled.to_csv(path)
    table = pytest.importorskip("pandas").read_csv(path, comment="#")
    assert list(table.columns)[6:] == [*(f"error of {name}" for name in coupled.names), "coupling_error"]
    np.testing.assert_array_equal(table["coupling_error"], coupled.coupling_error)
    path.write_text(path.read_text().replace("# estimates: errors, coupling_error", "# estimates: coupling_error"))
    assert len(Result.from_csv(path).names) == 10  # then they are signals like others
    path.write_text("time,x\n# s,m\n# title: C:\\data\n# estimates: errors\n0,1\n1,2\n")
    with pytest.raises(SimulationError, match=r"it has no column for each of its estimates \(errors\)"):
        Result.from_csv(path)


def test_warnings_are_mentioned(coupled: Result, parsed: Any) -> None:
    assert repr(coupled).endswith(f"; 3 warnings, the first: {coupled.warnings[0]}>")
    assert repr(dataclasses.replace(coupled, warnings=("one",))).endswith("; 1 warning: one>")
    assert f"Warning: {coupled.warnings[1]}" in parsed(coupled._repr_html_()).texts


@pytest.mark.parametrize("where", ["missing/swing.png", "occupied"])
def test_file_that_cannot_be_written_is_named_and_leaves_nothing(result: Result, tmp_path: Path, where: str) -> None:
    (tmp_path / "occupied").mkdir()
    with pytest.raises(SimulationError, match=rf"{where}: cannot be written: .*; choose another path"):
        result.to_csv(tmp_path / where)
    with pytest.raises(SimulationError, match=rf"{where}: cannot be written"):
        result.plot(path=tmp_path / where)
    assert [item.name for item in tmp_path.iterdir()] == ["occupied"]


def test_failure_in_mid_file_keeps_the_old_one(tmp_path: Path, result: Result) -> None:
    path = tmp_path / "old.csv"
    path.write_text("old")
    torn = dataclasses.replace(result, units={**result.units, "plain": "\ud800"})  # cannot be encoded
    with pytest.raises(UnicodeEncodeError):
        torn.to_csv(path)
    assert path.read_text() == "old"
    assert [item.name for item in tmp_path.iterdir()] == ["old.csv"]


@pytest.mark.parametrize(
    "text",
    [
        *("", "\n", "time,x\n", "time,x\n# s,m\n0,1,2\n", "time,x\n# s,m\n0,high\n", "time,x,x\n0,1,2\n", "x"),
        *("time,case,x,failure\n0,0,1,\n0,1,1,\n1,0,1,\n", "x,failure\n"),
    ],
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
    assert figure.axes[0].get_shared_x_axes().joined(figure.axes[0], figure.axes[-1])
    np.testing.assert_array_equal(figure.axes[0].lines[1].get_ydata(), result["swing.phi"])
    assert path.read_text().startswith("<?xml")


def test_legends_stand_beside_the_curves(result: Result, tmp_path: Path) -> None:
    figure = result.plot(path=tmp_path / "swing.png")
    width, height = figure.get_size_inches() * figure.dpi
    assert width == 1000
    for axes in figure.axes:
        legend = axes.get_legend()
        assert legend is not None
        box = legend.get_window_extent()
        assert axes.get_window_extent().x1 <= box.x0 <= box.x1 <= width
        assert box.y1 <= height


@pytest.mark.parametrize("names", [("plain", "swing.phi"), (["plain", "swing.phi"],), (["plain"], "swing.phi")])
def test_plot_draws_what_is_named(result: Result, tmp_path: Path, names: Any) -> None:
    figure = result.plot(*names, path=tmp_path / "two.png")
    assert _drawn(figure) == [["plain"], ["swing.phi"]]
    with pytest.raises(SimulationError, match="no signal 'plan'"):
        result.plot("plan")
    assert [item.name for item in tmp_path.iterdir()] == ["two.png"]


def test_plot_over_time_cases_or_another_signal(tmp_path: Path, cases: Result, both: Result) -> None:
    path = tmp_path / "some.png"
    (axes,) = cases.plot("theta", path=path).axes
    assert (axes.get_xlabel(), axes.lines[0].get_linestyle()) == ("case", "None")
    one = dataclasses.replace(cases, values=np.sort(cases.values))
    (axes,) = one.plot("theta", path=path).axes
    assert (axes.get_xlabel(), axes.lines[0].get_linestyle()) == ("mass [kg]", "-")
    np.testing.assert_array_equal(axes.lines[0].get_xdata(), one["mass"])
    (axes,) = both.plot("e", over="x[1]", path=path).axes
    np.testing.assert_array_equal([line.get_xdata() for line in axes.lines], both["x[1]"].T)
    assert _drawn(both.plot("x", path=path)) == [["x (2×2)"]]
    with pytest.raises(SimulationError, match=r"e and x .* have different shapes; choose another over="):
        both.plot("e", over="x", path=path)


def test_a_phase_portrait_in_axes_of_a_figure(result: Result, tmp_path: Path) -> None:
    figure = Figure()
    left, right = figure.subplots(1, 2)
    assert result.plot("swing.theta_dot", over="swing.theta", axes=left) is figure
    assert (left.get_xlabel(), left.get_ylabel()) == ("swing.theta [rad]", "[rad/s]")
    np.testing.assert_array_equal(
        left.lines[0].get_xydata(), np.array([result["swing.theta"], result["swing.theta_dot"]]).T
    )
    result.plot("swing.phi", axes=right)
    result.plot("swing.theta", axes=right, path=tmp_path / "both.png")  # beside what is there, the whole figure saved
    assert _drawn(figure) == [["swing.theta_dot"], ["swing.phi", "swing.theta"]]
    assert len({line.get_color() for line in right.lines}) == 2
    assert (tmp_path / "both.png").stat().st_size > 1000


def test_axes_that_do_not_do(result: Result) -> None:
    figure = Figure()
    with pytest.raises(
        SimulationError, match=r"axes: plain, swing.phi \[rad\] of a swing need a diagram each; name sig"
    ):
        result.plot("plain", "swing.phi", axes=figure.subplots())
    with pytest.raises(SimulationError, match=r"plot: axes = .*: give one Axes, as matplotlib.pyplot.subplots\(\)"):
        result.plot("plain", axes=figure.subplots(1, 2))
    with pytest.raises(SimulationError, match=r"no signal 'swing\.thet'; did you mean 'swing\.theta'"):
        result.plot("swing.phi", over="swing.thet", axes=figure.subplots())
    assert all(not axes.lines for axes in figure.axes)


def _mapped(count: int) -> Result:
    """As of a sweep of two values on a grid of so many times three, in no order, whose last case has failed."""
    mass, length = (column.ravel() for column in np.meshgrid(np.arange(1.0, count + 1), [0.5, 1.0, 4.0]))
    signals = {"mass": mass, "length": length, "period": mass + 10 * length, "x[1]": mass, "x[2]": length}
    shuffled = np.array(list(signals.values()))[:, np.random.default_rng(0).permutation(mass.size)]
    shuffled[2:, -1] = np.nan
    units = {**dict.fromkeys(signals, ""), "mass": "kg", "length": "m", "period": "s"}
    return Result("a grid", np.empty(0), tuple(signals), shuffled, units, failures={mass.size - 1: "too much"})


def test_a_sweep_over_two_is_a_map(tmp_path: Path) -> None:
    grid = _mapped(4)
    figure = grid.plot(path=tmp_path / "map.png")
    maps = [axes for axes in figure.axes if axes.collections and axes.get_xlabel()]
    assert [(axes.get_xlabel(), axes.get_ylabel()) for axes in maps] == 3 * [("mass [kg]", "length [m]")]
    assert {axes.get_ylabel() for axes in figure.axes} == {"length [m]", "period [s]", "x[1]", "x[2]"}  # of the bars
    drawn = np.ma.masked_invalid(np.ma.asarray(maps[0].collections[0].get_array()))
    expected = np.arange(1.0, 5.0) + 10 * np.array([[0.5], [1.0], [4.0]])
    assert drawn.mask.sum() == 1
    np.testing.assert_array_equal(drawn.compressed(), expected[~drawn.mask])
    failed = [float(grid[name][-1]) for name in ("mass", "length")]
    assert expected[drawn.mask] == failed[0] + 10 * failed[1]
    other = Figure()
    axes = other.subplots()
    assert grid.plot("period", axes=axes) is other
    assert [each.get_ylabel() for each in other.axes] == ["length [m]", "period [s]"]
    with pytest.raises(SimulationError, match=r"axes: x\[1\], x\[2\] of a grid need a diagram each"):
        grid.plot("x", axes=axes)
    with pytest.raises(SimulationError, match="no signal 'perio'; did you mean 'period'"):
        grid.plot("perio")


def test_a_sweep_that_is_no_map(tmp_path: Path) -> None:
    """A third value, a line, pairs that are missing, or another signal on the horizontal axis."""
    grid = _mapped(4)
    third = dataclasses.replace(grid, values=np.hstack([grid.values, grid.values]))
    for other in (third, _mapped(1), dataclasses.replace(grid, values=grid.values[:, 1:])):
        assert other.plot("period", path=tmp_path / "x.png").axes[0].lines
    assert grid.plot("period", over="mass", path=tmp_path / "x.png").axes[0].lines


@pytest.mark.parametrize("suffix", ["csv", "fmu"])
def test_plot_to_a_file_of_unknown_kind(result: Result, tmp_path: Path, suffix: str) -> None:
    with pytest.raises(SimulationError, match=rf"two\.{suffix}: .*'{suffix}' is not supported"):
        result.plot(path=tmp_path / f"two.{suffix}")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", [".pdf", ".svg"])
def test_a_figure_for_a_lecture(result: Result, tmp_path: Path, suffix: str) -> None:
    name = result.names[0]
    labels = {name: "angle", "time": "instant"}
    path = tmp_path / f"figure{suffix}"
    figure = result.plot(name, labels=labels, title="A swing", width=0.085, path=path)
    (diagram,) = figure.axes
    unit = result.units[name]
    assert diagram.get_ylabel() == (f"angle [{unit}]" if unit else "angle")
    assert (diagram.get_xlabel(), diagram.get_title()) == ("instant [s]", "A swing")
    assert diagram.get_legend() is None
    assert figure.get_figwidth() * 0.0254 == pytest.approx(0.085)
    assert {text.get_fontsize() for text in (diagram.title, diagram.yaxis.label, *diagram.get_xticklabels())} == {8}
    content = path.read_bytes()
    if suffix == ".pdf":
        box = re.search(rb"/MediaBox \[ 0 0 ([\d.]+) ", content)
        assert box is not None
        assert float(box[1]) == pytest.approx(0.085 / 0.0254 * 72, abs=0.01)  # points
    else:
        assert b"<svg" in content
    two = result.plot(list(result.names[:2]), labels={name: "angle"}, width=0.085).axes
    texts = [text.get_text() for axes in two if (legend := axes.get_legend()) for text in legend.get_texts()]
    assert "angle" in [*texts, *(axes.get_ylabel().partition(" ")[0] for axes in two)]


def test_what_a_plot_cannot_do_is_said(result: Result) -> None:
    with pytest.raises(SimulationError, match="plot: width = -1: give metres"):
        result.plot(width=-1)
    with pytest.raises(SimulationError, match="nobody"):
        result.plot(labels={"nobody": "x"})


def test_plot_draws_what_matters(tmp_path: Path) -> None:
    """A pendulum with all its variables: what stays 0, copies and what nobody asked for are left out."""
    t = np.linspace(0, 10, 201)
    wave = np.sin(3 * t)
    signals = {
        "q": (0.1 * wave, "rad"), "q_dot": (0.3 * np.cos(3 * t), "rad/s"), "q_ddot": (-0.9 * wave, "rad/s2"),
        "p_q": (0.3 * np.cos(3 * t), "kg.m2/s"), "q_force": (0 * t, "N.m"), "q_load": (0 * t, "N.m"),
        "s": (1 + 0.1 * wave, "m"), "s_power": (wave, "W"), "s_force": (-9.8 - wave, "N"),
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


@pytest.mark.parametrize(("signals", "drawn"), [({"y": 2.0, "zero": 0.0}, ["y"]), ({"zero": 0.0}, ["zero"]), ({}, [])])
def test_plot_of_what_does_not_move(tmp_path: Path, signals: dict[str, float], drawn: list[str]) -> None:
    values = np.repeat([*signals.values()], 3).reshape(len(signals), 3)
    still = Result("still", np.arange(3.0), tuple(signals), values, dict.fromkeys(signals, "m"))
    assert _drawn(still.plot(path=tmp_path / "still.png")) == [drawn]


def test_a_figure_is_seen_once(result: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    """By pyplot's window, or as what a cell of a notebook returns: that shows what pyplot knows, too."""
    pyplot.close("all")  # what other tests have left
    monkeypatch.setattr("matplotlib.get_backend", lambda: "module://matplotlib_inline.backend_inline")
    result.plot()
    assert pyplot.get_fignums() == []
    monkeypatch.setattr("matplotlib.get_backend", lambda: "agg")
    figure = result.plot()
    assert [pyplot.figure(number) for number in pyplot.get_fignums()] == [figure]
    pyplot.close("all")


def test_a_notebook_shows_a_table(result: Result, cases: Result, both: Result, parsed: Any) -> None:
    html = result._repr_html_()
    _, tags, texts = parsed(html)
    assert texts[:9] == [
        *("Result of a swing: 4 points, t = 0 to 1 s, 5 signals", "signal", "unit", "start", "end", "smallest"),
        *("largest", "swing.theta", "rad"),
    ]
    assert "svg" in tags
    for points in re.findall('points="(.*?)"', html):
        across, down = np.array([point.split(",") for point in points.split()], dtype=float).T
        assert [across.min(), across.max(), down.min(), down.max()] == [0, 120, 1, 23]  # of 120 × 24 pixels
    _, tags, texts = parsed(cases._repr_html_())
    assert texts[1:7] == ["mass [kg]", "theta [rad]", "all", "1", "0.1", "3"]
    assert texts[-1] == "case 1 failed: mass = 2, too much"
    assert "svg" not in tags
    last = both["x"][:, 0].max()  # of the case that has not failed
    assert list(both.summary(few=0)[0].values()) == ["x (2)", "m", "", "", "0", f"{last:.6g}"]
    assert [row["signal"] for row in both.summary()] == ["x[1]", "x[2]", "e"]
    dataclasses.replace(both, values=np.full_like(both.values, np.nan))._repr_html_()  # nothing to draw


def test_text_of_fmus_is_text_in_a_notebook(parsed: Any) -> None:
    signal, units = np.arange(3.0)[None], {HOSTILE: HOSTILE}
    _, tags, texts = parsed(Result(HOSTILE, np.arange(3.0), (HOSTILE,), signal, units)._repr_html_())
    assert texts[0].startswith(f"Result of {HOSTILE}:")
    assert texts.count(HOSTILE) == 2
    sweep = Result("s", np.empty(0), (HOSTILE,), signal, units, failures={0: HOSTILE})
    _, others, more = parsed(sweep._repr_html_())
    assert more[-1] == f"case 0 failed: {HOSTILE}"
    assert not {"img", "script"} & (tags | others)


def test_data_frames(result: Result, cases: Result, both: Result) -> None:
    pandas = pytest.importorskip("pandas")
    frame = result.to_pandas()
    assert (list(frame), frame.index.name, frame.attrs["units"]["plain"]) == (list(result.names), "time", "")
    np.testing.assert_array_equal(frame.to_numpy().T, result.values)
    assert cases.to_pandas().loc[2, "theta"] == cases["theta"][2]
    assert cases.to_pandas().attrs["failures"] == {1: "mass = 2, too much"}
    series = both.to_pandas()["x[2]"]
    assert isinstance(series, pandas.Series)
    np.testing.assert_array_equal(series.unstack().to_numpy(), both["x[2]"])
    assert series.index.names == ["time", "case"]


def test_labelled_arrays(result: Result, cases: Result, both: Result) -> None:
    pytest.importorskip("xarray")
    data = both.to_xarray()
    assert (data["x"].dims, data["e"].attrs["units"]) == (("time", "case", "i_2"), "J")
    np.testing.assert_array_equal(data["x"].sel(case=0), both["x"][:, 0])
    assert data["failure"].to_numpy().tolist() == ["", "r must stay > 0"]
    assert cases.to_xarray()["theta"].dims == ("case",)
    timed = dataclasses.replace(result, names=("time", *result.names[1:]), units={**result.units, "time": "s"})
    assert list(timed.to_xarray()) == list(result.names[1:])


@pytest.mark.parametrize("package", ["pandas", "xarray"])
def test_without_an_extra_one_is_told_what_to_install(
    result: Result, package: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(SimulationError, match=rf"^to_{package} needs {package}; pip install 'liaisons\[{package}\]'$"):
        getattr(result, f"to_{package}")()


def test_cases_without_convergence_are_those_whose_error_is_infinite(both: Result) -> None:
    errors = np.zeros((len(both.names), both.values.shape[-1]))
    errors[0, 0], errors[-1, 1] = np.nan, np.inf  # not a number: one that has failed
    found = dataclasses.replace(both, errors=errors)
    assert found.unconverged == (1,)
    assert "1 without convergence" in repr(found)
