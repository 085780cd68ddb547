"""Changes of one place of a component's source, the ones that authors most often have to make."""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, final

_PARTNERS = {"sin": "cos", "cos": "sin", "sinh": "cosh", "cosh": "sinh", "sn": "cn", "cn": "sn"}
_DECORATORS = {"output": "constraint", "constraint": "output"}
_DECLARATIONS = {"Coordinate": "ActiveCoordinate", "ActiveCoordinate": "Coordinate"}
_UNITS = (
    *("1", "m", "rad", "kg", "kg.m2", "N", "N.m", "N/m", "N.m/rad", "N.s/m", "N.m.s/rad", "J", "s"),
    *("1/s", "1/m", "m/s", "rad/s", "m/s2", "m2", "kg/m3", "Hz"),
)
"""Units that mechanics declares most often."""
_OPERATORS: dict[type[ast.operator], ast.operator] = {ast.Add: ast.Sub(), ast.Sub: ast.Add()}


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
        ast.copy_location(value, node)
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
            is_plain = statement.name in solutions or not statement.decorator_list
            method = statement.name if is_plain else ""
            for line in statement.body:
                for node in ast.walk(line):
                    edits += _edits_at(node, alike, method)
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
            yield _renamed(function, "id", _DECORATORS[function.id], decorator, rank=1)


def _renamed(node: ast.AST, field: str, name: str, shown: ast.AST, *, rank: int, method: str = "") -> Edit:
    return _edit(shown, [(node, field, None, name)], rank, method)


def _edit(shown: ast.AST, places: Sequence[tuple[ast.AST, str, int | None, Any]], rank: int, method: str) -> Edit:
    """Edit whose texts are those of the whole expression ``shown``, before and after it."""
    edit = Edit(getattr(shown, "lineno", 0), ast.unparse(shown), "", method, rank, places)
    take_back = edit.swap()
    instead = ast.unparse(shown)
    take_back()
    return replace(edit, instead=instead)


def _edits_at(node: ast.AST, alike: Callable[[str], Sequence[str]], method: str) -> Iterator[Edit]:
    """Changes of a node and of the expressions that it holds."""
    if isinstance(node, ast.BinOp):
        if other := _OPERATORS.get(type(node.op)):
            yield _edit(node, [(node, "op", None, other)], 0, method)
        yield from _constant_edits(node, method)
    if isinstance(node, ast.Call):
        function = node.func
        name, field = (
            (function.attr, "attr") if isinstance(function, ast.Attribute) else (getattr(function, "id", ""), "id")
        )
        if name in _PARTNERS:
            yield _renamed(function, field, _PARTNERS[name], node, rank=0, method=method)
    if isinstance(node, (ast.Assign, ast.Return)) and node.value is not None:
        yield from _swapped_names(node, alike, method)
    for field, index, child in _expressions_of(node):
        yield from _replacements((node, field, index), child, alike, method)


def _expressions_of(node: ast.AST) -> Iterator[tuple[str, int | None, ast.expr]]:
    """Fields of a node that hold numbers: of what is computed, not of annotations, keys and functions' names."""
    if isinstance(node, (ast.Return, ast.Assign)) and node.value is not None:
        yield "value", None, node.value
    elif isinstance(node, ast.BinOp):
        yield "left", None, node.left
        yield "right", None, node.right
    elif isinstance(node, ast.UnaryOp):
        yield "operand", None, node.operand
    elif isinstance(node, ast.Call):
        yield from (("args", index, child) for index, child in enumerate(node.args))
    elif isinstance(node, ast.Dict):
        yield from (("values", index, child) for index, child in enumerate(node.values))
    elif isinstance(node, (ast.Tuple, ast.List)):
        yield from (("elts", index, child) for index, child in enumerate(node.elts))


def _constant_edits(node: ast.BinOp, method: str) -> Iterator[Edit]:
    for field in ("left", "right"):
        child = getattr(node, field)
        if isinstance(child, ast.Constant) and isinstance(child.value, (int, float)):
            for other in {child.value + 1, child.value - 1, child.value * 2} - {child.value}:
                if other:
                    yield _edit(node, [(node, field, None, ast.Constant(other))], 1, method)


def _replacements(
    place: tuple[ast.AST, str, int | None], child: ast.expr, alike: Callable[[str], Sequence[str]], method: str
) -> Iterator[Edit]:
    """Other expressions in one's place: scaled, without a term, with another name, with a further term."""
    if isinstance(child, (ast.Dict, ast.List, ast.Tuple, ast.Constant)):
        return
    text = ast.unparse(child)

    def edit(other: str, rank: int) -> Edit:
        return _edit(place[0], [(*place, ast.parse(other, mode="eval").body)], rank, method)

    if isinstance(child, (ast.BinOp, ast.Call)) or isinstance(place[0], (ast.Call, ast.Dict)):
        for scaled, rank in (("-({})", 0), ("2 * ({})", 1), ("({}) / 2", 1)):
            yield edit(scaled.format(text), rank)
    if isinstance(child, ast.BinOp) and isinstance(child.op, (ast.Add, ast.Sub)):
        yield edit(ast.unparse(child.left), 2)
        yield edit(ast.unparse(child.right), 2)
    if isinstance(child, ast.BinOp) and isinstance(child.op, (ast.Mult, ast.Div)):
        yield edit(ast.unparse(child.left), 3)
    if isinstance(child, ast.Attribute) and isinstance(child.value, ast.Name) and child.value.id in {"self", "at"}:
        owner = child.value.id
        for name in alike(child.attr):
            yield edit(f"{owner}.{name}", 2)
            if owner == "self":
                yield edit(f"{text} + {owner}.{name}", 3)
                yield edit(f"{text} - {owner}.{name}", 3)
        yield edit(f"{text} ** 2", 3)


def _swapped_names(node: ast.Assign | ast.Return, alike: Callable[[str], Sequence[str]], method: str) -> Iterator[Edit]:
    """Pairs of names of the same kind, each in place of the other throughout a statement."""
    used: dict[str, list[ast.AST]] = {}
    for part in ast.walk(node):
        if isinstance(part, ast.Attribute) and isinstance(part.value, ast.Name) and part.value.id in {"self", "at"}:
            used.setdefault(part.attr, []).append(part)
    for (first, firsts), (second, seconds) in combinations(used.items(), 2):
        if second in alike(first):
            places = [(part, "attr", None, second) for part in firsts]
            places += [(part, "attr", None, first) for part in seconds]
            yield _edit(node, places, 2, method)
