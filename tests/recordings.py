"""Record what runs, plans, fits and derivatives give, to the last bit, and compare two records.

    python tests/recordings.py record FILE [NAME...]      all, or those named: scenarios, components of the catalogue,
                                                          "systems" (those of recorded_systems.py), one of these
    python tests/recordings.py compare OLD NEW            exit status 1 if a number differs or is missing

The proof that a redesign changed no result: record before, record after, compare.  Only the public API is used, so that
both trees are recorded by the same file, ``PYTHONPATH=TREE/components python tests/recordings.py record FILE``.

- of a scenario: what each of its claims compares (systems, sweeps, ensembles, plans, feedback, fits, derivatives);
- of a system: times, values, coupling errors, warnings, and the same in steps with branches;
- of a component: all outputs of its FMU, with prescribed coordinates that move, in the three reconstructions of inputs.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from liaisons import LiaisonsError, Result, fmu_path, simulate
from liaisons.library import component, component_names, model
from liaisons_tools.scenarios import Claims, load, names
from recorded_systems import SYSTEMS, of_system

STOP, STEP, AMPLITUDE, FREQUENCY = 1.0, 0.02, 0.02, 3.0
"""Of the runs of components [s, s, unit of the coordinate, rad/s]: small enough for every domain of the catalogue."""

Record = dict[str, NDArray[Any]]


class RecordingClaims:
    """Claims of a scenario that keep the numbers which they compare."""

    def __init__(self, name: str) -> None:
        self.name, self.claims, self.numbers = name, Claims(), Record()
        self.verdicts = self.claims.verdicts  # a scenario may add those of a plan

    def __call__(self, text: str, got: Any, expected: Any, *arguments: Any, **options: Any) -> None:
        self.claims(text, got, expected, *arguments, **options)
        signals = expected if isinstance(expected, Mapping) else ()
        self._keep(text, *([got[name] for name in options.get("names") or signals] if signals else [got]))

    def below(self, text: str, got: Any, *arguments: Any) -> None:
        self.claims.below(text, got, *arguments)
        self._keep(text, got)

    def order(self, text: str, sizes: Any, errors: Any, *arguments: Any) -> None:
        self.claims.order(text, sizes, errors, *arguments)
        self._keep(text, errors)

    def energy(self, text: str, *runs: Result, tolerance: float) -> None:
        self.claims.energy(text, *runs, tolerance=tolerance)
        self._keep(text, *(run[name] for run in runs for name in run.names))

    def _keep(self, text: str, *values: Any) -> None:
        for value in values:
            self.numbers[f"{self.name}: {len(self.numbers)}: {text}"] = np.asarray(value)


def of_scenario(name: str) -> Record:
    """What each claim of a scenario compares."""
    claims: Any = RecordingClaims(name)
    load(name).main(claims)
    plt.close("all")
    return claims.numbers | {f"{name}: errors": np.array([verdict.error for verdict in claims.verdicts])}


def of_component(name: str) -> Record:
    """All outputs of a component's FMU, in the three reconstructions of inputs where these are prescribed."""

    def moving(start: float) -> Any:
        w, a = FREQUENCY, AMPLITUDE
        return lambda t: (start + a * np.sin(w * t), a * w * np.cos(w * t), -a * w**2 * np.sin(w * t))

    starts = {v.name: v.starts[0] for v in inputs_of(name)}
    moved = {q: moving(start) for q, start in starts.items() if f"{q}_dot" in starts and f"{q}_ddot" in starts}
    runs = {}
    for mode in (0, 1, 2) if moved else (1,):
        settings = {"input_reconstruction": mode} if moved else {}
        run = simulate(fmu_path(name), stop_time=STOP, step_size=STEP, inputs=moved, start_values=settings)
        runs |= {f"{name}: {mode}: {signal}": run[signal] for signal in run.names}
    return runs


def inputs_of(name: str) -> Any:
    """Inputs of a component."""
    return model(component(name)).flat().inputs


def all_records(chosen: list[str]) -> Iterator[tuple[str, Record]]:
    """Yield names and records, those of components first; of what is refused, its sentence."""
    work = dict.fromkeys(component_names(), of_component) | dict.fromkeys(names(), of_scenario)
    work |= dict.fromkeys(SYSTEMS, of_system)
    for name in (SYSTEMS if chosen == ["systems"] else chosen) or work:
        try:
            yield name, work[name](name)
        except LiaisonsError as error:
            yield name, {f"{name}: refused": np.asarray(str(error))}


def record(path: str, *chosen: str) -> int:
    """Write a record."""
    mpl.use("Agg")
    numbers: Record = {}
    for name, added in all_records([*chosen]):
        print(f"{name}: {len(added)}", flush=True)
        numbers |= added
    named: dict[str, Any] = {key.replace("/", "÷"): value for key, value in numbers.items()}  # members of an archive
    np.savez_compressed(path, **named)
    print(f"{len(numbers)} records: {path}")
    return 0


def compare(old_path: str, new_path: str) -> int:
    """Print what differs, largest difference relative to the largest value; 1 if anything does."""
    with np.load(old_path) as old, np.load(new_path) as new:
        differing = [
            f"{key}: {difference(old[key], new[key])}" if key in new else f"{key}: missing"
            for key in old
            if key not in new or old[key].tobytes() != new[key].tobytes()
        ]
        differing += [f"{key}: new" for key in new if key not in old]
        print(*differing, f"{len(differing)} of {len(old.files)} records differ", sep="\n")
    return int(bool(differing))


def difference(old: NDArray[Any], new: NDArray[Any]) -> str:
    """How far two arrays are apart, in words."""
    if old.shape != new.shape or old.dtype.kind not in "biufc":
        return f"{old.dtype}{old.shape} and {new.dtype}{new.shape}"
    return f"{np.max(np.abs(new - old)) / max(np.max(np.abs(old)), 1e-300):.1e}"


if __name__ == "__main__":
    sys.exit({"record": record, "compare": compare}[sys.argv[1]](*sys.argv[2:]))
