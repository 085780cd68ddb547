"""Invariants of the default experiment of any FMU."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from fmpy.validation import validate_fmu

from liaisons.base.archive import DESCRIPTION, Archive
from liaisons.check.comparison import compare
from liaisons.check.verdicts import Verdict, verdict
from liaisons.cosim import SystemComponent, simulate, start
from liaisons.fmu_files import Fmu, experiment_problems

if TYPE_CHECKING:
    from liaisons.results import Result

_ROUNDING = 1e-12
"""Rounding error of a sum that is 0, relative to the largest signal."""
_MOST_VALIDATED = 2**23
"""Size of the largest model description that is validated [B]; its validator takes some fifty times as much."""


def check_fmu(path: Path | str) -> Iterator[Verdict | str]:
    """Yield verdicts on an FMU of any tool, and the findings of its validator as text.

    The claims are: its model description is valid; its default experiment can be simulated; half the communication step
    gives the same signals; the energy balance closes, if there is one; and a step that is rolled back is repeated to
    the bit::

        verdicts = [report for report in check_fmu("Pendulum.fmu") if isinstance(report, Verdict)]

    :raises SimulationError: if it cannot be read, or refuses its default experiment.
    """
    path = Path(path)
    part = SystemComponent.read(path.stem, path, {})
    with Archive(path) as archive:
        size = archive.unpacked_size(DESCRIPTION)
    if size > _MOST_VALIDATED:
        yield f"{DESCRIPTION} has {size} bytes; fmpy's validator would need too much memory and is left out"
    else:
        yield from (problems := [*validate_fmu(str(path)), *experiment_problems(path)])
        claim = "fmpy's validator finds no problem, and the default experiment can be simulated"
        yield verdict(claim, error=len(problems), tolerance=0)
    yield from _run_verdicts(part)


def _run_verdicts(part: SystemComponent) -> Iterator[Verdict]:
    """Yield verdicts on runs of the default experiment."""
    fmu = part.fmu
    stop_time = fmu.experiment.stop_time or 1.0
    steps = max(2, round(stop_time / (fmu.experiment.step_size or stop_time / 100)))
    step_size = stop_time / steps
    tolerance = fmu.experiment.tolerance or 1e-6  # what FMI tools take where nothing is said
    hidden = fmu.mismatches
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


def _roll_back_difference(fmu: Fmu, step_size: float, tolerance: float) -> float | None:
    """Largest difference between two steps and their repetition after a roll-back; None if it has no roll-back."""
    outputs = fmu.reals("output")
    if not (fmu.can_get_and_set_state and outputs):
        return None
    seen: list[float] = []
    with start(fmu.path, 3 * step_size, step_size, tolerance=tolerance, record=outputs) as run:
        run.step()
        before = run.save()  # the history of solver and inputs has to come back, too
        for _ in range(2):
            run.restore(before)
            run.step()
            run.step()
            seen += [run[name] for name in outputs]
    first, second = np.split(np.array(seen), 2)
    return float(np.max(np.abs(first - second)))


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
