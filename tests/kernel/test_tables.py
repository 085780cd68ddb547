"""Everything that a table may have: obeyed, listed or refused, the same by each reader; the page that says so.

``python tests/kernel/test_tables.py`` writes the page.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import fmpy.util
import numpy as np
import pytest

from liaisons import System, simulate
from liaisons.base.tables import read_table
from liaisons.base.units import size_in_si
from liaisons.check import compare
from liaisons.errors import IdentificationError, SimulationError, ValidityError
from liaisons.mechanics import assemble
from liaisons.models import Pendulum
from liaisons.results import Result
from liaisons_motion.identification.measurements import measurements, table_of
from liaisons_tools.cli._inputs import _checked_columns, _input_table

PAGE = Path(__file__).parents[2] / "docs/reference/tables.md"
TIMES, LENGTHS = [0.0, 0.5, 1.0], [1.0, 1.25, 1.125]
Numbers = tuple[list[float], list[float]]


class Property(NamedTuple):
    """What a table may have, an example, and what becomes of it.

    :param refused: words with which each reader refuses it; empty: all read the same numbers.
    :param otherwise: by reader, words of a refusal where the others read it, or the other way round: numbers.
    :param note: for the page.
    :param listed: left out by ``--input``, which says so.
    """

    name: str
    text: str
    refused: str = ""
    otherwise: dict[str, str | Numbers] = {}  # noqa: RUF012 - never changed
    note: str = ""
    listed: bool = False


def _rows(top: str, bottom: tuple[str, str, str] = ("1,0.2", "1.25,0.1", "1.125,0.3"), sign: str = ",") -> str:
    """Text of a table of times, lengths and angles."""
    times = ("0", "0.5", "1")
    lines = [f"{time},{rest}".replace(",", sign) for time, rest in zip(times, bottom, strict=True)]
    return "\n".join([top, *lines, ""])


PLAIN = _rows("time,length,theta")
NAN = float("nan")
JUMP = "time,length,theta\n0,1,0.2\n0.5,1,0.1\n0.5,2,0.1\n1,2,0.1\n"
PROPERTIES = [
    Property("names above, SI units", PLAIN),
    Property("time column `t`", PLAIN.replace("time", "t")),
    Property("time column `Time`", PLAIN.replace("time", "Time")),
    Property("time in another column", "length,time,theta\n1,0,0.2\n1.25,0.5,0.1\n1.125,1,0.3\n"),
    Property("units behind names, `length [mm]`", _rows("time,length [mm],theta", ("1000,0", "1250,0", "1125,0"))),
    Property("units in parentheses, `length (mm)`", _rows("time,length (mm),theta", ("1000,0", "1250,0", "1125,0"))),
    Property("units without a space, `length[cm]`", _rows("time,length[cm],theta", ("100,0", "125,0", "112.5,0"))),
    Property("a line of units, `# s,mm,rad`", _rows("time,length,theta\n# s,mm,rad", ("1000,0", "1250,0", "1125,0"))),
    Property("a line of units without `#`", _rows("time,length,theta\ns,[mm],rad", ("1000,0", "1250,0", "1125,0"))),
    Property("units above the names", _rows("# s mm rad\ntime,length,theta", ("1000,0", "1250,0", "1125,0"))),
    Property("time in ms", "time [ms],length,theta\n0,1,0\n500,1.25,0\n1000,1.125,0\n"),
    Property(
        "time in minutes or hours",
        f"# h,m,rad\ntime,length,theta\n0,1,0\n{0.5 / 3600!r},1.25,0\n{1 / 3600!r},1.125,0\n",
    ),
    Property(
        "a unit of another quantity",
        _rows("time,length [kg],theta"),
        "column length: unit 'kg' cannot be converted to 'm'",
        {"result": "as written"},
        "`from_csv` does not know the variables; it keeps the units, and `compare` converts or refuses them",
    ),
    Property(
        "a time in a unit of another quantity",
        _rows("time [kg],length,theta"),
        "column time: unit 'kg' cannot be converted to 's'",
    ),
    Property(
        "an unknown unit",
        _rows("time,length [furlong],theta"),
        "unit 'furlong' is not understood",
        {"result": "as written"},
    ),
    Property("fewer units than columns", _rows("time,length,theta\n# s,mm"), "line 2: 2 units for 3 columns"),
    Property(
        "different units in both places",
        _rows("time,length [mm],theta\n# s,m,rad"),
        "column length: in mm above, in m below",
        {"result": "as written"},
    ),
    Property("semicolons", _rows("time,length,theta", sign=";").replace("time,length,theta", "time;length;theta")),
    Property("tabs", PLAIN.replace(",", "\t")),
    Property("decimal commas between semicolons", PLAIN.replace(",", ";").replace(".", ",")),
    Property("decimal commas in quotes", 'time,length,theta\n0,1,0\n"0,5","1,25",0\n1,"1,1250",0\n'),
    Property(
        "`1,125` in quotes between commas",
        'time,length,theta\n0,1,0\n0.5,"1,125",0\n',
        "line 3, column 2: '1,125': a decimal sign, or a separator of thousands",
    ),
    Property(
        "decimal commas and decimal points",
        "time;length;theta\n0;1.0;0\n0,5;1;0\n",
        "line 2, column 2: '1.0': a decimal sign, or",
    ),
    Property("the first line of Excel, `sep=;`", "sep=;\n" + PLAIN.replace(",", ";")),
    Property("a byte order mark", "\ufeff" + PLAIN),
    Property("line ends as in Windows", PLAIN.replace("\n", "\r\n")),
    Property("quoted names and cells", PLAIN.replace("length", '"length"').replace("1.25", '"1.25"')),
    Property("a quote that does not end", PLAIN.replace("1.25", '"1.25'), "unexpected end of data"),
    Property("comments that begin with `#`", "# an old remark\n" + PLAIN.replace("\n0.5", "\n# begin, here\n0.5")),
    Property("names in a comment, as `numpy.savetxt` writes them", "# " + PLAIN),
    Property("empty lines, and lines of empty cells", PLAIN.replace("\n0.5", "\n\n,,\n0.5")),
    Property("a separator at the end of each line", PLAIN.replace("\n", ",\n")),
    Property("a column without a name", _rows(",time,length").replace("\n", ",\n"), "column 1 has no name"),
    Property("two columns of the same name", _rows("time,length,length"), "twice|each once"),
    Property(
        "an unknown column",
        _rows("time,lenght,theta"),
        "'?lenght'?.*; did you mean 'length'",
        {"result": "as written"},
        "`ignore=[...]` of `identify` leaves columns out",
    ),
    Property(
        "error estimates of a result",
        "time,length,theta,coupling_error\n0,1,0,0\n0.5,1.25,0,1e-9\n1,1.125,0,1e-9\n",
        listed=True,
    ),
    Property("a row with too few cells", PLAIN + "2,1\n", "line 5: 2 numbers for 3 columns"),
    Property("text", PLAIN.replace("1.25", "long"), "column length: line 3: could not convert string to float: 'long'"),
    Property(
        "a date", PLAIN.replace("\n0.5", "\n2024-05-01"), "column time: line 3: could not convert string to float"
    ),
    Property(
        "an error value of a spreadsheet",
        PLAIN.replace("\n0.5", "\n#N/A"),
        "column time: line 3: could not convert string to float: '#N/A'",
    ),
    Property(
        "`1_250`", PLAIN.replace("1.25", "1_25"), "column length: line 3: could not convert string to float: '1_25'"
    ),
    Property(
        "a number too large for a double",
        PLAIN.replace("1.25", "1e999"),
        "column length: line 3: more than a number can be",
    ),
    Property(
        "an infinite number",
        PLAIN.replace("1.25", "-inf"),
        "column length: line 3: finite numbers only",
        {"result": (TIMES, [1.0, -np.inf, 1.125])},
    ),
    Property(
        "an empty cell",
        PLAIN.replace("1.25", ""),
        "",
        {
            "--input": (TIMES, [1.0, NAN, 1.125]),
            "identify": (TIMES, [1.0, 1.0625, 1.125]),
            "result": (TIMES, [1.0, NAN, 1.125]),
        },
        "`identify` ignores missing measurements; the curve of an input passes over the gap, with a warning",
    ),
    Property(
        "`NaN`, `NA`, `null`",
        PLAIN.replace("1.25", "NA"),
        "",
        {
            "--input": (TIMES, [1.0, NAN, 1.125]),
            "identify": (TIMES, [1.0, 1.0625, 1.125]),
            "result": (TIMES, [1.0, NAN, 1.125]),
        },
    ),
    Property(
        "an empty cell in the last line",
        PLAIN.replace("1.125", ""),
        "column length: line 4: a value is missing at an end or a jump",
        {"result": (TIMES, [1.0, 1.25, NAN])},
    ),
    Property("a missing instant", PLAIN.replace("\n0.5", "\n"), "column time: line 3: a value is missing"),
    Property(
        "instants that do not ascend",
        PLAIN.replace("\n0.5", "\n2"),
        "column time: line 4: it must (not be less|be greater) than",
    ),
    Property(
        "the same instant twice: a jump",
        JUMP,
        "",
        {
            "identify": "column time: line 4: it must be greater than the one before",
            "--input": ([0, 0.5, 0.5, 1], [1, 1, 2, 2]),
            "result": ([0, 0.5, 0.5, 1], [1, 1, 2, 2]),
        },
    ),
    Property(
        "a jump in the last line",
        JUMP.replace("\n1,2,0.1", ""),
        "line 4: (a jump after which nothing follows|it must be greater)",
        {"result": ([0, 0.5, 0.5], [1, 1, 2])},
    ),
    Property(
        "the same instant three times",
        JUMP.replace("\n1,2", "\n0.5,2"),
        "line [45]: (the same instant for the third time|it must be greater)",
        {"result": ([0, 0.5, 0.5, 0.5], [1, 1, 2, 2])},
    ),
    Property("an empty file", "", "has nothing|empty|no numbers"),
    Property("a single line of numbers", "time,length,theta\n0,1,0\n", "give two", {"result": ([0], [1])}),
]
SYSTEM = System("pendulum")


def _by_input(path: Path) -> Numbers:
    """What ``--input`` reads."""
    if not SYSTEM.parts:
        SYSTEM.add("pendulum", "Pendulum")
    times, columns = _checked_columns(*_input_table(SYSTEM, path, single=True))
    return times.tolist(), columns["length"].tolist()


def _by_identify(path: Path) -> Numbers:
    """What ``identify`` reads."""
    (read,) = measurements(path, assemble(Pendulum), measured="theta")
    return read.times.tolist(), read.inputs["length"](read.times).tolist()


def _by_result(path: Path) -> Numbers:
    """What ``Result.from_csv``, and with it ``compare``, reads."""
    result = Result.from_csv(path)
    return result.time.tolist(), (result["length"] * size_in_si(result.units["length"], "m")).tolist()


READERS: dict[str, Callable[[Path], Numbers]] = {
    "--input": _by_input,
    "identify": _by_identify,
    "result": _by_result,
}


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("what", PROPERTIES, ids=lambda what: what.name)
def test_a_property_of_tables(what: Property, reader: str, tmp_path: Path) -> None:
    path = tmp_path / "motion.csv"
    path.write_bytes(what.text.encode())
    expected = what.otherwise.get(reader, what.refused or (TIMES, LENGTHS))
    if expected == "as written":
        assert Result.from_csv(path).time.tolist() == TIMES
        return
    if isinstance(expected, str):
        with pytest.raises((SimulationError, IdentificationError), match=rf"(?s)motion\.csv.*({expected})") as caught:
            READERS[reader](path)
        assert "\n" not in str(caught.value)
        return
    for got, right in zip(READERS[reader](path), expected, strict=True):
        np.testing.assert_allclose(got, right, rtol=1e-15)  # a conversion rounds once


PAGE_TEXT = """# Tables: CSV, Parquet, units

`--input` of `liaisons simulate`, `identify`, `compare`, `Result.from_csv` and `from_parquet` read tables in the same
way. A table is CSV with commas, semicolons or tabs, or Parquet, or, where arrays are accepted, a pandas data frame. The
list below is written by `tests/kernel/test_tables.py`, which tests each of its lines. *Obeyed* means that the numbers
are right, *listed* that a message says what is left out, *refused* that an error names file, line and column.

| property of the table | `--input` | `identify` | `from_csv`, `compare` | remark |
|---|---|---|---|---|
{}

Numbers are converted to the unit that the FMU declares, from SI units with the prefixes k, c, m, µ, n, and from `g`,
`deg`, `rev`, `rpm`, `min` and `h`. `--input` leaves out columns of outputs, with a warning. If a table begins at 5 s,
the run, or the motion that `identify` fits, starts at 5 s. `compare` converts the second file to the units of the
first.

All commands can read what any of them writes. FMPy reads only CSV without comments. For its `--input-file`, `--plain`,
in Python `result.to_csv(path, plain=True)`, leaves out units and notes.
"""


def _page() -> str:
    """The page that lists the properties."""
    rows = []
    for what in PROPERTIES:
        words = []
        for reader in READERS:
            expected = what.otherwise.get(reader, what.refused)
            refused = isinstance(expected, str) and expected not in {"", "as written"}
            listed = what.listed and reader == "--input"
            words.append("refused" if refused else "listed" if listed else expected or "obeyed")
        cells = [word if isinstance(word, str) else "obeyed" for word in words]
        rows.append(f"| {' | '.join([what.name, *cells, what.note])} |")
    return PAGE_TEXT.format("\n".join(rows))


def test_the_page_says_what_is_tried() -> None:
    assert PAGE.read_text(encoding="utf-8") == _page()


@pytest.mark.parametrize("row", [3, 20, 56])
def test_a_single_wrong_value_is_told(row: int, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    t = np.cumsum(np.random.default_rng(row).uniform(0.01, 0.03, 60))
    length = 1 + 0.1 * np.sin(3 * t) + 1e-5 * np.random.default_rng(row).standard_normal(t.size)
    length[row] += 0.05
    _by_input(_written(tmp_path, t, length))
    assert (
        f"column length: line {row + 2}: {length[row]:.6g} lies far off the curve through its neighbours" in caplog.text
    )


@pytest.mark.parametrize(
    "shape",
    [
        lambda t: 1 + 0.2 * (t > 0.5),
        lambda t: 1 + 0.2 * np.abs(t - 0.5),
        lambda t: 1 + 0.2 * np.clip(t - 0.5, 0, 0.1),
        lambda t: 1 + 1e-4 * np.random.default_rng(1).standard_normal(t.size),
        lambda t: 1 + 0.1 * np.sin(40 * t),
        np.ones_like,
    ],
)
def test_steps_kinks_and_noise_are_not_taken_for_wrong_values(
    shape: Callable[[Any], Any], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    t = np.linspace(0, 1, 101)
    _by_input(_written(tmp_path, t, shape(t)))
    assert "lies far off" not in caplog.text


def _written(folder: Path, times: Any, lengths: Any) -> Path:
    """Path of a table."""
    lines = [f"{time!r},{length!r}" for time, length in zip(times.tolist(), lengths.tolist(), strict=True)]
    (folder / "length.csv").write_text("\n".join(["time,length", *lines]))
    return folder / "length.csv"


def test_what_a_command_writes_the_others_read(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Results with estimates, comments and outputs; FMPy, without what it cannot read."""
    moving = {"length": lambda t: (1 + 0.1 * t**3, 0.3 * t**2, 0.6 * t)}
    result = simulate("Pendulum", theta_0=0.3, inputs=moving, stop_time=1.0, step_size=0.25)
    assert result.coupling_error is not None
    for ending in ("csv", "parquet"):
        path = tmp_path / f"swing.{ending}"
        getattr(result, f"to_{ending}")(path)
        if not SYSTEM.parts:
            SYSTEM.add("pendulum", "Pendulum")
        times, columns = _checked_columns(*_input_table(SYSTEM, path, single=True))
        np.testing.assert_array_equal(times, result.time)
        inputs = set(SYSTEM.parts["pendulum"].fmu.reals("input"))
        assert set(columns) == inputs & set(result.names)
        np.testing.assert_array_equal(columns["length"], result["length"])
        assert "left out, as they are no inputs: theta, " in caplog.text
        assert "coupling_error" in caplog.text
        (read,) = measurements(path, assemble(Pendulum), measured="theta")
        np.testing.assert_array_equal(read.values, [result["theta"]])
    result.to_csv(tmp_path / "plain.csv", plain=True)
    table = fmpy.util.read_csv(tmp_path / "plain.csv")
    np.testing.assert_array_equal(table["length_dot"], result["length_dot"])
    again = Result.from_csv(tmp_path / "plain.csv")
    assert again.names == (*result.names, "coupling_error")  # what says that it is an estimate is left out


def test_data_frames_are_tables() -> None:
    result = simulate("Pendulum", theta_0=0.3, stop_time=1.0, step_size=0.25, record=["theta"])
    frame = result.to_pandas()
    (read,) = measurements(frame, assemble(Pendulum))
    np.testing.assert_array_equal(read.values, [result["theta"]])
    frame.attrs["units"]["theta"] = "deg"
    (read,) = measurements(frame, assemble(Pendulum))
    np.testing.assert_allclose(read.values, [result["theta"] * np.pi / 180], rtol=1e-15)
    dates = {"time": np.array(["2024-05-01", "2024-05-02"], dtype="datetime64[D]"), "theta": [0.0, 1.0]}
    with pytest.raises(IdentificationError, match=r"column time: row 0: could not convert .*2024-05-01"):
        measurements(dates, assemble(Pendulum))
    assert table_of({"x": [1, None]}, SimulationError).numbers("x", "m").tolist() == pytest.approx(
        [1, NAN], nan_ok=True
    )


def test_compare_minds_units(tmp_path: Path) -> None:
    """90° at 1000 ms is π/2 at 1 s; a length is no mass."""
    (tmp_path / "one.csv").write_text("time,x\n# s,rad\n0,0\n1,1.5\n2,3\n")
    angles = [np.degrees(value).item() for value in (0, 1.5, 3)]
    rows = [f"{time},{angle!r}" for time, angle in zip((0, 1000, 2000), angles, strict=True)]
    (tmp_path / "two.csv").write_text("\n".join(["time [ms],x [deg]", *rows]))
    one, two = (Result.from_csv(tmp_path / f"{name}.csv") for name in ("one", "two"))
    assert two.time.tolist() == [0, 1, 2]
    assert dict(two.units) == {"x": "deg"}
    assert compare(one, two)["x"].maximum < 1e-15  # π/180 rounds
    assert compare(two, one)["x"].maximum < 1e-13
    (tmp_path / "two.csv").write_text("time,x [kg]\n0,0\n1,1\n")
    with pytest.raises(ValidityError, match="x is in rad in one, in kg in two; convert one"):
        compare(one, Result.from_csv(tmp_path / "two.csv"))


def test_no_command_falls_for_the_names_of_variables(tmp_path: Path) -> None:
    """An element of an array and a derivative are no units; a line of units says that names are as they stand."""
    path = tmp_path / "foreign.csv"
    path.write_text("time,x[1],der(h),x[m],y [N.m]\n0,1,2,3,4\n1,1,2,3,4\n")
    result = Result.from_csv(path)
    assert result.names == ("x[1]", "der(h)", "x", "y")
    assert dict(result.units)["y"] == "N.m"
    path.write_text("time,x[1],x[m]\n# s,m(1/2),kg\n0,1,2\n1,1,2\n")
    assert Result.from_csv(path).names == ("x[1]", "x[m]")
    assert [Result.from_csv(path).units[name] for name in ("x[1]", "x[m]")] == ["m(1/2)", "kg"]
    with pytest.raises(SimulationError, match="column x: in m above, in kg below; leave one out"):
        read_table(path, SimulationError).named({"x[1]", "x"})


if __name__ == "__main__":
    PAGE.write_text(_page(), encoding="utf-8", newline="\n")
