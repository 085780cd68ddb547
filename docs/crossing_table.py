"""Kinds of subject against capabilities: ``reference/crossings.md``, made from ``crossings.toml``."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from functools import cache
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from sphinx.application import Sphinx

HERE = Path(__file__).parent
WORKS, OTHERWISE, REFUSED = "works", "works by another method", "refused"
_SIGNS = {WORKS: "✓", OTHERWISE: "≈", REFUSED: "–"}
_INTRODUCTION = """# Compatibility: what works with what

The rows are functions, the columns kinds of models.  ✓ means that the function works, ≈ that it works by another
method, and – that it is refused; the number leads to the method or the error message.  A test tries every cell.  It
compares results with something that shares no code with liaisons and is named below the table, and it expects the
error message of each refusal.  The kind of a component follows from what it declares, so that a component of [your own
package](../howto/publish.md) works like one of the catalogue.
"""


class Cell(NamedTuple):
    """A kind of subject and a capability.

    :param remark: the other method, or the sentence of the refusal.
    """

    kind: str
    capability: str
    verdict: str
    remark: str


class Trial(NamedTuple):
    """A line of Python in ``crossing_lines.toml``.

    :param holds: condition on X, what it returns; empty where it is refused.
    :param against: what the condition holds it against; else the sentence.
    """

    call: str
    holds: str
    against: str


@cache
def _lines() -> dict[str, Any]:
    return tomllib.loads((HERE / "crossing_lines.toml").read_text(encoding="utf-8"))


def _functions() -> dict[str, dict[str, Any]]:
    """Entries of functions, by group."""
    return {group: entries for group, entries in _lines().items() if group not in {"subjects", "refused"}}


@cache
def trials() -> dict[tuple[str, str], list[Trial]]:
    """Lines of ``crossing_lines.toml`` by kind and function."""
    found: dict[tuple[str, str], list[Trial]] = {}
    for function, entry in (item for group in _functions().values() for item in group.items()):
        for kind, subject in _lines()["subjects"].items():
            default = entry["default"].replace("{subject}", subject)
            lines = entry[kind] if kind in entry else [_lines()["refused"][kind]]
            found[kind, function] = [
                Trial(default, "", line)
                if isinstance(line, str)
                else Trial(line["call"], line.get("holds", ""), line.get("against") or line["refused"])
                for line in lines
            ]
    return found


@cache
def table() -> dict[str, Any]:
    """The file, as it is."""
    return tomllib.loads((HERE / "crossings.toml").read_text(encoding="utf-8"))


def groups() -> dict[str, dict[str, tuple[str, str]]]:
    """Capabilities by group: title, and what their results are held against."""
    lines = {
        group: {name: (lines.get("title", f"`{name}`"), "") for name, lines in functions.items()}
        for group, functions in _functions().items()
    }
    return table()["capabilities"] | lines


@cache
def cells() -> dict[tuple[str, str], Cell]:
    """All cells, by kind and capability.

    :raises ValueError: for a name that is none, or a cell that two entries list.
    """
    kinds, capabilities = [*table()["kinds"]], [name for group in groups().values() for name in group]
    found = {(k, c): Cell(k, c, WORKS, "") for c in capabilities for k in kinds}
    for verdict, entries in ((OTHERWISE, table().get("otherwise", ())), (REFUSED, table().get("refused", ()))):
        for entry in entries:
            for pair in ((k, c) for c in entry["capabilities"] for k in entry["kinds"]):
                if pair not in found or found[pair].verdict != WORKS:
                    raise ValueError(f"crossings.toml: {pair} is {'listed twice' if pair in found else 'no cell'}")
                found[pair] = Cell(*pair, verdict, entry["text"])
    for pair, lines in trials().items():
        refusals = "; ".join(dict.fromkeys(line.against for line in lines if not line.holds))
        found[pair] = Cell(*pair, WORKS if any(line.holds for line in lines) else REFUSED, refusals)
    return found


def page() -> str:
    """The page as Markdown."""
    counts = {verdict: sum(cell.verdict == verdict for cell in cells().values()) for verdict in _SIGNS}
    total = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    parts = [_INTRODUCTION, f"{len(cells())} cells: {total}.\n"]
    remarks = list(dict.fromkeys(cell.remark for cell in cells().values() if cell.remark))
    kinds = {kind: title for kind, (title, _) in table()["kinds"].items()}
    head = "".join(f"<th>{escape(title)}</th>" for title in kinds.values())
    for group, capabilities in groups().items():
        rows = [
            f"<tr><th>{_code(title)}</th>" + "".join(_cell(cells()[kind, name], remarks) for kind in kinds) + "</tr>"
            for name, (title, _) in capabilities.items()
        ]
        parts += [f"## {group}\n", f'<table class="crossings">\n<tr><th></th>{head}</tr>', *rows, "</table>\n"]
        parts += ["Results are compared with:\n", *_against(capabilities, kinds), ""]
    parts.append("## Other methods, and error messages\n")
    parts += [f'<p id="crossing-{i}"><small>{i}</small> {escape(remark)}</p>' for i, remark in enumerate(remarks, 1)]
    parts.append("\n## Example of each kind\n")
    parts += [f"- {title}: {subject}" for title, subject in table()["kinds"].values()]
    return "\n".join(parts) + "\n"


def _against(capabilities: dict[str, tuple[str, str]], kinds: dict[str, str]) -> Iterator[str]:
    for name, (title, against) in capabilities.items():
        if against:
            yield f"- {title}: {against}"
            continue
        lines = [(kind, line) for kind in kinds for line in trials()[kind, name] if line.holds]
        items = [(f"{kinds[kind]}: {line.against}", line.call) for kind, line in lines]
        text = "".join(f"<dt>{escape(head)}</dt><dd><code>{escape(call)}</code></dd>" for head, call in items)
        yield f'<details class="crossings"><summary>{_code(title)}</summary><dl>{text}</dl></details>'


def _cell(cell: Cell, remarks: list[str]) -> str:
    number = remarks.index(cell.remark) + 1 if cell.remark else 0
    note = f'<sup><a href="#crossing-{number}">{number}</a></sup>' if number else ""
    return f'<td class="{cell.verdict}" title="{cell.verdict}">{_SIGNS[cell.verdict]}{note}</td>'


def _code(title: str) -> str:
    name = title.strip("`")
    return f"<code>{escape(name)}</code>" if name != title else escape(title)


def setup(app: Sphinx) -> None:
    """Write the page before it is read."""
    app.connect("builder-inited", _write, priority=700)


def _write(app: Sphinx) -> None:
    (Path(app.srcdir) / "reference" / "crossings.md").write_text(page(), encoding="utf-8")
