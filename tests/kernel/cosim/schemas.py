"""The schemas of SSP, as pyssp_standard has them."""

from __future__ import annotations

from pathlib import Path
from typing import Literal
from zipfile import ZipFile

import pytest

from liaisons import System


def validated(system: System, folder: Path, form: Literal["portable", "full"], **experiment: float) -> int:
    """Write a system, check all files of the archive, and count them."""
    pytest.importorskip("pyssp_standard")
    from pyssp_standard.ssd import SSD
    from pyssp_standard.ssm import SSM
    from pyssp_standard.ssv import SSV

    folder.mkdir(exist_ok=True)
    system.write_ssp(folder / "system.ssp", form=form, **experiment)
    kinds = {".ssd": SSD, ".ssv": SSV, ".ssm": SSM}
    with ZipFile(folder / "system.ssp") as archive:
        names = [name for name in archive.namelist() if Path(name).suffix in kinds]
        archive.extractall(folder, names)
    for name in names:
        with kinds[Path(name).suffix](folder / name) as read:
            assert read.identifier.startswith(Path(name).suffix[1:] + ("2" if form == "full" else ""))
            read.__check_compliance__()
    return len(names)
