"""What the tests of derivatives share."""

from __future__ import annotations

import sys
from pathlib import Path

import fmpy
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "kernel/cosim"))  # what packs C into an FMU
sys.path.insert(0, str(Path(__file__).parent))  # modules beside the tests

from making import packed

from exchange import Exchange, Made


@pytest.fixture(params=["2", "3"], ids=["FMI 2.0", "FMI 3.0"])
def made(request: pytest.FixtureRequest, tmp_path: Path) -> Made:
    """The FMU of equations, of both versions."""

    def make(exchange: Exchange) -> Path:
        fmi, folder = request.param, tmp_path / str(len(list(tmp_path.iterdir())))
        folder.mkdir()
        platform = fmpy.platform if fmi == "2" else fmpy.platform_tuple
        return packed(folder, "Foreign", exchange.code(fmi), exchange.description("Foreign", fmi), platform)

    return make
