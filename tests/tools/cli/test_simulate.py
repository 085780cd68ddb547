"""``liaisons simulate``: components, files, archives; and ``--input``: motions and forces without Python."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from pythonfmu import FmuBuilder
from scipy.integrate import solve_ivp

from liaisons import System
from liaisons.cosim import Result
from liaisons.library import fmu_path
from liaisons.models import Pendulum

from .conftest import Cli, Runs, Simulated, is_misuse

pytestmark = pytest.mark.usefixtures("shared_fmus")

G = 9.81

INTEGRATOR = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Real

class Integrator(Fmi2Slave):
    def __init__(self, **options):
        super().__init__(**options)
        self.u = 0.0
        self.y = 0.0
        self.register_variable(Real("u", causality=Fmi2Causality.input, start=0.0))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, time, step):
        self.y += step * self.u
        return True
"""


def swing(times: NDArray, *, start: float = 0.0) -> NDArray:
    """θ of a pendulum of length 1 + 0.1 sin(5t): (l² θ')' = -g l sin θ, from θ = 0.1 at rest."""

    def rates(t: float, x: NDArray) -> list[float]:
        length, rate = 1 + 0.1 * np.sin(5 * t), 0.5 * np.cos(5 * t)
        return [x[1], -(G * np.sin(x[0]) + 2 * rate * x[1]) / length]

    found = solve_ivp(rates, (start, times[-1]), [0.1, 0.0], "DOP853", times, rtol=1e-12, atol=1e-13)
    return found.y[0]


WORDS = ("--stop", "2", "--step", "0.01", "--tolerance", "1e-10")
MODE = ("--set", "input_reconstruction=2")
# six digits of sixth order in H from Hermite's polynomial, 3e-12 (5e-11 at H = 0.1), and the solver
EXACT = 1e-8


def test_a_component_ends_in_a_table_a_file_and_a_figure(runs: Runs, tmp_path: Path) -> None:
    words = ("--stop", "2", "--step", "0.5", "--tolerance", "1e-10", "--record", "theta,theta_dot")
    out = runs("simulate", "Pendulum", "--set", "theta_0=1", *words, "--csv", "swing.csv", "--plot")
    rows = [line.split() for line in out.splitlines()[2:]]
    assert [row[0] for row in rows[:2]] == ["theta", "theta_dot"]
    assert rows[0][1:3] == ["rad", "1"]
    result = Result.from_csv(tmp_path / "swing.csv")
    assert result.time.tolist() == [0, 0.5, 1, 1.5, 2]
    # 1e-10 a step of the solver adds up over some hundred steps.
    np.testing.assert_allclose(result["theta"], Pendulum.exact(result.time, theta_0=1.0)["theta"], atol=1e-8, rtol=0)
    assert (tmp_path / "Pendulum.png").read_bytes().startswith(b"\x89PNG")


def test_a_parameter_may_have_the_name_of_an_option(simulated: Simulated) -> None:
    result = simulated("Ramp", "--set", "start_time=1", "--set", "rate=2", "--stop", "3", "--step", "0.5")
    assert result["y"][[0, -1]].tolist() == [0.0, 4.0]


def test_an_archive(simulated: Simulated, tmp_path: Path) -> None:
    system = System("pumped")
    swing = system.add("swing", fmu_path("Pendulum"), theta_0=0.5)
    motor = system.add("motor", fmu_path("Sinusoid"), offset=1.0, amplitude=0.1)
    system.connect(motor["y"], swing["length"])
    system.write_ssp(tmp_path / "pumped.ssp", stop_time=1.0, step_size=0.1)
    result = simulated("pumped.ssp", "--set", "swing.theta_0=0.25", "--record", "swing.theta,swing.length")
    assert result.names == ("swing.theta", "swing.length")
    assert (result["swing.theta"][0], result.time[-1], len(result.time)) == (0.25, 1.0, 11)


def test_an_archive_in_processes_of_its_own(simulated: Simulated, tmp_path: Path) -> None:
    system = System("swing")
    system.add("swing", fmu_path("Pendulum"), theta_0=0.5)
    system.write_ssp(tmp_path / "swing.ssp", stop_time=1.0, step_size=0.5)
    alone = System.from_ssp(tmp_path / "swing.ssp", {"swing.theta_0": 0.25}).isolated_copy(5.0)
    assert [part.isolated for part in alone.parts.values()] == [5.0]
    assert [part.isolated for part in system.parts.values()] == [0.0]
    apart, here = (simulated("swing.ssp", "--set", "swing.theta_0=0.25", *words) for words in (["--isolated"], []))
    assert apart["swing.theta"].tolist() == here["swing.theta"].tolist()
    assert here["swing.theta"][0] == 0.25


def test_a_formula_is_longer_than_a_name_of_a_file(simulated: Simulated) -> None:
    long = "length=1" + "+0.001*t" * 40
    assert simulated("Pendulum", "--input", long, "--stop", "1")["length"][-1] == pytest.approx(1.04, rel=1e-12)


@pytest.mark.parametrize(("join", "largest"), [("quintic", 3.2), ("pchip", 3.0), ("linear", 3.0)])
def test_a_table_is_joined_as_it_is_asked(simulated: Simulated, tmp_path: Path, join: str, largest: float) -> None:
    (tmp_path / "steps.csv").write_text("time,length\n-5,3\n-4,3\n-3,3\n-2,2\n-1,2\n0,2\n")
    words = ("--input", "steps.csv", "--join", join, "--start=-5", "--stop", "0")
    result = simulated("Pendulum", *words, "--set", "theta_0=0.5")
    assert result["length"].max() == pytest.approx(largest, abs=0.005)
    assert np.abs(result["energy_balance"]).max() < 1e-6


def test_a_measured_table_is_smoothed_and_its_gaps_are_said(
    simulated: Simulated, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """An acceleration that noise of 1e-4 m would make 1e-4 / (0.01 s)² = 1 m/s², and more."""
    t = np.linspace(0, 4, 401)
    length = 1 + 0.1 * np.sin(2 * t) + 1e-4 * np.random.default_rng(4).standard_normal(t.size)
    cells = [
        f"{at:.10g},{'' if row in {7, 8, 200} else value}"
        for row, (at, value) in enumerate(zip(t, length, strict=True))
    ]
    (tmp_path / "measured.csv").write_text("\n".join(["time,length", *cells]))
    words = ("Pendulum", "--input", "measured.csv", "--stop", "4")
    errors = [
        np.std(result["length_ddot"] + 0.4 * np.sin(2 * result.time))
        for result in (simulated(*words), simulated(*words, "--smoothing", "0.5"))
    ]
    assert errors[0] > 1.0
    assert errors[1] < 0.02  # of the fit: 1e-4 m / (0.5 s)² times about 30 for the ends of a spline
    assert "column length: 3 of 401 values are missing, the first in line 9; a curve passes over gaps of 0.03 s" in (
        caplog.text
    )


@pytest.mark.parametrize("name", ["length", "length_dot"])
@pytest.mark.parametrize("given", ["length=1+0.1*t", "length.csv"])
def test_what_is_moved_has_no_start_value_beside(liaisons: Cli, tmp_path: Path, name: str, given: str) -> None:
    (tmp_path / "length.csv").write_text("time,length\n0,1\n2,2\n")
    reply = liaisons("simulate", "Pendulum", "--stop", "1", "--set", f"{name}=2", "--input", given)
    assert is_misuse(reply, f"--set {name}: --input length says where it begins, too; leave one out")


def test_a_command_ends_with_what_was_warned_of(liaisons: Cli, tmp_path: Path) -> None:
    pair = System("pair")
    upper, lower = pair.add("upper", fmu_path("Pendulum"), theta_0=1.0), pair.add("lower", fmu_path("Pendulum"))
    pair.connect(upper["bob"], lower["pivot"])
    pair.write_ssp(tmp_path / "pair.ssp", stop_time=1.0, step_size=0.25)
    for words in (["simulate", "pair.ssp", "--csv", "pair.csv"], ["animate", "pair.ssp", "--output", "pair.html"]):
        reply = liaisons(*words)
        assert (reply.status, reply.err.count("\n")) == (0, 1)
        assert reply.err.startswith("warning: coupling error ")
    result = Result.from_csv(tmp_path / "pair.csv")
    assert reply.err == f"warning: {result.warnings[0]}\n"
    assert result.title == "pair"
    assert result.coupling_error is not None
    assert result.coupling_error.max() > 1e-4


def test_a_truncated_fmu(liaisons: Cli, tmp_path: Path) -> None:
    whole = fmu_path("Constant")
    (tmp_path / "half.fmu").write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    for command in ("simulate", "check"):
        assert is_misuse(liaisons(command, "half.fmu"), "half.fmu", "truncated")


@pytest.mark.parametrize("begin", [0.0, 1.0])
def test_a_length_by_an_expression(simulated: Simulated, begin: float) -> None:
    result = simulated("Pendulum", "--input", "length = 1 + 0.1*sin(5*t)", "--start", str(begin), *MODE, *WORDS)
    assert (result.time[0], result.time[-1], len(result.time)) == (begin, 2.0, 100 * (2 - begin) + 1)
    np.testing.assert_allclose(result["length"], 1 + 0.1 * np.sin(5 * result.time), rtol=1e-15)
    np.testing.assert_allclose(result["length_dot"], 0.5 * np.cos(5 * result.time), rtol=1e-14, atol=1e-15)
    np.testing.assert_allclose(result["length_ddot"], -2.5 * np.sin(5 * result.time), rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(result["theta"], swing(result.time, start=begin), rtol=0, atol=EXACT)


def test_a_pulse_between_two_points(simulated: Simulated) -> None:
    """Without gravity, 1 ms long: from then on p = ∫ 100 exp(-(2000 t)²) dt = 100 √π/2000."""
    pulse = "theta_force=100*exp(-((t-0.505)*2000)**2)"
    result = simulated("Pendulum", "--set", "gravity=0", "--input", pulse, "--stop", "1", "--step", "0.01")
    p = np.where(result.time < 0.505, 0.0, 100 * np.sqrt(np.pi) / 2000)
    np.testing.assert_allclose(result["p_theta"], p, rtol=0, atol=1e-4 * p[-1])  # by what coupling errors may add up to


@pytest.mark.parametrize("record", [(), ("--record", "theta,length_mismatch")])
def test_a_contradiction_is_said_and_shown_where_it_is_asked_for(runs: Runs, record: tuple[str, ...]) -> None:
    out = runs("simulate", "Pendulum", "--set", "length_dot=0.1", "--stop", "1", "--step", "0.1", *record)
    said = (
        "length, length_dot and length_ddot contradict each other: length_mismatch is up to 0.01 m, for the first time"
    )
    assert (f"{said} at t = 0.2 s" in out, "\nlength_mismatch " in out) == (not record, bool(record))


@pytest.mark.parametrize("columns", [1, 2, 3])
def test_a_length_by_a_table(simulated: Simulated, tmp_path: Path, columns: int) -> None:
    times = np.linspace(0, 2, 101)
    table = [times, 1 + 0.1 * np.sin(5 * times), 0.5 * np.cos(5 * times), -2.5 * np.sin(5 * times)][: 1 + columns]
    names = ["t", "length", "length_dot", "length_ddot"][: 1 + columns]
    np.savetxt(tmp_path / "motion.csv", np.transpose(table), delimiter=",", header=",".join(names), comments="")
    result = simulated("Pendulum", "--input", "motion.csv", *MODE, *WORDS)
    # quintics between points 0.02 s apart: (5 H)⁶ 0.1 / 46080 for values, H² and H of that less for derivatives
    np.testing.assert_allclose(result["length"], 1 + 0.1 * np.sin(5 * result.time), rtol=0, atol=1e-9)
    np.testing.assert_allclose(result["theta"], swing(result.time), rtol=0, atol=1e-7)


def test_a_table_that_jumps(simulated: Simulated, tmp_path: Path) -> None:
    """A spring's end jumps by 1 at 0.55 s, between two steps: x'' = -(x - 1), from rest."""
    (tmp_path / "step.csv").write_text("t,support\n0,0\n0.55,0\n0.55,1\n2,1\n")
    result = simulated("Oscillator", "--set", "x_0=0", "--set", "damping=0", "--input", "step.csv", *WORDS)
    since = np.maximum(result.time - 0.55, 0)
    np.testing.assert_allclose(result["x"], 1 - np.cos(since), rtol=0, atol=1e-13)


def test_a_force_by_a_table_that_jumps(simulated: Simulated, tmp_path: Path) -> None:
    """A force of 100 N for 1 ms, between two steps, which the file says and no search would come upon; from rest."""
    (tmp_path / "pulse.csv").write_text("t,x_force\n0,0\n0.5537,0\n0.5537,100\n0.5547,100\n0.5547,0\n2,0\n")
    words = ("--set", "x_0=0", "--set", "damping=0", "--input", "pulse.csv")
    result = simulated("Oscillator", *words, *WORDS)
    on, off = (1 - np.cos(np.maximum(result.time - instant, 0)) for instant in (0.5537, 0.5547))
    np.testing.assert_allclose(result["x"], 100 * (on - off), rtol=0, atol=1e-11)


def test_several_inputs_and_a_force(simulated: Simulated) -> None:
    """x'' = -x + 2 cos t from rest is t sin t."""
    words = ("--set", "x_0=0", "--set", "damping=0", "--input", "support=0*t", "--input", "x_force=2*cos(t)")
    result = simulated("Oscillator", *words, *MODE, *WORDS)
    # a force that has a value only moves straight within a step: H²/12 of its second derivative
    np.testing.assert_allclose(result["x"], result.time * np.sin(result.time), rtol=0, atol=1e-4)
    simulated("Oscillator", "--input", "x_force=sqrt(t)", "--stop", "1")


@pytest.mark.parametrize("whole", [True, False], ids=["archive", "with python"])
def test_a_system_whose_ports_go_both_ways(simulated: Simulated, tmp_path: Path, whole: bool) -> None:
    """A double pendulum whose upper pivot moves: as if an operator's FMU did it."""
    pendulum, sinusoid = fmu_path("Pendulum"), fmu_path("Sinusoid")

    def system() -> System:
        pair = System("pair")
        upper, lower = pair.add("upper", pendulum, theta_0=0.5), pair.add("lower", pendulum, theta_0=-0.2)
        pair.connect(upper["bob"], lower["pivot"])
        return pair

    driven = system()
    motor = driven.add("motor", sinusoid, offset=0.0, amplitude=0.1, angular_frequency=5.0)
    driven.connect(motor["y"], driven.parts["upper"]["pivot_x"])
    expected = driven.simulate(1.0, 0.01, tolerance=1e-11)
    if whole:
        system().write_ssp(tmp_path / "pair.ssp", stop_time=1.0, step_size=0.01)
        result = simulated("pair.ssp", "--input", "upper.pivot_x=0.1*sin(5*t)", "--tolerance", "1e-11")
    else:
        function = lambda t: (0.1 * np.sin(5 * t), 0.5 * np.cos(5 * t), -2.5 * np.sin(5 * t))  # noqa: E731
        result = system().simulate(1.0, 0.01, tolerance=1e-11, inputs={"upper.pivot_x": function})
        free = system().simulate(1.0, 0.01, inputs={"upper.pivot_x": function}, error_tolerance=1e-7)
        # the tolerance of a step, some ten of them, in the unit of the largest angle
        assert abs(free["lower.theta"][-1] - expected["lower.theta"][-1]) < 1e-5
    # both of fourth order with the same constant: the difference is that of slopes, one order higher
    for name in ("upper.theta", "lower.theta", "upper.pivot_x_force"):
        np.testing.assert_allclose(result[name], expected[name], rtol=0, atol=1e-8, err_msg=name)


def test_an_fmu_of_another_make(simulated: Simulated, tmp_path: Path) -> None:
    (tmp_path / "integrator.py").write_text(INTEGRATOR)
    FmuBuilder.build_FMU(tmp_path / "integrator.py", dest=tmp_path)
    result = simulated("Integrator.fmu", "--input", "u=3*t**2", "--stop", "1", "--step", "0.01")
    np.testing.assert_allclose(result["u"], 3 * result.time**2, rtol=1e-15)
    assert result["y"][-1] == pytest.approx(1.0, abs=0.02)  # it holds what is newest: an error of H u(1)/2


def test_a_file_of_a_user(simulated: Simulated, bead: Path) -> None:
    result = simulated(f"{bead}:Bead", "--input", "x_force=6*t", *MODE, *WORDS)
    np.testing.assert_allclose(result["x"], result.time + result.time**3, rtol=0, atol=1e-12)
