"""documentation/index.html of an FMU: what the component is, its equations, its variables."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

from liaisons.mechanics.model import Model, Variable

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; color: #222; }
pre { background: #f6f6f4; padding: 1rem; white-space: pre-wrap; }
table { border-collapse: collapse; width: 100%; }
th, td { text-align: left; padding: .2rem .8rem .2rem 0; border-bottom: 1px solid #ddd; vertical-align: top; }
td:first-child { font-family: monospace; white-space: nowrap; }
"""
_RECONSTRUCTION = (
    ("0, hold", "the values at the start of the step, s, s_dot and s_ddot each as given"),
    ("1, extrapolate", "s + s_dot h + s_ddot h²/2 from the values at the start of the step (the default)"),
    (
        "2, interpolate",
        "the quintic Hermite polynomial from the values before to the values that are set, which belong to the end",
    ),
)


def index_page(model: Model) -> bytes:
    """The page, in UTF-8; the same bytes for the same model."""
    parts = [
        "<!DOCTYPE html>",
        '<html lang="en">',
        f'<head><meta charset="utf-8"><title>{escape(model.name)}</title><style>{_STYLE}</style></head>',
        f"<body><h1>{escape(model.name)}</h1>",
        f"<pre>{escape(model.documentation)}</pre>",
        *_equations(model),
        *_variables("Parameters", model.parameters),
        *_variables("Inputs", model.inputs),
        *_variables("Outputs and local variables", model.outputs),
    ]
    if model.inputs:
        parts += [
            "<h2>Motion of the inputs inside a communication step</h2>",
            "<p>The parameter <code>input_reconstruction</code> chooses:</p>",
            *_rows(("value", "what a prescribed coordinate s does"), _RECONSTRUCTION),
        ]
    return "\n".join([*parts, "</body></html>", ""]).encode()


def _equations(model: Model) -> list[str]:
    lines = [f"{title} = {text}" for title, text in model.equations.items()]
    return ["<h2>Equations</h2>", f"<pre>{escape(chr(10).join(lines))}</pre>"] if lines else []


def _variables(title: str, variables: tuple[Variable, ...]) -> list[str]:
    rows = ((v.name, v.unit, "" if v.start is None else f"{v.start:g}", v.domain(), v.description) for v in variables)
    return [f"<h2>{title}</h2>", *_rows(("name", "unit", "start", "allowed", "meaning"), rows)] if variables else []


def _rows(head: Iterable[str], rows: Iterable[Iterable[str]]) -> list[str]:
    def row(cells: Iterable[str], tag: str) -> str:
        return f"<tr>{''.join(f'<{tag}>{escape(cell)}</{tag}>' for cell in cells)}</tr>"

    return ["<table>", row(head, "th"), *(row(cells, "td") for cells in rows), "</table>"]
