"""Sweeps: many cases of one FMU or system, simulated in parallel."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

import liaisons
from liaisons.base.arguments import as_path, check_integer, check_positive, name_dictionary
from liaisons.base.arrays import Floats
from liaisons.base.logs import Warnings, logger, progress_bar
from liaisons.cosim import Coupling, Settings, System, SystemDocument, VariableReference, checked_simulation
from liaisons.errors import SimulationError, SweepError
from liaisons.results import Result
from liaisons_tools.sweeps import cluster
from liaisons_tools.sweeps.cases import checked_cases
from liaisons_tools.sweeps.journal import Journal
from liaisons_tools.sweeps.measures import Measures, checked_measures, signal_and_kind
from liaisons_tools.sweeps.study import Completed, Failure, Outcomes, Study
from liaisons_tools.sweeps.workers import simulate_locally


def sweep(
    subject: Path | str | type[Any] | System,
    cases: Mapping[str, ArrayLike],
    keep: str | Iterable[str] | Measures,
    *,
    stop_time: float | None = None,
    step_size: float | None = None,
    start_time: float | None = None,
    times: ArrayLike | None = None,
    tolerance: float | None = None,
    coupling: Coupling | None = None,
    start_values: Mapping[str, float | bool | str] | None = None,
    record: str | Iterable[str] | None = None,
    journal: Path | str | None = None,
    retry: bool = False,
    time_limit: float | None = None,
    workers: int | None = None,
    client: Any = None,
    progress: bool = False,
) -> Result:
    """Simulate an FMU or a system for many cases, on all cores of this machine or on a Dask cluster.

    ::

        table = sweep("Pendulum", grid({"theta_0": np.linspace(0.1, 3, 50), "length": [0.5, 1.0]}),
                      keep=["theta", "theta:max"], stop_time=10.0)

    A case gives the same numbers, bit by bit, in any order and on any machine, if the FMU itself does.  A case that
    fails is recorded, and the others continue.  A failure of the model is final; after a failure of the machine (no
    memory, a full disk, a killed process, the time limit) the case is simulated again at the next start with the same
    journal.

    FMUs and functions in ``keep`` are code that runs here, and on the workers of a cluster; everyone who can reach a
    Dask scheduler can run code there, too.  Take FMUs and functions only from people you trust.

    :param subject: path of an FMU; or a component by its name, file or class; or a system.
    :param cases: :func:`grid`, :func:`sample`, or columns of values, by names of parameters and inputs:
        ``"theta_0"`` of an FMU, ``"swing.theta_0"`` of a system.
    :param keep: values at the end, ``"theta"``, or extrema over the communication points, ``"theta:max"``,
        ``"theta:min"``, one or several; or name -> one of these or a function of the :class:`liaisons.Result`.
    :param stop_time: end [s]; this and the next four as in :func:`liaisons.simulate`.
    :param coupling: as in :meth:`liaisons.System.simulate`.
    :param start_values: start values that all cases have in common.
    :param record: signals that functions in ``keep`` can read; outputs and inputs if None.
    :param journal: a file that finished cases are written to; those in it already are not simulated again.
    :param retry: simulate again also the cases that the model has refused.
    :param time_limit: longest time that a case may take [s], the loading of its FMUs included; what takes longer is
        ended and counts as not finished.  There is none by default.
    :param workers: number of processes; one a core if None.
    :param client: a ``distributed.Client``, or the address of its scheduler, in place of processes.
    :param progress: show a progress bar on stderr.
    :raises SimulationError: for an unknown name, with the nearest match, or a value that cannot be set.
    :raises SweepError: if nothing is varied or kept, a setting is invalid, or a scheduler does not answer.
    :raises JournalError: if the journal belongs to another sweep, is in use by one, or has a line of another sweep.
    """
    _check_settings(workers, client, time_limit, retry=retry, journal=journal)
    study = _checked_study(
        subject,
        checked_cases(cases),
        checked_measures(keep),
        name_dictionary("start_values", {} if start_values is None else start_values, SweepError),
        stop_time=stop_time,
        step_size=step_size,
        start_time=start_time,
        times=times,
        tolerance=tolerance,
        coupling=coupling,
        record=record,
    )
    shape = study.count, len(study.keep)
    book = (
        nullcontext()
        if journal is None
        else Journal(as_path("journal", journal), study.journal_key(), *shape, retry=retry)
    )
    with book as opened:
        outcomes: Outcomes = {} if opened is None else dict(opened.done)
        remaining = [case for case in range(study.count) if case not in outcomes]
        title = study.simulation.title if progress and remaining else ""
        with progress_bar(title, "{:.0f} of {:.0f} cases", len(outcomes), study.count) as show:

            def deliver(finished: Outcomes) -> None:
                outcomes.update(finished)
                if opened is not None:
                    opened.add(finished)
                show(len(outcomes))

            if remaining and client is None:
                simulate_locally(study, remaining, workers or os.cpu_count() or 1, deliver, time_limit)
            elif remaining:
                with cluster.connected_client(client) as connection:
                    cluster.simulate_on_cluster(study, remaining, connection, deliver, time_limit)
    return _result_table(study, outcomes)


def _check_settings(
    workers: int | None, client: Any, time_limit: float | None, *, retry: bool, journal: Path | str | None
) -> None:
    """Raise a SweepError for settings that are invalid or exclude each other."""
    if workers is not None and client is not None:
        raise SweepError(f"workers = {workers!r} are processes of this machine; leave it out on a Dask cluster")
    if workers is not None:
        check_integer("workers", workers, SweepError)
    if time_limit is not None:
        check_positive("time_limit", time_limit, SweepError)
    if retry and journal is None:
        raise SweepError(
            "retry needs the journal of the sweep, where its failures are; give its file by journal or --journal"
        )


def _checked_study(
    subject: Path | str | type[Any] | System,
    cases: Mapping[str, Floats],
    keep: Measures,
    starts: Mapping[str, float | bool | str],
    *,
    stop_time: float | None,
    step_size: float | None,
    **settings: Unpack[Settings],
) -> Study:
    """Study of a sweep, with checked names, settings, and start values of the first case."""
    _check_names(cases, keep, starts)
    if not isinstance(subject, liaisons.System):  # the public class, which knows components by their names
        document = SystemDocument.of_fmu(subject, starts)
    elif starts:
        raise SweepError(f"{subject.name}: start_values are for a single FMU; give them to add()")
    else:
        document = subject.document.filled()
    signals = [signal_and_kind(measure)[0] for measure in keep.values() if isinstance(measure, str)]
    if settings.get("record") is None and len(signals) == len(keep):  # else functions can read all outputs and inputs
        settings["record"] = ()
    simulation = checked_simulation(document, stop_time, step_size, also=signals, **settings)
    parts = document.parts

    def scalar(name: str) -> VariableReference:
        """Component and variable of a name; a SimulationError for an array."""
        owner, variable = document.reference("the sweep of", name)
        if variable not in parts[owner].fmu.variables:
            raise SimulationError(f"{owner}: {parts[owner].fmu.unknown_variable_message(variable)}")
        return owner, variable

    for name in signals:
        owner, variable = scalar(name)
        if parts[owner].fmu.variables[variable].type == "String":
            raise SweepError(f"keep {name!r}: a sweep keeps numbers, and this is a string")
    study = Study(simulation, {name: scalar(name) for name in cases}, cases, keep)
    study.case_document(0)  # refuses, before any simulation, names that cannot be set
    return study


def _check_names(cases: Iterable[str], keep: Measures, starts: Mapping[str, float | bool | str]) -> None:
    """Raise a SweepError for a name that is varied and also set, or varied and also kept."""
    for name in cases:
        if name in starts:
            raise SweepError(f"{name!r} is varied, and set for all cases; do one of them")
        if name in keep:
            raise SweepError(f"{name!r} is varied and kept; give what is kept another name, keep={{'...': {name!r}}}")


def _result_table(study: Study, outcomes: Outcomes) -> Result:
    """Result of a sweep as a table of the cases: varied values, measures, failures and warnings."""
    done = {case: outcome for case, outcome in sorted(outcomes.items()) if not isinstance(outcome, Failure)}
    measured = np.full((len(study.keep), study.count), np.nan)
    measured[:, list(done)] = np.reshape([outcome.values for outcome in done.values()], (-1, len(study.keep))).T
    parts = study.simulation.parts
    units = {name: parts[owner].fmu.variables[variable].unit for name, (owner, variable) in study.varied.items()}
    for name, measure in study.keep.items():
        units[name] = study.simulation.units[signal_and_kind(measure)[0]] if isinstance(measure, str) else ""
    failures = {case: outcome for case, outcome in outcomes.items() if isinstance(outcome, Failure)}
    return Result(
        study.simulation.title,
        np.empty(0),
        (*study.cases, *study.keep),
        np.vstack([*study.cases.values(), measured]),
        units,
        failures={case: failure.reason for case, failure in failures.items()},
        unfinished=tuple(sorted(case for case, failure in failures.items() if not failure.refused)),
        warnings=(*study.simulation.warnings, *_collect_warnings(done)),
    )


def _collect_warnings(done: Mapping[int, Completed]) -> tuple[str, ...]:
    """Log how many cases have warnings, and return all warnings with the numbers of their cases."""
    collected = Warnings()
    for case, outcome in done.items():
        for text in outcome.warnings:
            collected.add(f"case {case}: {text}")
    if collected.texts:
        count = sum(1 for outcome in done.values() if outcome.warnings)
        logger.warning("%d %s warned of: %s", count, "cases were" if count > 1 else "case was", collected.texts[0])
    return collected.texts
