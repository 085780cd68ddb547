"""Scalar connections between two ports: terminals whose members have equal names, arrays, or single variables.

A coordinate is one port with two causalities, and so is a component of a named point, in the names of our FMUs::

    mover                                   moved
    q, q_dot, q_ddot         ------->       s, s_dot, s_ddot        outputs onto inputs
    q_load                   <-------       s_force                 if both have it
    q_impulse                <-------       s_impulse               likewise

The mover is a free coordinate ``q``, a component ``P_x`` of a named point ``P``, or a signal ``y``, which has no load;
an active coordinate ``s`` is moved.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from itertools import starmap
from typing import Literal, final

from liaisons.base.unit_definitions import SAME, Conversion
from liaisons.cosim.structure.components import Port
from liaisons.cosim.structure.schedule import VariableReference
from liaisons.errors import ConnectError
from liaisons.fmu_files import RECORDED, Scalar, TerminalDescription, integer_range

_NONE = TerminalDescription("")


@final
@dataclass(frozen=True, slots=True)
class Connection:
    """Scalar connection of an output with an input, which is factor * output + offset."""

    source: Port
    target: Port
    conversion: Conversion = SAME

    @classmethod
    def between(
        cls, first: Port, second: Port, conversion: Conversion | None = None, *, sums_to_zero: bool = False
    ) -> Connection:
        """Connection of two scalars, in either order.

        :param conversion: from output to input; if None, that of their units.
        :param sums_to_zero: whether the input is that times -1, as of flows.
        :raises ConnectError: if they do not fit; the message names both.
        """
        turned = (first.variable.causality, second.variable.causality) == ("input", "output")
        source, target = (second, first) if turned else (first, second)
        causalities = source.variable.causality, target.variable.causality
        if causalities != ("output", "input"):
            hint = "; a parameter is set where its component is added" if "parameter" in causalities else ""
            raise ConnectError(
                f"{source} ({causalities[0]}) and {target} ({causalities[1]}) cannot be connected: "
                f"one end must be an output, the other an input{hint}"
            )
        if not _is_assignable(source.variable, target.variable):
            kinds = [v.type if v.type == "Enumeration" else v.base for v in (source.variable, target.variable)]
            raise ConnectError(
                f"{source} ({kinds[0]}) and {target} ({kinds[1]}) cannot be connected: both ends must be of the same "
                "type; of integers, the input may have the wider range, or be a real"
            )
        conversion = _unit_conversion(source, target) if conversion is None else conversion
        if sums_to_zero:
            conversion = conversion.then(Conversion(-1.0))
        if conversion != SAME and {source.variable.type, target.variable.type} != {"Real"}:
            raise ConnectError(
                f"{source} ({source.variable.base}) and {target} ({target.variable.base}) cannot be connected with a "
                f"factor of {conversion.factor:g} and an offset of {conversion.offset:g}: only reals can"
            )
        return cls(source, target, conversion)

    @property
    def is_reaction(self) -> bool:
        """Whether it feeds the force of a moved mechanism back to its mover, so that the port is bidirectional."""
        return self._joins("force")

    @property
    def is_impulse(self) -> bool:
        """Whether it feeds the impulses of a moved mechanism back to its mover."""
        return self._joins("impulse")

    def _joins(self, member: Literal["force", "impulse"]) -> bool:
        """Whether both ends are this member of their terminals."""
        source, target = self.source.terminal, self.target.terminal
        if source is None or target is None:
            return False
        return getattr(source, member) == self.source.name and getattr(target, member) == self.target.name

    def __str__(self) -> str:
        factor, offset = (f"{number:.10g}" for number in self.conversion)
        times, plus = ("" if factor == "1" else f"{factor} * "), ("" if offset == "0" else f" + {offset}")
        return f"{times}{self.source}{plus} -> {self.target}"


def feeds_of(connections: Iterable[Connection]) -> dict[VariableReference, VariableReference]:
    """Reference of each input of some connections -> reference of its output."""
    return {connection.target.reference: connection.source.reference for connection in connections}


def scalar_connections(first: Port, second: Port) -> list[Connection]:
    """Scalar connections between two ports, in either order; causality tells source and target.

    Values are converted between units of one kind.

    :raises ConnectError: if they do not fit; the message names both.
    """
    both_exist = first.exists and second.exists
    if both_exist and (first.is_array or second.is_array):
        return [connection for pair in _element_pairs(first, second) for connection in scalar_connections(*pair)]
    if both_exist and not (first.triple() and second.triple()):
        return [Connection.between(first, second)]
    return _terminal_connections(first, first.terminal or _NONE, second, second.terminal or _NONE)


def _element_pairs(first: Port, second: Port) -> Iterable[tuple[Port, Port]]:
    """Pairs of the elements of two ports."""
    one, other = first.elements(), second.elements()
    if len(one) != len(other):
        raise ConnectError(
            f"{first} has {len(one)} elements, {second} has {len(other)}: connect single elements, "
            f"for example '{(one if first.is_array else other)[0].name}'"
        )
    return zip(one, other, strict=True)


def _terminal_connections(
    first: Port, one: TerminalDescription, second: Port, other: TerminalDescription
) -> list[Connection]:
    """Connections of the members and nested terminals with equal names; flows change their sign."""
    if one.nested.keys() != other.nested.keys():
        raise ConnectError(
            f"{first} has the port components {_listed(one.nested)}, {second} has {_listed(other.nested)}: "
            "connect single components, for example 'bob_x' with 'pivot_x'"
        )
    if not (one.motion and other.motion) and one.kind and other.kind and one.kind != other.kind:
        raise ConnectError(
            f"{first} ({one.kind}) and {second} ({other.kind}) cannot be connected: their terminals differ in kind"
        )
    joined: list[Connection] = []
    for name in one.nested:
        joined += _terminal_connections(first, one.nested[name], second, other.nested[name])
    members = [*filter(other.members.__contains__, one.members)]
    complete = one.members.keys() == other.members.keys() or "bus" in {one.rule, other.rule}
    if not complete or not (members or joined):
        raise ConnectError(
            f"{first} has the members {_listed(one.members)}, {second} has {_listed(other.members)}: "
            "connect single variables"
        )
    for name in members:
        member, counterpart = one.members[name], other.members[name]
        ends = Port(first.part, member.variable), Port(second.part, counterpart.variable)
        flows = member.sums_to_zero_with(counterpart)
        joined += starmap(partial(Connection.between, sums_to_zero=flows), _element_pairs(*ends))
    return joined


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names) or "none"


def _is_assignable(source: Scalar, target: Scalar) -> bool:
    """Whether each value of a source is a value of the target's type, too."""
    if {source.type, target.type} in ({"Integer"}, {"Integer", "Enumeration"}):
        (least, most), (lowest, highest) = integer_range(source.base), integer_range(target.base)
        return lowest <= least and most <= highest
    same = source.type == target.type and source.type in RECORDED
    return same or (source.type, target.type) == ("Integer", "Real")


def _unit_conversion(source: Port, target: Port) -> Conversion:
    """Conversion between the units of two ports, checked to be of one kind."""
    one, other = source.unit, target.unit
    if one is None or other is None:  # no unit fits any; one without a definition cannot be checked
        return SAME
    if one.exponents != other.exponents:
        units = (f"{port} [{port.variable.unit}]" for port in (source, target))
        raise ConnectError(f"{' and '.join(units)} cannot be connected: their units are of different kinds")
    return one.conversion_to(other)
