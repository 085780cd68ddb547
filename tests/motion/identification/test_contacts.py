"""Fits with impacts and dry friction, against the closed forms that measurements were calculated with."""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from liaisons import System, identify, simulate
from liaisons.errors import IdentificationError
from liaisons.models import BouncingBall, DryOscillator
from liaisons_motion.identification import Fit
from liaisons_motion.identification.verifying import impact_sides

DROPPED = {"bounce": 0.8, "gravity": 9.7, "height_0": 1.0, "table": 0.05}
RUBBED = {"mu_static": 0.3, "mu_sliding": 0.2, "stiffness": 10.0}
BELT: dict[str, Any] = {"x_0": 0.0, "belt.rate": 0.3, "belt.start_time": -1.0}  # runs from the start on


def instants_of_impacts(count: int, values: Mapping[str, float]) -> np.ndarray:
    """The first fall takes √(2H/g), each further flight e times the one before it."""
    e, fall = values["bounce"], np.sqrt(2 * (values["height_0"] - values["table"]) / values["gravity"])
    return fall * (1 + 2 * np.cumsum(np.append(0, e ** np.arange(1, count))))


@dataclass(frozen=True)
class Case:
    """A mechanism, what is unknown of it, and the noise of what is measured."""

    subject: Any
    truth: Mapping[str, float]
    near: Mapping[str, Any]
    times: np.ndarray
    noise: Mapping[str, float]
    exact: Mapping[str, float]
    options: Mapping[str, Any] = field(default_factory=dict)
    impacts: int = 0

    def fit(self, seed: int) -> Fit:
        """A fit to measurements with noise."""
        random, options = np.random.default_rng(seed), dict(self.options)
        motion = self.subject.exact(self.times, **self.truth, **self.exact)
        data = {name: motion[name] + random.normal(0, level, self.times.size) for name, level in self.noise.items()}
        if self.impacts:
            instants = instants_of_impacts(self.impacts, self.truth) + random.normal(0, 2e-3, self.impacts)
            options["instants"] = {"gap_impacts": (instants, 2e-3)}
        return identify(
            self.subject, {"time": self.times, **data}, list(self.truth), dict(self.noise), **options, **self.near
        )


CASES = {
    "ball": Case(
        BouncingBall,
        DROPPED,
        {"bounce": 0.7, "gravity": 9.81, "table": 0.0},
        np.linspace(0, 3, 61),
        {"height": 0.01},
        {},
        impacts=5,
    ),
    "belt": Case(
        DryOscillator,
        RUBBED,
        {"mu_static": 0.33, "mu_sliding": 0.19, "stiffness": 10.5},
        np.linspace(0, 6, 61),
        {"x": 0.003},
        {"x_0": 0.0, "belt_dot": 0.3},
        {"operators": {"belt": "Ramp"}, "start_values": BELT},
    ),
}


def covered(case: Case, seeds: range) -> np.ndarray:
    """How often intervals of 95 % hold the truth, each unknown."""
    holds = np.zeros(len(case.truth), dtype=int)
    for seed in seeds:
        low, high = np.transpose([*case.fit(seed).intervals(0.95).values()])
        truth = np.array([*case.truth.values()])
        holds += (low <= truth) & (truth <= high)
    return holds


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_intervals_of_95_percent_hold_the_truth_so_often(name: str) -> None:
    holds = covered(CASES[name], range(200))
    assert ((holds >= 181) & (holds <= 199)).all(), dict(zip(CASES[name].truth, holds.tolist(), strict=True))


def test_a_few_intervals_of_95_percent() -> None:
    assert (covered(CASES["ball"], range(3)) >= 2).all()
    assert (covered(CASES["belt"], range(4)) >= 3).all()


LISTENED = {"bounce": 0.8, "height_0": 1.2, "gravity": 9.81, "table": 0.0}


def listened(instants: Any, unknown: list[str], deviation: float = 1e-3, **starts: Any) -> Fit:
    return identify(
        BouncingBall, {"time": [0.0, 1.0]}, unknown, instants={"gap_impacts": (instants, deviation)}, **starts
    )


@pytest.mark.parametrize("bounce", [0.1, 0.5, 0.98])
def test_a_microphone_tells_restitution_and_height_from_starts_with_other_numbers_of_impacts(bounce: float) -> None:
    fit = listened(instants_of_impacts(8, LISTENED), ["bounce", "height_0"], bounce=bounce, height_0=2.0)
    assert fit.values == pytest.approx({"bounce": 0.8, "height_0": 1.2}, rel=1e-8)
    assert fit.instants[0]["gap_impacts"] == pytest.approx(instants_of_impacts(8, LISTENED), abs=1e-8)
    assert fit.sentences == ()


def test_standard_errors_from_instants_are_those_of_the_closed_form() -> None:
    values = {"bounce": 0.8, "height_0": 1.2}
    fit = listened(instants_of_impacts(6, LISTENED), [*values])
    h = 1e-6
    slopes = [
        (instants_of_impacts(6, LISTENED | {n: v + h}) - instants_of_impacts(6, LISTENED | {n: v - h})) / (2 * h)
        for n, v in values.items()
    ]
    J = np.transpose(slopes) / 1e-3
    assert fit.covariance == pytest.approx(np.linalg.inv(J.T @ J), rel=1e-8)


def test_an_impact_that_nobody_heard_is_missing() -> None:
    heard = instants_of_impacts(6, LISTENED)
    heard[[1, 5]] = np.nan
    fit = listened(heard, ["bounce", "height_0"], bounce=0.7)
    assert fit.values == pytest.approx({"bounce": 0.8, "height_0": 1.2}, rel=1e-12)
    assert fit.estimate.degrees_of_freedom == 4 - 2


def test_instants_alone_leave_the_quotient_of_height_and_gravity() -> None:
    fit = listened(instants_of_impacts(6, LISTENED), ["bounce", "height_0", "gravity"], height_0=1.0)
    assert fit.sentences == (
        "of height_0 and gravity only height_0/gravity is determined by gap_impacts",
        "gravity is held at 9.81",
    )


def test_a_clock_that_is_slow() -> None:
    heard = instants_of_impacts(6, LISTENED) - 0.3
    fit = listened(heard, ["bounce", "height_0", "time_offset"], bounce=0.7)
    assert fit.values == pytest.approx({"bounce": 0.8, "height_0": 1.2, "time_offset": 0.3}, rel=1e-12)


def test_an_impact_that_never_comes_is_said() -> None:
    heard = np.append(instants_of_impacts(3, LISTENED), [2.6, 3.0, 3.4, 3.8])
    fit = listened(heard, ["height_0"], deviation=1.0, bounce=0.0)
    words = "the motion has 1 of 7 impacts; the others are continued at equal distances"
    assert fit.sentences == (f"data: gap_impacts: {words}",)
    fall = np.sqrt(2 * fit.values["height_0"] / 9.81)
    assert fit.instants[0]["gap_impacts"] == pytest.approx(fall * np.arange(1, 8))
    slopes = fit.estimate.linearization[1][:, 0]
    assert slopes == pytest.approx(fall * np.arange(1, 8) / (2 * fit.values["height_0"]))


def test_a_ball_that_never_falls_so_far_has_no_impact() -> None:
    fit = listened([1.0, 2.0], ["height_0"], gravity=0.01, height_0=5.0)
    assert fit.instants[0]["gap_impacts"] == pytest.approx([6.0, 9.0])  # 3 s are simulated
    assert fit.values == {"height_0": 5.0}
    assert (
        "data: gap_impacts: the motion has 0 of 2 impacts; the others are continued at equal distances" in fit.sentences
    )


def test_two_experiments_have_instants_of_their_own() -> None:
    tables, heights = [{"time": [0.0, 1.0]}] * 2, (1.2, 0.6)
    heard = [{"gap_impacts": (instants_of_impacts(5, LISTENED | {"height_0": h}), 1e-3)} for h in heights]
    fit = identify(BouncingBall, tables, ["bounce", "height_0"], each=["height_0"], instants=heard, bounce=0.7)
    assert fit.values == pytest.approx({"bounce": 0.8, "height_0 (1)": 1.2, "height_0 (2)": 0.6}, rel=1e-12)
    with pytest.raises(IdentificationError, match="instants: 1 dictionaries for 2 experiments; give one each"):
        identify(BouncingBall, tables, "bounce", instants=heard[:1])


@pytest.mark.parametrize(
    ("instants", "message"),
    [
        ({"gap_impact": ([1.0], 1e-3)}, "no output 'gap_impact' counts impacts; did you mean 'gap_impacts'?"),
        ({"gap_impacts": [1.0, 2.0, 3.0]}, r"gap_impacts = \[1.0, 2.0, 3.0\]: give \(instants, standard deviation\)"),
        ({"gap_impacts": ([1.0, 0.5], 1e-3)}, r"gap_impacts = \[1.0, 0.5\]: give instants \[s\] in ascending order"),
        ({"gap_impacts": ([0.5, np.inf], 1e-3)}, r"gap_impacts = \[0.5, inf\]: give instants \[s\] in ascending order"),
        ({"gap_impacts": ([-1.0, 0.5], 1e-3)}, "gap_impacts = -1 s: the motion begins at 0 s; leave it out"),
        ({"gap_impacts": ([1.0], 0.0)}, "instants: standard deviation of gap_impacts = 0.0: must be > 0"),
        ({"gap_impacts": ("soon", 1e-3)}, "instants: gap_impacts = 'soon': give numbers"),
        ("gap_impacts", "instants = 'gap_impacts': give a dictionary with names as keys"),
    ],
)
def test_refusals(instants: Any, message: str) -> None:
    with pytest.raises(IdentificationError, match=message):
        identify(BouncingBall, {"time": [0.0, 1.0]}, ["bounce"], instants=instants)


def slid(times: np.ndarray, **values: float) -> dict[str, np.ndarray]:
    """A mass that is let go on a belt at rest."""
    return {"time": times, "x": DryOscillator.exact(times, **values)["x"]}


def test_static_friction_is_not_determined_before_anything_sticks() -> None:
    data = slid(np.linspace(0, 0.9, 19), mu_static=0.3, mu_sliding=0.2)
    fit = identify(DryOscillator, data, ["mu_static", "mu_sliding"], 1e-3, mu_static=0.35, mu_sliding=0.25)
    assert fit.values == pytest.approx({"mu_static": 0.35, "mu_sliding": 0.2})
    assert fit.sentences == ("mu_static: not determined at all by x", "mu_static is held at 0.35")


def test_a_search_that_ends_where_there_is_no_motion_says_so() -> None:
    case = CASES["belt"]
    times = case.times[:21]
    data = {"time": times, "x": DryOscillator.exact(times, **case.truth, **case.exact)["x"]}
    with pytest.raises(
        IdentificationError, match=r"lead to where there is no motion \(DryOscillator: slip at"
    ) as error:
        identify(DryOscillator, data, "mu_sliding", 1e-3, segments=1, **case.options, mu_static=0.15, mu_sliding=0.1)
    assert error.value.fit.values == pytest.approx({"mu_sliding": 0.15})


def test_multiple_shooting_across_impacts() -> None:
    times = np.linspace(0, 2, 41)
    data = {"time": times, "height": BouncingBall.exact(times, bounce=0.8, table=0.05)["height"]}
    fit = identify(BouncingBall, data, ["bounce", "table"], 0.01, segments=5, bounce=0.5, table=0.3)
    assert fit.values == pytest.approx({"bounce": 0.8, "table": 0.05}, rel=1e-13)


@pytest.mark.slow
def test_verdicts() -> None:
    for case in CASES.values():
        fit = case.fit(3)
        assert [verdict.claim for verdict in fit.verify() if not verdict.passed] == []


def test_a_fit_is_not_pickled() -> None:
    fit = identify(BouncingBall, {"time": [0.0, 1.0]}, ["height_0"], instants={"gap_impacts": ([0.45], 1e-3)})
    with pytest.raises(IdentificationError, match=r"^a Fit is neither copied nor pickled; values, "):
        pickle.dumps(fit)


def test_diagrams_and_tables_show_impacts(tmp_path: Path) -> None:
    heard = instants_of_impacts(4, LISTENED) + np.array([0, 1e-3, np.nan, 0])
    fit = listened(heard, ["height_0"])
    above, below = fit.plot().axes
    assert above.lines[0].get_xdata() == pytest.approx(fit.instants[0]["gap_impacts"])
    assert below.lines[0].get_ydata() == pytest.approx(heard - fit.instants[0]["gap_impacts"], nan_ok=True)
    assert (above.get_ylabel(), below.get_ylabel()) == ("gap_impacts [1]", "residual [s]")
    fit.to_csv(tmp_path / "fit.csv")
    rows = np.genfromtxt(tmp_path / "fit_gap_impacts.csv", delimiter=",", comments="#", skip_header=1)
    rows = rows[np.isfinite(rows).all(axis=1)]
    assert rows[:, :2] == pytest.approx(np.column_stack([heard[[0, 1, 3]], [1, 2, 4]]))
    assert rows[:, 2] + rows[:, 3] == pytest.approx(heard[[0, 1, 3]])


def test_instants_of_a_ball_in_a_system() -> None:
    system = System("toys")
    system.add("ball", "BouncingBall", bounce=0.7)
    system.add("swing", "Pendulum")
    instants = {"ball.gap_impacts": (instants_of_impacts(5, LISTENED), 1e-3)}
    fit = identify(system, {"time": [0.0, 1.0]}, ["ball.bounce", "ball.height_0"], instants=instants)
    assert fit.values == pytest.approx({"ball.bounce": 0.8, "ball.height_0": 1.2}, rel=1e-12)


def test_a_recorded_motion_is_data_with_what_it_counts() -> None:
    result = simulate("BouncingBall", stop_time=1.0, step_size=0.1, tolerance=1e-12, bounce=0.8)
    fit = identify("BouncingBall", result, "bounce", 0.01, measured=["height", "gap_impacts"], bounce=0.7)
    assert fit.values == pytest.approx({"bounce": 0.8}, rel=1e-13)
    assert fit.signals[0][1].tolist() == result["gap_impacts"].tolist()


def test_values_at_which_events_change_are_said() -> None:
    """With equal frictions a mass that slips from the belt comes back to its speed where it stays just so.

    Up to 3e-10, that is: above the static friction, where rounding leads, too, an FMU refuses the sliding one.
    """
    case = CASES["belt"]
    equal = {**case.truth, "mu_static": 0.1, "mu_sliding": 0.1}
    times = case.times[:11]
    data = {"time": times, "x": DryOscillator.exact(times, **equal, **case.exact)["x"]}
    static = 0.1 * (1 + 3e-10)
    fit = identify(DryOscillator, data, "mu_sliding", 0.003, **case.options, mu_static=static, mu_sliding=0.1)
    assert 0 < fit.standard_errors["mu_sliding"] < 0.01
    (sentence,) = fit.sentences
    assert sentence.startswith("data: t = 0.4985758")
    assert sentence.endswith("standard errors take derivatives by mu_sliding to one side of it")


def test_impacts_are_looked_at_within_what_was_measured() -> None:
    """At a millionth of the duration before and after; measurements and their clock begin when they like."""
    measured = SimpleNamespace(start_time=5.0)
    experiment = SimpleNamespace(measurements=measured, offset=0, motion=SimpleNamespace(times=np.array([5.5, 7.0])))
    instants = [{"gap_impacts": np.array([4.75, 6.0])}]
    objective = SimpleNamespace(experiments=[experiment])
    estimate: Any = SimpleNamespace(values=np.array([0.25]), instants=instants, objective=objective)
    sides = impact_sides(estimate, 0)["gap_impacts"]
    np.testing.assert_allclose(sides, [[5.0, 6.25 - 2e-6], [5.0 + 2e-6, 6.25 + 2e-6]], rtol=1e-14)
