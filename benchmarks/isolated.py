"""Cost of a communication step of an FMU in a process of its own, beside one in this process.

    python benchmarks/isolated.py [--quick]

A pendulum, all outputs of which are recorded, alone and with an operator that sets its length: to set, to step and to
get are three messages to the other process and three answers.  By the clock on the wall, since the processes
take turns; the machine has to be idle.
"""

from __future__ import annotations

import tempfile
import time
from functools import partial
from pathlib import Path

from _measure import Row, command, interleaved

from liaisons.cosim import System
from liaisons.cosim.running.run import Run
from liaisons.cosim.structure.schedule import Coupling
from liaisons.cosim.structure.simulation import checked_simulation
from liaisons.fmu import build
from liaisons.mechanics import assemble
from liaisons.models import Pendulum, Sinusoid

H = 0.001
HERE, APART = "in this process", "isolated"


def measure(quick: bool, plots: Path) -> list[Row]:  # noqa: ARG001 - no diagram
    rounds, steps = (3, 2000) if quick else (9, 20_000)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        pendulum, sinusoid = (build(assemble(kind), Path(name), backend="native") for kind in (Pendulum, Sinusoid))
        rows = []
        cases: list[tuple[str, bool, Coupling, str]] = [
            ("a pendulum", False, "gauss-seidel", "<= 100"),
            ("a pendulum and its operator", True, "gauss-seidel", ""),
            ("a pendulum and its operator, implicit", True, "implicit", ""),
        ]
        for title, operated, coupling, asked in cases:

            def system(where: str, operated: bool = operated) -> System:
                made = System("pendulum")
                swing = made.add("swing", pendulum, isolated=where == APART)
                if operated:
                    motor = made.add("motor", sinusoid, isolated=where == APART, offset=1.0, amplitude=0.1)
                    made.connect(motor["y"], swing["length"])
                return made

            count = steps // 10 if coupling == "implicit" else steps
            runs = {where: partial(_seconds, system(where), count, coupling) for where in (HERE, APART)}
            times = interleaved(runs, rounds)
            here, apart = ([1e6 * seconds / count for seconds in times[where]] for where in (HERE, APART))
            more = [b - a for a, b in zip(here, apart, strict=True)]
            rows.append(Row.of("A communication step", f"{title}, {HERE}", here, "µs"))
            rows.append(Row.of("A communication step", f"{title}, {APART}", apart, "µs"))
            rows.append(Row.of("What isolation adds to it", title, more, "µs", asked=asked))
    return rows


def _seconds(system: System, steps: int, coupling: Coupling) -> float:
    """Of the steps alone, by the clock on the wall."""
    simulation = checked_simulation(system.document, steps * H, H, coupling=coupling)
    with Run(simulation) as run:
        run.start()
        begin = time.perf_counter()
        run.finish()
        return time.perf_counter() - begin


if __name__ == "__main__":
    command(measure)
