"""What is connected when two ends are: ports, found from the names of variables, or two single variables.

A coordinate is one port with two causalities, and so is a component of a named point::

    what moves                              what is moved
    q, q_dot, q_ddot         ------->       s, s_dot, s_ddot        outputs onto inputs
    q_load                   <-------       s_force                 where both have it

What moves is a free coordinate ``q``, a component ``P_x`` of a named point ``P``, or a signal ``y``, which has no
load; what is moved is an active coordinate ``s``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import final

from liaisons.cosim.component import End
from liaisons.errors import ConnectError


@final
@dataclass(frozen=True, slots=True)
class Link:
    """One scalar connection: an output feeds an input."""

    source: End
    target: End

    @property
    def back(self) -> bool:
        """Whether it takes the force of a moved mechanism back to what moves it, so that the port goes two ways."""
        moved, mover = self.source.without("_force"), self.target.without("_load")
        return moved is not None and mover is not None and bool(moved.port() and mover.port())

    def opposite(self, place: tuple[str, str]) -> list[End]:
        """The other end, if the variable of this component and name is one of the two."""
        ends = (self.source, self.target)
        return [other for end, other in zip(ends, reversed(ends), strict=True) if end.place == place]


def links(first: End, second: End) -> list[Link]:
    """The scalar connections that join two ends; the order of the ends does not matter, causality decides.

    :raises ConnectError: if they do not fit; the message names both.
    """
    if not (first.exists and second.exists):
        return _point_links(first, second)
    if first.is_array or second.is_array:
        return _array_links(first, second)
    if (first.variable.causality, second.variable.causality) == ("input", "output"):
        first, second = second, first
    source, target = first.port(), second.port()
    if source is None or target is None:
        return [_link(first, second)]
    joined = [_link(output, input_) for output, input_ in zip(source, target, strict=True)]
    load, force = first.beside("_load"), second.beside("_force")
    if load is not None and force is not None:
        joined.append(_link(force, load))
    return joined


def _array_links(first: End, second: End) -> list[Link]:
    one, other = first.elements(), second.elements()
    if len(one) != len(other):
        raise ConnectError(
            f"{first} has {len(one)} elements, {second} has {len(other)}: connect single elements, "
            f"for example '{(one if first.is_array else other)[0].name}'"
        )
    return [link for pair in zip(one, other, strict=True) for link in links(*pair)]


def _point_links(first: End, second: End) -> list[Link]:
    one, other = first.axes(), second.axes()
    if one.keys() != other.keys():
        raise ConnectError(
            f"{first} has the port components {_listed(one)}, {second} has {_listed(other)}: "
            "connect single components, for example 'bob_x' with 'pivot_x'"
        )
    return [link for axis in one for link in links(one[axis], other[axis])]


def _listed(axes: dict[str, End]) -> str:
    return ", ".join(axes) or "none"


def _link(source: End, target: End) -> Link:
    causalities = source.variable.causality, target.variable.causality
    if causalities != ("output", "input"):
        hint = "; a parameter is set where its component is added" if "parameter" in causalities else ""
        raise ConnectError(
            f"{source} ({causalities[0]}) and {target} ({causalities[1]}) cannot be connected: "
            f"one end must be an output, the other an input{hint}"
        )
    for end in (source, target):
        if end.variable.type != "Real":
            raise ConnectError(
                f"{source} and {target} cannot be connected: {end} is {end.variable.type}, only Real variables can be"
            )
    _check_units(source, target)
    return Link(source, target)


def _check_units(source: End, target: End) -> None:
    one, other = (end.component.fmu.units.get(end.variable.unit) for end in (source, target))
    if one is None or other is None:  # no unit fits any; one without a definition cannot be checked
        return
    words = f"{source} [{source.variable.unit}] and {target} [{target.variable.unit}] cannot be connected: "
    if one.exponents != other.exponents:
        raise ConnectError(f"{words}their units are of different kinds")
    if not math.isclose(one.factor, other.factor) or one.offset != other.offset:
        raise ConnectError(
            f"{words}their units differ by the factor {one.factor / other.factor:g} or an offset; "
            "export one of the FMUs with the unit of the other"
        )
