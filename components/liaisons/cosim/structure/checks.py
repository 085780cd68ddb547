"""Checks of a system before any FMU is loaded: coupling, capabilities of the FMUs, connections."""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, filterfalse
from operator import attrgetter
from typing import final, get_args

import numpy as np

from liaisons.base.arguments import check_choice
from liaisons.base.compiler import no_compiler_message
from liaisons.base.logs import logger
from liaisons.base.unit_definitions import SAME
from liaisons.cosim.compiled import library as compiled
from liaisons.cosim.structure import schedule
from liaisons.cosim.structure.components import INPUT_RECONSTRUCTION, Components, Port, SystemComponent
from liaisons.cosim.structure.connections import Connection, feeds_of
from liaisons.cosim.structure.schedule import Coupling, Feeds, VariableReference
from liaisons.errors import SimulationError

ITERATING = {"implicit", "waveform"}
"""Couplings that repeat steps."""


@final
@dataclass(frozen=True, eq=False)
class ConnectionGraph:
    """Graph of a system: components are nodes, connections are edges.

    :param parts: components by name.
    :param driven: inputs that functions of time feed.
    """

    parts: Components
    connections: Sequence[Connection]
    driven: Collection[VariableReference]

    @cached_property
    def feeds(self) -> Feeds:
        """Reference of each connected input -> reference of the output that feeds it."""
        return feeds_of(self.connections)

    @cached_property
    def strong_components(self) -> Sequence[Sequence[str]]:
        """Strong components, lists of names, in execution order."""
        return schedule.strong_components(self.parts, self.feeds)

    @cached_property
    def cyclic(self) -> Collection[str]:
        """Names of the components in cycles of connections."""
        cyclic: set[str] = set()
        for (target, _), (source, _) in self.feeds.items():
            if target == source:
                cyclic.add(target)
        for group in self.strong_components:
            if len(group) > 1:
                cyclic.update(group)
        return cyclic

    def inputs_without_end_value(self, coupling: Coupling) -> Mapping[VariableReference, str]:
        """Inputs whose value at the end of a step is not set when their component is stepped, and what feeds them."""
        order = [*chain.from_iterable(self.strong_components)]
        late: dict[VariableReference, str] = {}
        for input_ in schedule.late_inputs(order, self.feeds, coupling):
            late[input_] = ".".join(self.feeds[input_])
        return late | dict.fromkeys(self.driven if coupling == "jacobi" else (), "a function of time")

    @cached_property
    def algebraic_loops(self) -> Sequence[str]:
        """Algebraic loops as texts, ``"a.y -> b.u -> b.y -> a.u -> a.y"``."""
        loops = schedule.shortest_algebraic_loops(self.feeds, lambda o, i: self.parts[o[0]].fmu.depends(o[1], i[1]))
        return [" -> ".join(".".join(variable) for variable in loop) for loop in loops]


def choose_coupling(graph: ConnectionGraph, requested: Coupling | None) -> Coupling:
    """Coupling of a system: the requested one; else implicit if it reduces the error, else Gauss-Seidel.

    Implicit coupling reduces the error if a cycle has a bidirectional port, or if there are no cycles and a continuous
    signal feeds an FMU that takes input derivatives.

    :raises SimulationError: for an unknown coupling, and for one that repeats steps if an FMU in a cycle cannot, or if
        there is no C compiler.
    """
    if requested is not None:
        check_choice("coupling", requested, get_args(Coupling))
    parts, connections = graph.parts, graph.connections
    two_ways = [*filter(attrgetter("is_reaction"), connections)]
    reduces_error = two_ways or (not graph.cyclic and _reduces_error(parts, connections, graph.driven))
    if requested in ITERATING or (requested is None and reduces_error):
        hurdle = _hurdle(graph, connections if requested is None else ())
        if hurdle is None:
            return requested or "implicit"
        if requested is not None:
            raise SimulationError(
                f"coupling = {requested!r} repeats steps by compiled code, but {hurdle}; or choose "
                "coupling='gauss-seidel'"
            )
        logger.warning(
            "%s would be coupled implicitly, but %s: coupled by 'gauss-seidel', an error of first order%s",
            two_ways[0].source if two_ways else "a signal",
            hurdle,
            ", unstable where effective masses are large" if two_ways else "",
        )
    for group in graph.strong_components:
        if len(group) > 1:
            cycle = " -> ".join(group)
            logger.info("%s form a cycle: stepped in this order, so what feeds back is one step old", cycle)
    for loop in graph.algebraic_loops:
        logger.log(
            logging.WARNING if requested is None else logging.INFO,
            "algebraic loop, which explicit coupling solves by one sweep per step (unstable where its gain exceeds 1; "
            "coupling='implicit' solves it): %s",
            loop,
        )
    return requested or "gauss-seidel"


def _hurdle(graph: ConnectionGraph, connections: Iterable[Connection]) -> str | None:
    """What keeps components from repeating steps, or connections from handing values on in them; None: nothing."""
    for group in graph.strong_components:
        for name in group if len(group) > 1 else ():
            if not (fmu := graph.parts[name].fmu).can_get_and_set_state:
                return f"{name} ({fmu.path.name}) cannot go back: canGetAndSetFMUstate is false"
    for connection in connections:
        if connection.conversion != SAME:
            return f"{connection} converts values"
    return no_compiler_message() if compiled.step_library(coupled=True) is None else None


def _reduces_error(parts: Components, connections: Sequence[Connection], driven: Collection[VariableReference]) -> bool:
    """Whether implicit coupling reduces the error of a system without cycles, and can transfer all signals."""
    fed: set[str] = set()
    for connection in connections:
        signal = connection.source.variable
        if signal.type != "Real" or connection.conversion != SAME:
            return False
        if signal.continuous:
            fed.add(connection.target.part.name)
    for owner, name in driven:
        if parts[owner].fmu.variables[name].type != "Real":
            return False
        fed.add(owner)
    return any(parts[name].approximation.follows_polynomials for name in fed)


def check_signals(connections: Sequence[Connection], chosen: Coupling) -> None:
    """Check that the coupling can transfer all signals; iterations transfer reals without conversion.

    :raises SimulationError: for the first connection that it cannot transfer.
    """
    for connection in connections:
        kind = connection.source.variable.type
        for end in (connection.source, connection.target) if kind == "String" else ():
            if end.part.isolated:
                raise SimulationError(
                    f"{connection} carries strings, which isolated FMUs cannot exchange: do not isolate {end.part.name}"
                )
        if chosen in ITERATING and kind != "Real":
            raise SimulationError(
                f"coupling={chosen!r} carries reals only, but {connection.source} -> {connection.target} is of type "
                f"{kind}: choose coupling='gauss-seidel'"
            )
        if chosen in ITERATING and connection.conversion != SAME:
            raise SimulationError(
                f"coupling={chosen!r} carries values as they are, but {connection} converts them: choose "
                "coupling='gauss-seidel'"
            )


def prepare_components(graph: ConnectionGraph, chosen: Coupling) -> Components:
    """Components with the start values of ``input_reconstruction`` that the coupling needs.

    In an iteration, FMUs of liaisons that take no derivatives of inputs interpolate their inputs.  In explicit
    coupling, FMUs do whose inputs are continuous and all known at the end of a step, unless start values say otherwise.

    :raises SimulationError: if a start value forbids interpolation that the coupling needs.
    """
    parts, feeds, driven = graph.parts, graph.feeds, graph.driven
    if chosen not in ITERATING:
        # Outputs of an FMU that holds its inputs jump at each communication point.
        stepwise = {
            c.target.part.name
            for c in graph.connections
            if c.source.part.approximation.holds_by_choice or not c.source.variable.continuous
        }
        stepwise |= {name for name, variable in driven if parts[name].fmu.variables[variable].type != "Real"}
        delayed = {name for name, _ in graph.inputs_without_end_value(chosen)}
        connected = {*feeds, *driven}
        partial = {name for name, variable in connected if _unfed_ends(parts[name], variable, connected)}
        able = {name for name, _ in connected} - stepwise - delayed - partial
        return {
            name: part.interpolating_copy() if name in able and _extrapolates_by_default(part) else part
            for name, part in parts.items()
        }
    ready = dict(parts)
    for name, _ in feeds:
        part = ready[name]
        if part.approximation.method is None or part.approximation.interface != "mean value":
            continue
        if part.approximation.is_chosen and name not in graph.cyclic:
            continue
        if INPUT_RECONSTRUCTION in part.starts:
            raise SimulationError(
                f"{name}: {INPUT_RECONSTRUCTION}={part.approximation.method} cannot be coupled by {chosen!r}: this FMU "
                f"takes no derivatives of inputs; leave {INPUT_RECONSTRUCTION} out, or set 2"
            )
        ready[name] = part.interpolating_copy()
    return ready


def _extrapolates_by_default(part: SystemComponent) -> bool:
    """Whether a component extrapolates its inputs by default, not by a start value, and is not sampled."""
    return (
        not part.fmu.has_sampled_outputs and part.approximation.method == 1 and INPUT_RECONSTRUCTION not in part.starts
    )


def _unfed_ends(part: SystemComponent, name: str, fed: Collection[VariableReference]) -> list[str]:
    """Names of value, rate and acceleration of an input's port that are not among the fed inputs."""
    port = part.fmu.terminals.port(name)
    motion = (port and port.motion) or ()
    return [end for end in motion if (part.name, end) not in fed] if name in motion else []


def check_steps(
    parts: Components,
    graph: ConnectionGraph,
    times: Sequence[float],
    chosen: Coupling,
    *,
    adaptive: bool,
) -> None:
    """Check that all FMUs, prepared for the coupling, can make the communication steps.

    :raises SimulationError: for the first FMU that cannot, with the capability that it lacks.
    """
    for (name, variable), source in graph.inputs_without_end_value(chosen).items():
        if parts[name].approximation.takes_end_values:
            cure = ", or coupling='gauss-seidel'" if chosen == "jacobi" else "; the connections go round in a cycle"
            raise SimulationError(
                f"{name}: {INPUT_RECONSTRUCTION}=2 (interpolate) needs {variable} at the end of a step, but "
                f"{source} sets it later: choose {INPUT_RECONSTRUCTION}=1{cure}"
            )
    if adaptive:
        if chosen not in ITERATING and graph.algebraic_loops:
            raise SimulationError(
                f"error_tolerance cannot be kept by {chosen!r}, which solves this algebraic loop by one sweep per step "
                f"however short it is: choose coupling='implicit': {graph.algebraic_loops[0]}"
            )
        for name, part in parts.items():
            needed = ("canGetAndSetFMUstate", part.fmu.can_get_and_set_state), (_VARIABLE_STEP, part.fmu.variable_step)
            for flag in (flag for flag, is_true in needed if not is_true):
                raise SimulationError(
                    f"error_tolerance needs steps that can be repeated and vary in size, but {name} "
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


def check_input_sources(parts: Components, graph: ConnectionGraph) -> None:
    """Check that each input has one source or a start value; warn of ports of which a part is connected.

    :raises SimulationError: for an input with neither, or with two sources.
    """
    feeds = graph.feeds
    for variable in graph.driven:
        if variable in feeds:
            text = f"inputs: {'.'.join(variable)} is connected with {'.'.join(feeds[variable])} already"
            raise SimulationError(text)
    fed = {*feeds, *graph.driven}
    for name, part in parts.items():
        for variable in part.fmu.unset_inputs:
            if (name, variable) not in fed and variable not in part.starts:
                raise SimulationError(
                    f"{name}.{variable} is an input without a start value and nothing feeds it: connect it, or "
                    f"set {variable}=... where {name} is added"
                )
    for name, variable in feeds:
        part = parts[name]
        missing = [*filterfalse(part.starts.__contains__, _unfed_ends(part, variable, fed))]
        if missing and part.approximation.method != 0 and Port(part, variable).triple():
            words = "%s.%s is fed, but %s.%s is not and has to be derived: connect the whole port, or set %s=0 (hold)"
            logger.warning(words, name, variable, name, missing[0], INPUT_RECONSTRUCTION)


_VARIABLE_STEP = "canHandleVariableCommunicationStepSize"
