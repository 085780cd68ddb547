"""``liaisons identify``: measurements in, values, files and verdicts out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from liaisons import Result, System
from liaisons.check import verdict
from liaisons.models import Pendulum
from liaisons_motion.identification import Fit

FIT = """
subject = "Pendulum"
data = "tracked.csv"
unknown = ["gravity", "theta_0"]
noise = { theta = 0.01 }
start_values = { theta_0 = 0.8 }
"""

OWN = '''
"""A pendulum of a user."""

from liaisons.models import Pendulum


class WeighedPendulum(Pendulum):
    """Pendulum by another name."""
'''


@pytest.fixture
def fit(tmp_path: Path) -> Path:
    """What to identify, and a table of the closed form with noise beside it."""
    folder = tmp_path / "experiment"
    folder.mkdir()
    times = np.arange(60) / 20
    theta = Pendulum.exact(times, theta_0=1.0, gravity=9.7)["theta"] + np.random.default_rng(0).normal(0, 0.01, 60)
    rows = "".join(f"{t},{x}\n" for t, x in zip(times, np.degrees(theta), strict=True))
    (folder / "tracked.csv").write_text(f"time [s],theta [deg]\n{rows}")
    (folder / "fit.toml").write_text(FIT)
    return folder / "fit.toml"


@pytest.mark.variants(core=0)
def test_measurements_become_values_figure_film_residuals_and_verdicts(runs, tmp_path, fit) -> None:
    said = runs("identify", fit, "--output", "reached")
    assert "gravity" in said
    assert "FAIL" not in said
    assert "replayed through the FMUs" in said
    for end in (".png", ".gif"):
        assert (tmp_path / f"reached/fit{end}").stat().st_size > 1000
    residuals = Result.from_csv(tmp_path / "reached/fit_residuals.csv")
    assert residuals.names == ("theta", "fitted theta", "residual of theta")
    assert residuals.units["residual of theta"] == "rad"
    np.testing.assert_array_equal(residuals["theta"] - residuals["fitted theta"], residuals["residual of theta"])
    assert 0.005 < np.std(residuals["residual of theta"]) < 0.02


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("noise", "noises", "unknown key 'noises'; did you mean 'noise'?"),
        ('data = "tracked.csv"', "", 'data is missing, for example data = "measured.csv"'),
        ('"tracked.csv"', "7", "data = 7: give a name or a list of names"),
        ('"tracked.csv"', '"track.csv"', "track.csv: cannot be read: No such file"),
        ('"gravity"', '"gravitty"', "did you mean 'gravity'?"),
        ("theta = 0.01", "theta = 0.0", "noise: theta = 0.0: must be > 0"),
        ('"Pendulum"', '"Pendulums"', "did you mean 'Pendulum'?"),
        ("subject = ", "subject ", "Expected '='"),
    ],
)
def test_what_cannot_be_identified_is_said_in_a_line(liaisons, fit, before, after, words) -> None:
    text = fit.read_text()
    assert before in text
    fit.write_text(text.replace(before, after))
    reply = liaisons("identify", fit)
    assert reply.status == 2
    assert words in reply.err
    assert reply.err.count("\n") == 1


def test_a_verdict_that_fails_is_the_exit_status(liaisons, fit, monkeypatch) -> None:
    monkeypatch.setattr(Fit, "verify", lambda _: [verdict("it holds", error=1.0, tolerance=0.5)])
    monkeypatch.setattr(Fit, "animate", lambda *_: 1.0)  # takes seconds
    reply = liaisons("identify", fit)
    assert reply.status == 1
    assert "FAIL" in reply.out


def test_components_systems_and_tables_are_looked_for_beside_the_file(runs, fit, monkeypatch) -> None:
    monkeypatch.setattr(Fit, "verify", lambda _: [])
    monkeypatch.setattr(Fit, "animate", lambda *_: 1.0)
    folder, table = fit.parent, fit.parent / "tracked.csv"
    (folder / "weighed.py").write_text(OWN)
    fit.write_text(FIT.replace("Pendulum", "weighed.py").replace('"tracked.csv"', '["tracked.csv", "tracked.csv"]'))
    assert "gravity" in runs("identify", fit, "--output", folder)
    assert sorted(path.name for path in folder.glob("*residuals*")) == ["fit_residuals.csv", "fit_residuals_2.csv"]

    system = System("one swing")
    system.add("swing", "Pendulum")
    system.write_ssp(folder / "swing.ssp")
    table.write_text(table.read_text().replace("theta", "swing.theta"))
    text = 'subject = "swing.ssp"\ndata = "tracked.csv"\nunknown = ["swing.theta_0", "swing.gravity"]\n'
    fit.write_text(f"{text}start_values = {{ 'swing.theta_0' = 0.8 }}\n")
    said = runs("identify", fit, "--output", folder)
    (line,) = (line for line in said.splitlines() if line.startswith("swing.gravity"))
    assert float(line.split()[1]) == pytest.approx(9.7, rel=0.01)
