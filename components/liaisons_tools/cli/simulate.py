"""``liaisons simulate``: an FMU or a system of them, its signals as a table, a file, a picture."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer.core import TyperCommand

from liaisons.base.array_names import array_and_index
from liaisons.base.files import check_writable
from liaisons.base.port_names import MISMATCH, port_names
from liaisons.base.processes import TIME_LIMIT
from liaisons.errors import SimulationError
from liaisons_tools.cli._command import (
    BalanceInertia,
    FloatingBase,
    Inputs,
    Join,
    LeaveOut,
    Limits,
    Prescribe,
    Size,
    Smoothing,
    Start,
    Starts,
    Step,
    Stop,
    Tolerance,
    add_robot_options,
    check_figure_writable,
    command,
    flag,
    option,
    print_table,
    signal_completions,
    subject_argument,
)

if TYPE_CHECKING:
    from liaisons import Result


class _Command(TyperCommand):
    """Command whose options ``--plot`` and ``--isolated`` may lack their value, which Typer does not support."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the words of a command, with default values for options that lack theirs."""
        bare = {index for index, word in enumerate([*args[1:], "-"]) if word.startswith("-")}
        alone = {"--plot": "--plot=", "--isolated": f"--isolated={TIME_LIMIT}"}
        return super().parse_args(
            ctx, [alone.get(word, word) if index in bare else word for index, word in enumerate(args)]
        )


@command(
    """
    liaisons simulate Pendulum --set theta_0=3 --stop 20 --plot
    liaisons simulate fmus/Pendulum.fmu --set length=2 --record theta,energy_balance --csv swing.csv
    liaisons simulate Pendulum --input length="1 + 0.1*sin(5*t)"
    liaisons simulate Pendulum --input motion.csv --stop 5
    liaisons simulate system.ssp --set swing.theta_0=0.1 --step 0.01
    liaisons simulate my_component.py --step 0.1 --tolerance 1e-10
    liaisons simulate OscillatorChain --size n=50
    liaisons simulate robot.urdf --prescribe shoulder --input shoulder="0.1*sin(t)" --stop 5 --step 0.01
    liaisons simulate foreign.fmu --isolated
    """,
    cls=_Command,
)
def simulate(
    fmu: Annotated[str, subject_argument("FMU|SSP|NAME|FILE.py|FILE.urdf|FILE.xml")],
    *,
    starts: Starts,
    size: Size = None,
    prescribe: Prescribe = "",
    limits: Limits = False,
    balance_inertia: BalanceInertia = False,
    floating_base: FloatingBase = False,
    leave_out: LeaveOut = "",
    start: Start = None,
    stop: Stop = None,
    step: Step = None,
    tolerance: Tolerance = None,
    inputs: Inputs,
    join: Join = "quintic",
    smoothing: Smoothing = None,
    record: Annotated[
        str,
        option("NAME,...", "show only these signals (default: outputs and inputs)", autocompletion=signal_completions),
    ] = "",
    csv: Annotated[Path | None, option("FILE", "write the signals to a file")] = None,
    plain: Annotated[bool, flag("--plain", "write the --csv file without units and notes, for FMPy")] = False,
    parquet: Annotated[Path | None, option("FILE", "write the signals to a Parquet file")] = None,
    verify: Annotated[bool, flag("--verify", "simulate again at half the step size and show the differences")] = False,
    plot: Annotated[str | None, option("[FILE]", "draw the signals (default: NAME.png)")] = None,
    diagram: Annotated[Path | None, option("FILE.svg", "draw the FMUs of a system and their connections")] = None,
    isolated: Annotated[
        float, option("[S]", "run FMUs in processes of their own, with a time limit for each call (default: 60 s)")
    ] = 0.0,
) -> int:
    """Simulate an FMU or an SSP archive, and print a summary of its signals."""
    from liaisons.results import IncompleteError, Interrupted
    from liaisons_tools.cli._subject import requested_simulation

    (fmu,) = add_robot_options(
        [fmu], prescribe, leave_out, limits=limits, balance_inertia=balance_inertia, floating_base=floating_base
    )
    names = record.split(",") if record else None
    asked = requested_simulation(
        fmu,
        *(starts, start, stop, step, tolerance),
        inputs=inputs,
        join=join,
        smoothing=smoothing,
        record=names,
        isolated=isolated,
        size=size,
    )
    if diagram:
        asked.system.diagram(diagram)
        print(f"diagram: {diagram}")
    figure = None if plot is None else Path(plot or f"{asked.system.name}.png")
    _check_writable(csv, parquet, figure)
    write = partial(_print_and_write, names=names or (), csv=csv, parquet=parquet, figure=figure, plain=plain)
    try:
        result = asked.run(progress=asked.steps > 1e4, verify=verify)
    except (IncompleteError, Interrupted) as error:
        write(error.result, f", up to t = {error.result.time[-1]:.10g} s")
        raise
    write(result)
    return 0


def _print_and_write(
    result: Result,
    extent: str = "",
    *,
    names: Collection[str],
    csv: Path | None,
    parquet: Path | None,
    figure: Path | None,
    plain: bool,
) -> None:
    """Print the table of a result and write its files.

    :param extent: words for a result that ends early; ``names``: signals that were asked for.
    """
    shown, contradictions = _without_mismatches(result, names)
    print_table(shown.summary())
    for line in contradictions:
        print(line)
    for title, file, save in (
        ("signals", csv, lambda path: shown.to_csv(path, plain=plain)),
        ("signals", parquet, shown.to_parquet),
        ("figure", figure, lambda path: shown.plot(path=path)),
    ):
        if file:
            save(file)
            print(f"{title}: {file}{extent}")


def _without_mismatches(result: Result, requested: Collection[str]) -> tuple[Result, list[str]]:
    """Result without mismatches that were not requested, and a line of text for each of these that is not 0."""
    rows, lines = [], []
    for row, name in enumerate(result.names):
        base = array_and_index(name)[0]
        if name in requested or not base.endswith(MISMATCH):
            rows.append(row)
        elif (late := abs(result.values[row]).nonzero()[0]).size:
            value, rate, acceleration, *_ = port_names(base.removesuffix(MISMATCH))
            largest, first = abs(result.values[row]).max(), result.time[late[0]]
            lines.append(
                f"{value}, {rate} and {acceleration} contradict each other: {name} is up to {largest:.6g} "
                f"{result.units[name]}, for the first time at t = {first:.6g} s"
            )
    names = tuple(result.names[row] for row in rows)
    units = {name: result.units[name] for name in names}
    errors = None if result.errors is None else result.errors[rows]
    return replace(result, names=names, values=result.values[rows], units=units, errors=errors), lines


def _check_writable(csv: Path | None, parquet: Path | None, figure: Path | None) -> None:
    """Raise a SimulationError for files that cannot be written."""
    for path in filter(None, (csv, parquet)):
        check_writable(path)
    if parquet and find_spec("pyarrow") is None:
        raise SimulationError(f"{parquet}: Parquet needs PyArrow; pip install 'liaisons[parquet]'")
    check_figure_writable(figure)
