"""documentation/index.html of an FMU: description, equations, variables and ports on one page."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable
from functools import lru_cache
from html import escape
from importlib.resources import files
from itertools import compress

import casadi as ca
import numpy as np

from liaisons.base.version import __version__
from liaisons.fmu import index_ranges, jump_effects
from liaisons.language import Terminal, Variable
from liaisons.mechanics import Model
from liaisons.reference_results import Trajectory, trajectory
from liaisons_pages.fmu_pages import figures
from liaisons_pages.fmu_pages.sources import cited_entries
from liaisons_pages.formulas import MathML, Notation, of_model

_JOINT = "where the link before ends, or its rate"
_KINDS = {
    "free": "moves by itself; takes the force of what is attached",
    "active": "an operator, or another mechanism, prescribes it; gives back the force that this takes",
    "point": "a place to attach another mechanism; takes its force",
    "signal": "a source for an active port",
}
_PLUG = (
    "In brackets: the member's name in the terminal, as in the flanges of the Modelica Standard Library. A free "
    "coordinate or a point of one mechanism (<code>q</code>) is plugged into an active coordinate of another "
    "(<code>s</code>), both ways at once and without a sign to remember:"
)
_RESULTS = (
    "Reference results, integrated from the same functions by another method, lie in "
    "<code>extra/org.fmi-standard.fmi-ls-ref</code>, unless the experiment is too much to integrate."
)
_HERMITE = (
    "the quintic Hermite polynomial between the values before the step and those that are set for it, which belong "
    "to its end: continuous in s, s_dot and s_ddot, error of the sixth order in the step"
)
_TRIPLE = (
    "The three inputs of a prescribed coordinate belong together: s_dot is the rate of s, s_ddot that of s_dot. Model "
    "exchange takes them as they are, so that all three have to be set. Co-simulation warns in the log, once for each "
    "coordinate, where they contradict each other by more than the step explains; s_mismatch says by how much. Rates "
    "that stay 0 while s changes it derives from the values at communication points, and says so; s_derived says which."
)
_LIMIT = (
    "from one communication point to the next is taken as the limit of an ever faster straight motion, whatever "
    "<code>input_reconstruction</code> is: the effective mass does not depend on the free coordinates (M eq. 50)"
)
_NO_LIMIT = (
    "leaves coordinates and momenta as they are, or puts them back onto the constraints, and the operator's work is "
    "what the energy gains; interpolated, it is a motion as fast as the step"
)
_RECONSTRUCTION = (
    ("0", "hold", "the value at the start of the step; rate and acceleration as given"),
    ("1", "extrapolate", "s + s_dot h + s_ddot h²/2 from the values at the start of the step (the default)"),
    ("2", "interpolate", _HERMITE),
)


@lru_cache(maxsize=1)  # the FMUs of one component are built one after the other
def index_page(model: Model) -> bytes:
    """Return documentation/index.html, the same bytes for the same model."""
    printer = MathML(Notation.from_model(model))
    results = trajectory(model)
    sections = {
        "Picture": _picture_section(model, results),
        "About": _docstring_markup(model.documentation.removeprefix(model.description)),
        "Equations": of_model(model).html(),
        "Variables": _variable_tables(model, printer),
        "Ports": _port_tables(model.ports, {v.name: v for v in model.variables}),
        "Inputs inside a step": _reconstruction_section(model) if model.inputs else [],
        "Checked against": _closed_form_section(model),
        "Default experiment": [*figures.plot_svg(results), *_experiment_section(model)],
    }
    sections["Sources"] = _cited_sources(sections)
    shown = {title: lines for title, lines in sections.items() if lines}
    style = (files("liaisons_pages.fmu_pages") / "style.css").read_text(encoding="utf-8")
    contents = " · ".join(f'<a href="#{_heading_anchor(title)}">{title}</a>' for title in shown)
    page = [
        "<!DOCTYPE html>",
        '<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{escape(model.name)}</title><style>\n{style}</style></head><body>",
        f"<header><h1>{escape(model.name)}</h1><p>{_inline_markup(model.description)}</p><nav>{contents}</nav></header>",
    ]
    for title, lines in shown.items():
        page += [f'<section id="{_heading_anchor(title)}"><h2>{title}</h2>', *lines, "</section>"]
    page += [f"<footer>Written by liaisons {__version__} from the symbols of the model.</footer>", "</body></html>", ""]
    return "\n".join(page).encode()


def _picture_section(model: Model, results: Trajectory | None) -> list[str]:
    """Return the figure of the mechanism with its caption."""
    shown = figures.picture_svg(figures.picture_faces(model, results), model.name)
    command = f"<code>liaisons show {escape(model.name)}.fmu</code>"
    return shown and [
        *shown,
        f"<p class=note>At the start of the default experiment. {command} writes a page that moves.</p>",
    ]


# ---- text --------------------------------------------------------------------------------------------------------


def _docstring_markup(docstring: str) -> list[str]:
    """Return a docstring as paragraphs, displayed blocks and lists of fields."""
    lines: list[str] = []
    displayed = False
    for block in re.split(r"\n\s*\n", docstring.strip("\n")):
        indented = all(line.startswith("    ") for line in block.splitlines())
        if displayed and indented:
            lines.append(f"<pre>{escape(re.sub('(?m)^    ', '', block))}</pre>")
            continue
        displayed = block.rstrip().endswith("::")
        text = block.rstrip().removesuffix("::").rstrip(":") + (":" if displayed and block.strip() != "::" else "")
        fields = re.split(r"(?m)^:(?=\w+(?: \w+)?:)", text)
        lines += [f"<p>{_inline_markup(fields[0])}</p>"] if fields[0].strip() else []
        rows = [field.partition(":")[::2] for field in fields[1:]]
        lines += [f"<p class=field><b>{escape(name)}</b> {_inline_markup(value)}</p>" for name, value in rows]
    return lines


def _inline_markup(text: str) -> str:
    """Return text as markup: code in elements, references of Sphinx as code."""
    named = re.sub(r":\w+:`[~]?([^`]+)`", r"``\1``", text.strip())
    return re.sub(r"``(.+?)``", r"<code>\1</code>", escape(named))


def _heading_anchor(title: str) -> str:
    """Return the anchor of a heading: small letters, hyphens for blanks."""
    return title.lower().replace(" ", "-")


def _html_table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> list[str]:
    """Return a table whose cells are markup."""

    def row(cells: Iterable[str], tag: str) -> str:
        return f"<tr>{''.join(f'<{tag}>{cell}</{tag}>' for cell in cells)}</tr>"

    return ["<div class=wide><table>", row(head, "th"), *(row(cells, "td") for cells in rows), "</table></div>"]


# ---- variables and ports -----------------------------------------------------------------------------------------


def _variable_tables(model: Model, printer: MathML) -> list[str]:
    """Return tables of parameters, inputs, outputs and further symbols."""
    head = ("", "name", "unit", "kind", "start", "allowed", "meaning")
    lines = [
        f"<p class=field><code>{escape(size.name)}</code> = {size.count}: {escape(size.description)}; fixed</p>"
        for size in model.dimensions
    ]
    for title, variables in (
        ("Parameters", model.parameters),
        ("Inputs", model.inputs),
        ("Outputs and local variables", model.outputs),
    ):
        if variables:
            lines += [f"<h3>{title}</h3>", *_html_table(head, (_variable_cells(v, printer) for v in variables))]
    names = {v.name for v in model.variables}
    further = {symbol.name() for equation in model.equations for symbol in ca.symvar(equation.right)} - names
    if further:
        rows = (
            (f"<math>{printer.name(name)}</math>", escape(name), _symbol_meaning(name, names))
            for name in sorted(further)
        )
        lines += ["<h3>Further symbols</h3>", *_html_table(("", "name", "meaning"), rows)]
    return lines


def _symbol_meaning(name: str, variables: Collection[str]) -> str:
    """Return the meaning of a symbol of the equations that is no variable."""
    if name == "t":
        return "time [s]"
    return f"that of a link: one of {name}[1], {name}[2], ..." if f"{name}[1]" in variables else _JOINT


def _variable_cells(variable: Variable, printer: MathML) -> tuple[str, ...]:
    """Return the cells of the row of a variable."""
    size = "" if variable.dimension is None else f"[1…{variable.dimension.name or variable.count}]"
    starts = variable.starts if len(set(variable.starts)) > 1 else variable.starts[:1]  # those of an array may be alike
    kind = variable.causality + (", tunable" if variable.variability == "tunable" else "")
    kind += "" if variable.type == "Real" else f", {variable.type}"
    return (
        f"<math>{printer.name(variable.name)}</math>",
        f"<code>{escape(variable.name)}{size}</code>",
        escape(variable.unit) or "any",
        kind,
        "" if variable.start is None else ", ".join(f"{start:.6g}" for start in starts),
        escape(variable.domain()),
        _inline_markup(variable.description),
    )


def _port_tables(ports: tuple[Terminal, ...], variables: dict[str, Variable]) -> list[str]:
    """Return tables of the ports, and of how ports fit each other."""
    if not ports:
        return []

    def members(port: Terminal, causality: str) -> str:
        return ", ".join(
            f"<code>{escape(m.variable)}</code> <small>({m.role})</small>"
            for m in port.members
            if variables[m.variable].causality == causality
        )

    rows = ((f"<b>{escape(p.name)}</b>", p.kind, members(p, "output"), members(p, "input")) for p in ports)
    lines = _html_table(("port", "kind", "gives", "takes"), rows)
    lines += [f"<p class=field><b>{kind}</b> {_KINDS[kind]}</p>" for kind in dict.fromkeys(p.kind for p in ports)]
    plugs = (("q", "→", "s"), ("q_dot", "→", "s_dot"), ("q_ddot", "→", "s_ddot"), ("q_load", "←", "s_force"))
    rows = ((f"<code>{q}</code>", arrow, f"<code>{s}</code>") for q, arrow, s in plugs)
    return [*lines, f"<p>{_PLUG}</p>", *_html_table(("free coordinate or point", "", "active coordinate"), rows)]


def _reconstruction_section(model: Model) -> list[str]:
    """Return the section on the motion of inputs inside a communication step."""
    rows = ((f"<code>{value}</code>", name, escape(text)) for value, name, text in _RECONSTRUCTION)
    text = "Between two communication points a prescribed coordinate has to move; this fixed parameter says how:"
    lines = [f"<p>{text}</p>", *_html_table(("<code>input_reconstruction</code>", "", "motion during a step"), rows)]
    return [*lines, f"<p>{_TRIPLE}</p>", f"<p>{_jump_sentences(model)}</p>"] if model.active else lines


def _jump_sentences(model: Model) -> str:
    """Return sentences that say what a jump of each prescribed coordinate does."""
    effects, inputs = jump_effects(model), index_ranges(model.inputs)
    values = [a.value for a in model.active for _ in inputs[a.value]]

    def chosen_names(chosen: Iterable[bool]) -> str:
        return ", ".join(f"<code>{escape(n)}</code>" for n in dict.fromkeys(compress(values, chosen)))

    with_limit, without = chosen_names(effects.have_limit), chosen_names(~effects.have_limit)
    text = []
    if with_limit:
        alone = " alone" if np.count_nonzero(effects.mixes) > np.trace(effects.mixes) else ""
        text.append(f"A jump of {with_limit}{alone} {_LIMIT}.")
    if without:
        text.append(f"A jump of {without} {_NO_LIMIT}.")
    return " ".join(text)


# ---- evidence ----------------------------------------------------------------------------------------------------


def _closed_form_section(model: Model) -> list[str]:
    """Return the section with the docstring of the closed form; empty if there is none."""
    if not model.closed_form:
        return []
    return [
        f"<p><code>{escape(model.name)}.exact(t)</code>, which knows nothing of the FMU:</p>",
        *_docstring_markup(model.closed_form),
    ]


def _experiment_section(model: Model) -> list[str]:
    """Return the section with the settings of the default experiment, and the place of its results."""
    e = model.experiment
    rows = (
        ("stop time", f"{e.stop_time:g} s"),
        ("step size", f"{e.step_size:g} s"),
        ("tolerance", f"{e.tolerance:g}, relative, of each internal step"),
    )
    starts = ", ".join(f"<code>{name}</code> = {value:g}" for name, value in e.reference.items())
    own = [f"<p>Nothing would happen there by itself; the reference results have {starts}.</p>"] if starts else []
    return [*_html_table(("", ""), rows), *([] if model.contacts or model.sample else [f"<p>{_RESULTS}</p>"]), *own]


def _cited_sources(sections: dict[str, list[str]]) -> list[str]:
    """Return the section with the sources that the other sections cite."""
    entries = cited_entries("\n".join(line for lines in sections.values() for line in lines))
    titled = {mark: re.sub(r"\*([^*]+)\*", r"<i>\1</i>", escape(text)) for mark, text in entries.items()}
    return [f"<p><b>{mark}</b> {text}</p>" for mark, text in titled.items()]
