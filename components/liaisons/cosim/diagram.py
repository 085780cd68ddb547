"""A picture of a system as SVG: its FMUs in boxes, sources left of what they feed, arrows for what is connected.

A triple, a point or an array is one arrow, with two heads where the force goes back.  The mouse over a box shows start
values, over an arrow the variables.  Whatever text is shown is escaped: names come from FMUs of any make.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from html import escape

from liaisons.array_names import split
from liaisons.cosim import schedule
from liaisons.cosim.connections import Connection
from liaisons.cosim.parts import Part, Port

_MOST = 60
"""So many boxes are drawn."""
_WIDTH, _HEIGHT = 150, 44
"""Of a box [px]."""
_COLUMN, _ROW, _MARGIN = 320, 84, 48
"""From one box to the next, to the right and down, and around all [px]."""
_LINES = 3
"""So many ports are named at an arrow."""

_HEAD = (
    '<defs><marker id="liaisons-head" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8" markerHeight="8" '
    'orient="auto-start-reverse"><path d="M0 0 8 4 0 8z" fill="currentColor"/></marker></defs>'
)
_STYLE = 'fill="none" stroke="currentColor" font-family="sans-serif" font-size="11" text-anchor="middle"'


def diagram(name: str, parts: Mapping[str, Part], connections: Collection[Connection]) -> str:
    """The picture, as an SVG element.

    :param name: of the system.
    """
    forward = {c.target.place: c.source.place for c in connections if not c.back}
    drawn = schedule.order(parts, forward)[:_MOST]
    corners = _corners(drawn, {(source, target) for (target, _), (source, _) in forward.items()})
    boxes = [_box(parts[part], *corner) for part, corner in corners.items()]
    arrows = [_arrow(wires, corners) for wires in _wired(connections, corners)]
    width, height = (max((corner[k] for corner in corners.values()), default=0) for k in (0, 1))
    width, height = width + _WIDTH + _MARGIN, height + _HEIGHT + 2 * _MARGIN
    more = len(parts) - len(drawn)
    title = f"{name}, and {more} FMUs more" if more else name
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" {_STYLE}>{_HEAD}'
        f"{_text(width / 2, 20, title, bold=True)}{''.join(arrows)}{''.join(boxes)}</svg>"
    )


def _corners(ordered: Iterable[str], pairs: Collection[tuple[str, str]]) -> dict[str, tuple[int, int]]:
    """Upper left corners of the boxes: each right of what feeds it, those of a column below each other."""
    columns: dict[str, int] = {}
    for name in ordered:
        columns[name] = max((columns[s] + 1 for s, t in pairs if t == name and s in columns), default=0)
    members = {column: [name for name in columns if columns[name] == column] for column in columns.values()}
    highest = max(map(len, members.values()), default=0)
    return {
        name: (_MARGIN + column * _COLUMN, _MARGIN + row * _ROW + (highest - len(names)) * _ROW // 2)
        for column, names in members.items()
        for row, name in enumerate(names)
    }


def _wired(connections: Iterable[Connection], drawn: Collection[str]) -> Iterable[list[Connection]]:
    """The connections between two boxes, those that take forces back among them."""
    wires: dict[tuple[str, str], list[Connection]] = {}
    for connection in connections:
        source, target = connection.source.place[0], connection.target.place[0]
        if source in drawn and target in drawn:
            wires.setdefault((target, source) if connection.back else (source, target), []).append(connection)
    return wires.values()


def _box(part: Part, x: float, y: float) -> str:
    starts = "\n".join(f"{name} = {value!r}" for name, value in part.starts.items())
    return (
        f'<g><title>{escape(starts)}</title><rect x="{x}" y="{y}" width="{_WIDTH}" height="{_HEIGHT}" rx="5" '
        f'fill="currentColor" fill-opacity="0.08"/>{_text(x + _WIDTH / 2, y + 19, part.name, bold=True)}'
        f"{_text(x + _WIDTH / 2, y + 35, part.fmu.path.stem)}</g>"
    )


def _arrow(wires: list[Connection], corners: Mapping[str, tuple[int, int]]) -> str:
    """From right to left edge; where that would go backwards, from below to below."""
    forth = [connection for connection in wires if not connection.back]
    source, target = (forth[0].source, forth[0].target) if forth else (wires[0].target, wires[0].source)
    (x, y), (to_x, to_y) = corners[source.place[0]], corners[target.place[0]]
    if x < to_x:
        x, y, to_y = x + _WIDTH, y + _HEIGHT / 2, to_y + _HEIGHT / 2
        bend = (to_x - x) / 2
        path = f"M{x} {y}C{x + bend} {y} {to_x - bend} {to_y} {to_x} {to_y}"
        middle = (x + to_x) / 2, (y + to_y) / 2
    else:
        x, to_x, y, to_y = x + 0.6 * _WIDTH, to_x + 0.4 * _WIDTH, y + _HEIGHT, to_y + _HEIGHT
        low = max(corner[1] for corner in corners.values()) + _HEIGHT + _MARGIN
        path = f"M{x} {y}C{x} {low} {to_x} {low} {to_x} {to_y}"
        middle = (x + to_x) / 2, (y + to_y + 6 * low) / 8
    names = list(dict.fromkeys(_named(connection) for connection in forth))
    lines = names[:_LINES] + ([f"and {len(names) - _LINES} more"] if len(names) > _LINES else [])
    words = "".join(_text(middle[0], middle[1] - 6 - 13 * k, line) for k, line in enumerate(reversed(lines)))
    both = ' marker-start="url(#liaisons-head)"' if len(forth) < len(wires) else ""
    variables = escape("\n".join(map(str, wires)))
    return f'<g><title>{variables}</title><path d="{path}" marker-end="url(#liaisons-head)"{both}/>{words}</g>'


def _named(connection: Connection) -> str:
    """What is connected with what: of triples their values, of arrays and points themselves."""
    source, target = _whole(connection.source), _whole(connection.target)
    if source[-2:] == target[-2:] and source[-2:] in {"_x", "_y", "_z"}:
        source, target = source[:-2], target[:-2]
    return f"{source} → {target}"


def _whole(port: Port) -> str:
    triple, _ = port.curve()
    return split(triple[0].name if triple else port.name)[0]


def _text(x: float, y: float, words: str, *, bold: bool = False) -> str:
    """One line, shortened to the width that there is."""
    words = words if len(words) <= 26 else f"{words[:25]}…"
    weight = ' font-weight="bold"' if bold else ""
    return f'<text x="{x}" y="{y}" stroke="none" fill="currentColor"{weight}>{escape(words)}</text>'
