"""Terms that an energy, a point or a rate may lack."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Sequence
from itertools import combinations, product

from liaisons.language import Component, Parameter
from liaisons_motion.examination.edits import Edit

_ENERGIES = {"kinetic_energy", "potential_energy", "dissipation_function"}


def missing_terms(declared: ast.ClassDef, component: type[Component]) -> Iterator[Edit]:
    """Further terms of the right units, as changes of the lines that lack them."""
    coordinates = {c.name: c.unit for c in (*getattr(component, "coordinates", ()), *getattr(component, "actives", ()))}
    for method in declared.body:
        if isinstance(method, ast.FunctionDef):
            for node in ast.walk(method):
                yield from _terms_at(node, method, component, coordinates)


def _terms_at(
    node: ast.AST, method: ast.FunctionDef, component: type[Component], coordinates: dict[str, str]
) -> Iterator[Edit]:
    """Further terms of an energy that is returned, of a point's components, and of rates."""
    plain = "" if method.decorator_list else method.name
    if isinstance(node, ast.Return) and node.value is not None and method.name in _ENERGIES:
        for term in _energies(method.name, component, coordinates):
            yield _added((node, "value", None), node.value, term, plain, 2)
    if isinstance(node, ast.Dict) and any(ast.unparse(one).startswith("point") for one in method.decorator_list):
        lengths = [name for name, unit in coordinates.items() if unit == "m"]
        for (index, value), name, sign in product(enumerate(node.values), lengths, "+-"):
            yield _added((node, "values", index), value, f"{sign} self.{name}", plain, 1)
    for name, child in ast.iter_fields(node):
        if isinstance(child, ast.Call) and ast.unparse(child.func) == "self.dot":
            for term, sign in product(_rates(ast.unparse(child), coordinates), "+-"):
                yield _added((node, name, None), child, f"{sign} {term}", plain, 2)


def _energies(method: str, component: type[Component], coordinates: dict[str, str]) -> Sequence[str]:
    """Terms of kinetic or potential energy that a mechanism of these declarations may have."""
    declared = {p.name: p.unit for p in vars(component).values() if isinstance(p, Parameter)}

    def of(unit: str) -> list[str]:
        return [f"self.{name}" for name, other in declared.items() if other == unit]

    points = [f"self.{point.name}" for point in getattr(component, "points", ())]
    lengths = [f"self.{name}" for name, unit in coordinates.items() if unit == "m"]
    angles = [f"self.{name}" for name, unit in coordinates.items() if unit == "rad"]
    kinds = (("m", lengths), ("rad", angles))
    if method == "kinetic_energy":
        terms = [f"+ {m} / 2 * self.speed_squared({p})" for m, p in product(of("kg"), points)]
        terms += [f"+ {m} / 2 * self.dot({x}) ** 2" for m, x in product(of("kg"), lengths)]
        terms += [f"+ {j} / 2 * self.dot({a}) ** 2" for j, a in product(of("kg.m2"), angles)]
        rolling, turning = product(of("kg.m2"), lengths, of("m")), product(of("kg"), of("m"), angles)
        terms += [f"+ {j} / 2 * (self.dot({x}) / {r}) ** 2" for j, x, r in rolling]
        return [*terms, *(f"+ {m} / 2 * ({r} * self.dot({a})) ** 2" for m, r, a in turning)]
    ways = [(kind, [*names, *(f"({a} - {b})" for a, b in combinations(names, 2))]) for kind, names in kinds]
    if method == "dissipation_function":
        units = {"m": "N.s/m", "rad": "N.m.s/rad"}
        return [f"+ {c} / 2 * self.dot({x}) ** 2" for kind, xs in ways for c, x in product(of(units[kind]), xs)]
    instance = component()
    heights = [*lengths, *(f'{p}["z"]' for p in points if "z" in getattr(instance, p.removeprefix("self.")))]
    springs = [pair for kind, xs in ways for pair in product(of("N/m" if kind == "m" else "N.m/rad"), xs)]
    terms = [f"{s} {m} * {g} * {z}" for m, g, z, s in product(of("kg"), of("m/s2"), heights, "+-")]
    return [*terms, *(f"+ {k} / 2 * {x} ** 2" for k, x in springs)]


def _rates(text: str, coordinates: dict[str, str]) -> Iterator[str]:
    """Further rates beside one: of another coordinate, as it is or led through an angle."""
    angles = [name for name, unit in coordinates.items() if unit == "rad"]
    for name in coordinates:
        if f"self.{name}" not in text:
            yield f"self.dot(self.{name})"
            yield from (f"self.dot(self.{name}) * ca.{f}(self.{a})" for f, a in product(("cos", "sin"), angles))


def _added(place: tuple[ast.AST, str, int | None], child: ast.expr, term: str, method: str, rank: int) -> Edit:
    written = ast.unparse(child)
    value = ast.parse(f"({written} {term})", mode="eval").body
    return Edit(child.lineno, written, f"{written} {term}", method, rank, [(*place, value)])
