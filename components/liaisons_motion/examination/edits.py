"""Changes of one place of a component's source, the ones that authors most often have to make."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, cast, final

_PARTNERS = {
    "sin": ("cos", "sinh"),
    "cos": ("sin", "cosh"),
    "sinh": ("cosh", "sin"),
    "cosh": ("sinh", "cos"),
    "tan": ("tanh",),
    "tanh": ("tan",),
    "arcsin": ("arccos",),
    "arccos": ("arcsin",),
    "exp": ("expm1",),
    "expm1": ("exp",),
}
_AXES = {"x", "y", "z"}
_DECORATORS = {"output": ("constraint", "non_holonomic"), "constraint": ("output",), "non_holonomic": ("output",)}
_DECLARATIONS = {"Coordinate": "ActiveCoordinate", "ActiveCoordinate": "Coordinate"}
_UNITS = (
    *("1", "m", "rad", "kg", "kg.m2", "N", "N.m", "N/m", "N.m/rad", "N.s/m", "N.m.s/rad", "J", "s"),
    *("1/s", "1/m", "m/s", "rad/s", "m/s2", "m2", "kg/m3", "Hz"),
)
"""Units that mechanics declares most often."""
_PAIRS = ((ast.Add, ast.Sub), (ast.Mult, ast.Div), (ast.Lt, ast.Gt), (ast.LtE, ast.GtE))
_OPPOSITES: dict[type[ast.AST], ast.AST] = {
    kind: other for one, two in _PAIRS for kind, other in ((one, two()), (two, one()))
}
_FIELDS: dict[type[ast.AST] | tuple[type[ast.AST], ...], tuple[str, ...]] = {
    (ast.Return, ast.Assign, ast.AugAssign): ("value",),
    ast.BinOp: ("left", "right"),
    ast.UnaryOp: ("operand",),
    ast.Call: ("args",),
    ast.Dict: ("values",),
    (ast.Tuple, ast.List): ("elts",),
    (ast.GeneratorExp, ast.ListComp): ("elt",),
    ast.IfExp: ("body", "orelse"),
}


@final
@dataclass(frozen=True)
class Edit:
    """One change of a tree, made and taken back in place.

    :param line: number of the line that is changed.
    :param method: the undecorated method that it lies in; empty: what it changes is declared by more than a method.
    :param rank: how far from what authors mistype, 0 the nearest.
    """

    line: int
    written: str
    instead: str
    method: str
    rank: int
    places: Sequence[tuple[ast.AST, str, int | None, Any]]

    def swap(self) -> Callable[[], None]:
        """Make the change; returns a function that takes it back."""
        before = [(node, name, index, _get(node, name, index)) for node, name, index, _ in self.places]
        for place in self.places:
            _set(*place)

        def take_back() -> None:
            for place in before:
                _set(*place)

        return take_back


def _get(node: ast.AST, name: str, index: int | None) -> Any:
    value = getattr(node, name)
    return value if index is None else value[index]


def _set(node: ast.AST, name: str, index: int | None, value: Any) -> None:
    if isinstance(value, ast.AST):
        ast.fix_missing_locations(value)
    if index is None:
        setattr(node, name, value)
    else:
        getattr(node, name)[index] = value


def edits_of(declared: ast.ClassDef, alike: Callable[[str], Sequence[str]], solutions: Sequence[str]) -> list[Edit]:
    """All changes that are tried in a class, the likely ones first.

    :param alike: name of a declaration -> names that may stand in its place, for it has the same unit.
    :param solutions: names of the methods that are closed forms.
    """
    edits = list[Edit]()
    for statement in declared.body:
        if isinstance(statement, ast.FunctionDef):
            names = _names_of(statement, declared, alike, solutions)
            for line in statement.body:
                if not isinstance(line, ast.Expr):  # a docstring, or a condition
                    for node in ast.walk(line):
                        edits += _edits_at(node, names)
            edits += [] if statement.name in solutions else _decorator_edits(statement)
        elif isinstance(statement, ast.Assign) and isinstance(statement.value, ast.Call):
            function = statement.value.func
            if isinstance(function, ast.Name) and function.id in _DECLARATIONS:
                edits.append(_renamed(function, "id", _DECLARATIONS[function.id], statement, rank=1))
    return sorted(edits, key=lambda edit: edit.rank)


def unit_edits(declared: ast.ClassDef) -> list[Edit]:
    """Other units in place of those that a class declares."""
    edits = list[Edit]()
    for statement in declared.body:
        if isinstance(statement, ast.Assign) and isinstance(statement.value, ast.Call):
            call = statement.value
            for index, argument in enumerate(call.args[:2]):
                if isinstance(argument, ast.Constant) and argument.value in _UNITS:
                    others = (unit for unit in _UNITS if unit != argument.value)
                    edits += [_edit(statement, [(call, "args", index, ast.Constant(one))], 3, "") for one in others]
    return edits


def _decorator_edits(statement: ast.FunctionDef) -> Iterator[Edit]:
    for decorator in statement.decorator_list:
        function = decorator.func if isinstance(decorator, ast.Call) else decorator
        if isinstance(function, ast.Name) and function.id in _DECORATORS:
            yield from (_renamed(function, "id", one, decorator, rank=1) for one in _DECORATORS[function.id])


def _renamed(node: ast.AST, field: str, name: str, shown: ast.AST, *, rank: int, method: str = "") -> Edit:
    return _edit(shown, [(node, field, None, name)], rank, method)


def _edit(
    shown: ast.AST,
    places: Sequence[tuple[ast.AST, str, int | None, Any]],
    rank: int,
    method: str,
    changed: ast.AST | None = None,
) -> Edit:
    """Edit whose texts are those of the whole expression ``shown``, before and after it; ``changed`` has its line."""
    edit = Edit(getattr(changed or shown, "lineno", 0), ast.unparse(shown), "", method, rank, places)
    take_back = edit.swap()
    instead = ast.unparse(shown)
    take_back()
    return replace(edit, instead=instead)


@final
@dataclass(frozen=True)
class Names:
    """Names that may stand in each other's place in one method.

    :param alike: name of a declaration -> those of the same unit, or of the same kind.
    :param method: as of an edit, ``owner`` the argument whose attributes they are.
    :param inside: local variables of the method, and methods of no arguments as ``self.name()``.
    """

    method: str
    owner: str
    alike: Callable[[str], Sequence[str]]
    inside: Sequence[str]


def _names_of(
    statement: ast.FunctionDef, declared: ast.ClassDef, alike: Callable[[str], Sequence[str]], solutions: Sequence[str]
) -> Names:
    stored = (node.id for node in ast.walk(statement) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store))
    inside = sorted({*stored} - {"_"})
    if statement.name in solutions:
        return Names(statement.name, "at", alike, inside)
    methods = (s for s in declared.body if isinstance(s, ast.FunctionDef) and s is not statement)
    helpers = [s.name for s in methods if s.name.startswith("_") and [a.arg for a in s.args.args] == ["self"]]
    method = "" if statement.decorator_list else statement.name
    return Names(method, "self", alike, [*inside, *(f"self.{name}()" for name in helpers)])


def _edits_at(node: ast.AST, names: Names) -> Iterator[Edit]:
    """Changes of a node and of the expressions that it holds."""
    for kind, changes in _CHANGES.items():
        if isinstance(node, kind):
            yield from changes(node, names)
    for field, index, child in _expressions_of(node):
        for other, rank in _replacements(node, child, names):
            value = ast.parse(other, mode="eval").body
            yield _edit(node, [(node, field, index, value)], rank, names.method, child)


def _operations(node: ast.BinOp, names: Names) -> Iterator[Edit]:
    """The opposite operation, and other numbers."""
    if other := _OPPOSITES.get(type(node.op)):
        rank = 0 if isinstance(other, (ast.Add, ast.Sub)) else 2
        yield _edit(node, [(node, "op", None, other)], rank, names.method, node.right)
    for field in ("left", "right"):
        child = getattr(node, field)
        if isinstance(child, ast.Constant) and isinstance(child.value, (int, float)):
            for other, rank in _constants(child.value):
                yield _edit(node, [(node, field, None, other)], rank, names.method, child)


def _comparisons(node: ast.Compare, names: Names) -> Iterator[Edit]:
    if other := _OPPOSITES.get(type(node.ops[0])):
        yield _edit(node, [(node, "ops", 0, other)], 1, names.method)


def _choices(node: ast.IfExp, names: Names) -> Iterator[Edit]:
    yield _edit(node, [(node, "body", None, node.orelse), (node, "orelse", None, node.body)], 1, names.method)


def _axes(node: ast.Subscript, names: Names) -> Iterator[Edit]:
    if isinstance(node.slice, ast.Constant) and node.slice.value in _AXES:
        for axis in sorted(_AXES - {node.slice.value}):
            yield _edit(node, [(node, "slice", None, ast.Constant(axis))], 1, names.method)


def _calls(node: ast.Call, names: Names) -> Iterator[Edit]:
    """The partners of a function, and its last two arguments in each other's place."""
    function = node.func
    name, field = (function.attr, "attr") if isinstance(function, ast.Attribute) else (ast.unparse(function), "id")
    for rank, partner in zip((0, 2), _PARTNERS.get(name, ()), strict=False):
        yield _renamed(function, field, partner, node, rank=rank, method=names.method)
    yield from _swapped(node, "args", node.args, len(node.args) - 2, names.method)


def _entries(node: ast.Dict, names: Names) -> Iterator[Edit]:
    for first in range(len(node.values) - 1):
        yield from _swapped(node, "values", node.values, first, names.method)


def _constants(value: float) -> Iterator[tuple[ast.Constant, int]]:
    """Other numbers in a number's place: of factors and of moments of inertia."""
    near = {value + 1, value - 1, value * 2, value / 2 if isinstance(value, float) else value // 2 or value}
    yield from ((ast.Constant(other), 1) for other in sorted(near - {value, 0}))
    if isinstance(value, int) and value > 1:
        yield from ((ast.Constant(other), 3) for other in (2, 3, 4, 5, 6, 8, 12) if other not in near | {value})


def _swapped(node: ast.AST, field: str, values: Sequence[ast.AST], first: int, method: str) -> Iterator[Edit]:
    """Two neighbours in a list of values, each in place of the other."""
    if first >= 0:
        pair = [(node, field, first, values[first + 1]), (node, field, first + 1, values[first])]
        yield _edit(node, pair, 2, method)


def _expressions_of(node: ast.AST) -> Iterator[tuple[str, int | None, ast.expr]]:
    """Fields of a node that hold numbers: of what is computed, not of annotations, keys and functions' names."""
    for kinds, fields in _FIELDS.items():
        if isinstance(node, kinds):
            for field in fields:
                value = getattr(node, field)
                if isinstance(value, list):
                    children = cast("list[ast.expr]", value)
                    yield from ((field, index, child) for index, child in enumerate(children))
                elif value is not None:
                    yield field, None, value


def _replacements(node: ast.AST, child: ast.expr, names: Names) -> Iterator[tuple[str, int]]:
    """Expressions in place of a node's child, with their ranks: scaled, without a term, with another name or term."""
    text, is_number = ast.unparse(child), isinstance(child, ast.Constant)
    if is_number and isinstance(node, (ast.List, ast.Tuple)):
        yield from ((f"-{text}", 1), (f"{text} + 1", 2), (f"{text} - 1", 2))
    if is_number or isinstance(child, (ast.Dict, ast.List, ast.Tuple, ast.Starred)):
        return
    if isinstance(child, (ast.BinOp, ast.Call)) or isinstance(node, (ast.Call, ast.Dict, ast.List, ast.Tuple)):
        yield from ((f"-({text})", 0), (f"2 * ({text})", 1), (f"({text}) / 2", 1))
    if isinstance(child, ast.UnaryOp):
        yield ast.unparse(child.operand), 0
    elif isinstance(child, ast.BinOp):
        rank = 2 if isinstance(child.op, (ast.Add, ast.Sub)) else 3
        yield from ((ast.unparse(side), rank) for side in (child.left, child.right))
    elif isinstance(child, ast.Call) and len(child.args) == 1 and not isinstance(child.args[0], ast.Starred):
        yield ast.unparse(child.args[0]), 3
    elif isinstance(child, ast.Attribute) and text == f"{names.owner}.{child.attr}":
        yield from _other_names(text, child.attr, names)
    elif isinstance(child, ast.Name) and text in names.inside:
        yield from ((name, 3) for name in (*names.inside, f"{text} ** 2") if name != text)
        if names.alike(text):
            yield f"{names.owner}.{text}", 2


def _other_names(text: str, declared: str, names: Names) -> Iterator[tuple[str, int]]:
    """Expressions in place of a declared name."""
    for name in names.alike(declared):
        yield f"{names.owner}.{name}", 2
        if names.owner == "self":
            yield from ((f"{text} {sign} self.{name}", 3) for sign in "+-")
    yield from ((name, 2 if name == declared else 3) for name in names.inside)
    yield f"{text} ** 2", 3


def _swapped_names(node: ast.Assign | ast.Return, names: Names) -> Iterator[Edit]:
    """Pairs of names of the same kind, each in place of the other throughout a statement."""
    used: dict[str, list[ast.AST]] = {}
    for part in ast.walk(node):
        if isinstance(part, ast.Attribute) and isinstance(part.value, ast.Name) and part.value.id in {"self", "at"}:
            used.setdefault(part.attr, []).append(part)
    for (first, firsts), (second, seconds) in combinations(used.items(), 2):
        if second in names.alike(first):
            places = [(part, "attr", None, second) for part in firsts]
            places += [(part, "attr", None, first) for part in seconds]
            yield _edit(node, places, 2, names.method)


_CHANGES: dict[Any, Callable[[Any, Names], Iterator[Edit]]] = {
    ast.BinOp: _operations,
    ast.Compare: _comparisons,
    ast.IfExp: _choices,
    ast.Subscript: _axes,
    ast.Call: _calls,
    ast.Dict: _entries,
    (ast.Assign, ast.Return): _swapped_names,
}
"""Changes of a node by its kind."""
