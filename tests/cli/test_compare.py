"""``liaisons compare``."""

from pathlib import Path

import numpy as np
import pytest

from liaisons.cosim import Result

from .conftest import Cli, is_misuse


def _write(path: Path, offset: float) -> None:
    time = np.arange(5) / 4
    Result(path.stem, time, ("x",), np.array([1 + time + offset]), {"x": "m"}).to_csv(path)


@pytest.mark.parametrize(("tolerance", "status"), [(None, 0), ("0.2", 0), ("0.1", 1)])
def test_two_files(liaisons: Cli, tmp_path: Path, tolerance: str | None, status: int) -> None:
    _write(tmp_path / "one.csv", 0.0)
    _write(tmp_path / "two.csv", 0.25)
    reply = liaisons("compare", "one.csv", "two.csv", *(["--tolerance", tolerance] if tolerance else []))
    assert reply.status == status, reply.err  # 0.25 beside the largest value, 2: 0.125
    assert "one and two at 5 points" in reply.out
    assert reply.out.splitlines()[-1].split()[:3] == ["x", "m", "0.25"]


def test_files_that_will_not_do(liaisons: Cli, tmp_path: Path) -> None:
    _write(tmp_path / "one.csv", 0.0)
    (tmp_path / "text.csv").write_text("no table")
    assert is_misuse(liaisons("compare", "one.csv", "none.csv"), "none.csv", "No such file")
    assert is_misuse(liaisons("compare", "one.csv", "text.csv"), "text.csv", "not a result")
    assert is_misuse(liaisons("compare", "one.csv", "none.parquet"), "none.parquet")
