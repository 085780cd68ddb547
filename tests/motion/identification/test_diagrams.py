"""Diagrams, films and tables of a fit show what was measured and fitted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.stats import chi2

from liaisons import Result
from liaisons.errors import IdentificationError
from liaisons.mechanics import assemble
from liaisons.models import Pendulum, PendulumChain
from liaisons_motion.identification import Fit, identify

SIGMA = 0.02


@pytest.fixture(scope="module")
def fit() -> Fit:
    """Two swings of one pendulum; the clock of the second is slow, and one of its values is missing."""
    random, experiments = np.random.default_rng(3), []
    for theta_0, count in ((1.0, 40), (0.5, 30)):
        times = np.arange(count) / 10
        theta = Pendulum.exact(times, theta_0=theta_0, gravity=9.7)["theta"] + random.normal(0, SIGMA, count)
        experiments.append({"time": times, "theta": theta})
    experiments[1]["theta"][7] = np.nan
    return identify(
        "Pendulum", experiments, unknown=["gravity", "length", "theta_0"], each=["theta_0"], noise=SIGMA,
        prior={"length": (1.0, 0.01)}, theta_0=0.7,
    )  # fmt: skip


def test_points_and_residuals_are_drawn_over_curve_and_band(fit) -> None:
    above, below = fit.plot("theta").axes
    curves = [line for line in above.lines if line.get_marker() == "None"]
    points = [line for line in above.lines if line.get_marker() == "."]
    for data, fitted, drawn, residuals in zip(fit.measurements, fit.signals, points, below.lines, strict=False):
        np.testing.assert_array_equal(drawn.get_xydata(), np.transpose([data.times, data.values[0]]))
        np.testing.assert_array_equal(residuals.get_ydata(), data.values[0] - fitted[0])
    assert len(points) == len(curves) == 2
    for data, fitted, curve, band in zip(fit.measurements, fit.signals, curves, above.collections, strict=True):
        at_ends = np.interp(data.times[[0, -1]], *np.transpose(curve.get_xydata()))
        np.testing.assert_allclose(at_ends, fitted[0, [0, -1]], rtol=1e-9)  # tolerance of the steps: 1e-10
        corners = band.get_paths()[0].vertices
        half = [np.ptp(corners[corners[:, 0] == x][:, 1]) / 2 for x in curve.get_xdata()[1:-1]]
        assert np.min(half) > 1.96 * SIGMA
        assert np.max(half) < 1.5 * 1.96 * SIGMA  # noise, and a little of the unknowns
    assert above.get_ylabel() == "theta [rad]"


def test_an_array_has_one_diagram() -> None:
    times = np.linspace(0, 1, 20)
    data = {"time": times, "theta[1]": 0.1 * np.cos(times), "theta[2]": 0.1 * np.cos(times)}
    fit = identify(assemble(PendulumChain, 2), data, unknown=["gravity"])
    above, _ = fit.plot().axes
    assert above.get_legend_handles_labels()[1] == ["theta[1], data", "theta[2], data"]
    assert above.get_ylabel() == "theta [rad]"
    above, _ = fit.plot("theta[2]").axes
    assert above.get_legend_handles_labels()[1] == ["theta[2], data"]


def test_the_ellipse_holds_points_of_one_probability(fit) -> None:
    (diagram,) = fit.plot_ellipse("gravity", "length", 0.9).axes
    drawn = diagram.lines[0].get_xydata() - [fit.values["gravity"], fit.values["length"]]
    covariance = fit.covariance[:2, :2]
    np.testing.assert_allclose(
        np.einsum("ni,ij,nj->n", drawn, np.linalg.inv(covariance), drawn), chi2.ppf(0.9, 2), rtol=1e-10
    )
    assert diagram.get_xlabel() == "gravity [m/s2]"


def test_without_covariance_there_is_no_ellipse(fit) -> None:
    data = {"time": fit.measurements[0].times, "theta": fit.measurements[0].values[0]}
    unsure = identify("Pendulum", data, unknown=["gravity", "length", "theta_0"], theta_0=0.9)
    with pytest.raises(IdentificationError, match="plot_ellipse: gravity and length have no covariance"):
        unsure.plot_ellipse("gravity", "length")


def test_residuals_go_to_a_file_for_each_experiment(fit, tmp_path) -> None:
    fit.to_csv(tmp_path / "residuals.csv")
    for path, data, residuals in zip(("residuals", "residuals_2"), fit.measurements, fit.residuals, strict=True):
        table = Result.from_csv(tmp_path / f"{path}.csv")
        np.testing.assert_array_equal(table.time, data.times)
        np.testing.assert_array_equal(table["residual of theta"], residuals[0])


def test_a_film_has_what_was_measured_as_a_ghost(fit, tmp_path) -> None:
    pictures = []
    for name, experiment in (("first", 1), ("second", 2)):
        path: Path = tmp_path / f"{name}.png"
        fit.animate(path, experiment=experiment)
        with Image.open(path) as image:
            pictures.append(np.asarray(image.convert("L"), dtype=float))
    assert pictures[0].shape != pictures[1].shape or (pictures[0] != pictures[1]).any()
    alone = tmp_path / "alone.png"
    fit.replay()[0].animate(alone)
    with Image.open(alone) as image:
        without = np.asarray(image.convert("L"), dtype=float)
    assert without.shape != pictures[0].shape or (without != pictures[0]).any()


def test_names_that_were_not_fitted_are_refused(fit) -> None:
    with pytest.raises(IdentificationError, match="plot: 'thetta' was not measured; did you mean 'theta'"):
        fit.plot("thetta")
    with pytest.raises(IdentificationError, match="plot_ellipse: 'gravitty' is not unknown; did you mean 'gravity'"):
        fit.plot_ellipse("gravitty", "length")
