"""Reference results inside an FMU, repeated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from liaisons import System, Verdict, verdict
from liaisons.base.archive import Archive
from liaisons.base.folders import temporary_folder
from liaisons.base.related_files import related_files
from liaisons.base.tables import read_table
from liaisons.errors import LiaisonsError, SimulationError
from liaisons_exchange import ssp
from liaisons_tools.cli._subject import requested_simulation


def reference_verdicts(path: Path) -> Iterator[Verdict | str]:
    """Yield a verdict on each table of reference results in an FMU, by a run that has to reproduce it."""
    with Archive(path) as archive, temporary_folder() as folder:
        try:
            files = related_files(archive)
            for file in files:
                archive.copy(file.member, folder / file.member)
            for result in files:
                if (result.role, result.type) == ("result", "text/csv"):
                    beside = {file.role: folder / file.member for file in files if file.labels == result.labels}
                    yield _reference_verdict(path, folder / result.member, beside)
        except (LiaisonsError, ValueError, LookupError) as error:
            yield f"reference results are left out: {error}"


def _reference_verdict(path: Path, results: Path, files_by_role: Mapping[str, Path]) -> Verdict:
    """Verdict on a table of reference results.

    :param files_by_role: files of the same labels, with parameters and inputs of the run.
    """
    part = System(path.stem).add("fmu", path)
    fmu = part.fmu
    table = read_table(results, SimulationError)
    rows = zip(*table.cells, strict=True)
    times, *columns = np.transpose([[float(x) for cell in row for x in cell.split()] for row in rows])
    names = [name for column in table.names[1:] for name in fmu.elements(column)]
    starts = []
    if "parameter" in files_by_role:
        starts = ssp.fmu_start_values(part, files_by_role["parameter"])
    inputs = [str(files_by_role["testcase"])] if "testcase" in files_by_role else []
    tolerance = fmu.experiment.tolerance or 1e-6
    span = times[0], times[-1], times[1] - times[0], tolerance
    run = requested_simulation(str(path), starts, *span, inputs=inputs, record=names).run()
    expected = zip(names, columns, strict=True)
    error = max(np.max(np.abs(run[name] - column)) / (np.max(np.abs(column)) or 1) for name, column in expected)
    claim = f"results as in {results.name} beside the largest of each column"
    return verdict(claim, error=error, tolerance=1e3 * tolerance)  # as for halved steps
