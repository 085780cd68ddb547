"""``identify`` on motions whose closed forms are known, with noise of fixed seeds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from liaisons import identify, operator, simulate
from liaisons.errors import IdentificationError
from liaisons.models import Oscillator, Pendulum
from liaisons_motion.identification import Fit
from liaisons_motion.identification.minimising import LOSSES
from liaisons_motion.identification.verifying import glejser_statistic, grubbs_bound, grubbs_ratio, residual_tests

TIMES = np.linspace(0.0, 6.0, 121)
NOISE = 0.01


def pendulum(noise: float = NOISE, seed: int = 0, times: np.ndarray = TIMES, **values: float) -> dict[str, np.ndarray]:
    """Measurements of a pendulum without friction."""
    theta = Pendulum.exact(times, **{"theta_0": 1.2, "length": 0.8, **values})["theta"]
    return {"time": times, "theta": theta + noise * np.random.default_rng(seed).standard_normal(times.size)}


def within(fit: Fit, deviations: float = 4.0, **truth: float) -> None:
    for name, value in truth.items():
        assert abs(fit.values[name] - value) < deviations * fit.standard_errors[name], name


def test_pendulum() -> None:
    fit = identify("Pendulum", pendulum(), unknown=["length", "theta_0"], noise={"theta": NOISE})
    within(fit, length=0.8, theta_0=1.2)
    assert fit.standard_errors["length"] < 1e-3
    assert fit.residuals[0].shape == (1, TIMES.size)
    assert fit.cost == pytest.approx(np.sum(fit.residuals[0] ** 2) / NOISE**2 / 2, rel=1e-12)
    assert fit.sentences == ()
    assert fit.estimate.degrees_of_freedom == TIMES.size - 2
    assert "length" in repr(fit)
    assert fit.units == {"length": "m", "theta_0": "rad"}
    assert np.diag(fit.correlation) == pytest.approx(1)
    low, high = fit.intervals()["length"]
    assert (high - low) / 2 == pytest.approx(1.959964 * fit.standard_errors["length"], rel=1e-6)


class TestLinear:
    """Start values of an oscillator: normal equations with the closed form as the design matrix."""

    omega = 2.0
    times = np.linspace(0.0, 3.0, 31)

    def data(self, seed: int = 0) -> tuple[dict[str, np.ndarray], np.ndarray]:
        columns = np.array([np.cos(self.omega * self.times), np.sin(self.omega * self.times) / self.omega]).T
        x = columns @ [0.3, -0.5] + NOISE * np.random.default_rng(seed).standard_normal(self.times.size)
        return {"time": self.times, "x": x}, columns

    def fit(self, data: Any, noise: float | None = NOISE, **options: Any) -> Fit:
        return identify(Oscillator, data, ["x_0", "x_dot_0"], noise, mass=1.0, stiffness=4.0, **options)

    def test_covariance(self) -> None:
        data, columns = self.data()
        fit = self.fit(data)
        expected = np.linalg.inv(columns.T @ columns) * NOISE**2
        assert np.abs(fit.covariance / expected - 1).max() < 1e-8
        assert list(fit.values.values()) == pytest.approx(np.linalg.lstsq(columns, data["x"])[0], rel=1e-10)

    def test_covariance_from_residuals(self) -> None:
        data, columns = self.data()
        fit = self.fit(data, None)
        _, (square,), *_ = np.linalg.lstsq(columns, data["x"])
        expected = np.linalg.inv(columns.T @ columns) * square / (self.times.size - 2)
        assert np.abs(fit.covariance / expected - 1).max() < 1e-8
        low, high = fit.intervals(0.9)["x_0"]
        assert (high - low) / 2 == pytest.approx(1.699127 * fit.standard_errors["x_0"], rel=1e-6)  # t of 29

    def test_missing_values(self) -> None:
        data, columns = self.data()
        seen = np.arange(self.times.size) % 3 > 0
        data["x"][~seen] = np.nan
        expected = np.linalg.inv(columns[seen].T @ columns[seen]) * NOISE**2
        assert np.abs(self.fit(data).covariance / expected - 1).max() < 1e-8

    def test_prior(self) -> None:
        data, columns = self.data()
        fit = self.fit(data, prior={"x_dot_0": (-0.4, 0.005)})
        information = columns.T @ columns / NOISE**2 + np.diag([0, 1 / 0.005**2])
        assert np.abs(fit.covariance / np.linalg.inv(information) - 1).max() < 1e-8
        right = columns.T @ data["x"] / NOISE**2 + [0, -0.4 / 0.005**2]
        assert list(fit.values.values()) == pytest.approx(np.linalg.solve(information, right), rel=1e-8)

    def test_interval_at_a_bound(self) -> None:
        """The profile of a quadratic function is one."""
        data, columns = self.data()
        bound = 0.32
        fit = self.fit(data, bounds={"x_0": (bound, None)}, x_0=0.4)
        assert fit.values["x_0"] == bound
        assert np.isnan(fit.standard_errors["x_0"])
        assert fit.sentences == ("x_0 = 0.32 is at its bound; its interval is one-sided",)
        covariance = np.linalg.inv(columns.T @ columns) * NOISE**2
        best = np.linalg.lstsq(columns, data["x"])[0][0]
        reach = np.sqrt((bound - best) ** 2 / covariance[0, 0] + 1.644854**2) * np.sqrt(covariance[0, 0])
        assert fit.intervals()["x_0"] == pytest.approx((bound, best + reach), rel=1e-6)
        other = np.linalg.norm(columns[:, 1]) ** -1 * NOISE
        assert fit.standard_errors["x_dot_0"] == pytest.approx(other, rel=1e-11)

    def test_several_experiments(self) -> None:
        (first, columns), (second, _) = self.data(1), self.data(2)
        fit = self.fit([first, second], each=["x_0"])
        assert fit.names == ("x_dot_0", "x_0 (1)", "x_0 (2)")
        C, S = columns.T
        zero = np.zeros_like(C)
        design = np.vstack([np.array([S, C, zero]).T, np.array([S, zero, C]).T])
        both = np.concatenate([first["x"], second["x"]])
        assert list(fit.values.values()) == pytest.approx(np.linalg.lstsq(design, both)[0], rel=1e-10)

    def test_two_signals_of_unknown_noise(self) -> None:
        data, _ = self.data()
        velocity = -0.6 * np.sin(2 * self.times) - 0.5 * np.cos(2 * self.times)
        data["x_dot"] = velocity + 0.1 * np.random.default_rng(3).standard_normal(self.times.size)
        fit = self.fit(data, None)
        assert fit.noise[0] == pytest.approx([0.01, 0.1], rel=0.4)
        within(fit, x_0=0.3, x_dot_0=-0.5)


def test_what_is_not_determined_is_said() -> None:
    fit = identify("Pendulum", pendulum(), unknown=["gravity", "length", "mass", "theta_0"], noise=NOISE)
    assert fit.sentences == (
        "of gravity and length only gravity/length is determined by theta",
        "mass: not determined at all by theta",
        "length is held at 1",
        "mass is held at 1",
    )
    assert np.isnan(fit.covariance[:3]).all()
    assert fit.values["gravity"] / fit.values["length"] == pytest.approx(9.81 / 0.8, rel=2e-3)
    alone = identify("Pendulum", pendulum(), unknown=["length", "theta_0"], noise=NOISE)
    assert fit.standard_errors["theta_0"] == pytest.approx(alone.standard_errors["theta_0"], rel=1e-9)
    assert not next(v for v in fit.verify() if "determine" in v.claim).passed


def test_a_force_beside_it_determines_the_product() -> None:
    result = simulate("Pendulum", times=TIMES, theta_0=1.2, gravity=0.0, theta_dot_0=2.0)
    data = {"time": TIMES, "length_force": result["length_force"]}
    fit = identify(
        "Pendulum", data, unknown=["mass", "length"], noise=1e-3, gravity=0.0, theta_0=1.2, theta_dot_0=2.0, mass=1.1
    )
    assert fit.sentences[0] == "of mass and length only mass*length is determined by length_force"
    assert fit.values["mass"] * fit.values["length"] == pytest.approx(1, rel=1e-5)


def test_outliers() -> None:
    data = pendulum()
    wrong = np.random.default_rng(5).choice(TIMES.size, 8)
    data["theta"][wrong] += 2.0
    fit = identify("Pendulum", data, unknown=["length", "theta_0"], loss="soft_l1")
    within(fit, length=0.8, theta_0=1.2)
    assert fit.noise[0][0] == pytest.approx(NOISE, rel=0.3)


def test_time_offset() -> None:
    data = pendulum(times=TIMES + 0.123)
    data["time"] = TIMES
    fit = identify("Pendulum", data, unknown=["length", "time_offset"], noise=NOISE, theta_0=1.2, time_offset=0.05)
    within(fit, length=0.8, time_offset=0.123)


def test_parameter_of_an_operator() -> None:
    """A forgotten amplitude, from the angle alone."""
    motor = operator("Sinusoid", offset=1.0, amplitude=0.07, angular_frequency=5.0)
    theta = simulate("Pendulum", times=TIMES, theta_0=0.5, length=motor)["theta"]
    theta = theta + NOISE * np.random.default_rng(0).standard_normal(theta.shape)
    fit = identify(
        "Pendulum",
        {"time": TIMES, "theta": theta},
        unknown=["length.amplitude", "theta_0"],
        noise=NOISE,
        operators={"length": "Sinusoid"},
        start_values={"length.offset": 1.0, "length.angular_frequency": 5.0, "length.amplitude": 0.01},
    )
    within(fit, **{"length.amplitude": 0.07, "theta_0": 0.5})
    assert all(verdict.passed for verdict in fit.verify())


def test_measured_drive() -> None:
    """A pivot that was measured drives; its spline is what the FMU follows in the replay."""
    pivot = 0.1 * np.sin(3 * TIMES)
    run = simulate(
        "Pendulum",
        times=TIMES,
        theta_0=0.5,
        inputs={"pivot_x": lambda t: (0.1 * np.sin(3 * t), 0.3 * np.cos(3 * t), -0.9 * np.sin(3 * t))},
    )
    theta = run["theta"] + NOISE * np.random.default_rng(0).standard_normal(TIMES.size)
    fit = identify(
        "Pendulum", {"time": TIMES, "pivot_x": pivot, "theta": theta}, unknown=["length", "theta_0"], noise=NOISE
    )
    within(fit, length=1.0, theta_0=0.5)
    assert all(verdict.passed for verdict in fit.verify())


@pytest.mark.variants(core=0)
def test_measured_load() -> None:
    """An input that is no coordinate has no rates that drive."""
    load = 0.3 * np.sin(2 * TIMES)
    run = simulate("Pendulum", times=TIMES, theta_0=0.5, inputs={"theta_load": lambda t: 0.3 * np.sin(2 * t)})
    theta = run["theta"] + NOISE * np.random.default_rng(0).standard_normal(TIMES.size)
    data = {"time": TIMES, "theta_load": load, "theta": theta}
    fit = identify("Pendulum", data, unknown=["length", "theta_0"], noise=NOISE)
    within(fit, length=1.0, theta_0=0.5)
    assert all(verdict.passed for verdict in fit.verify())


def test_verdicts() -> None:
    fit = identify("Pendulum", pendulum(), unknown=["length", "theta_0"], noise=NOISE)
    verdicts = fit.verify()
    assert all(verdict.passed for verdict in verdicts), verdicts
    assert [verdict.claim.split(":")[0] for verdict in verdicts][:8] == [
        "least squares came to its end",
        "measurements determine all unknowns",
        "the noise is given, or residuals are left that show it",
        "replayed through the FMUs, the motion is the fitted one",
        "residuals of theta are white",
        "residuals of theta keep their size",
        "residuals of theta have no outlier",
        "residuals are as large as the noise",
    ]


@pytest.mark.parametrize("noise", [pytest.param(NOISE / 2, marks=pytest.mark.slow), NOISE * 2])
def test_wrong_noise_is_seen(noise: float) -> None:
    verdicts = identify("Pendulum", pendulum(), unknown=["length", "theta_0"], noise=noise).verify()
    assert [v.claim.startswith("residuals are as large") for v in verdicts if not v.passed] == [True]


def test_wrong_model_is_seen() -> None:
    """Friction that is left out stays in the residuals."""
    theta = simulate("Pendulum", times=TIMES, theta_0=1.2, friction=0.05)["theta"]
    data = {"time": TIMES, "theta": theta + NOISE * np.random.default_rng(0).standard_normal(TIMES.size)}
    failed = [v.claim for v in identify("Pendulum", data, unknown=["length", "theta_0"]).verify() if not v.passed]
    assert any("white" in claim for claim in failed)


def failing(noise: np.ndarray, level: float | None = None) -> set[str]:
    """Which tests of residuals fail for measurements of a pendulum with this noise."""
    data = pendulum(noise=0.0)
    fit = identify("Pendulum", data | {"theta": data["theta"] + noise}, ["length", "theta_0"], level)
    return {
        v.claim.split(":")[0].removeprefix("residuals of theta ") for v in residual_tests(fit.estimate) if not v.passed
    }


@pytest.mark.parametrize("level", [None, NOISE])
@pytest.mark.parametrize("seed", range(10))
def test_noise_that_is_not_the_same_everywhere_is_seen(seed: int, level: float | None) -> None:
    normal = np.random.default_rng(seed).standard_normal(TIMES.size)
    assert "keep their size" in failing(np.linspace(0.002, 0.022, TIMES.size) * normal, level)
    outlying = np.random.default_rng(seed).permutation(TIMES.size) < 0.05 * TIMES.size
    assert "have no outlier" in failing(NOISE * np.where(outlying, 10, 1) * normal, level)


@pytest.mark.parametrize("count", [20, pytest.param(200, marks=pytest.mark.slow)])
def test_normal_noise_passes(count: int) -> None:
    """At a chance of 0.001 a set, one of 200 fails with a probability of 0.16, and two with 0.02."""
    failed = [seed for seed in range(count) if failing(NOISE * np.random.default_rng(seed).standard_normal(TIMES.size))]
    assert len(failed) <= count // 100


@pytest.mark.parametrize("n", [12, 60, 400])
def test_residuals_fail_as_rarely_as_the_level_says(n: int) -> None:
    """At a level of 5 %; Glejser's sum, chi-squared for large n only, is rather too small below."""
    random, t = np.random.default_rng(n), np.linspace(0, 5, n)
    grows_with = np.array([t, np.abs(np.cos(3 * t))])
    sets = random.standard_normal((4000, n))
    deviation = np.sqrt(0.05 * 0.95 / len(sets))
    grown = np.mean([glejser_statistic(r, grows_with) > chi2.isf(0.05, 2) for r in sets])
    assert (0 if n < 20 else 0.04) < grown < 0.05 + 3 * deviation
    assert np.mean([grubbs_ratio(r) > grubbs_bound(n, 0.05) for r in sets]) == pytest.approx(0.05, abs=3 * deviation)


@pytest.mark.parametrize("noise", [None, NOISE / 100])
def test_as_many_unknowns_as_rows_leave_nothing_that_shows_the_noise(noise: float | None) -> None:
    data = {name: column[[20, 40]] for name, column in pendulum().items()}
    fit = identify("Pendulum", data, ["gravity", "theta_0"], noise, length=0.8)
    failed = [v.claim for v in fit.verify() if not v.passed]
    if noise:
        assert (fit.sentences, failed) == ((), [])
    else:
        assert np.isnan([*fit.standard_errors.values(), *fit.intervals()["gravity"]]).all()
        (sentence,) = fit.sentences
        assert sentence.startswith(
            "2 unknowns from as many numbers leave no residual that shows the noise; give noise="
        )
        assert failed == ["the noise is given, or residuals are left that show it"]


@pytest.mark.parametrize("loss", LOSSES)
def test_losses_have_their_derivatives(loss: str) -> None:
    z, h = np.array([0.3, 0.9, 1.1, 4.0]), 1e-5
    value, slope, curvature = LOSSES[loss](z)
    high, low = LOSSES[loss](z + h), LOSSES[loss](z - h)
    assert value == pytest.approx(z if loss == "linear" else 2 * (np.sqrt(1 + z) - 1))
    assert slope == pytest.approx((high[0] - low[0]) / (2 * h), abs=1e-8)
    assert curvature == pytest.approx((high[1] - low[1]) / (2 * h), abs=1e-8)


def test_exact_data() -> None:
    fit = identify("Pendulum", pendulum(noise=0.0), unknown=["length", "theta_0"])
    assert fit.values["length"] == pytest.approx(0.8, rel=1e-11)
    assert all(verdict.passed for verdict in fit.verify())


def test_a_result_is_data() -> None:
    result = simulate("Pendulum", times=TIMES, theta_0=0.7, friction=0.1)
    fit = identify("Pendulum", result, unknown=["friction"], measured="theta", theta_0=0.7)
    assert fit.values["friction"] == pytest.approx(0.1, rel=1e-10)


def double_pendulum(stop_time: float, seed: int) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    truth = {"theta_1_0": 2.0, "theta_2_0": 2.5, "length_1": 0.8, "length_2": 1.3}
    times = np.linspace(0, stop_time, int(40 * stop_time) + 1)
    result = simulate("DoublePendulum", times=times, tolerance=1e-12, start_values=truth)
    random = np.random.default_rng(seed)
    data = {name: result[name] + NOISE * random.standard_normal(times.size) for name in ("theta_1", "theta_2")}
    return {"time": times, **data}, truth


@pytest.mark.slow
def test_chaos_from_starts_that_are_far_off() -> None:
    """Errors of the start grow by 7e4 in ten seconds; starts and lengths are 50 % off."""
    data, truth = double_pendulum(10.0, 1)
    starts = {"theta_1_0": 1.0, "theta_2_0": 3.75, "length_1": 0.4, "length_2": 1.95}
    settings: dict[str, Any] = {"noise": NOISE, "start_values": starts, "time_limit": 3600.0}
    fit = identify("DoublePendulum", data, unknown=list(truth), **settings)
    within(fit, **truth)
    with pytest.raises(IdentificationError, match="evaluations is exceeded") as error:
        identify("DoublePendulum", data, unknown=list(truth), segments=1, **settings)
    assert error.value.fit.cost > 100 * fit.cost


def test_segments() -> None:
    data, truth = double_pendulum(2.0, 2)
    unknown = [*truth, "theta_1_dot_0"]
    single = identify("DoublePendulum", data, unknown=unknown, noise=NOISE, segments=1, start_values=truth)
    several = identify("DoublePendulum", data, unknown=unknown, noise=NOISE, segments=4, start_values=truth)
    assert list(several.values.values()) == pytest.approx(list(single.values.values()), abs=1e-7)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"unknown": ["lenght"]}, "did you mean 'length'"),
        ({"unknown": []}, "nothing is unknown"),
        ({"unknown": ["length", "length"]}, "given twice"),
        ({"each": ["mass"]}, "each: mass is not unknown"),
        ({"noise": 0.0}, "noise: theta = 0.0: must be > 0"),
        ({"noise": {"theta": -1.0}}, "must be > 0"),
        ({"noise": {"thta": 1.0}}, "did you mean 'theta'"),
        ({"bounds": {"mass": (0, 1)}}, "bounds: mass is not unknown"),
        ({"bounds": {"length": (2, 1)}}, "the first must be less"),
        ({"bounds": {"length": 2}}, "give two numbers"),
        ({"bounds": {"length": (2, 3)}}, "length starts at 1, outside of 2 to 3"),
        ({"prior": {"length": (1, 0)}}, "prior: standard deviation of length = 0: must be > 0"),
        ({"loss": "quadratic"}, "choose one of 'linear'"),
        ({"length": -1.0}, "length = -1: must be > 0"),
        ({"mass": 0.0}, "mass = 0: must be > 0"),
        ({"start_time": 1.0}, "before start_time = 1"),
        ({"segments": 0}, "segments = 0"),
        ({"time_limit": 0}, "time_limit = 0"),
        ({"length": operator("Sinusoid")}, "length"),
        ({"tolerance": 0}, "tolerance = 0"),
        ({"theta_O": 1.0}, "did you mean 'theta_0'"),
    ],
)
def test_refusals(options: dict[str, Any], message: str) -> None:
    with pytest.raises(IdentificationError) as error:
        identify("Pendulum", pendulum(), **{"unknown": ["length"], **options})
    assert message in str(error.value)


def test_start_values_are_taken_from_what_was_measured() -> None:
    """From the declared start, at rest near the bottom, no descent leads over the top."""
    data = pendulum(theta_0=-2.8, theta_dot_0=-6.0, length=1.0)
    fit = identify("Pendulum", data, ["theta_0", "theta_dot_0", "length"], noise=NOISE, segments=1)
    within(fit, theta_0=-2.8, theta_dot_0=-6.0, length=1.0)
    starts = {"theta_0": 0.1, "theta_dot_0": 0.0}
    with pytest.raises(IdentificationError, match="evaluations is exceeded") as error:
        identify("Pendulum", data, ["theta_0", "theta_dot_0", "length"], NOISE, segments=1, start_values=starts)
    assert error.value.fit.cost > 100 * fit.cost


def test_an_unknown_that_is_zero_is_determined() -> None:
    """Of exact measurements, and at its bound."""
    fit = identify("Pendulum", pendulum(noise=0.0), ["length", "theta_0", "theta_dot_0"], noise=1e-4)
    assert fit.sentences == ()
    assert abs(fit.values["theta_dot_0"]) < 1e-6
    data = pendulum(seed=3)
    data["theta"] *= np.exp(0.005 * TIMES)  # it grows, which no friction can do
    fit = identify("Pendulum", data, ["length", "theta_0", "friction"], noise=NOISE)
    assert fit.values["friction"] == 0
    assert fit.sentences == ("friction = 0 is at its bound; its interval is one-sided",)
    assert fit.estimate.degrees_of_freedom == TIMES.size - 2  # friction is not fitted
    low, high = fit.intervals()["friction"]
    assert low == 0
    assert 0 < high < 0.01


@pytest.mark.parametrize("bounds", [(0.5, 0.799), (0.801, 2.0)])
def test_an_unknown_that_a_bound_stops_is_at_it(bounds: tuple[float, float]) -> None:
    at = min(bounds, key=lambda bound: abs(bound - 0.8))
    start = {"length": at + 0.1 if at == bounds[0] else at - 0.1}
    fit = identify("Pendulum", pendulum(), ["length", "theta_0"], NOISE, bounds={"length": bounds}, start_values=start)
    assert fit.values["length"] == at
    assert fit.sentences == (f"length = {at:g} is at its bound; its interval is one-sided",)


@pytest.mark.slow
def test_what_is_not_determined_stays_where_it_was() -> None:
    """Also where nothing fits, so that segments are tried."""
    fit = identify("Pendulum", pendulum(), ["mass"], noise=NOISE, theta_0=0.3)
    assert fit.values == {"mass": 1.0}
    assert fit.sentences == ("mass: not determined at all by theta", "mass is held at 1")


def test_values_of_arrays() -> None:
    times = np.linspace(0, 2, 21)
    names = [f"theta[{i}]" for i in range(1, 11)]
    result = simulate("PendulumChain", times=times, theta_0=np.linspace(0.1, 0.3, 10), length=0.2)
    data = {"time": times, **{name: result[name] for name in names}}
    fit = identify("PendulumChain", data, ["theta_0"], noise=1e-3, length=0.2)
    assert list(fit.values.values()) == pytest.approx(np.linspace(0.1, 0.3, 10), rel=1e-7)
    with pytest.raises(IdentificationError, match="theta_0 has 2 numbers; give 1 or 10"):
        identify("PendulumChain", data, ["length"], theta_0=[0.1, 0.2])


def test_more_unknowns_than_numbers() -> None:
    with pytest.raises(IdentificationError, match="4 values from 3 numbers"):
        identify("Pendulum", pendulum(times=TIMES[:3]), unknown=["length", "friction", "theta_0", "theta_dot_0"])


def test_what_was_reached_is_in_the_exception(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("liaisons_motion.identification.minimising._MAX_EVALUATIONS", 1)
    with pytest.raises(IdentificationError, match="give other start values") as error:
        identify("Pendulum", pendulum(), unknown=["length", "theta_0"], segments=1)
    assert error.value.fit.values["length"] == 1.0


@pytest.mark.parametrize("segments", [1, 4])
def test_time_that_is_over(segments: int) -> None:
    options: dict[str, Any] = {"segments": segments, "theta_0": 0.1, "length": 2.0}
    with pytest.raises(IdentificationError, match="time_limit has passed; give other start values") as error:
        identify("Pendulum", pendulum(), unknown=["length", "theta_0"], time_limit=1e-9, **options)
    assert error.value.fit.values["length"] == 2.0
    assert error.value.fit.estimate.problem.deadline == np.inf  # what was reached can be looked at


def test_a_time_offset_alone() -> None:
    exact = Pendulum.exact(TIMES + 0.2, theta_0=0.7)["theta"]
    fit = identify("Pendulum", {"time": TIMES, "theta": exact}, unknown="time_offset", theta_0=0.7)
    assert fit.values["time_offset"] == pytest.approx(0.2, abs=1e-10)


def test_signals_that_stay_0() -> None:
    fit = identify("Pendulum", {"time": TIMES, "theta": np.zeros(TIMES.size)}, unknown="theta_0")
    assert abs(fit.values["theta_0"]) < 1e-9
    assert np.isfinite(fit.covariance).all()
