"""Both texts, number by number: ``reference/texts.md``, made from ``liaisons_pages.companion``."""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Collection, Iterator
from functools import cache
from html import escape
from math import prod
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from docutils import nodes
from sphinx import addnodes

import liaisons
from liaisons import language, mechanics, models
from liaisons.base.project import load_module
from liaisons.language import Mechanism
from liaisons.library import catalogue
from liaisons.mechanics import derive
from liaisons.scenario_files import read_gallery, scenario_files
from liaisons_motion import analysis
from liaisons_pages.companion import TITLES, Entry, entries, sections

if TYPE_CHECKING:
    from sphinx.application import Sphinx

TESTS = Path(__file__).parents[1] / "tests"
mathml = load_module(Path(__file__).with_name("mathml.py"))
VERIFIED, CONDITIONAL, CORRECTED = "verified", "verified where it holds", "verified with a correction"
NOT_RUN, NOT_YET = "not a formula to be run", "not yet"
VERDICTS = (VERIFIED, CONDITIONAL, CORRECTED, NOT_RUN, NOT_YET)
COLUMNS = ("", "formula", "says", "implemented in", "verified by", "tolerance")
SOURCES = "texts"
"""Folder of the pages with the sources of tests."""


def setup(app: Sphinx) -> None:
    """Write the pages before they are read, after those of gallery and catalogue, to which they lead."""
    app.connect("builder-inited", write_texts, priority=700)
    app.connect("autodoc-process-docstring", _numbers_of_a_function)
    app.connect("doctree-read", index_numbers)


def write_texts(app: Sphinx) -> None:
    """Write ``reference/texts.md``, and the sources of the tests that it names."""
    root = Path(app.srcdir)
    shown = [path.stem for path in (root / "gallery").glob("*.md")]
    (root / "reference" / "texts.md").write_text(page(shown), encoding="utf-8")
    (root / SOURCES).mkdir(exist_ok=True)
    for file in sorted({check.partition("::")[0] for entry in entries() for check in entry.by if "::" in check}):
        (root / SOURCES / f"{_page_of(file)}.md").write_text(source_page(file), encoding="utf-8")


def index_numbers(app: Sphinx, doctree: nodes.document) -> None:
    """Let the site's search lead from a number of the texts, or a word of the table, to its row."""
    if app.env.current_document.docname == "reference/texts":
        entries = [("single", name, anchor, "main", None) for name, anchor in index_entries().items()]
        doctree += addnodes.index(entries=entries)


def index_entries() -> dict[str, str]:
    """Numbers of texts and errata, as people write them, and words in English and French -> anchor."""
    anchors: dict[str, str] = {}
    for entry in entries():
        citation = entry.citation.partition(",")[0]
        short = citation.replace("eq. ", "")
        for name in (citation, short, short.replace(" ", ""), *entry.corrections, *entry.conditions):
            anchors.setdefault(name, entry.anchor)
    for section in sections():
        within = next(filter(section.contains, entries()), None)
        if within:
            anchors.setdefault(section.citation, within.anchor)
    for entry in entries():
        for word in re.findall(r"\w{4,}", f"{entry.french} {entry.says}".casefold()):
            anchors.setdefault(word, entry.anchor)
    return anchors


def verdict(entry: Entry) -> str:
    """One of the five kinds."""
    if entry.no:
        return NOT_RUN
    if not entry.by:
        return NOT_YET
    return CORRECTED if entry.corrections else CONDITIONAL if entry.conditions else VERIFIED


def page(shown: Collection[str]) -> str:
    """The page as Markdown.

    :param shown: scenarios that have a page.
    """
    introduction = (
        "Every numbered equation, example, figure and proposition of the two texts of the "
        "[bibliography](bibliography.md), and their statements without a number: the formula, where it is implemented, "
        "and what verifies it, with the tolerance.  In a terminal, `liaisons text K122` looks up a number, "
        "`liaisons text viriel` searches in English and French, and `liaisons run K122` runs what verifies it.  "
        "Tolerances are the finest and the coarsest of the tests and scenarios named here, in SI units or relative; "
        "the errors themselves are on the scenario's page.  A *misprint* is an error in the text: the formula here is "
        "corrected, and in most cases a test shows that the printed form fails.  *Holds if* names what the text "
        "assumes without saying so."
    )
    parts = ["# Both texts, line by line", introduction, _counts(entries())]
    for text, title in TITLES.items():
        parts.append(f"## {text}: {title}")
        for kind in dict.fromkeys(entry.kind for entry in entries() if entry.text == text):
            chosen = [entry for entry in entries() if (entry.text, entry.kind) == (text, kind)]
            lines = "\n".join(_line(entry, chosen, shown) for entry in chosen)
            head = "".join(f"<th>{name}</th>" for name in COLUMNS)
            parts += [f"### {text}: {kind}", f'<table class="texts">\n<tr>{head}</tr>\n{lines}\n</table>']
    parts += ["## Where L is hyper-regular", _ranks()]
    return "\n\n".join(parts) + "\n"


def links(owner: str) -> str:
    """Links from a page beside ``reference/`` to the numbers that a component has, or a scenario verifies."""
    groups: dict[str, Entry] = {}
    for entry in entries():
        if (owner in entry.scenarios and not entry.no) or owner in {name.partition(".")[0] for name in entry.lives}:
            groups.setdefault(entry.group_citation, entry)
    return ", ".join(f'<a href="../reference/texts.html#{e.anchor}">{name}</a>' for name, e in groups.items())


def source_page(file: str) -> str:
    """The tests of a file that the table names, as Markdown."""
    names = dict.fromkeys(c.partition("::")[2] for e in entries() for c in e.by if c.startswith(f"{file}::"))
    parts = ["---\norphan: true\n---", f"# tests/{file}.py", f"`pytest tests/{file}.py` runs them."]
    for name in names:
        parts.append(f'<a id="{name}"></a>\n\n## {name.removeprefix("test_").replace("_", " ")}')
        parts.append(f"```{{literalinclude}} ../../tests/{file}.py\n:language: python\n:pyobject: {name}\n```")
    return "\n\n".join(parts) + "\n"


def _page_of(file: str) -> str:
    return file.replace("/", "-")


def _numbers_of_a_function(*arguments: Any) -> None:
    """Add the numbers that a function has to its docstring; Sphinx gives app, kind, name, object, options, lines."""
    _, _, name, *_, lines = arguments
    groups = {e.group_citation: e for e in reversed(entries()) if name in {f"liaisons.{x}" for x in e.lives}}
    if groups:
        cited = ", ".join(f"`{text} <texts.html#{e.anchor}>`__" for text, e in reversed(groups.items()))
        lines += ["", f"Both texts: {cited}.", ""]


def resolve(name: str) -> Any:
    """The object that a name of ``lives`` stands for.

    :raises AttributeError: if there is none.
    """
    for owner in (models, liaisons, language, mechanics):
        try:
            return attrgetter(name)(owner)
        except AttributeError:
            continue
    return attrgetter(name)(liaisons)


@cache
def _module(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def source(check: str) -> ast.AST:
    """The test function or scenario that a name of ``by`` stands for.

    :raises LookupError: if there is none.
    """
    if "::" not in check:
        return _module(scenario_files()[check])
    file, name = check.split("::")
    path = TESTS / f"{file}.py"
    if not path.is_file():
        raise LookupError(f"{check}: there is no {path.name}")
    for node in _module(path).body:
        if isinstance(node, ast.FunctionDef) and node.name == name:
            return node
    raise LookupError(f"{check}: {path.name} has no such test")


def tolerances(check: str) -> list[float]:
    """Tolerances of approx, assert_allclose, within, algebra, assert_follows, and of comparisons; ascending.

    Where a tolerance is a constant times a size, the constant.
    """
    tree, constants = source(check), {"algebra": 1e-12, "quotient": 1e-10}  # see on_paper.py and test_hoops.py
    file, inside, _ = check.partition("::")
    statements = [*(_module(TESTS / f"{file}.py").body if inside else []), *ast.walk(tree)]
    for node in statements:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            value = _value(node.value, constants)
            constants |= {} if value is None else {node.targets[0].id: value}
    found = (_value(expression, constants) for expression in _bounds(tree))
    return sorted({value for value in found if value is not None and 0 < value < 0.1})


def _bounds(tree: ast.AST) -> Iterator[ast.expr]:
    """Expressions that bound an error."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            name = node.func.id if isinstance(node.func, ast.Name) else ""
            if name == "within":
                yield node.args[0]
            elif name in {"algebra", "quotient"}:
                yield node.args[1] if len(node.args) > 1 else node.func
            elif name == "assert_follows":
                yield node.args[2]
            yield from (keyword.value for keyword in node.keywords if keyword.arg in {"rtol", "atol", "rel", "abs"})
        elif isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.Lt | ast.LtE):
            yield node.comparators[0]


def _value(node: ast.expr, constants: dict[str, float]) -> float | None:
    """The number that an expression is, or the constant by which it is multiplied."""
    match node:
        case ast.Constant(value=int() | float() as value):
            return float(value)
        case ast.Name(id=name):
            return constants.get(name)
        case ast.BinOp(left, op, right):
            first, second = _value(left, constants), _value(right, constants)
            known = [value for value in (first, second) if value is not None]
            if isinstance(op, ast.Mult) and known:
                return prod(known)
            if isinstance(op, ast.Pow) and len(known) == 2:
                return float(known[0] ** known[1])
            return first if isinstance(op, ast.Div) and second is None else None
    return None


# ---- text --------------------------------------------------------------------------------------------------------


def _counts(chosen: Collection[Entry]) -> str:
    lines = ["| | " + " | ".join((*VERDICTS, "numbers")) + " |", "|---" * (len(VERDICTS) + 2) + "|"]
    for text, kind in dict.fromkeys((entry.text, entry.kind) for entry in chosen):
        found = Counter(verdict(entry) for entry in chosen if (entry.text, entry.kind) == (text, kind))
        numbers = [found[name] for name in VERDICTS]
        lines.append(f"| {text}, {kind} | " + " | ".join(map(str, [*numbers, sum(numbers)])) + " |")
    return "\n".join(lines)


def _line(entry: Entry, chosen: Collection[Entry], shown: Collection[str]) -> str:
    """A row of the table; numbers of a range share all cells but the first two."""
    formulas = "".join(f"<div>{_markup(formula)}</div>" for formula in entry.formulas)
    cells = f'<td><a href="#{entry.anchor}">{entry.number}</a></td><td>{formulas}</td>'
    group = [other for other in chosen if other.group == entry.group]
    if entry is group[0]:
        span = f' rowspan="{len(group)}"' if group[1:] else ""
        *shared, tolerance = _shared(entry, shown)
        cells += "".join(f"<td{span}>{cell}</td>" for cell in shared) + f'<td{span} class="tolerance">{tolerance}</td>'
    return f'<tr id="{entry.anchor}">{cells}</tr>'


def _shared(entry: Entry, shown: Collection[str]) -> tuple[str, ...]:
    """What it says, where it lives, what verifies it, tolerances."""
    notes = [("Misprint", f"{note} ({number})") for number, note in entry.corrections.items()]
    notes += [("Holds if", f"{note} ({number})") for number, note in entry.conditions.items()]
    notes += [("Remark", f"{note} ({number})") for number, note in entry.remarks.items()]
    notes += [(NOT_RUN.capitalize(), entry.no)] if entry.no else []
    says = f'{escape(entry.says)}<br><small lang="fr">{escape(entry.french)}</small>'
    says += "".join(f"<br><small>{head}: {escape(note)}.</small>" for head, note in notes)
    says += "".join(f"<div><small>Printed: {_markup(formula)}</small></div>" for formula in entry.printed)
    found = [value for check in entry.by for value in tolerances(check)]
    range_ = "" if not found else f"{min(found):.0e}" + (f" to {max(found):.0e}" if max(found) > min(found) else "")
    return says, ", ".join(map(_object, entry.lives)), "<br>".join(_check(check, shown) for check in entry.by), range_


def _markup(latex: str) -> str:
    """MathML on one line: Markdown ends a table where a line is empty."""
    return "".join(line.strip() for line in mathml.markup(latex).splitlines())


def _object(name: str) -> str:
    owner, shown = name.partition(".")[0], re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[._])", "<wbr>", name)
    if owner in catalogue():
        return f'<a href="../catalogue/{owner}.html">{shown}</a>'
    if owner == "analysis":
        return f'<a href="api.html#liaisons.{name}">{shown}</a>'
    if (alone := name.rpartition(".")[2]) in liaisons.__all__:
        return f'<a href="api.html#liaisons.{alone}">{shown}</a>'
    return f"<code>{shown}</code>"


def _check(check: str, shown: Collection[str]) -> str:
    if "::" in check:
        file, name = check.split("::")
        words = name.removeprefix("test_").replace("_", " ")
        link = f'<a href="../{SOURCES}/{_page_of(file)}.html#{name}">{words}</a>'
        return f"{link} <small>{file.replace('_', '_<wbr>')}</small>"
    title = f"scenario <i>{_titles().get(check, check.replace('_', ' '))}</i>"
    return f'<a href="../gallery/{check}.html">{title}</a>' if check in shown else title


@cache
def _titles() -> dict[str, str]:
    """Titles of scenarios that their names do not give."""
    return read_gallery()["titles"]


def _ranks() -> str:
    """Where M eq. 29-38 apply as they are."""
    lines = ["| mechanism | rank of ∂²L/∂v∂v | rates v | equations |", "|---|---|---|---|"]
    for name, component in catalogue().items():
        if not (issubclass(component, Mechanism) and component.actives):
            continue
        if component.constraints or component.non_holonomic or component.rheonomic_constraints:
            continue
        rank, count = analysis.legendre_rank(derive(component))
        space = "M eq. 36-38, on T*M" if rank == count else "M eq. 45-47, on V*M"
        lines.append(f"| {name} | {rank} | {count} | {space} |")
    said = (
        "Legendre's transformation can be inverted where the kinetic energy has full rank in the rates of all "
        "coordinates, free and active.  Where an operator moves what has no mass of its own, it has not, and the "
        "Hamiltonian on V*M takes its place; the motion and the operator's forces are the same."
    )
    return "\n".join([said, "", *lines])
