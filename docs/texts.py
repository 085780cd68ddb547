"""Both texts, number by number: ``reference/texts.md``, made from ``texts.toml``."""

from __future__ import annotations

import ast
import re
import tomllib
from collections import Counter
from collections.abc import Collection, Iterator
from functools import cache
from html import escape
from math import prod
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import liaisons
from liaisons import analysis, language, mechanics, models
from liaisons.base.project import scenario_files, scenario_order
from liaisons.language import Mechanism
from liaisons.library import catalogue
from liaisons.mechanics import derive

if TYPE_CHECKING:
    from sphinx.application import Sphinx

HERE = Path(__file__).parent
TESTS = HERE.parent / "tests"
TEXTS = {"K": "Kneller, Mécanique analytique", "M": "Marle, Géométrie des systèmes mécaniques à liaisons actives"}
VERIFIED, CORRECTED, NOT_RUN, NOT_YET = "verified", "verified with a correction", "not a formula to be run", "not yet"


class Row(NamedTuple):
    """One line of ``texts.toml``."""

    text: str  # K or M
    kind: str  # equations, examples, figures, propositions
    number: str  # "7", or "10-13"
    says: str
    lives: list[str]
    by: list[str]
    no: str
    misprint: str

    @property
    def numbers(self) -> list[str]:
        """The single numbers of a range."""
        first, _, last = self.number.partition("-")
        return [str(i) for i in range(int(first), int(last) + 1)] if last else [self.number]

    @property
    def place(self) -> str:
        """Where it stands on the page."""
        return f"{self.text}-{self.kind}-{self.numbers[0].replace(', ', '-')}"

    @property
    def citation(self) -> str:
        """As docstrings cite it: "K eq. 10-13", "M 8.1"."""
        kind = {"equations": "eq. ", "figures": "Fig. "}.get(self.kind, "" if self.text == "M" else "Ex. ")
        return f"{self.text} {kind}{self.number}"

    @property
    def verdict(self) -> str:
        """One of the four kinds."""
        if self.no:
            return NOT_RUN
        return NOT_YET if not self.by else CORRECTED if self.misprint else VERIFIED


def setup(app: Sphinx) -> None:
    """Write the page before it is read, after those of gallery and catalogue, to which it leads."""
    app.connect("builder-inited", write_texts, priority=700)


def write_texts(app: Sphinx) -> None:
    """Write ``reference/texts.md``."""
    shown = [path.stem for path in (Path(app.srcdir) / "gallery").glob("*.md")]
    (Path(app.srcdir) / "reference" / "texts.md").write_text(page(shown), encoding="utf-8")


def rows() -> list[Row]:
    """The lines of the table, in order."""
    table = tomllib.loads((HERE / "texts.toml").read_text(encoding="utf-8"))
    empty = {"lives": [], "by": [], "no": "", "misprint": ""}
    return [
        Row(text=text, kind=kind, number=number, **{**empty, **entry})
        for text, kinds in table.items()
        for kind, entries in kinds.items()
        for number, entry in entries.items()
    ]


def page(shown: Collection[str]) -> str:
    """The page as Markdown.

    :param shown: scenarios that have a page.
    """
    entries = rows()
    introduction = (
        "Every numbered equation, every example and figure of the two texts of the [bibliography](bibliography.md): "
        "what it says, where it lives, what verifies it and how finely.  Tolerances are those that the tests and "
        "scenarios named here apply, in SI units or relative, the finest and the coarsest; a scenario's page has the "
        "errors found.  Where the text is misprinted, what is used is said, and in most cases a test shows that the "
        "printed form fails."
    )
    parts = ["# Both texts, line by line", introduction, _counts(entries)]
    for text, title in TEXTS.items():
        parts.append(f"## {text}: {title}")
        for kind in dict.fromkeys(row.kind for row in entries if row.text == text):
            lines = "\n".join(_line(row, shown) for row in entries if (row.text, row.kind) == (text, kind))
            head = "".join(f"<th>{name}</th>" for name in ("", "says", "lives in", "verified by", "tolerance"))
            parts += [f"### {text}: {kind}", f'<table class="texts">\n<tr>{head}</tr>\n{lines}\n</table>']
    parts += ["## Where L is hyper-regular", _ranks()]
    return "\n\n".join(parts) + "\n"


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


def _counts(entries: list[Row]) -> str:
    lines = ["| | " + " | ".join((VERIFIED, CORRECTED, NOT_RUN, NOT_YET, "numbers")) + " |", "|---" * 6 + "|"]
    for text, kind in dict.fromkeys((row.text, row.kind) for row in entries):
        found = Counter[str]()
        for row in entries:
            if (row.text, row.kind) == (text, kind):
                found[row.verdict] += len(row.numbers)
        numbers = [found[verdict] for verdict in (VERIFIED, CORRECTED, NOT_RUN, NOT_YET)]
        lines.append(f"| {text}, {kind} | " + " | ".join(map(str, [*numbers, sum(numbers)])) + " |")
    return "\n".join(lines)


def _line(row: Row, shown: Collection[str]) -> str:
    remarks = {"Misprint": row.misprint, NOT_RUN.capitalize(): row.no}
    notes = (f"<br><small>{head}: {escape(remark)}.</small>" for head, remark in remarks.items() if remark)
    says = escape(row.says) + "".join(notes)
    lives = ", ".join(map(_object, row.lives))
    checks = "<br>".join(_check(check, shown) for check in row.by)
    found = [value for check in row.by for value in tolerances(check)]
    range_ = "" if not found else f"{min(found):.0e}" + (f" to {max(found):.0e}" if max(found) > min(found) else "")
    cells = (row.number.replace("-", "\N{EN DASH}"), says, lives, checks, range_)
    return f'<tr id="{row.place}">' + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"


def _object(name: str) -> str:
    owner, shown = name.partition(".")[0], re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[._])", "<wbr>", name)
    if owner in catalogue():
        return f'<a href="../catalogue/{owner}.html">{shown}</a>'
    if owner == "analysis":
        return f'<a href="api.html#liaisons.{name}">{shown}</a>'
    return f"<code>{shown}</code>"


def _check(check: str, shown: Collection[str]) -> str:
    if "::" in check:
        file, name = check.split("::")
        return f"{name.removeprefix('test_').replace('_', ' ')} <small>{file.replace('_', '_<wbr>')}</small>"
    title = f"scenario <i>{_titles().get(check, check.replace('_', ' '))}</i>"
    return f'<a href="../gallery/{check}.html">{title}</a>' if check in shown else title


@cache
def _titles() -> dict[str, str]:
    """Titles of scenarios that their names do not give."""
    return scenario_order()["titles"]


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
