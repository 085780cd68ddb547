"""Signals as a table, as files, as a picture."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from liaisons.cli._command import show
from liaisons.errors import SimulationError
from liaisons.files import check_writable
from liaisons.results import Result


@dataclass(frozen=True)
class Outputs:
    """Files that signals go to, where they are not None."""

    csv: Path | None
    parquet: Path | None
    figure: Path | None

    def check(self) -> None:
        """Notice before the run what would keep them from being written after it.

        :raises SimulationError: if one of them cannot be written.
        """
        for path in filter(None, (self.csv, self.parquet, self.figure)):
            check_writable(path)
        if self.parquet and find_spec("pyarrow") is None:
            raise SimulationError(f"{self.parquet}: Parquet needs PyArrow; pip install 'liaisons[parquet]'")
        if self.figure:
            from matplotlib.figure import Figure

            kinds = Figure().canvas.get_supported_filetypes()
            if (self.figure.suffix[1:].lower() or "png") not in kinds:
                raise SimulationError(f"{self.figure}: no figure ends so; choose one of {', '.join(sorted(kinds))}")

    def write(self, result: Result, remarks: Iterable[str], words: str) -> None:
        """Show the signals as a table, and write them.

        :param remarks: lines below the table.
        :param words: what to say of the files besides their names.
        :raises SimulationError: if one of them cannot be written.
        """
        show(result.summary())
        for remark in remarks:
            print(remark)
        for file, write in ((self.csv, result.to_csv), (self.parquet, result.to_parquet)):
            if file:
                write(file)
                print(f"signals: {file}{words}")
        if self.figure:
            result.plot(path=self.figure)
            print(f"figure: {self.figure}{words}")
