"""``liaisons simulate``."""

from pathlib import Path

import numpy as np
import pytest

from liaisons import System
from liaisons.cosim import Result
from liaisons.models import Pendulum

from .conftest import Cli, is_misuse

pytestmark = pytest.mark.usefixtures("shared_fmus")


def rows(out: str) -> dict[str, list[str]]:
    return {line.split()[0]: line.split()[1:] for line in out.splitlines()[2:]}


def test_a_component_is_built_and_simulated(liaisons: Cli) -> None:
    reply = liaisons("simulate", "Pendulum", "--set", "theta_0=1", "--stop", "2")
    unit, start, *_ = rows(reply.out)["theta"]
    assert reply.status == 0, reply.err
    assert (unit, start) == ("rad", "1")
    assert "energy_balance" in rows(reply.out)


def test_signals_end_in_csv_and_figure(liaisons: Cli, tmp_path: Path) -> None:
    words = ("--stop", "2", "--step", "0.5", "--tolerance", "1e-10", "--record", "theta,theta_dot")
    reply = liaisons("simulate", "Pendulum", "--set", "theta_0=1", *words, "--csv", "swing.csv", "--plot")
    assert reply.status == 0, reply.err
    assert list(rows(reply.out))[:2] == ["theta", "theta_dot"]
    result = Result.from_csv(tmp_path / "swing.csv")
    assert result.time.tolist() == [0, 0.5, 1, 1.5, 2]
    # 1e-10 a step of the solver adds up over some hundred steps.
    np.testing.assert_allclose(result["theta"], Pendulum.exact(result.time, theta_0=1.0)["theta"], atol=1e-8, rtol=0)
    assert (tmp_path / "Pendulum.png").read_bytes().startswith(b"\x89PNG")


def test_a_parameter_may_have_the_name_of_an_option(liaisons: Cli) -> None:
    reply = liaisons("simulate", "Ramp", "--set", "start_time=1", "--set", "rate=2", "--stop", "3", "--step", "0.5")
    _, start, end, *_ = rows(reply.out)["y"]
    assert reply.status == 0, reply.err
    assert (float(start), float(end)) == (0.0, 4.0)


def test_a_file_of_a_user(liaisons: Cli, bead: Path) -> None:
    reply = liaisons("simulate", f"{bead}:Bead", "--stop", "1.25", "--step", "0.25")
    assert reply.status == 0, reply.err
    assert float(rows(reply.out)["x"][2]) == pytest.approx(1.25, rel=1e-6)  # six digits are printed


def test_an_archive(liaisons: Cli, fmus: Path, tmp_path: Path) -> None:
    liaisons("build", "Pendulum", "Sinusoid")
    system = System("pumped")
    swing = system.add("swing", next(fmus.rglob("Pendulum.fmu")), theta_0=0.5)
    motor = system.add("motor", next(fmus.rglob("Sinusoid.fmu")), offset=1.0, amplitude=0.1)
    system.connect(motor["y"], swing["length"])
    system.write_ssp(tmp_path / "pumped.ssp", stop_time=1.0, step_size=0.1)
    words = ("--set", "swing.theta_0=0.25", "--record", "swing.theta,swing.length", "--csv", "pumped.csv")
    reply = liaisons("simulate", "pumped.ssp", *words)
    assert reply.status == 0, reply.err
    assert list(rows(reply.out))[:2] == ["swing.theta", "swing.length"]
    result = Result.from_csv(tmp_path / "pumped.csv")
    assert (result["swing.theta"][0], result.time[-1], len(result.time)) == (0.25, 1.0, 11)


def test_a_truncated_fmu(liaisons: Cli, fmus: Path, tmp_path: Path) -> None:
    liaisons("build", "Constant")
    whole = next(fmus.rglob("Constant.fmu"))
    (tmp_path / "half.fmu").write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    for command in ("simulate", "check"):
        assert is_misuse(liaisons(command, "half.fmu"), "half.fmu", "truncated")
