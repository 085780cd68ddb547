"""Invariants of the default experiment of any FMU."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from ctypes import c_double
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from fmpy.validation import validate_fmu

from liaisons.base.archive import Archive
from liaisons.base.folders import temporary_folder
from liaisons.base.related_files import related_files
from liaisons.base.tables import read_table
from liaisons.base.xml_documents import read_tree
from liaisons.check import Verdict, compare, verdict
from liaisons.cli._subject import mismatch_names, subject_simulation
from liaisons.cosim import simulate
from liaisons.cosim.description.fmu import DESCRIPTION, read, read_description
from liaisons.cosim.instances import extract_fmus, make_instance
from liaisons.cosim.messages import WARNING
from liaisons.cosim.running.run import run_to_end
from liaisons.errors import LiaisonsError, SimulationError
from liaisons.ssp.assignment import parameter_quantities, value_for_variable

if TYPE_CHECKING:
    from liaisons.cosim.compiled.calls import Call
    from liaisons.cosim.description.fmu import Fmu
    from liaisons.results import Result

_ROUNDING = 1e-12
"""Rounding error of a sum that is 0, relative to the largest signal."""
_MOST_VALIDATED = 2**23
"""Bytes of a model description; its validator takes some fifty times as many."""


def invariants(path: Path) -> Iterator[Verdict | str]:
    """Yield verdicts on an FMU, and what its validator finds as text.

    :raises SimulationError: if it cannot be read, or refuses its default experiment.
    """
    fmu = read(path)
    with Archive(path) as archive:
        size = archive.unpacked_size(DESCRIPTION)
    if size > _MOST_VALIDATED:
        yield f"{DESCRIPTION} has {size} bytes; fmpy's validator would need too much memory and is left out"
    else:
        yield from (problems := [*validate_fmu(str(path)), *_experiment_problems(path)])
        claim = "fmpy's validator finds no problem, and the default experiment can be simulated"
        yield verdict(claim, error=len(problems), tolerance=0)
    yield from _run_verdicts(fmu)
    yield from _reference_verdicts(fmu)


def _experiment_problems(path: Path) -> Iterator[str]:
    """Yield what is wrong with the default experiment, beyond FMI's schema."""
    experiment = read_description(path).experiment
    names = "startTime", "stopTime", "stepSize", "tolerance"
    values = {name: float(experiment[name]) for name in names if name in experiment}
    start = values.pop("startTime", 0.0)
    for name, value in values.items():
        least = start if name == "stopTime" else 0.0
        if not least < value < float("inf"):
            yield f"DefaultExperiment: {name} = {value:g}: it must be a number > {least:g}"


def _run_verdicts(fmu: Fmu) -> Iterator[Verdict]:
    """Yield verdicts on runs of the default experiment."""
    stop_time = fmu.experiment.stop_time or 1.0
    steps = max(2, round(stop_time / (fmu.experiment.step_size or stop_time / 100)))
    step_size = stop_time / steps
    tolerance = fmu.experiment.tolerance or 1e-6  # what FMI tools take where nothing is said
    hidden = mismatch_names(fmu)
    record = [*fmu.recorded(), *hidden]
    coarse, fine = (
        simulate(fmu.path, stop_time=stop_time, step_size=h, tolerance=tolerance, record=record)
        for h in (step_size, step_size / 2)
    )
    if hidden:
        yield verdict(
            "no prescribed coordinate contradicts its rate and acceleration",
            error=max(float(np.max(np.abs(run[name]))) for run in (coarse, fine) for name in hidden),
            tolerance=0,
        )
    yield verdict("all signals are finite", error=int(np.count_nonzero(~np.isfinite(fine.values))), tolerance=0)
    difference, location = _relative_difference(coarse, fine)
    # Local errors of the solver add up over the run and are amplified; a factor of 1000 leaves room for both.
    yield verdict(
        f"communication steps of {step_size:g} and {step_size / 2:g} s agree beside the largest of each unit{location}",
        error=difference,
        tolerance=1e3 * tolerance,
    )
    if "energy_balance" in fine.names:
        scale = sum(np.max(np.abs(fine[name])) for name in ("kinetic_energy", "potential_energy", "work"))
        lost = " - impact_loss" if "impact_loss" in fine.names else ""
        yield verdict(
            f"energy = energy at start + work - dissipated{lost}",
            error=np.max(np.abs(fine["energy_balance"])),
            tolerance=10 * tolerance * scale * stop_time,
            unit="J",
        )
    repeated = _roll_back_difference(fmu, step_size, tolerance)
    if repeated is not None:
        yield verdict("a step that is rolled back and repeated gives the same bits", error=repeated, tolerance=0)


def _reference_verdicts(fmu: Fmu) -> Iterator[Verdict | str]:
    """Yield a verdict on each table of reference results in the FMU, by a run that has to reproduce it."""
    with Archive(fmu.path) as archive, temporary_folder() as folder:
        try:
            files = related_files(archive)
            for file in files:
                archive.copy(file.member, folder / file.member)
            for result in files:
                if (result.role, result.type) == ("result", "text/csv"):
                    beside = {file.role: folder / file.member for file in files if file.labels == result.labels}
                    yield _reference_verdict(fmu, folder / result.member, beside)
        except (LiaisonsError, ValueError, LookupError) as error:
            yield f"reference results are left out: {error}"


def _reference_verdict(fmu: Fmu, results: Path, files_by_role: Mapping[str, Path]) -> Verdict:
    """Verdict on a table of reference results.

    :param files_by_role: files of the same labels, with parameters and inputs of the run.
    """
    table = read_table(results, SimulationError)
    rows = zip(*table.cells, strict=True)
    times, *columns = np.transpose([[float(x) for cell in row for x in cell.split()] for row in rows])
    names = [name for column in table.names[1:] for name in fmu.elements(column)]
    starts = []
    if "parameter" in files_by_role:
        with files_by_role["parameter"].open("rb") as file:
            starts = [
                (name, value_for_variable(name, fmu, name, quantity))
                for name, quantity in parameter_quantities(read_tree(file))
            ]
    inputs = [str(files_by_role["testcase"])] if "testcase" in files_by_role else []
    tolerance = fmu.experiment.tolerance or 1e-6
    span = times[0], times[-1], times[1] - times[0], tolerance
    run = run_to_end(subject_simulation(str(fmu.path), starts, *span, inputs=inputs, record=names)[1])
    expected = zip(names, columns, strict=True)
    error = max(np.max(np.abs(run[name] - column)) / (np.max(np.abs(column)) or 1) for name, column in expected)
    claim = f"results as in {results.name} beside the largest of each column"
    return verdict(claim, error=error, tolerance=1e3 * tolerance)  # as for halved steps


def _relative_difference(coarse: Result, fine: Result) -> tuple[float, str]:
    """Largest difference relative to the largest signal of the same unit, and in words its signal and time.

    A balance is small, not imprecise.  Where all signals of a unit are small beside the motion's size in other units,
    rounding of these is what differs.  Strings differ by 1 or not at all.
    """
    differences = compare(coarse, fine).differences
    scales: dict[str, float] = {}
    for difference in differences:
        if difference.name not in coarse.texts:
            scales[difference.unit] = max(scales.get(difference.unit, 0.0), difference.scale)
    least = _ROUNDING * max(scales.values(), default=0.0)
    worst, location = 0.0, ""
    for difference in differences:
        scale = 1.0 if difference.name in coarse.texts else max(scales[difference.unit], least) or 1.0
        if not difference.maximum / scale <= worst:
            worst = difference.maximum / scale
            location = f", at worst {difference.name} at t = {difference.at:.6g} s"
    return worst, location


def _roll_back_difference(fmu: Fmu, step_size: float, tolerance: float) -> float | None:
    """Largest difference between two steps and their repetition after a roll-back; None if it has no roll-back."""
    outputs = [fmu.variables[name] for name in fmu.reals("output")]
    if not (fmu.can_get_and_set_state and outputs):
        return None
    seen = (c_double * len(outputs))()
    time, size = c_double(0.0), c_double(step_size)
    results = []
    with (
        temporary_folder() as folder,
        make_instance(fmu.path.stem, fmu, extract_fmus([fmu], folder)[fmu.path]) as instance,
    ):
        instance.initialize({}, tolerance, 0.0, 3 * step_size)
        instance.exit_initialization()
        save, restore = instance.save_and_restore_calls()
        step, get = instance.stepper(time, size), instance.getter(outputs, seen)

        def call_or_raise(*calls: Call) -> None:
            """Call functions of the FMU, and raise an error if one fails."""
            for call in calls:
                status = call()
                if status and status > WARNING:
                    raise instance.failure(call.action, status, " in the roll-back")

        call_or_raise(step, save)  # the history of solver and inputs has to come back, too
        for _ in range(2):
            call_or_raise(restore)
            for number in (1, 2):
                time.value = number * step_size
                call_or_raise(step)
            call_or_raise(get)
            results.append(np.array(seen))
    return float(np.max(np.abs(results[0] - results[1])))
