"""FMU or system of a command-line argument, and its simulation."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, final

from liaisons import Result, System, fmu_path, simulate
from liaisons.base.arguments import shown
from liaisons.base.knots import Join
from liaisons.base.logs import logger
from liaisons.base.project import ProjectError, load_module
from liaisons.errors import InvalidValueError
from liaisons.library import fmu_file
from liaisons_exchange import ssp
from liaisons_tools.cli._inputs import PrescribedInputs, input_port, prescribed_inputs, span_of_tables

_SPAN, _STEPS = 1.0, 1000  # [s] and their number, of an archive that says nothing, nor do its FMUs


@final
@dataclass(frozen=True)
class RequestedSimulation:
    """Simulation of a system, or of one FMU, whose signals have no prefix, as the options of a command describe it.

    The files of an archive are deleted with its system.

    :param system: with the operators of --input.
    :param settings: of ``simulate``.
    :param fmu: the one FMU, and ``start_values`` its start values and operators.
    :param isolated: each FMU in a process of its own, where a call may take so long [s]; 0: in this one.
    """

    system: System
    settings: Mapping[str, Any]
    fmu: Path | None = None
    start_values: Mapping[str, Any] | None = None
    isolated: float = 0.0

    @property
    def steps(self) -> float:
        """Number of communication steps, about."""
        size = self.settings["step_size"]
        return (self.settings["stop_time"] - self.settings["start_time"]) / size if size else math.inf

    def run(self, **options: Any) -> Result:
        """Run it, with further settings of ``simulate``."""
        settings = {**self.settings, **options}
        if self.fmu is None:
            return self.system.isolated_copy(self.isolated).simulate(**settings)
        return simulate(self.fmu, isolated=self.isolated, start_values=self.start_values, **settings)


def resolved_subject(word: str, starts: Iterable[Any], size: Any = None) -> tuple[Path | System, dict[str, Any]]:
    """FMU or system of a command-line argument, and the start values that remain to be set.

    :param size: --size, of a component.
    :raises ProjectError: if there is no such thing.
    """
    start_values = dict(starts)
    if size:
        return fmu_path(word, **dict([size])), start_values
    if word.lower().endswith(".ssp"):
        return System.from_ssp(word, start_values), {}
    return declared_system(word) or fmu_file(word), start_values


def declared_system(word: str) -> System | None:
    """System called NAME in a file, for a word ``FILE.py:NAME``; None for any other word."""
    file, separator, name = word.rpartition(".py:")
    system = getattr(load_module(Path(f"{file}.py")), name, None) if separator else None
    return system if isinstance(system, System) else None


def _end_and_step_size(
    word: str, system: System, begin: float, stop: float | None, step: float | None, *, single: bool
) -> tuple[float, float]:
    """End and step size [s]: given ones, else those of the experiment; a system that has none takes usual ones."""
    system.filled()
    experiment = ssp.effective_experiment(replace(system.document, experiment=system.experiment), begin, stop, step)
    end, size = experiment.stop_time, experiment.step_size
    if end is None or size is None:
        if single:
            raise ProjectError(f"{Path(word).name} does not say when to end, or by which steps; add --stop and --step")
        end = begin + _SPAN if end is None else end
        size = (end - begin) / _STEPS if size is None else size
        words = (
            "%s does not say when to end, or by which steps: taken for %.4g s and %.4g s; --stop and --step say more"
        )
        logger.warning(words, Path(word).name, end, size)
    return end, size


def requested_simulation(
    word: str,
    starts: Sequence[Any],
    *span: float | None,
    inputs: Iterable[str],
    join: Join = "quintic",
    smoothing: float | None = None,
    record: list[str] | None = None,
    isolated: float = 0.0,
    size: Any = None,
) -> RequestedSimulation:
    """Simulation of a command-line argument as the options describe it.

    :param span: --start, --stop, --step and --tolerance, None where they are not given.
    :param inputs: --input, ``join`` --join, ``smoothing`` --smoothing.
    :param record: signals besides mismatches; outputs and inputs if None.
    :param isolated: as :class:`RequestedSimulation` has it.
    :param size: --size, of a component.
    """
    if not 0 <= isolated < math.inf:
        raise InvalidValueError(f"--isolated = {shown(isolated)}: give True, or the seconds that a call may take")
    subject, rest = resolved_subject(word, starts, size)
    if single := not isinstance(subject, System):
        system = System(subject.stem)
        system.experiment = system.add(subject.stem.replace(".", "_"), subject, start_values=rest).fmu.experiment
    elif rest:
        raise ProjectError(f"{word}: start values of a system are given where its FMUs are added")
    else:
        system = subject
    own = system.experiment
    start, stop, step, tolerance = span
    begin = (own.start_time or 0.0) if start is None else start
    inputs = list(inputs)
    given = span_of_tables(inputs) if start is None else None
    if given and given[0] > begin:  # the clock begins where the table begins
        begin, stop = given[0], given[1] if stop is None else stop
    end, size = _end_and_step_size(word, system, begin, stop, step, single=single)
    driven = prescribed_inputs(system, inputs, begin, end, single=single, join=join, smoothing=smoothing)
    _refuse_ignored_starts(system, dict(starts), driven, single=single)
    for owner, operators in driven.operators.items():
        system.prescribe(owner, operators)
    settings = {
        "start_time": begin,
        "stop_time": end,
        "step_size": size,
        "tolerance": own.tolerance if tolerance is None else tolerance,
        "record": _recorded(system, record, isolated, single=single),
        "inputs": driven.functions,
    }
    if isinstance(subject, System):
        return RequestedSimulation(system, settings, isolated=isolated)
    prescribed = {port: operator for operators in driven.operators.values() for port, operator in operators.items()}
    return RequestedSimulation(system, settings, subject, {**rest, **prescribed}, isolated)


def _recorded(system: System, record: list[str] | None, isolated: float, *, single: bool) -> list[str] | None:
    """Names to be recorded: those that were asked for, or outputs and inputs, and mismatches; None for the default."""
    parts = {name: part.isolated_copy(isolated) if isolated else part for name, part in system.parts.items()}
    mismatches = [
        name if single else f"{owner}.{name}" for owner, part in parts.items() for name in part.fmu.mismatches
    ]
    if record is None and mismatches:
        every = list(parts.items())[: 1 if single else None]
        usual = [(owner, name) for owner, part in every for name in part.fmu.recorded(part.transferable_types)]
        record = [name if single else f"{owner}.{name}" for owner, name in usual]
    return None if record is None else [*record, *mismatches]


def _refuse_ignored_starts(system: System, starts: Iterable[str], driven: PrescribedInputs, *, single: bool) -> None:
    """Raise a ProjectError for a start value of a variable that --input moves."""
    ports = [input_port(system, name, single=single) for name in driven.functions]
    ports += [system.parts[owner][port] for owner, operators in driven.operators.items() for port in operators]
    for port in ports:
        for moved in port.triple() or [port]:
            name = moved.name if single else str(moved)
            if name in starts:
                raise ProjectError(f"--set {name}: --input {port.name} says where it begins, too; leave one out")
