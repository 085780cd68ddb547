"""What a sweep gives back."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from liaisons.cosim.files import replacing
from liaisons.errors import suggestion
from liaisons.sweeps.errors import SweepError


@final
@dataclass(frozen=True, eq=False, repr=False)
class Table:
    """One row a case: what was varied, then what was kept.  ``table["theta:max"]`` is a column, shape (cases,).

    :param title: what was simulated.
    :param rows: structured array with a field of doubles a column; ``pandas.DataFrame(table.rows)`` takes it as it is.
    :param units: name -> unit; empty where there is none.
    :param failures: number of a case, from 0 -> why it has failed; what was to be kept of it is not-a-number.
    :param unfinished: those of them that the machine did not finish, rather than the model refused: the same sweep with
        its journal tries them again.
    """

    title: str
    rows: NDArray[Any]
    units: Mapping[str, str]
    failures: Mapping[int, str]
    unfinished: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        self.rows.flags.writeable = False
        object.__setattr__(self, "units", MappingProxyType(dict(self.units)))
        object.__setattr__(self, "failures", MappingProxyType(dict(sorted(self.failures.items()))))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(self.units)

    def __len__(self) -> int:
        """Number of cases."""
        return len(self.rows)

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """A column by its name.

        :raises SweepError: with the nearest name, if there is none of this name.
        """
        if name not in self.units:
            raise SweepError(f"the sweep of {self.title} has no column {name!r}{suggestion(name, self.units)}")
        return self.rows[name]

    def to_csv(self, path: Path | str) -> None:
        """Write a file: names in its first line, units in the second after ``#``, then a line a case.

        Numbers are written so that the same doubles are read again, e.g. by ``pandas.read_csv(path, comment="#")``;
        the last column, ``failure``, is empty but for cases that failed.  The file appears when it is complete.

        :raises SimulationError: if it cannot be written.
        """
        with replacing(Path(path)) as part, part.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow([*self.names, "failure"])
            first, *others = self.units.values()
            writer.writerow([f"# {first}", *others, ""])
            for case, row in enumerate(self.rows.tolist()):
                writer.writerow([*row, self.failures.get(case, "")])

    def __repr__(self) -> str:
        return f"<Table of {self.title}: {len(self)} cases, {len(self.failures)} failed, {', '.join(self.names)}>"
