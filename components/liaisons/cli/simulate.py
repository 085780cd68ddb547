"""``liaisons simulate``: an FMU or a system of them, its signals as a table, a file, a picture."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer.core import TyperCommand

from liaisons.cli._command import Start, Starts, Step, Stop, Tolerance, UnpackedLimit, command, option, several, subject
from liaisons.library import fmu_file
from liaisons.project import ProjectError

if TYPE_CHECKING:
    from liaisons.results import Result


class _Command(TyperCommand):
    """``--plot`` may stand without a file, which Typer does not know."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        bare = {place for place, word in enumerate([*args[1:], "-"]) if word.startswith("-")}
        return super().parse_args(
            ctx, [f"{word}=" if word == "--plot" and place in bare else word for place, word in enumerate(args)]
        )


@command(
    """
    liaisons simulate Pendulum --set theta_0=3 --stop 20 --plot
    liaisons simulate fmus/Pendulum.fmu --set length=2 --record theta,energy_balance --csv swing.csv
    liaisons simulate Pendulum --input length="1 + 0.1*sin(5*t)"
    liaisons simulate Pendulum --input motion.csv --stop 5
    liaisons simulate system.ssp --set swing.theta_0=0.1 --step 0.01
    liaisons simulate my_component.py --step 0.1 --tolerance 1e-10
    """,
    cls=_Command,
)
def simulate(
    fmu: Annotated[str, subject("FMU|SSP|NAME|FILE.py")],
    *,
    starts: Starts,
    start: Start = None,
    stop: Stop = None,
    step: Step = None,
    tolerance: Tolerance = None,
    _limit: UnpackedLimit = None,
    given: Annotated[
        list[str],
        several(
            "NAME=EXPRESSION|FILE.csv",
            "move an input: an expression of the time t (its rates follow), or a table with a column time and one an "
            "input, rates beside it where they are known; may be given several times",
            "--input",
        ),
    ],
    record: Annotated[str, option("NAME,...", "show only these signals (default: outputs and inputs)")] = "",
    csv: Annotated[Path | None, option("FILE", "write the signals to a file")] = None,
    parquet: Annotated[Path | None, option("FILE", "write the signals to a Parquet file")] = None,
    plot: Annotated[str | None, option("[FILE]", "draw the signals (default: NAME.png)")] = None,
) -> int:
    """Simulate an FMU or an SSP archive, and show what its signals did."""
    from liaisons import ssp
    from liaisons.cli._inputs import drives
    from liaisons.cli._mismatch import mismatches, taken_out
    from liaisons.cli._outputs import Outputs
    from liaisons.cosim import System
    from liaisons.results import IncompleteError, Interrupted

    path = Path(fmu)
    if path.suffix.lower() == ".ssp":
        system, prefix = ssp.read(path, System, dict(starts)), ""
    else:
        # A system of one: unlike keywords of simulate(), its start values may have any name (Ramp.start_time).
        path = fmu_file(fmu)
        system, prefix = System(path.stem), f"{path.stem.replace('.', '_')}."
        system.experiment = system.add(prefix[:-1], path, **dict(starts)).fmu.experiment
    own = system.experiment
    begin = (own.start_time or 0.0) if start is None else start
    span = ssp.chosen(system, begin, stop, step)
    if span.stop_time is None or span.step_size is None:
        raise ProjectError(f"{path.name} does not say when to end, or by which steps; add --stop and --step")

    figure = None if plot is None else Path(plot or f"{system.name}.png")
    outputs = Outputs(csv, parquet, figure)
    outputs.check()
    inputs = drives(system, given, prefix=prefix, start_time=begin, stop_time=span.stop_time)
    wanted = [f"{prefix}{name}" for name in record.split(",")] if record else None
    parts = system.parts.items()
    hidden = [n for part, c in parts for v in mismatches(c.fmu) if (n := f"{part}.{v}") not in (wanted or ())]
    if wanted is None:
        wanted = [f"{part}.{v}" for part, c in parts for v in c.fmu.recorded()]

    def write(result: Result, words: str = "") -> None:
        """Show it with names as the user knows them: that of a single FMU is left out."""
        units = {name.removeprefix(prefix): result.units[name] for name in result.names}
        bare = replace(result, names=tuple(units), units=units)
        shown, contradictions = taken_out(bare, [name.removeprefix(prefix) for name in hidden])
        outputs.write(shown, contradictions, words)

    try:
        result = system.simulate(
            span.stop_time,
            span.step_size,
            start_time=begin,
            tolerance=own.tolerance if tolerance is None else tolerance,
            record=[*wanted, *hidden],
            inputs=inputs,
            progress=span.stop_time - begin > 1e4 * span.step_size,
        )
    except (IncompleteError, Interrupted) as error:
        write(error.result, f", up to t = {error.result.time[-1]:.10g} s")
        raise
    write(result)
    return 0
