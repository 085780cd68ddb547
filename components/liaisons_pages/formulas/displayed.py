"""The equations of a component, to be read: in a terminal, a notebook, a document, SymPy."""

from __future__ import annotations

import re
import shutil
import textwrap
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeAlias

import casadi as ca

from liaisons.base.array_names import suffixed_name
from liaisons.errors import ProjectError, suggestion
from liaisons.language import Component, Mechanism
from liaisons.mechanics import Equation, Model, assemble, further_equations
from liaisons_pages.companion import CITATION
from liaisons_pages.formulas import symbolic
from liaisons_pages.formulas.latex import LaTeX
from liaisons_pages.formulas.laws import LAWS, Law
from liaisons_pages.formulas.mathml import MathML
from liaisons_pages.formulas.notation import Notation
from liaisons_pages.formulas.printing import Printer
from liaisons_pages.formulas.terms import Formula, Name, Term
from liaisons_pages.formulas.unicode import Unicode, width, wrapped_lines
from liaisons_pages.formulas.writing import formula

_TOO_LONG = "Too long to be read: {}; the FMU's sources have them in C."
_OF_ALL = ("hamiltonian", "canonical")
_FIXED = "It is of all coordinates; without --fix it is shown."
_Section: TypeAlias = tuple[Law, str, list[tuple[str, Formula]], str]
"""Law of a part, its general form, the equations' left and right sides, and a remark on those that are missing."""
_PAGE = 72
"""Characters of a formula in LaTeX up to which it stays on a line."""


@dataclass(frozen=True, eq=False, repr=False)
class DisplayedEquations:
    """The equations of a component, by parts: ``equations("Pendulum")["motion"]`` has those of motion alone.

    A notebook typesets them, ``print`` writes them for a terminal.

    :param notes: why there are no equations of a part.
    :param prescribed: start values of the prescribed coordinates.
    """

    name: str
    equations: tuple[Equation, ...]
    notation: Notation
    notes: Mapping[str, str] = field(default_factory=dict)
    prescribed: Mapping[str, float] = field(default_factory=dict)

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the parts: ``"lagrangian"``, ``"momenta"``, ``"motion"``, ``"forces"``, ..."""
        return tuple(dict.fromkeys([*(equation.section for equation in self.equations), *self.notes]))

    def __getitem__(self, part: str) -> DisplayedEquations:
        if part not in self.parts:
            raise ProjectError(f"{self.name} has no equations called {part!r}{suggestion(part, self.parts)}")
        chosen = tuple(equation for equation in self.equations if equation.section == part)
        return replace(self, equations=chosen, notes={k: v for k, v in self.notes.items() if k == part})

    def fix(self, *coordinates: str) -> DisplayedEquations:
        """Return the equations with prescribed coordinates at rest: 0 for their rates, and for those that start at 0.

        :param coordinates: names of prescribed ones; their forces, powers and effective masses are left out.
        :raises ProjectError: for another name.
        """
        for name in coordinates:
            if name not in self.prescribed:
                raise ProjectError(f"{self.name} prescribes no {name!r}{suggestion(name, self.prescribed)}")
        resting = {name for name in coordinates if self.prescribed[name] == 0}
        resting |= {suffixed_name(name, end) for name in coordinates for end in ("_dot", "_ddot")}
        remaining = tuple(
            replace(equation, right=_with_zeros(equation.right, resting))
            for equation in self.equations
            if equation.section not in _OF_ALL and not any(_is_of_operator(equation.left, name) for name in coordinates)
        )
        noted = {equation.section for equation in self.equations} & set(_OF_ALL)
        notes = {**self.notes, **dict.fromkeys(sorted(noted, key=_OF_ALL.index), _FIXED)}
        rest = {name: start for name, start in self.prescribed.items() if name not in coordinates}
        return replace(self, equations=remaining, notes=notes, prescribed=rest)

    @cached_property
    def _formulas(self) -> list[tuple[Equation, Formula | None]]:
        """The equations, each with its formula, or None if that is too long."""
        return [(equation, formula(equation.right, self.notation)) for equation in self.equations]

    def _sections(self, printer: Printer, inline: str) -> Iterator[_Section]:
        """Yield the parts, printed.

        :param inline: template of a formula within a sentence.
        """
        for part in self.parts:
            law, own = LAWS[part], [(e.left, right) for e, right in self._formulas if e.section == part]
            dropped = ", ".join(inline.format(printer.name(left)) for left, right in own if right is None)
            remark = self.notes.get(part, "") or (dropped and _TOO_LONG.format(dropped))
            general = inline.format(law.printed_formula(printer)) if law.formula else ""
            yield law, general, [(left, right) for left, right in own if right is not None], remark

    def html(self) -> list[str]:
        """Return lines of HTML with MathML: each law in its general form, then for this component."""
        printer, lines = MathML(self.notation), list[str]()
        for law, general, equations, remark in self._sections(printer, "<math>{}</math>"):
            general = general.replace("<math>", '<math display="block">')  # noqa: PLW2901
            lines += [f"<h3>{law.title}</h3>", f"<p>{law.text}{general}</p>"]
            shown = [line for left, right in equations for line in _html_paragraphs(left, right, printer)]
            lines += ["<div class=equations>", *shown, "</div>"] if shown else []
            lines += [f"<p class=note>{remark}</p>"] if remark else []
        return lines

    def latex(self) -> str:
        """Return paragraphs of LaTeX, with the package amsmath."""
        printer, lines = LaTeX(self.notation), list[str]()
        for law, general, equations, remark in self._sections(printer, "${}$"):
            lines.append(rf"\paragraph{{{law.title}}} {general}")
            rows = [row for left, right in equations for row in self._latex_rows(left, right, printer)]
            lines += [r"\begin{align*}", " \\\\\n".join(rows), r"\end{align*}"] if rows else []
            lines += [re.sub(r"_(?!\{)", r"\_", remark)] if remark else []
        return "\n".join(lines)

    def _latex_rows(self, left: str, right: Formula, printer: LaTeX) -> Iterator[str]:
        """Yield rows of LaTeX with an equation and its abbreviations; long ones break between terms."""
        plain = Unicode(self.notation)
        for i, (name, term) in enumerate([(Name(left), right.term), *right.where]):
            first, *further = _filled_lines(printer.terms(term), map(width, plain.terms(term)), _PAGE)
            where = r"\text{where } " if i == 1 else ""
            yield f"{where}{printer.row(name)} &= {first}"
            yield from (rf"&\quad {line}" for line in further)

    def text(self, width: int | None = None) -> str:
        """Return lines for a terminal.

        :param width: columns; those of the terminal unless given, 80 where there is none.
        """
        columns = shutil.get_terminal_size((80, 24)).columns if width is None else width
        return "\n\n".join("\n".join(lines) for lines in self._text_paragraphs(columns))

    def _text_paragraphs(self, columns: int) -> Iterator[list[str]]:
        """Yield the lines of each part, for a terminal of so many columns."""
        printer = Unicode(self.notation)
        for law, general, equations, remark in self._sections(printer, "{}"):
            formula = " ".join(general.split()).replace("( ", "(").replace(" )", ")")
            numbers = ", ".join(match[0] for match in CITATION.finditer(law.text))
            title = f"{law.title} ({numbers})" if numbers else law.title
            lines = textwrap.wrap(f"{title}: {formula}" if formula else title, columns)
            margin = max((width(printer.name(left)) for left, _ in equations), default=0)
            for left, right in equations:
                lines += _aligned_lines(printer.name(left), printer.terms(right.term), margin + 2, columns)
                for i, (name, term) in enumerate(right.where):
                    head = f"{'' if i else 'where '}{printer.row(name)}"
                    lines += _aligned_lines(head, printer.terms(term), margin + 8, columns)
            yield lines + textwrap.wrap(remark, columns, initial_indent="  ", subsequent_indent="  ")

    def sympy(self) -> list[Any]:
        """Return equations of SymPy, without those that are too long to be read.

        Symbols have the names of the FMU's variables, ``theta_dot``.

        :raises ProjectError: if SymPy is missing (``pip install 'liaisons[sympy]'``).
        """
        return [symbolic.equation(e.left, right) for e, right in self._formulas if right is not None]

    def __repr__(self) -> str:
        return self.text()

    def _repr_latex_(self) -> str:
        return self.latex()

    def _repr_html_(self) -> str:
        return "\n".join(["<div>", *self.html(), "</div>"])


def _is_of_operator(left: str, coordinate: str) -> bool:
    """Return whether a left side is the force, the power or an effective mass of a prescribed coordinate."""
    array, _, index = left.partition("[")
    forces = {f"{coordinate}_force", f"{coordinate}_power"}
    return left in forces or (array == "Theta" and coordinate in index.rstrip("]").split(","))


def _with_zeros(expression: ca.SX, names: Collection[str]) -> ca.SX:
    """Return an expression with 0 in place of the symbols with these names."""
    symbols = [symbol for symbol in ca.symvar(expression) if symbol.name() in names]
    return ca.substitute([expression], symbols, [ca.SX(0)] * len(symbols))[0]


def of_model(model: Model) -> DisplayedEquations:
    """Return the equations of a model, as the page inside its FMU has them."""
    return DisplayedEquations(model.name, model.equations, Notation.from_model(model))


def of_component(component: type[Component]) -> DisplayedEquations:
    """Return the equations of a component, with those of Hamilton's mechanics."""
    shown = of_model(assemble(component))
    if not issubclass(component, Mechanism):
        return shown if shown.equations else replace(shown, notes={"signal": "It is read from a table."})
    further, reason = further_equations(component)
    notes = {"hamiltonian": f"{reason}."} if reason else {}
    order = list(LAWS)
    every = sorted((*shown.equations, *further), key=lambda equation: order.index(equation.section))
    prescribed = {s.name: s.start for s in component.actives}
    return replace(shown, equations=tuple(every), notes=notes, prescribed=prescribed)


def _html_paragraphs(left: str, right: Formula, printer: MathML) -> list[str]:
    """Return paragraphs of HTML with an equation and its abbreviations."""
    where = [_html_paragraph(name.name, term, printer) for name, term in right.where]
    return [_html_paragraph(left, right.term, printer), *(["<p>where</p>", *where] if where else [])]


def _html_paragraph(left: str, right: Term, printer: MathML) -> str:
    """Return a paragraph of HTML with an equation; lines break between its terms."""
    first, *further = printer.terms(right)
    signed = (re.sub("^<mo>", '<mo form="infix">', term) for term in further)  # spaced as between its neighbours
    pieces = (f"{printer.name(left)}<mo>=</mo>{first}", *signed)
    written = " ".join(f'<math displaystyle="true">{piece}</math>' for piece in pieces)
    return f"<p class=formula>{written}</p>"


def _filled_lines(terms: Iterable[str], widths: Iterable[int], room: int) -> list[str]:
    """Return lines of terms; only a line of one term may be wider than the room."""
    lines, used = list[str](), room
    for term, size in zip(terms, widths, strict=True):
        if used + size > room or not lines:
            lines.append("")
            used = 0
        lines[-1] += term
        used += size
    return [line.strip() for line in lines]


def _aligned_lines(left: str, terms: Sequence[str], margin: int, columns: int) -> Iterator[str]:
    """Yield the lines of an equation.

    :param margin: columns before its sign of equality.
    """
    head = " " * (margin - width(left)) + f"{left} = "
    room = max(columns - width(head), 10)
    for line in _filled_lines(terms, map(width, terms), room):
        for piece in wrapped_lines(line, room):
            yield head + piece
            head = " " * width(head)
