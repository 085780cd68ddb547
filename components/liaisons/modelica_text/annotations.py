"""Annotations of components: documentation, and an icon from the picture at the start."""

from __future__ import annotations

import html
import re
from typing import Any

import casadi as ca
import numpy as np

from liaisons.language import Mechanism
from liaisons.language.component import Component
from liaisons.modelica_text.text import quoted

MOST_SHAPES, MOST_POINTS = 6, 12
_LAWS = "p = ∂L/∂q_dot: K eq. 79; der(p) = ∂L/∂q + Q: M eq. 36; forces of the operator: M eq. 27."


def annotation(component: type[Component]) -> list[str]:
    """The line of the annotation of a package: sources with the numbers of their equations, icon."""
    source = re.findall(r"(?ms)^Source: .+?(?=\n\n|\Z)", (component.__doc__ and _flat(component.__doc__)) or "")
    texts = [*(" ".join(text.split()) for text in source), *([_LAWS] if issubclass(component, Mechanism) else [])]
    body = "".join(f"<p>{html.escape(text, quote=False)}</p>" for text in texts or [component.summary()])
    info = f"Documentation(info={quoted(f'<html>{body}</html>')})"
    shapes = _shapes(component) if issubclass(component, Mechanism) else []
    graphics = shapes or ['Text(extent={{-90, -40}, {90, 40}}, textString="%name")']
    return [f"annotation(Icon(graphics={{{', '.join(graphics)}}}), {info});"]


def _flat(text: str) -> str:
    return "\n".join(line.strip() for line in text.splitlines())


def _shapes(component: type[Mechanism]) -> list[str]:
    """Graphics of the shapes, in the plane in which they are widest; none if they are many."""
    m = component()
    starts = m.start_values()
    symbols = [*m.symbols.values()]
    values = [starts[name] for name in m.symbols]

    def at_start(expression: Any) -> float:
        return float(ca.Function("at_start", symbols, [ca.densify(ca.SX(expression))])(*values))

    shapes = [shape.document(at_start) for shape in m.picture()]
    drawn = [shape for shape in shapes if shape["shape"] != "trail"]
    if not 0 < len(drawn) <= MOST_SHAPES:
        return []
    paths = [np.array(_path(shape), dtype=float) for shape in drawn]
    points = np.concatenate(paths)
    plane = sorted(np.argsort(-np.ptp(points, axis=0), kind="stable")[:2])
    middle, size = (np.max(points, axis=0) + np.min(points, axis=0)) / 2, np.max(np.ptp(points, axis=0)) or 1.0
    graphics = []
    for shape, path in zip(drawn, paths, strict=True):
        ends = np.round(150 * (path - middle)[:, plane] / size).astype(int).tolist()
        if shape["shape"] in ("ball", "box"):
            (x, y), kind = ends[0], "Ellipse" if shape["shape"] == "ball" else "Rectangle"
            corners = f"{{{{{x - 20}, {y - 20}}}, {{{x + 20}, {y + 20}}}}}"
            graphics.append(f"{kind}(extent={corners})")
        else:
            graphics.append(f"Line(points={{{', '.join(f'{{{x}, {y}}}' for x, y in ends)}}})")
    return graphics


def _path(shape: dict) -> list:
    if "at" in shape:
        return [shape["at"]]
    if "points" in shape:
        kept = shape["points"][:: max(1, len(shape["points"]) // MOST_POINTS)]
        return [*kept, *kept[: int(shape["closed"])]]
    return [shape["from"], shape["to"]]
