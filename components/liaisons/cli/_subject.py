"""FMU or system of a command-line argument, and its simulation."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from liaisons import ssp
from liaisons.base.array_names import array_and_index
from liaisons.base.knots import Join
from liaisons.base.project import ProjectError, load_module
from liaisons.cli._inputs import PrescribedInputs, prescribed_inputs, span_of_tables
from liaisons.cosim import System
from liaisons.cosim.description.fmu import Fmu
from liaisons.cosim.messages import logger
from liaisons.cosim.structure.simulation import Simulation, SimulationSettings, checked_simulation, variable_reference
from liaisons.library import fmu_file, fmu_path

MISMATCH = "_mismatch"
_SPAN, _STEPS = 1.0, 1000  # [s] and their number, of an archive that says nothing, nor do its FMUs


def resolved_subject(word: str, starts: Iterable[Any], size: Any = None) -> tuple[Path | System, dict[str, Any]]:
    """FMU or system of a command-line argument, and the start values that remain to be set.

    :param size: --size, of a component.
    :raises ProjectError: if there is no such thing.
    """
    start_values = dict(starts)
    if size:
        return fmu_path(word, **dict([size])), start_values
    if word.lower().endswith(".ssp"):
        return ssp.read(word, System, start_values), {}
    return declared_system(word) or fmu_file(word), start_values


def declared_system(word: str) -> System | None:
    """System called NAME in a file, for a word ``FILE.py:NAME``; None for any other word."""
    file, separator, name = word.rpartition(".py:")
    system = getattr(load_module(Path(f"{file}.py")), name, None) if separator else None
    return system if isinstance(system, System) else None


def subject_simulation(
    word: str,
    starts: Sequence[Any],
    *span: float | None,
    inputs: Iterable[str],
    join: Join = "quintic",
    record: list[str] | None = None,
    isolated: float = 0.0,
    size: Any = None,
) -> tuple[System, Simulation]:
    """System of a command-line argument, and its simulation as the options describe it.

    The files of an archive are deleted with its system.

    :param span: --start, --stop, --step and --tolerance, None where they are not given.
    :param inputs: --input, and ``join`` --join.
    :param record: signals besides :func:`mismatch_names`; outputs and inputs if None.
    :param isolated: each FMU in a process of its own, where a call may take so long [s]; 0: in this one.
    :param size: --size, of a component.
    """
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
    system.filled()
    experiment = ssp.effective_experiment(system, begin, stop, step)
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
    driven = prescribed_inputs(system, inputs, begin, end, single=single, join=join)
    _refuse_ignored_starts(system, dict(starts), driven, single=single)
    for owner, operators in driven.operators.items():
        system.prescribe(owner, operators)
    parts = {name: part.isolated_copy(isolated) if isolated else part for name, part in system.parts.items()}
    watched = [
        name if single else f"{owner}.{name}" for owner, part in parts.items() for name in mismatch_names(part.fmu)
    ]
    settings = SimulationSettings(
        start_time=begin,
        stop_time=end,
        step_size=size,
        tolerance=own.tolerance if tolerance is None else tolerance,
        record=record,
        inputs=driven.functions,
    )
    asked = checked_simulation(system.name, parts, system.connections, settings, single=single, also=watched)
    return system, asked


def _refuse_ignored_starts(system: System, starts: Iterable[str], driven: PrescribedInputs, *, single: bool) -> None:
    """Raise a ProjectError for a start value of a variable that --input moves."""
    variables = [
        variable_reference(system.name, system.parts, "input", name, single=single) for name in driven.functions
    ]
    variables += [(owner, port) for owner, operators in driven.operators.items() for port in operators]
    for owner, variable in variables:
        port = system.parts[owner][variable]
        for moved in port.triple() or [port]:
            name = moved.name if single else str(moved)
            if name in starts:
                raise ProjectError(f"--set {name}: --input {variable} says where it begins, too; leave one out")


def mismatch_names(fmu: Fmu) -> list[str]:
    """Names of the local variables that measure how far σ, σ̇ and σ̈ of inputs contradict each other."""
    inputs = {name for port in fmu.reals("input") for name in (port, array_and_index(port)[0])}
    names: list[str] = []
    for name in fmu.reals("local"):
        base, _ = array_and_index(name)
        value = f"{base.removesuffix(MISMATCH)}{name[len(base) :]}"
        if base.endswith(MISMATCH) and value in inputs and fmu.terminals.port(value):
            names.append(name)
    return names
