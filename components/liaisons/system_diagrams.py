"""A block diagram of a system as SVG: FMUs with ports, connections, and the execution order.

Sources are left of their targets.  A port, a point or an array is one port, an arrow with two heads includes the
force.  Tooltips of blocks show start values, those of arrows the variables.  All text is escaped.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from html import escape
from itertools import zip_longest
from typing import final

from liaisons.base.array_names import array_and_index
from liaisons.cosim import Connection, Diagram, Port, SystemComponent, SystemDocument

_MOST = 60
"""Largest number of blocks."""
_WIDTH = 170
"""Width of a block [px]."""
_HEAD = 47
"""Height of the title of a block [px]."""
_LINE = 16
"""Height of a port [px]."""
_GAP = 70
"""Distance between columns [px]."""
_SPACE = 34
"""Distance between blocks of a column [px]."""
_MARGIN = 32
"""Distance to the border [px]."""
_LANE = 7
"""Distance of parallel arrows [px]."""
_FREE = 4
"""Largest number of ports of one causality of an FMU that are drawn if they are not connected."""
_LETTER = 6.0
"""Width of a character [px]."""

_ARROW = (
    '<defs><marker id="liaisons-head" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="7" markerHeight="7" '
    'orient="auto-start-reverse"><path d="M0 0 8 4 0 8z" fill="currentColor"/></marker></defs>'
)
_STYLE = (
    'style="max-width:100%;height:auto" fill="none" stroke="currentColor" stroke-linejoin="round" '
    'font-family="sans-serif" font-size="11"'
)


@final
@dataclass(frozen=True, slots=True)
class _Wire:
    """An arrow: names of component and port at both ends, and its connections."""

    source: tuple[str, str]
    target: tuple[str, str]
    connections: list[Connection]


@final
@dataclass(frozen=True, slots=True)
class _Block:
    """Block of an FMU: column, upper end [px], and names of ports from above; inputs are left, outputs right."""

    part: SystemComponent
    column: int
    y: int
    left: list[str]
    right: list[str]

    @property
    def x(self) -> int:
        """Left end [px]."""
        return _MARGIN + self.column * (_WIDTH + _GAP)

    @property
    def height(self) -> int:
        """Height [px]."""
        return _HEAD + _LINE * max(len(self.left), len(self.right))


def block_diagram(document: SystemDocument) -> Diagram:
    """Block diagram of a system, under its name."""
    name, parts, connections = document.name, document.parts, document.connections
    groups = document.graph.strong_components
    numbers = {part: number for number, group in enumerate(groups, 1) for part in group}
    drawn = document.order[:_MOST]
    wires = [w for w in _wires(connections) if w.source[0] in drawn and w.target[0] in drawn]
    pairs = {(c.source.part.name, c.target.part.name) for c in connections if not c.is_reaction}
    blocks = _blocks(drawn, parts, pairs, wires)
    bodies = [_block_svg(block, numbers[part], wires) for part, block in blocks.items()]
    bottom = max((block.y + block.height for block in blocks.values()), default=_MARGIN) + _SPACE
    arrows = _arrow_svgs(wires, blocks, bottom)
    more = len(parts) - len(drawn)
    title = _shortened(f"{name}, and {more} more FMUs" if more else name, 60)
    words = ["numbers: the order in which the FMUs are stepped"] if len(drawn) > 1 else []
    if any(len(group) > 1 for group in groups):
        words.append("those with the same number feed each other")
    legend = "; ".join(words)
    right = max((block.x for block in blocks.values()), default=_MARGIN) + _WIDTH + _MARGIN
    width = max(right, 2 * _MARGIN + _LETTER * max(len(legend), len(title)))
    height = bottom + _SPACE
    return Diagram(
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height}" width="{width:g}" {_STYLE}>{_ARROW}'
        f"{_text_svg(_MARGIN, 20, title, bold=True)}{''.join(arrows)}{''.join(bodies)}"
        f"{_text_svg(_MARGIN, height - 10, legend, faint=True)}</svg>"
    )


def _wires(connections: Iterable[Connection]) -> list[_Wire]:
    """Arrows of a diagram, one for all connections of two ports, the reaction force included."""
    wires: dict[tuple[tuple[str, str], tuple[str, str]], _Wire] = {}
    for c in connections:
        ports = [_drawn_port(port, is_reaction=c.is_reaction) for port in (c.source, c.target)]
        points = [port.terminal.point for port in ports if port.terminal and port.triple()]
        joined = len(points) == 2 and len({point and point.axis for point in points}) == 1
        names = [point.point if joined and point else port.name for port, point in zip_longest(ports, points)]
        source, target = (array_and_index(name)[0] for name in names)
        ends = (c.source.reference[0], source), (c.target.reference[0], target)
        ends = (ends[1], ends[0]) if c.is_reaction else ends
        wires.setdefault(ends, _Wire(*ends, [])).connections.append(c)
    return list(wires.values())


def _drawn_port(port: Port, *, is_reaction: bool) -> Port:
    """Port that is drawn for the end of a connection: of value, rate, acceleration and reaction force, the value."""
    return port.value_port if is_reaction or port.motion_and_order()[0] else port


def _port_names(part: SystemComponent, causality: str) -> list[str]:
    """Names of the ports of a causality with value, rate and acceleration; points instead of their components."""
    entries = part.fmu.variables.entries
    ports = [Port(part, name) for name in entries if entries[name].prototype.causality == causality]
    terminals = [port.terminal for port in ports if port.triple()]
    return list(dict.fromkeys(t.point.point if t.point else t.motion[0] for t in terminals if t and t.motion))


def _blocks(
    drawn: Iterable[str],
    parts: Mapping[str, SystemComponent],
    pairs: Collection[tuple[str, str]],
    wires: Collection[_Wire],
) -> dict[str, _Block]:
    """Blocks by name, each in a column right of its sources, with connected ports and then a few others.

    :param pairs: names of source and target, for each pair of connected components.
    """
    sources: dict[str, list[str]] = {}
    for source, target in pairs:
        sources.setdefault(target, []).append(source)
    blocks: dict[str, _Block] = {}
    lowest: dict[int, int] = {}  # y below the last block of each column
    for name in drawn:
        part = parts[name]
        column = max((blocks[source].column + 1 for source in sources.get(name, ()) if source in blocks), default=0)
        ends = [wire.target[1] for wire in wires if wire.target[0] == name]
        begins = [wire.source[1] for wire in wires if wire.source[0] == name]
        left, right = (
            list(dict.fromkeys([*used, *(free if len(free) <= _FREE else ())]))
            for used, free in ((ends, _port_names(part, "input")), (begins, _port_names(part, "output")))
        )
        blocks[name] = block = _Block(part, column, lowest.get(column, _MARGIN + 10), left, right)
        lowest[column] = block.y + block.height + _SPACE
    return blocks


def _block_svg(block: _Block, number: int, wires: Collection[_Wire]) -> str:
    """SVG of a block, with its number in execution order."""
    part, x, y = block.part, block.x, block.y
    starts = "\n".join(f"{name} = {value!r}" for name, value in part.starts.items())
    dashes = ' stroke-dasharray="5 3"' if part.isolated else ""
    size = f'width="{_WIDTH}" height="{block.height}"'
    lines = [
        f"<title>{escape(starts)}</title>",
        f'<rect x="{x}" y="{y}" {size} rx="5" fill="currentColor" fill-opacity="0.07"{dashes}/>',
        _text_svg(x + 10, y + 17, _shortened(part.name, 22), bold=True),
        _text_svg(x + _WIDTH - 10, y + 17, str(number), anchor="end", faint=True),
        _text_svg(
            x + 10, y + 32, _shortened(f"{part.fmu.path.stem}{', isolated' if part.isolated else ''}", 24), faint=True
        ),
    ]
    longest = int((_WIDTH - 24) / _LETTER)
    for side, names, anchor in ((0, block.left, "start"), (_WIDTH, block.right, "end")):
        opposite = block.right if side == 0 else block.left
        for k, name in enumerate(names):
            at = y + _HEAD + _LINE * k
            used = (part.name, name) in (wire.source if side else wire.target for wire in wires)
            room = longest // 2 if k < len(opposite) else longest
            fill = "currentColor" if used else "none"
            lines.append(f'<circle cx="{x + side}" cy="{at}" r="2.5" fill="{fill}"/>')
            lines.append(_text_svg(x + abs(side - 8), at + 4, _shortened(name, room), anchor=anchor, faint=not used))
    return f"<g>{''.join(lines)}</g>"


def _arrow_svgs(wires: Iterable[_Wire], blocks: Mapping[str, _Block], bottom: int) -> list[str]:
    """SVG of each arrow: to the next column a curve, to others a line below the lower end of all blocks [px]."""
    lanes = 0
    drawn = []
    for wire in wires:
        (source, port), (target, other) = wire.source, wire.target
        one, two = blocks[source], blocks[target]
        x, y = one.x + _WIDTH, one.y + _HEAD + _LINE * one.right.index(port)
        to_x, to_y = two.x, two.y + _HEAD + _LINE * two.left.index(other)
        if two.column == one.column + 1:
            path = f"M{x} {y}C{x + _GAP / 2} {y} {to_x - _GAP / 2} {to_y} {to_x} {to_y}"
        else:
            lane = lanes % 6 * _LANE
            lanes += 1
            out, into = x + 12 + lane, to_x - 12 - lane
            path = f"M{x} {y}H{out}V{bottom - _SPACE + 14 + lane}H{into}V{to_y}H{to_x}"
        both = ' marker-start="url(#liaisons-head)"' if any(c.is_reaction for c in wire.connections) else ""
        variables = escape("\n".join(map(str, wire.connections)))
        drawn.append(f'<g><title>{variables}</title><path d="{path}" marker-end="url(#liaisons-head)"{both}/></g>')
    return drawn


def _shortened(words: str, longest: int) -> str:
    """Text that is cut to a number of characters."""
    return words if len(words) <= longest else f"{words[: longest - 1]}…"


def _text_svg(x: float, y: float, words: str, *, bold: bool = False, faint: bool = False, anchor: str = "start") -> str:
    weight = ' font-weight="bold"' if bold else ""
    opacity = ' fill-opacity="0.65"' if faint else ""
    return (
        f'<text x="{x:g}" y="{y:g}" stroke="none" fill="currentColor" text-anchor="{anchor}"{weight}{opacity}>'
        f"{escape(words)}</text>"
    )
