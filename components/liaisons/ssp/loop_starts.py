"""Start values of inputs that solve algebraic loops: masters hand values on once or twice before the first step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from liaisons.base.logs import logger
from liaisons.cosim.running.run import performed
from liaisons.cosim.structure.checks import ConnectionGraph
from liaisons.cosim.structure.components import SystemComponent
from liaisons.cosim.structure.connections import Connection
from liaisons.cosim.structure.simulation import SimulationSettings, checked
from liaisons.errors import SimulationError

_SHORT = 1e-6
"""A step [s] that is not looked at: a run has one at least."""


def with_solved_loops(
    name: str, parts: Mapping[str, SystemComponent], connections: Sequence[Connection], start_time: float
) -> dict[str, SystemComponent]:
    """Components whose inputs in algebraic loops start from the solution of the loops.

    :param name: of the system.
    :param start_time: [s].
    """
    graph = ConnectionGraph(parts, connections, ())
    if not graph.loops:
        return dict(parts)
    settings = SimulationSettings(times=(start_time, start_time + _SHORT))
    try:
        result = performed(checked(name, parts, connections, settings))
    except SimulationError as error:
        logger.warning("%s: its algebraic loops are not solved at the start, for it cannot be run: %s", name, error)
        return dict(parts)
    starts = {owner: dict(part.starts) for owner, part in parts.items()}
    for owner, variable in (connection.target.place for connection in connections):
        if owner in graph.cyclic and not parts[owner].fmu.variables.whole(variable):
            starts[owner][variable] = float(result[f"{owner}.{variable}"][0])
    return {owner: replace(part, starts=starts[owner]) for owner, part in parts.items()}
