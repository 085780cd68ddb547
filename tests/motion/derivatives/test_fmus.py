"""Derivatives of motions of FMUs that are not ours, and of systems, against closed forms and equations."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from exchange import BALL, DAHLQUIST, VAN_DER_POL, Exchange, Made
from liaisons import System, gradient, hold, sensitivities
from liaisons.errors import LiaisonsError, SimulationError
from liaisons.fmu import build
from liaisons.library import catalogue, fmu_file
from liaisons.mechanics import assemble
from liaisons.models import BouncingBall, Pendulum
from liaisons_motion.derivatives import DifferentiableMotion, motion_of
from liaisons_motion.derivatives.fmus import fmu_motion

TIMES = np.linspace(0.25, 4.0, 16)


def _without(exchange: Exchange) -> Exchange:
    return replace(exchange, partials=None)


@pytest.mark.parametrize(("exact", "tolerance"), [(True, 1e-10), (False, 1e-8)])
def test_decay_has_the_derivatives_of_the_exponential(made: Made, exact: bool, tolerance: float) -> None:
    """Exact ones have the errors of runs, 1e-10 or less; differences of runs those of 1e-10 / 1e-3."""
    motion = motion_of(str(made(DAHLQUIST if exact else _without(DAHLQUIST))), ["k", "x"], TIMES, start_values={"x": 3})
    assert motion.method == ("directional derivatives" if exact else "differences")
    assert (motion.names, motion.signals, motion.values.tolist()) == (("k", "x"), ("x",), [2.0, 3.0])
    k, x = 1.5, 2.0
    signals, derivatives = motion.forward([k, x])
    decay = np.exp(-k * TIMES)
    assert_allclose(signals[0], x * decay, rtol=0, atol=1e-9)
    assert_allclose(derivatives[0], np.transpose([-TIMES * x * decay, decay]), rtol=0, atol=tolerance)
    assert_allclose(motion([k, x]), signals, rtol=1e-10)  # each keeps to the tolerance, by its own steps
    weights = np.cos(TIMES)[None]
    assert_allclose(motion.adjoint([k, x], weights)[1], np.einsum("st,stp->p", weights, derivatives), rtol=1e-12)
    squares = motion.adjoint([k, x], lambda z: 2 * z)[1]
    assert_allclose(squares, np.einsum("st,stp->p", 2 * signals, derivatives), rtol=1e-12)
    assert_allclose(
        motion.rates([k, x])[0], -k * x * decay, rtol=0, atol=1e-5
    )  # quintics over a quarter of a second / 8


@pytest.mark.parametrize(("exact", "tolerance"), [(True, 1e-8), (False, 1e-6)])
def test_van_der_pol_has_the_derivatives_of_its_variational_equations(
    made: Made, exact: bool, tolerance: float
) -> None:
    """By mu, too, which FMI has among the known variables in initialization only, and some FMUs give as 0."""
    wrong_by_mu = replace(VAN_DER_POL, knowns=("mu",))
    path = made(wrong_by_mu if exact else _without(VAN_DER_POL))
    motion = motion_of(path, ["mu", "x0", "x1"], TIMES)
    mu = 1.5

    def rates(_: float, z: Any) -> Any:
        x, y, *s = z
        J = np.array([[0, 1], [-2 * x * y * mu - 1, mu * (1 - x * x)]])
        by_mu = np.outer([0, (1 - x * x) * y], [1, 0, 0])
        return [y, mu * (1 - x * x) * y - x, *(J @ np.reshape(s, (2, 3)) + by_mu).ravel()]

    start = [2.0, 0.5, 0, 1, 0, 0, 0, 1]
    exactly = solve_ivp(rates, (0, 4), start, t_eval=TIMES, method="DOP853", rtol=1e-13, atol=1e-13).y
    signals, derivatives = motion.forward(motion.values)
    assert_allclose(signals, exactly[:2], rtol=0, atol=1e-9)
    expected = exactly[2:].reshape(2, 3, -1).swapaxes(1, 2)
    assert_allclose(derivatives, expected, rtol=0, atol=tolerance * np.abs(expected).max())
    if not exact:
        errors = np.abs(derivatives - expected).max(axis=1)
        assert (errors[:, 0] < 1e-7).all()  # by mu: the tolerance of runs, 1e-10, over the least difference, 1e-3


def test_sensitivities_of_fmus(made: Made) -> None:
    path = made(DAHLQUIST)
    s = sensitivities(path, by=["k", "x"], stop_time=2.0, step_size=0.5, k=1.0)
    assert s.method == "directional derivatives"
    assert_allclose(s.derivative("x", "k"), -s.time * np.exp(-s.time), rtol=0, atol=1e-11)
    total = gradient(path, lambda m: ca.sum1(m["x"]), by="k", stop_time=2.0, step_size=0.5, k=1.0)
    assert total["k"] == pytest.approx(-np.sum(s.time * np.exp(-s.time)), rel=1e-9)


def test_derivatives_of_the_states_that_are_wrong_are_named(made: Made) -> None:
    wrong = replace(VAN_DER_POL, partials={("x0'", "x1"): "1"})
    with pytest.raises(SimulationError, match=r"its derivative of der\(x1\) by x0 is 0, but -4"):
        motion_of(made(wrong), "mu", TIMES)


@pytest.mark.parametrize("exact", [True, False])
def test_measured_inputs_drive(made: Made, exact: bool) -> None:
    """x' = -k x + u: of a spline through a sine, whose error is its own."""
    followed = Exchange(
        {"x": 0.0}, {"x": "-k * x + u"}, {"k": 2.0}, {"u": 0.0}, {"y": "x + u"},
        {("x'", "x"): "-k", ("x'", "u"): "1", ("y", "x"): "1", ("y", "u"): "1"},
    )  # fmt: skip
    path = made(followed if exact else _without(followed))
    knots = np.linspace(0, 4, 400)
    motion = motion_of(path, "k", TIMES, record=["x", "y"], inputs={"u": CubicSpline(knots, np.sin(3 * knots))})

    def expected(k: float) -> Any:
        """Response at rest to sin(3 t)."""
        return (k * np.sin(3 * TIMES) - 3 * np.cos(3 * TIMES) + 3 * np.exp(-k * TIMES)) / (k**2 + 9)

    signals, derivatives = motion.forward([2.0])
    slope = (expected(2.0 + 1e-5) - expected(2.0 - 1e-5)) / 2e-5
    assert_allclose(signals, [expected(2.0), expected(2.0) + np.sin(3 * TIMES)], rtol=0, atol=1e-7 if exact else 1e-5)
    assert_allclose(derivatives[..., 0], [slope, slope], rtol=0, atol=1e-7 if exact else 1e-5)


def test_constant_inputs_are_values(made: Made) -> None:
    pushed = Exchange({"x": 0.0}, {"x": "u"}, {}, {"u": 2.0}, {"y": "x + u"}, {("x'", "u"): "1", ("y", "u"): "1"})
    pushed = replace(pushed, partials={**(pushed.partials or {}), ("y", "x"): "1"})
    signals, derivatives = motion_of(made(pushed), ["u"], TIMES, record="y").forward([2.0])
    assert_allclose(signals[0], 2 * TIMES + 2, rtol=1e-12)
    assert_allclose(derivatives[0, :, 0], TIMES + 1, rtol=1e-11)


def test_a_bounce_has_its_jump(made: Made) -> None:
    """h = v (t - T) - g/2 (t - T)^2 after the first bounce, T = sqrt(2 h_0 / g), v = e g T."""
    motion = motion_of(made(BALL), ["e", "g", "h"], [0.2, 0.6], record="h")
    assert motion.method == "differences"
    _, derivatives = motion.forward(motion.values)

    def height(t: float, e: float, g: float, h: float) -> float:
        T = np.sqrt(2 * h / g)
        return h - g / 2 * t**2 if t < T else e * g * T * (t - T) - g / 2 * (t - T) ** 2

    for i, t in enumerate((0.2, 0.6)):
        for k, move in enumerate(np.eye(3) * 1e-5):
            at = np.array([0.7, 9.81, 1.0])
            slope = (height(t, *(at + move)) - height(t, *(at - move))) / 2e-5
            assert derivatives[0, i, k] == pytest.approx(slope, abs=1e-7)


def test_derivatives_of_a_ball_are_right_or_not_a_number_beside_its_impacts(caplog: pytest.LogCaptureFixture) -> None:
    """Of runs of its FMU, as of those that have no equations: where one event lies between two runs there is none."""
    times, names = np.linspace(0, 5, 201), ("height", "height_dot")
    motion = fmu_motion(fmu_file("BouncingBall"), "height_0", times, record=names, start_values={"height_0": 1.0})
    derivatives = motion.forward(motion.values)[1][..., 0]
    near = 1e-6  # differences of a closed form that is as exact as doubles: 1e-16/1e-6
    high, low = (BouncingBall.exact(times, height_0=1 + move) for move in (near, -near))
    exact = np.array([high[name] - low[name] for name in names]) / (2 * near)
    bad = np.any(np.isnan(derivatives), axis=0)
    # The tolerance of runs, 1e-10, over the least of their differences, 1e-3.
    assert_allclose(derivatives[:, ~bad], exact[:, ~bad], rtol=0, atol=1e-6)
    # An impact at t goes through t (1 ± 0.002) when h goes through 1 ± 0.004; the bounces end at 9 √(2h/g) = 4.06 s.
    impacts = np.sqrt(2 / 9.81) * (1 + 2 * np.cumsum([0.0, *0.8 ** np.arange(1, 60)]))
    straddling = (np.abs(times[:, None] / impacts - 1) < 0.002).any(axis=1)
    assert set(times[bad]) <= set(times[straddling])
    assert bad[times == 1.175].all()  # between the runs is the impact at 1.17394 s
    assert 8 <= bad.sum() <= 14
    begin, _, instant = caplog.messages[0].partition(" changes at ")
    assert begin.startswith("BouncingBall: derivatives are not-a-number at t = 1.175, 1.75, ")
    assert begin.endswith("s: gap_impacts")
    assert float(instant.removesuffix(" s")) == pytest.approx(impacts[1], abs=3e-4)  # a fifth of its distance


def test_gradients_count_what_has_weight() -> None:
    """A cost of 1.2 s alone has a derivative although 1.175 s is recorded beside it, and one of both has none."""
    motion = fmu_motion(
        fmu_file("BouncingBall"),
        "height_0",
        np.array([0.2, 1.175, 1.2]),
        record="height_dot",
        start_values={"height_0": 1.0},
    )
    both, one = (motion.adjoint(motion.values, [weights])[1] for weights in ([1, 1, 1], [0, 0, 1]))
    assert np.isnan(both).all()
    # h' = e² u - g (t - (1 + 2e) u/g) = (1 + e)² u - g t, u = √(2gh)
    assert one == pytest.approx(1.8**2 * np.sqrt(2 * 9.81) / 2, abs=1e-6)


def test_a_foreign_kink_is_not_differentiated(made: Made, caplog: pytest.LogCaptureFixture) -> None:
    """An impact exactly at a recorded time: central differences agree, and those to the two sides do not."""
    T = float(np.sqrt(2 / 9.81))
    motion = motion_of(made(BALL), ["h", "e"], [0.4, T, 0.6], record=["h", "v"])
    _, derivatives = motion.forward(motion.values)
    assert np.isnan(derivatives[:, 1, 0]).all()
    assert np.isfinite(derivatives[:, [0, 2]]).all()
    assert f"not-a-number at t = {T:g} s: two branches of the motion meet there" in caplog.text


def test_a_regulator_is_differentiated_with_its_samples() -> None:
    """Its readings stay as they are for a period; equations without samples are off by 0.04."""

    def held(theta_0: float) -> System:
        target = {"theta": np.pi, "pivot_x": 0.0}
        return hold("Pendulum", target, "pivot_x", step_size=0.02).system(theta_0=theta_0)

    s = sensitivities(held(3.2), "Pendulum.theta_0", times=[0.1, 0.5], record="Pendulum.theta")
    low, high = (held(x).simulate(0.5, 0.02, tolerance=1e-11)["Pendulum.theta"] for x in (3.1999, 3.2001))
    assert s.method == "differences"
    # Differences of 2e-4 beside extrapolated ones: of second order, 1e-8.
    assert_allclose(
        s.derivative("Pendulum.theta", "Pendulum.theta_0"), ((high - low) / 2e-4)[[5, 25]], rtol=0, atol=1e-7
    )


def test_files_of_the_catalogue_have_the_derivatives_of_their_equations(fmu) -> None:
    times = np.linspace(0.1, 2, 5)
    of_file = motion_of(fmu(catalogue()["Pendulum"]), ["theta_0", "length"], times)
    of_class = motion_of("Pendulum", ["theta_0", "length"], times)
    assert isinstance(of_file, DifferentiableMotion)
    for got, expected in zip(of_file.forward([1.0, 2.0]), of_class.forward([1.0, 2.0]), strict=True):
        np.testing.assert_array_equal(got, expected)


def test_a_system_with_a_foreign_fmu(made: Made, fmu) -> None:
    """A pendulum that is pushed: against its equation; errors are those of the coupling, at steps of 0.02 s."""
    times = np.linspace(0.02, 1.0, 50)
    system = System("pushed")
    push = system.add("push", made(_without(Exchange({"f": 0.5}, {"f": "-k * f"}, {"k": 2.0}))))
    swing = system.add("swing", fmu(catalogue()["Pendulum"]), theta_0=1.0)
    system.connect(push["f"], swing["theta_force"])
    motion = motion_of(system, ["push.k", "swing.theta_0"], times, record="swing.theta")
    assert motion.method == "differences"
    assert motion.names == ("push.k", "swing.theta_0")
    assert motion.units == {"push.k": "", "swing.theta_0": "rad", "swing.theta": "rad"}

    def exact(values: Any) -> Any:
        def rates(_: float, z: Any) -> Any:
            theta, speed, f = z
            return [speed, -9.81 * np.sin(theta) + f, -values[0] * f]

        options: Any = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-12}
        return solve_ivp(rates, (0, 1), [values[1], 0.0, 0.5], t_eval=times, **options).y[0]

    signals, derivatives = motion.forward(motion.values)
    assert_allclose(signals[0], exact(motion.values), rtol=0, atol=1e-5)
    for k, move in enumerate(np.eye(2) * 1e-4):
        slope = (exact(motion.values + move) - exact(motion.values - move)) / 2e-4
        assert_allclose(derivatives[0, :, k], slope, rtol=0, atol=1e-5)


@pytest.mark.variants(core=0)
def test_a_system_in_implicit_coupling(fmu, tmp_path) -> None:
    """Two pendulums, one of a class that is not in the catalogue: against the flattened system of two that are."""

    class Hanging(Pendulum):
        __doc__ = Pendulum.__doc__

    times, motions = np.linspace(0.02, 1.0, 50), []
    for lower in (build(assemble(Hanging), tmp_path), fmu(Pendulum)):
        system = System("two")
        upper = system.add("upper", fmu(Pendulum), theta_0=1.0)
        system.connect(upper["bob"], system.add("lower", lower, theta_0=0.5)["pivot"])
        by = ["upper.theta_0", "lower.mass", "lower.friction"]
        motions.append(motion_of(system, by, times, record=["upper.theta", "lower.theta"]))
    coupled, whole = motions
    assert not isinstance(coupled, DifferentiableMotion)
    assert isinstance(whole, DifferentiableMotion)
    assert coupled.values.tolist() == whole.values.tolist() == [1.0, 1.0, 0.0]
    for values in ([1.0, 2.0, 0.5], coupled.values):  # friction = 0 is the edge of a domain
        for got, expected in zip(coupled.forward(values), whole.forward(values), strict=True):
            assert_allclose(
                got, expected, rtol=0, atol=1e-4 * np.abs(expected).max()
            )  # coupling: fourth order in 0.02 s


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"by": "kk"}, "no variable 'kk'; did you mean 'k'"),
        ({"by": "der(x)"}, "cannot be set"),
        ({"record": "y"}, "no variable 'y'"),
        ({"inputs": {"u": CubicSpline([0, 1], [0, 1])}}, "no variable 'u'"),
        ({"start_values": {"k": "fast"}}, "expected a number"),
        ({"operators": {"x": "Sinusoid"}}, "add an operator that moves an FMU to a System"),
        ({"times": [1.0, 0.5]}, "ascending"),
    ],
)
def test_refusals_name_what_is_wrong(made: Made, options: Any, message: str) -> None:
    with pytest.raises(LiaisonsError, match=message.replace("(", r"\(").replace(")", r"\)")):
        motion_of(made(DAHLQUIST), **({"by": "k", "times": TIMES} | options)).forward([1.0])


def test_what_is_stiff_says_so(made: Made, monkeypatch) -> None:
    monkeypatch.setattr("liaisons_motion.derivatives.fmus._MOST_CALLS", 10_000)
    motion = motion_of(made(DAHLQUIST), "k", [1e3, 2e3], start_values={"k": 1.0})
    with pytest.raises(SimulationError, match="it may be stiff"):
        motion([1e6])


def test_an_fmu_that_ends_early_says_when(made: Made) -> None:
    ending = replace(BALL, change="if (h <= 0) ends = 1;")
    with pytest.raises(SimulationError, match=r"Foreign ends at t = 0\.45\d* s; choose earlier times"):
        motion_of(made(ending), "g", [0.2, 1.0], record="h").forward([9.81])


def test_what_has_no_states_is_differentiated_by_runs(made: Made) -> None:
    gain = Exchange({}, {}, {"k": 2.0}, {"u": 3.0}, {"y": "k * u"}, {("y", "u"): "k"})
    signals, derivatives = motion_of(made(gain), ["k", "u"], [0.5, 1.0], record="y").forward([2.0, 3.0])
    assert_allclose(signals, [[6.0, 6.0]], rtol=1e-14)
    assert_allclose(derivatives, [[[3.0, 2.0]] * 2], rtol=1e-10)
