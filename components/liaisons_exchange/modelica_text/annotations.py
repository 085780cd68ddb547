"""Annotations of components: an icon from the picture at the start, and the sources."""

import html
import inspect
from typing import Any

import casadi as ca
import numpy as np

from liaisons.language import Component, Mechanism, Operator
from liaisons_exchange.modelica_text.text import string_literal

MOST_SHAPES, MOST_POINTS = 6, 12
_LAWS = "p = ∂L/∂q_dot: K eq. 78; der(p) = ∂L/∂q + Q: M eq. 36; forces of the operator: M eq. 27."
_NAME = 'Text(extent={{-90, -40}, {90, 40}}, textString="%name")'


def annotation(component: type[Component]) -> str:
    """Return the annotation of a package: icon and sources."""
    blocks = (inspect.getdoc(component) or "").split("\n\n")
    texts = [" ".join(block.split()) for block in blocks if block.startswith("Source:")]
    texts += [component.summary() if issubclass(component, Operator) else _LAWS]
    body = "".join(f"<p>{html.escape(text, quote=False)}</p>" for text in texts)
    icon = ", ".join(_graphics(component) if issubclass(component, Mechanism) else ()) or _NAME
    return f"annotation(Icon(graphics={{{icon}}}), Documentation(info={string_literal(f'<html>{body}</html>')}));"


def _graphics(component: type[Mechanism]) -> list[str]:
    """Return graphics of the picture at the start, in the plane where it is widest; none for many shapes."""
    m = component()
    starts = [m.start_values()[name] for name in m.symbols]

    def at_start(expression: Any) -> float:
        return float(ca.Function("at_start", [*m.symbols.values()], [ca.densify(ca.SX(expression))])(*starts))

    shapes = [document for shape in m.picture() if (document := shape.document(at_start))["shape"] != "trail"]
    paths = [np.array(_outline_points(**shape), dtype=float) for shape in shapes]
    if not 0 < len(paths) <= MOST_SHAPES:
        return []
    low, high = (extreme(np.concatenate(paths), axis=0) for extreme in (np.min, np.max))
    plane = sorted(np.argsort(low - high, kind="stable")[:2])
    scale = 150 / (np.max(high - low) or 1)
    drawn = [np.round(scale * (path - (low + high) / 2)).astype(int)[:, plane].tolist() for path in paths]
    texts = (
        f"Line(points={path})" if path[1:] else f"Ellipse(extent={[[x + d for x in path[0]] for d in (-20, 20)]})"
        for path in drawn
    )
    return [text.translate(str.maketrans("[]", "{}")) for text in texts]


def _outline_points(**shape: Any) -> list[list[float]]:
    """Return the points of a shape in drawing order, thinned out."""
    points = shape.get("points") or [shape[end] for end in ("at", "from", "to") if end in shape]
    points = points[:: len(points) // MOST_POINTS or 1]
    return [*points, *points[: int(shape.get("closed", 0))]]
