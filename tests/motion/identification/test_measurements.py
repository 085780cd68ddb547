"""What is read of files, results and arrays: names, units, drives, and what is refused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from liaisons import System, identify, simulate
from liaisons.base.units import size_in_si
from liaisons.composition import composed_model
from liaisons.errors import IdentificationError
from liaisons.mechanics import assemble
from liaisons.models import Pendulum, PendulumChain
from liaisons_motion.identification.measurements import Measurements, measurements, noise_levels
from liaisons_motion.identification.problems import smoothed_values

MODEL = assemble(Pendulum)
Reads = Callable[..., Measurements]


@pytest.fixture
def reads(tmp_path: Path) -> Reads:
    """The measurements in a CSV file with this text."""

    def read(text: str, **options: object) -> Measurements:
        path = tmp_path / "measured.csv"
        path.write_text(text, encoding="utf-8")
        (experiment,) = measurements(path, MODEL, **options)  # type: ignore[arg-type]
        return experiment

    return read


@pytest.mark.parametrize(
    "heading",
    ["time,theta [deg]", "time [s], theta (°)", "time,theta\n# s,deg", "t;theta [deg]", "#multi:\ntime\ttheta [deg]"],
)
def test_units_stand_behind_names_or_below_them(reads, heading) -> None:
    sign = next((sign for sign in "\t;" if sign in heading), ",")
    measured = reads(f"{heading}\n0{sign}90\n\n0.5{sign}\n1{sign}-45.0\n")
    assert measured.signals == ("theta",)
    assert measured.times.tolist() == [0, 0.5, 1]
    np.testing.assert_allclose(measured.values, [[np.pi / 2, np.nan, -np.pi / 4]], rtol=1e-15)


def test_a_comma_is_a_decimal_point_where_cells_are_separated_otherwise(reads) -> None:
    assert reads("time;theta\n0,5;1,25\n1,5;-2\n").values.tolist() == [[1.25, -2.0]]


@pytest.mark.parametrize(
    ("name", "unit", "size"),
    [
        ("cm", "m", 0.01),
        ("mm/s^2", "m/s2", 1e-3),
        ("km/h", "m/s", 1 / 3.6),
        ("rpm", "rad/s", 2 * np.pi / 60),
        ("g", "kg", 1e-3),
        ("kg.m²/s3", "W", 1.0),
        ("1/ms", "1/s", 1e3),
        ("min", "s", 60.0),
        ("deg/s2", "rad/s2", np.pi / 180),
        ("mN·m", "J", 1e-3),
    ],
)
def test_measured_units_are_converted(name, unit, size) -> None:
    assert size_in_si(name, unit) == pytest.approx(size, rel=1e-15)


@pytest.mark.parametrize(("name", "unit"), [("px", "m"), ("Hz", "rad/s"), ("m", "s"), ("inch", "m"), ("m/s/s", "m/s2")])
def test_a_unit_of_another_quantity_is_refused(name, unit) -> None:
    with pytest.raises(ValueError, match="unit"):
        size_in_si(name, unit)


def test_what_a_simulation_has_written_is_read_as_it_was(tmp_path) -> None:
    result = simulate(
        "Pendulum",
        theta_0=1.0,
        stop_time=1.0,
        step_size=0.125,
        inputs={"length": lambda t: (1 + t**3, 3 * t**2, 6 * t)},
    )
    result.to_csv(tmp_path / "swing.csv")
    from_file, from_result = measurements([tmp_path / "swing.csv", result], MODEL, measured=["theta", "bob_x"])
    for read in (from_file, from_result):
        assert read.signals == ("theta", "bob_x")
        np.testing.assert_array_equal(read.values, [result["theta"], result["bob_x"]])
        assert set(read.inputs) == {"length"}  # what has rested is no drive
    t = np.linspace(0, 1, 50)
    np.testing.assert_allclose(from_file.inputs["length"](t), 1 + t**3, rtol=1e-14)
    np.testing.assert_allclose(from_file.inputs["length"](t, 2), 6 * t, rtol=0, atol=1e-12)
    assert "energy" in measurements(result, MODEL)[0].signals


def test_a_drive_is_the_quintic_spline_through_its_values() -> None:
    rng = np.random.default_rng(1)
    t = np.sort(rng.uniform(0, 2, 40))
    polynomial = np.polynomial.Polynomial(rng.standard_normal(6))
    data = {"time": t, "theta": np.ones(40), "pivot_x": polynomial(t), "theta_force": np.sin(t)}
    (read,) = measurements(data, MODEL)
    assert set(read.inputs) == {"pivot_x", "theta_force"}
    inside = np.linspace(t[0], t[-1], 500)
    for order in range(3):
        np.testing.assert_allclose(
            read.inputs["pivot_x"](inside, order),
            polynomial.deriv(order)(inside) if order else polynomial(inside),
            rtol=0,
            atol=1e-8,
        )
    assert read.inputs["pivot_x"].c.shape[0] == 6


def test_smoothing_fits_noise_by_a_spline_of_the_width() -> None:
    rng = np.random.default_rng(2)
    t = np.linspace(0, 4, 400)
    noisy = np.sin(t) + 1e-3 * rng.standard_normal(t.size)
    data = {"time": t, "theta": t, "pivot_x": noisy}
    (rough,), (smooth,) = (measurements(data, MODEL, smoothing=width) for width in (None, 1.0))
    accelerations = [np.std(read.inputs["pivot_x"](t, 2) + np.sin(t)) for read in (rough, smooth)]
    assert accelerations[0] > 1.0
    assert accelerations[1] < 0.05  # 1e-3 / (1 s)² by the few knots, tens of times more at the ends
    assert smooth.inputs["pivot_x"].x.tolist() == [0, 1, 2, 3, 4]
    with pytest.raises(
        IdentificationError, match=r"data: column pivot_x: smoothing = 0.01 s leaves less than 2 values"
    ):
        measurements(data, MODEL, smoothing=0.01)


@pytest.mark.parametrize(("count", "width"), [(9, 1.0), (6, 4.0)])
def test_the_fewest_values_that_a_spline_can_be_fitted_to(count: int, width: float) -> None:
    """Two in each piece, and for one piece as many as its polynomial has coefficients."""
    t, quintic = np.linspace(0, 4, count), np.polynomial.Polynomial([1, 0.2, -0.3, 0.1, 0.02, -0.01])
    data = {"time": t, "theta": t, "pivot_x": quintic(t)}
    (read,) = measurements(data, MODEL, smoothing=width)
    np.testing.assert_allclose(read.inputs["pivot_x"](t), quintic(t), rtol=1e-12)
    fewer = {name: column[[0, *range(2, count)]] for name, column in data.items()}
    with pytest.raises(IdentificationError, match=f"smoothing = {width:g} s leaves less than"):
        measurements(fewer, MODEL, smoothing=width)


@pytest.mark.parametrize("signals", [("theta",), ("theta", "theta_dot")])
def test_starts_of_segments_are_those_that_were_measured_nearby(signals: tuple[str, ...]) -> None:
    """Of a parabola that lacks a value; a rate has 1 more if it was measured."""
    t, edges = np.linspace(0, 2, 21), [5, 20]
    columns = np.array([2 * t - 3 * t**2, 3 - 6 * t])[: len(signals)]
    columns[:, 6] = np.nan
    data = Measurements(t, signals, columns, {}, "")
    for name, expected in (("theta", columns[0]), ("theta_dot", 1 + len(signals) - 6 * t)):
        np.testing.assert_allclose(smoothed_values(data, name, edges, t[edges]), expected[edges], rtol=0, atol=1e-12)


def test_a_constant_column_of_what_is_unknown_is_left_out(reads) -> None:
    text = "time,theta,length\n0,1,2\n1,2,2\n"
    assert reads(text, unknown=["length"]).inputs == {}
    assert reads(text).inputs["length"](0.3) == 2.0
    assert reads(text.replace("2\n", "1\n")).inputs == {}  # as it is declared
    with pytest.raises(IdentificationError, match="column length: it moves, and is unknown"):
        reads("time,theta,length\n0,1,2\n1,2,3\n", unknown=["length"])


def test_arrays_are_named_element_by_element() -> None:
    chain = assemble(PendulumChain, 3)
    data = {"time": [0, 1], "theta[2]": [0.1, 0.2], "theta[1]": [0.3, 0.4], "theta_dot[1]": [0, 0]}
    (read,) = measurements(data, chain, measured="theta")
    assert read.signals == ("theta[1]", "theta[2]")
    assert read.values.tolist() == [[0.3, 0.4], [0.1, 0.2]]
    assert noise_levels({"theta": 0.1}, read).tolist() == [0.1, 0.1]
    assert noise_levels({"theta": 0.1, "theta[2]": 0.2}, read).tolist() == [0.1, 0.2]


@pytest.mark.variants(core=12)
@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "measured.csv: empty; its first line"),
        ("# only a comment\n", "measured.csv: empty; its first line"),
        ("time,theta\n", "column time: 0 rows; give two at least"),
        ("time,theta\n0,1\n", "column time: 1 rows; give two at least"),
        ("theta,theta_dot\n0,1\n1,2\n", "column time: 0 rows"),
        ("time,length\n0,1\n1,2\n", "no column is a measured output of Pendulum; it has length"),
        ("time,theta,theta [deg]\n0,1,1\n1,2,1\n", "column theta: it is there twice"),
        ("time,thetta\n0,1\n1,2\n", "column thetta: it is no variable; did you mean 'theta'?; ignore=[...] leaves"),
        ("time,theta\n0,1\n2,2\n1,3\n", "column time: line 4: it must be greater than the one before"),
        ("time,theta\n0,1\n0,2\n", "column time: line 3: it must be greater than the one before"),
        ("time,theta\n0,1\n,2\n", "column time: line 3: a value is missing"),
        ("time,theta\n0,\n1,nan\n", "column theta: all values are missing"),
        ("time,theta,length\n0,1,1\n1,2,\n", "column length: line 3: a value is missing"),
        ("time,theta\n0,1\n# note\n1,two\n", "column theta: line 4: could not convert string to float: 'two'"),
        ("time,theta\n0,1\n1,inf\n", "column theta: line 3: finite numbers only"),
        ("time,theta\n0,1\n1\n", "measured.csv, line 3: 1 numbers for 2 columns"),
        ("time,theta [px]\n0,1\n1,2\n", "column theta: unit 'px' is not understood"),
        ("time,theta [cm]\n0,1\n1,2\n", "column theta: unit 'cm' cannot be converted to 'rad'"),
        ("time,theta,length_dot\n0,1,1\n1,2,2\n", "column length_dot: length has no column; add it"),
    ],
)
def test_bad_files_are_refused_in_one_line_with_column_and_row(reads, text, words) -> None:
    with pytest.raises(IdentificationError) as caught:
        reads(text)
    assert "measured.csv" in str(caught.value)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_system_is_driven_and_measured_by_the_names_of_its_parts() -> None:
    system = System("pumped swing")
    swing = system.add("swing", "Pendulum", theta_0=0.2)
    operator = system.add("operator", "Sinusoid", offset=1.0, amplitude=0.1, angular_frequency=6.0)
    system.connect(operator["y"], swing["length"])
    slide = {"swing.pivot_x": lambda t: (0.1 * t**2, 0.2 * t, 0.2)}
    result = system.simulate(stop_time=1.0, step_size=0.1, inputs=slide)
    (read,) = measurements(result, composed_model(system), measured="swing.theta")
    assert (read.signals, set(read.inputs)) == (("swing.theta",), {"swing.pivot_x"})
    np.testing.assert_array_equal(read.values[0], result["swing.theta"])


def test_names_of_what_was_measured_are_outputs(reads) -> None:
    with pytest.raises(IdentificationError, match="measured: Pendulum has no output 'thetta'; did you mean 'theta'"):
        reads("time,theta\n0,1\n1,2\n", measured="thetta")


def test_a_drive_begins_when_the_motion_starts() -> None:
    times = np.linspace(1, 2, 10)
    data = {"time": times, "theta": times, "pivot_x": times**2}
    with pytest.raises(IdentificationError, match="data: pivot_x drives from 1 s on, after start_time = 0; give start"):
        identify("Pendulum", data, unknown=["gravity"], start_time=0)


@pytest.mark.parametrize(
    "data", [[], 3.0, {}, {"time": [0, 1], "theta": [1]}, "absent.csv", ["absent.csv"], [1, 2], None]
)
def test_what_is_no_data_is_refused(data) -> None:
    with pytest.raises(
        IdentificationError, match=r"^(data = |data: an empty list|absent\.csv: cannot be read: No such file)"
    ):
        measurements(data, MODEL)


def test_columns_can_be_ignored(reads) -> None:
    assert reads("frame,time,theta\nfirst,0,1\nsecond,1,2\n", ignore="frame").signals == ("theta",)


@pytest.mark.parametrize(
    ("noise", "words"),
    [
        (0, "noise: theta = 0: must be > 0"),
        ({"theta": -1}, "noise: theta = -1: must be > 0"),
        ({"theta": np.nan}, "noise: theta = nan: must be a finite number"),
        ({"theta": 1, "thetadot": 1}, "has no column 'thetadot'"),
        ({"theta": 0.1}, "noise: theta_dot is missing"),
    ],
)
def test_bad_noise_is_refused(reads, noise, words) -> None:
    experiment = reads("time,theta,theta_dot\n0,1,1\n1,2,2\n")
    assert noise_levels(0.1, experiment).tolist() == [0.1, 0.1]
    with pytest.raises(IdentificationError, match=words):
        noise_levels(noise, experiment)


@pytest.mark.parametrize(
    ("column", "amplitude", "turns", "asked"),
    [
        ("theta", 23.0, 0.0, True),
        ("theta", 6.0, 0.0, False),
        ("theta", 1.0, 40.0, False),
        ("theta [rad]", 23.0, 0.0, False),
    ],
)
def test_what_looks_like_degrees_is_asked(
    caplog: pytest.LogCaptureFixture, column: str, amplitude: float, turns: float, *, asked: bool
) -> None:
    """Not what turns on, nor what is said to be in radians."""
    t = np.linspace(0, 2 * np.pi, 40)
    measurements({"time": t, column: amplitude * np.cos(t) + turns * t}, MODEL)
    words = (
        "data: column theta reaches 23 rad and comes back: if these are degrees, call it theta [deg]; else theta [rad]"
    )
    assert (words in caplog.text) == asked
    assert ("degrees" in caplog.text) == asked


def test_each_recording_has_a_clock_of_its_own() -> None:
    """Those that begin at 5 s and at 100 s give the values of the ones that begin at 0 s."""
    t = np.linspace(0, 4, 41)
    swings = [simulate("Pendulum", times=t, theta_0=theta_0, length=0.8)["theta"] for theta_0 in (0.4, 0.9)]
    known = {"noise": 1e-3, "each": ["theta_0"], "start_values": {"length": 0.9}}
    for clocks in ((0, 0), (5, 100)):
        data = [{"time": t + clock, "theta": swing} for clock, swing in zip(clocks, swings, strict=True)]
        fit = identify("Pendulum", data, ["length", "theta_0"], **known)  # type: ignore[arg-type]
        assert fit.values == pytest.approx({"length": 0.8, "theta_0 (1)": 0.4, "theta_0 (2)": 0.9}, rel=1e-7)
