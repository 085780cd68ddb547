"""What is asked of a system before any FMU is touched: the coupling, what the FMUs can, what is connected."""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping, Sequence
from typing import get_args

import numpy as np

from liaisons.arguments import chosen
from liaisons.cosim.compiled import library as compiled
from liaisons.cosim.description.model_description import SAME
from liaisons.cosim.messages import logger
from liaisons.cosim.structure import schedule
from liaisons.cosim.structure.components import INPUT_RECONSTRUCTION, Port, SystemComponent
from liaisons.cosim.structure.connections import Connection
from liaisons.cosim.structure.schedule import Coupling, Feeds, VariableReference
from liaisons.errors import SimulationError

ITERATING = {"implicit", "waveform"}
"""Couplings that repeat steps."""
_NO_COMPILER = "no C compiler is found: pip install ziglang"


def coupling(
    parts: Mapping[str, SystemComponent],
    connections: Sequence[Connection],
    driven: Collection[VariableReference],
    asked: Coupling | None,
) -> Coupling:
    """The coupling that is asked for; else implicit where it gains something, else Gauss-Seidel.

    That is where a cycle has a port that goes two ways, and where something that moves feeds, outside of cycles, an FMU
    that can be told how.

    :raises SimulationError: if there is no such coupling, an FMU that would have to repeat steps cannot, or there is no
        C compiler for a coupling that repeats steps.
    """
    if asked is not None:
        chosen("coupling", asked, get_args(Coupling))
    feeds = {connection.target.place: connection.source.place for connection in connections}
    groups = schedule.groups(parts, feeds)
    cyclic = schedule.in_cycles(groups, feeds)
    cycles = [group for group in groups if len(group) > 1]
    stuck = [name for group in cycles for name in group if not parts[name].fmu.can_get_and_set_state]
    if asked in ITERATING:
        if stuck:
            raise SimulationError(
                f"coupling = {asked!r} repeats steps, but {stuck[0]} ({parts[stuck[0]].fmu.path.name}) cannot go "
                "back: its canGetAndSetFMUstate is false; choose coupling='gauss-seidel'"
            )
        if compiled.steps() is None:
            raise SimulationError(
                f"coupling = {asked!r} is made by compiled code, and {_NO_COMPILER}; or choose coupling='gauss-seidel'"
            )
        return asked
    two_ways = [connection for connection in connections if connection.back]
    hurdles = [f"{name} ({parts[name].fmu.path.name}) cannot go back (canGetAndSetFMUstate is false)" for name in stuck]
    hurdles += [f"{connection} converts values" for connection in connections if connection.conversion != SAME]
    if asked is None and (two_ways or (not cyclic and _gains(parts, connections, driven))):
        if compiled.steps() is None:
            hurdles.append(_NO_COMPILER)
        if not hurdles:
            return "implicit"
        logger.warning(
            "%s would be coupled implicitly, but %s: coupled by 'gauss-seidel', an error of first order%s",
            two_ways[0].source if two_ways else "a signal",
            hurdles[0],
            ", unstable where effective masses are large" if two_ways else "",
        )
    for group in cycles:
        logger.info("%s form a cycle: stepped in this order, what feeds back is one step old", " -> ".join(group))
    for loop in _loops(parts, feeds):
        logger.log(
            logging.WARNING if asked is None else logging.INFO,
            "algebraic loop, which explicit coupling solves by one sweep a step (unstable where its gain exceeds 1; "
            "coupling='implicit' solves it): %s",
            loop,
        )
    return asked or "gauss-seidel"


def _gains(
    parts: Mapping[str, SystemComponent], connections: Sequence[Connection], driven: Collection[VariableReference]
) -> bool:
    """Whether an FMU of ours can be told how a smooth signal moves inside a step, and iterations carry all signals."""
    if any(c.source.variable.type != "Real" or c.conversion != SAME for c in connections):
        return False
    if any(parts[owner].fmu.variables[name].type != "Real" for owner, name in driven):
        return False
    fed = {connection.target.place[0] for connection in connections if connection.source.variable.continuous}
    return any(parts[name].follows for name in {*fed, *(owner for owner, _ in driven)})


def signals(connections: Sequence[Connection], chosen: Coupling) -> None:
    """Whether the coupling can carry what is connected: iterations follow the curves of reals as they are.

    :raises SimulationError: naming a connection that it cannot.
    """
    for connection in connections:
        apart = [end.part.name for end in (connection.source, connection.target) if end.part.isolated]
        if apart and connection.source.variable.type == "String":
            raise SimulationError(
                f"{connection} hands on strings, which isolated FMUs cannot: do not isolate {apart[0]}"
            )
    for connection in connections if chosen in ITERATING else ():
        if connection.source.variable.type != "Real":
            raise SimulationError(
                f"coupling={chosen!r} carries reals only, but {connection.source} -> {connection.target} is of type "
                f"{connection.source.variable.type}: choose coupling='gauss-seidel'"
            )
        if connection.conversion != SAME:
            raise SimulationError(
                f"coupling={chosen!r} carries values as they are, but {connection} converts them: choose "
                "coupling='gauss-seidel'"
            )


def prepared(
    parts: Mapping[str, SystemComponent],
    connections: Sequence[Connection],
    driven: Collection[VariableReference],
    chosen: Coupling,
) -> Mapping[str, SystemComponent]:
    """The components as the coupling needs them.

    In an iteration, FMUs of ours that cannot be told how inputs move interpolate them.  In explicit coupling those do
    whose inputs are all known at the end of a step, and smooth, unless the user has said what they do.

    :raises SimulationError: if the user has said that one that has to interpolate does something else.
    """
    feeds = {connection.target.place: connection.source.place for connection in connections}
    if chosen not in ITERATING:
        # What a source that samples gives jumps at each communication point.
        stepwise = {
            c.target.part.name for c in connections if c.source.part.samples or not c.source.variable.continuous
        }
        stepwise |= {name for name, variable in driven if parts[name].fmu.variables[variable].type != "Real"}
        late = {name for name, _ in schedule.late_inputs(schedule.order(parts, feeds), feeds, chosen)}
        late |= {name for name, _ in driven if chosen == "jacobi"}
        known = {*feeds, *driven}
        partial = {name for name, variable in known if not _whole(parts[name], variable, known)}
        able = {name for name, _ in known} - stepwise - late - partial
        return {name: part.interpolating() if name in able and _free(part) else part for name, part in parts.items()}
    fed = {name for name, _ in feeds}
    cyclic = schedule.in_cycles(schedule.groups(parts, feeds), feeds)
    ready = dict(parts)
    for name, part in parts.items():
        if name not in fed or part.reconstruction is None or part.way != "mean":
            continue
        if part.left_alone and name not in cyclic:
            continue
        if INPUT_RECONSTRUCTION in part.starts:
            raise SimulationError(
                f"{name}: {INPUT_RECONSTRUCTION}={part.reconstruction} cannot be coupled by {chosen!r}: this FMU "
                f"takes no derivatives of inputs; leave {INPUT_RECONSTRUCTION} out, or set 2"
            )
        ready[name] = part.interpolating()
    return ready


def _free(part: SystemComponent) -> bool:
    """Whether it extrapolates its inputs, and nobody has said that it should."""
    return part.reconstruction == 1 and INPUT_RECONSTRUCTION not in part.starts


def _whole(part: SystemComponent, name: str, fed: Collection[VariableReference]) -> bool:
    """Whether the rates of an input are fed, too, if it has any."""
    triple, _ = Port(part, name).curve()
    return all(port.place in fed for port in triple or ())


def _loops(parts: Mapping[str, SystemComponent], feeds: Feeds) -> list[str]:
    """Algebraic loops, as one reads them."""
    found = schedule.algebraic_loops(feeds, lambda o, i: parts[o[0]].fmu.depends(o[1], i[1]))
    return [" -> ".join(".".join(place) for place in loop) for loop in found]


def steps(
    parts: Mapping[str, SystemComponent], feeds: Feeds, times: Sequence[float], chosen: Coupling, *, adaptive: bool
) -> None:
    """Whether all FMUs can take the steps that are planned.

    :raises SimulationError: naming the one that cannot, and what it lacks.
    """
    for name, variable in schedule.late_inputs(schedule.order(parts, feeds), feeds, chosen):
        if parts[name].interpolates:
            cure = ", or coupling='gauss-seidel'" if chosen == "jacobi" else "; the connections go round in a cycle"
            raise SimulationError(
                f"{name}: {INPUT_RECONSTRUCTION}=2 (interpolate) needs inputs at the end of a step, but "
                f"{'.'.join(feeds[name, variable])} is not known there yet: choose {INPUT_RECONSTRUCTION}=1{cure}"
            )
    if adaptive:
        loops = [] if chosen in ITERATING else _loops(parts, feeds)
        if loops:
            raise SimulationError(
                f"error_tolerance cannot be kept by {chosen!r}, which solves this algebraic loop by one sweep a step "
                f"however short it is: choose coupling='implicit': {loops[0]}"
            )
        for name, part in parts.items():
            needed = ("canGetAndSetFMUstate", part.fmu.can_get_and_set_state), (_VARIABLE_STEP, part.fmu.variable_step)
            for flag in (flag for flag, is_true in needed if not is_true):
                raise SimulationError(
                    f"error_tolerance needs steps that are taken back and differ in size, but {name} "
                    f"({part.fmu.path.name}) cannot: its {flag} is false; leave error_tolerance out"
                )
        return
    sizes = np.diff(times)
    odd = sizes[~np.isclose(sizes, sizes[0], rtol=2e-6, atol=0)]  # beyond the rounding of communication_points
    for name, part in parts.items():
        if odd.size and not part.fmu.variable_step:
            raise SimulationError(
                f"{name}: takes steps of one size only, {sizes[0]:.10g} s, and one would be {odd[-1]:.10g} s: "
                "choose a step_size that divides stop_time - start_time, or even times"
            )


def inputs(parts: Mapping[str, SystemComponent], feeds: Feeds, driven: Collection[VariableReference]) -> None:
    """Whether every input that needs a source has one, and whole ports are connected.

    :raises SimulationError: for an input without connection and without start value, or with two sources.
    """
    for place in driven:
        if place in feeds:
            raise SimulationError(f"inputs: {'.'.join(place)} is connected with {'.'.join(feeds[place])} already")
    known = {*feeds, *driven}
    for name, part in parts.items():
        for variable in part.fmu.reals("input", longest=_LONGEST):
            given = (name, variable) in known or variable in part.starts
            if not given and part.fmu.variables[variable].start is None:
                raise SimulationError(
                    f"{name}.{variable} is an input without a start value and nothing feeds it: connect it, or "
                    f"set {variable}=... where {name} is added"
                )
    for name, variable in feeds:
        triple, order = Port(parts[name], variable).curve()
        if triple and order == 0:
            missing = [end for end in triple if end.place not in known and end.name not in parts[name].starts]
            if missing and parts[name].reconstruction != 0:
                logger.warning(
                    "%s.%s is fed, but %s is not and keeps its start value: connect the whole port, or set %s=0 (hold)",
                    name,
                    variable,
                    missing[0],
                    INPUT_RECONSTRUCTION,
                )


_VARIABLE_STEP = "canHandleVariableCommunicationStepSize"
_LONGEST = 1000
"""Longer arrays are not searched for elements without a source."""
