"""``liaisons compare``."""

from pathlib import Path

import numpy as np
import pytest

from liaisons.cosim import Result

from .conftest import Cli


def _write(path: Path, offset: float) -> None:
    time = np.arange(5) / 4
    Result(path.stem, time, ("x",), np.array([1 + time + offset]), {"x": "m"}).to_csv(path)


@pytest.mark.parametrize(("tolerance", "status"), [(None, 0), ("0.2", 0), ("0.125", 0), ("0.1", 1)])
def test_two_files(liaisons: Cli, tmp_path: Path, tolerance: str | None, status: int) -> None:
    _write(tmp_path / "one.csv", 0.0)
    _write(tmp_path / "two.csv", 0.25)
    reply = liaisons("compare", "one.csv", "two.csv", *(["--tolerance", tolerance] if tolerance else []))
    assert reply.status == status, reply.err  # 0.25 beside the largest value, 2: 0.125
    assert "one and two at 5 points" in reply.out
    assert reply.out.splitlines()[-1].split()[:3] == ["x", "m", "0.25"]


def test_a_value_that_is_no_number_fits_no_tolerance(liaisons: Cli, tmp_path: Path) -> None:
    (tmp_path / "one.csv").write_text("time,x,y\n0,1,1\n1,1,1\n")
    (tmp_path / "two.csv").write_text("time,x,y\n0,1,1\n1,1,nan\n")
    assert liaisons("compare", "one.csv", "two.csv", "--tolerance", "1").status == 1
