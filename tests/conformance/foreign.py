"""FMUs of any makers through :func:`liaisons.simulate` and through fmpy, each in a process of its own.

    python tests/conformance/foreign.py FOLDER [SECONDS]

prints a table of all FMUs in the folder; one that has Co-Simulation and Model Exchange has a line for each.
Differences are relative to the largest value of a signal, at the ends of the same communication steps.
"""

from __future__ import annotations

import logging
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from zipfile import ZipFile

import fmpy
import numpy as np
from fmpy.model_description import ModelDescription

from liaisons import Result, simulate
from liaisons.errors import SimulationError
from liaisons.results import IncompleteError

KINDS = {"CoSimulation": "coSimulation", "ModelExchange": "modelExchange"}
POINTS, TOLERANCE = 500, 1e-6
"""Communication steps and tolerance where the FMU says nothing."""
HERE = "a process of its own"


def table(folder: Path, limit: float) -> None:
    """Print it.

    :param limit: so long may one line take [s].
    """
    _say("| FMU | maker | FMI | kind | outcome | greatest difference from fmpy |\n|---|---|---|---|---|---|")
    outcomes: Counter[str] = Counter()
    for path in sorted(folder.rglob("*.fmu")):
        try:
            description = fmpy.read_model_description(str(path), validate=False)
            maker, version = description.generationTool or "not said", description.fmiVersion
            kinds = [kind for kind, name in KINDS.items() if getattr(description, name) is not None] or ["none"]
        except Exception as error:  # noqa: BLE001 - whatever fmpy stumbles over
            words = f"fmpy: {_short(error, path)}", _simulated(path, {"stop_time": 1.0, "step_size": 1 / POINTS})[1]
            _say(f"| {path.relative_to(folder)} | | | none | {words[1]} | {words[0]} |")
            continue
        for kind in kinds:
            outcome, difference = _told(path, kind, limit)
            outcomes["as fmpy" if difference[:1].isdigit() else "else"] += 1
            row = path.relative_to(folder), re.split(" Version| Compiler|[ -]v?[0-9]", maker)[0], version, kind
            _say(f"| {' | '.join(map(str, (*row, outcome, difference)))} |")
    _say("\n" + ", ".join(f"{count} {word}" for word, count in outcomes.items()))


def _told(path: Path, kind: str, limit: float) -> tuple[str, str]:
    """Outcome and difference, as another process tells them."""
    command = [sys.executable, __file__, str(path), kind, HERE]
    try:
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=limit, check=False)
        said, fate = done.stdout, f"crashed ({done.returncode})"
    except subprocess.TimeoutExpired as late:
        said, fate = (late.stdout or b"").decode(errors="replace"), f"more than {limit:g} s"
    outcome, difference, *_ = [*re.findall(r"^TOLD (.*)$", said, re.MULTILINE), fate, fate]
    return outcome, "" if outcome == fate else difference


def tell(path: Path, kind: str) -> None:
    """Print outcome and difference, each as soon as it is known."""
    logging.disable()
    description = fmpy.read_model_description(str(path), validate=False)
    with TemporaryDirectory() as folder:
        if kind == "ModelExchange" and description.coSimulation is not None:
            path = _exchange_only(path, Path(folder))
        settings = _settings(description)
        ours, outcome = _simulated(path, settings)
        _say(f"\nTOLD {outcome}")
        _say(f"\nTOLD {'' if ours is None else _compared(ours, path, kind, settings)}")


def _exchange_only(path: Path, folder: Path) -> Path:
    """The FMU without its Co-Simulation."""
    with ZipFile(path) as source, ZipFile(folder / path.name, "w") as target:
        for name in source.namelist():
            content = source.read(name)
            if name == "modelDescription.xml":
                content = re.sub(rb"<CoSimulation\b([^>]*/>|.*?</CoSimulation>)", b"", content, flags=re.DOTALL)
            target.writestr(name, content)
    return folder / path.name


def _settings(description: ModelDescription) -> dict[str, Any]:
    """Begin, end, step [s] and tolerance that both take."""
    names = ("startTime", "stopTime", "stepSize", "tolerance")
    start, stop, step, tolerance = (float(getattr(description.defaultExperiment, name, None) or 0) for name in names)
    stop = stop if stop > start else start + 1.0
    step = step if (stop - start) / 1e5 < step < stop - start else (stop - start) / POINTS
    return {"start_time": start, "stop_time": stop, "step_size": step, "tolerance": tolerance or TOLERANCE}


def _simulated(path: Path, settings: dict[str, Any]) -> tuple[Result | None, str]:
    try:
        result = simulate(path, **settings)
    except IncompleteError as error:
        return error.result, _short(error, path)
    except SimulationError as error:
        return None, _short(error, path)
    end = result.time[-1] if result.time.size else settings["start_time"]
    ended = "" if end > settings["stop_time"] - settings["step_size"] / 2 else f", ends at t = {end:g} s"
    return result, f"{len(result.names)} signals, {len(result.time)} points{ended}"


def _compared(ours: Result, path: Path, kind: str, settings: dict[str, Any]) -> str:
    step, tolerance, *_ = settings["step_size"], settings["tolerance"]
    names = [name for name in ours.entries if ours[name].ndim == 1 and ours[name].dtype == float]
    try:
        theirs = fmpy.simulate_fmu(
            str(path),
            validate=False,
            fmi_type=kind,
            start_time=settings["start_time"],
            stop_time=settings["stop_time"],
            output_interval=step,
            relative_tolerance=tolerance,
            record_events=False,
            output=names,
        )
    except Exception as error:  # noqa: BLE001 - whatever fmpy stumbles over
        return f"fmpy: {_short(error, path)}"
    here, there = np.round(ours.time / step, 3), np.round(theirs["time"] / step, 3)
    _, mine, its = np.intersect1d(here, there, return_indices=True)
    worst, name = max(((_off(ours[name][mine], theirs[name][its]), name) for name in names), default=(0.0, ""))
    return f"{worst:.1g}" + (f" ({name})" if worst > tolerance else "")


def _off(one: np.ndarray, other: np.ndarray) -> float:
    other = other.astype(float)
    same = (one == other) | (np.isnan(one) & np.isnan(other))
    return float(
        np.max(np.where(same, 0.0, np.abs(one - other)), initial=0.0) / (np.max(np.abs(other), initial=0.0) or 1)
    )


def _short(error: Exception, path: Path) -> str:
    words = " ".join(str(error).split()).replace(f"{path.parent}/", "").replace("|", "/")
    return words if len(words) <= 120 else f"{words[:117]}..."


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    if sys.argv[3:] == [HERE]:
        tell(Path(sys.argv[1]), sys.argv[2])
    else:
        table(Path(sys.argv[1]), float(sys.argv[2]) if sys.argv[2:] else 60.0)
