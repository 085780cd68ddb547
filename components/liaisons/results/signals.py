"""Named signals with units, over time, over cases, or over both."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from liaisons.base.arguments import shown
from liaisons.base.array_names import Shape, array_and_index, complete_shape
from liaisons.base.arrays import Floats
from liaisons.base.port_names import PortNames
from liaisons.errors import SimulationError, UnknownSignalError, suggestion
from liaisons.results.pictures import Scene


@dataclass(frozen=True, eq=False, repr=False)
class LabelledSignals:
    """The data of a :class:`liaisons.Result`, which has the same fields."""

    title: str
    time: Floats
    names: tuple[str, ...]
    values: Floats
    units: Mapping[str, str]
    failures: Mapping[int, str] = field(default_factory=dict)
    unfinished: tuple[int, ...] = ()
    errors: Floats | None = None
    coupling_error: Floats | None = None
    compiled: bool = False
    texts: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    jumping: frozenset[str] = frozenset()
    ports: Mapping[str, PortNames] = field(default_factory=dict)
    scene: Scene | None = None
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for numbers in (self.time, self.values, self.coupling_error):
            if numbers is not None:
                numbers.flags.writeable = False
        units = dict(self.units)
        for name in self._arrays:
            units[name] = self.units.get(self.element(name), "")
        object.__setattr__(self, "units", MappingProxyType(units))
        object.__setattr__(self, "failures", MappingProxyType(dict(sorted(self.failures.items()))))

    def __reduce__(self) -> tuple[type[LabelledSignals], tuple[Any, ...]]:
        """Make it again from its fields: their read-only views cannot be pickled."""
        values = (getattr(self, each.name) for each in fields(self))
        return type(self), tuple(dict(value) if isinstance(value, MappingProxyType) else value for value in values)

    @property
    def kind(self) -> Literal["simulation", "sweep", "ensemble"]:
        """``"simulation"`` over time, ``"sweep"`` over cases, or ``"ensemble"`` over both."""
        if not self.time.size:
            return "sweep"
        return "simulation" if self.values.ndim == 2 else "ensemble"

    @property
    def index(self) -> dict[str, NDArray[Any]]:
        """Values along the axes of each signal, by name: ``"time"`` [s], ``"case"`` from 0, or both."""
        times = {"time": self.time} if self.time.size else {}
        return times if self.kind == "simulation" else {**times, "case": np.arange(self.values.shape[-1])}

    def __getitem__(self, name: str) -> NDArray[Any]:
        """A signal or an array of them by its name: numbers, or strings.

        :raises UnknownSignalError: with the nearest name, if there is none of this name; it is a ``KeyError``, too.
        """
        numbers = self.numbers(name)
        texts = self.texts.get(self.element(name))
        return numbers if texts is None else np.array(texts, dtype=object)[numbers.astype(int)]

    def get(self, name: str, default: Any = None) -> Any:
        """The signal or array of a name, or the default if there is none."""
        return self[name] if name in self else default  # noqa: SIM401 - it would call itself

    def numbers(self, name: str) -> Floats:
        """The signal or array of a name as numbers; of strings, their indices in ``texts``.

        :raises UnknownSignalError: if there is none of this name.
        """
        return self._rows(self.values, name)

    def error(self, name: str) -> Floats:
        """Estimated error of a signal: largest one of each case of an ensemble, or at each time of a simulation.

        :raises SimulationError: for an unknown name, or if there is no estimate.
        """
        if self.errors is None:
            simulated = self.kind == "simulation"
            cure = "simulate(verify=True) compares with half the step" if simulated else "leave estimate=False out"
            raise SimulationError(f"the result of {self.title} has no error estimate; {cure}")
        return self._rows(self.errors, name)

    @property
    def unconverged(self) -> tuple[int, ...]:
        """Numbers of the cases, from 0, whose errors do not shrink with the step size; empty without estimates."""
        if self.errors is None or self.kind != "ensemble":
            return ()
        return tuple(np.flatnonzero(np.isinf(self.errors).any(axis=0)).tolist())

    def _check_name(self, name: str) -> None:
        if not isinstance(name, str):
            raise UnknownSignalError(
                f"the result of {self.title} has signals by name, not by {shown(name)}; take one by one"
            )

    def _rows(self, table: Floats, name: str) -> Floats:
        """Row of a signal in a table, or rows of an array, whose axes become the last ones."""
        self._check_name(name)
        if name in self._row_by_name:
            return table[self._row_by_name[name]]
        if name not in self._arrays:
            raise UnknownSignalError(
                f"the result of {self.title} has no signal {name!r}{suggestion(name, self.entries)}; what is not "
                f"recorded by default has to be named in {'keep' if self.kind == 'sweep' else 'record'}=[...]"
            )
        rows, shape = self._arrays[name]
        adjacent = rows[-1] - rows[0] + 1 == len(rows)
        values = table[rows[0] : rows[-1] + 1] if adjacent else table[rows]
        array = np.moveaxis(values, 0, -1).reshape(*values.shape[1:], *shape)
        array.flags.writeable = False
        return array

    @property
    def entries(self) -> tuple[str, ...]:
        """Names of the signals and of the arrays, instead of those of their elements."""
        return self.grouped(0)

    def grouped(self, size: int) -> tuple[str, ...]:
        """Names of the signals and of arrays of more than ``size`` elements, instead of those of their elements."""
        elements = {row: name for name, (rows, _) in self._arrays.items() if len(rows) > size for row in rows}
        return tuple(dict.fromkeys(elements.get(row, name) for row, name in enumerate(self.names)))

    def element(self, name: str) -> str:
        """Name of the first element of an array; the name itself for a signal."""
        self._check_name(name)
        return self.names[self._arrays[name][0][0]] if name in self._arrays else name

    def sized(self, name: str) -> str:
        """Name of a signal or array with its shape: ``"theta (10)"``."""
        self._check_name(name)
        return f"{name} ({'×'.join(map(str, self._arrays[name][1]))})" if name in self._arrays else name

    def label(self, name: str) -> str:
        """Name of a signal or array with shape and unit: ``"theta (10) [rad]"``."""
        sized = self.sized(name)
        if name not in self.units:
            self._rows(self.values, name)  # says that there is none
        return f"{sized} [{self.units[name]}]" if self.units[name] else sized

    @property
    def headline(self) -> str:
        """Title, times, and numbers of cases and signals, on one line."""
        timed = self.kind != "sweep"
        parts = [f"{len(self.time)} points, t = {self.time[0]:g} to {self.time[-1]:g} s"] if timed else []
        if self.kind != "simulation":
            without = f", {len(self.unconverged)} without convergence" if self.unconverged else ""
            parts.append(f"{self.values.shape[-1]} cases, {len(self.failures)} failed{without}")
        return f"Result of {self.title}: {', '.join(parts)}, {len(self.names)} signals"

    def __repr__(self) -> str:
        rest = f", and {len(self) - 8} more" if len(self) > 8 else ""
        many, first = len(self.warnings), self.warnings[:1]
        rest += f"; {many} warning{'s, the first' if many > 1 else ''}: {first[0]}" if first else ""
        return f"<{self.headline}: {', '.join(map(self.label, self.entries[:8]))}{rest}>"

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and (name in self._row_by_name or name in self._arrays)

    def __iter__(self) -> Iterator[str]:
        return iter(self.entries)

    def __len__(self) -> int:
        return len(self.entries)

    def keys(self) -> tuple[str, ...]:
        """Names of the signals, as :attr:`entries`."""
        return self.entries

    @cached_property
    def _row_by_name(self) -> dict[str, int]:
        """Index of the row of each signal, by name."""
        return dict(zip(self.names, range(len(self.names)), strict=True))

    @cached_property
    def _arrays(self) -> dict[str, tuple[list[int], Shape]]:
        """Indices of rows, and shape, of each array whose elements are all recorded, by name."""
        elements: dict[str, tuple[list[int], list[Shape]]] = {}
        for name, row in self._row_by_name.items():
            base, index = array_and_index(name) if name.endswith("]") else (name, None)
            if index is not None and base not in self._row_by_name:
                rows, indices = elements.setdefault(base, ([], []))
                rows.append(row)
                indices.append(index)
        arrays: dict[str, tuple[list[int], Shape]] = {}
        for base, (rows, indices) in elements.items():
            if shape := complete_shape(indices):
                arrays[base] = rows, shape
        return arrays
