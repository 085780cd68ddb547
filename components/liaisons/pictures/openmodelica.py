"""A motion for OpenModelica's editor: ``NAME_visual.xml`` beside ``NAME_res.csv``, which its animation window opens.

The elements are those that OMEdit reads, in its ``Animation/Visualization.cpp``; a number stands in ``exp``, and what
moves names a column of the table in ``cref``.  Its cylinders and springs begin at ``r`` and go along ``lengthDir``,
spheres and boxes are pushed along it by half their length, its y axis is up, and it has no trails.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from itertools import pairwise
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from liaisons.pictures.frames import Frames, Moving
from liaisons.pictures.stage import BALL, COLOURS, ROD, SPRING, WIRE, Stage

_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
_IDENTITY = np.eye(3).ravel()
_ALONG, _ACROSS = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)

Attributes = Mapping[str, object]
"""Numbers, or arrays (n,) or (n, k) over the frames, by element."""


def visual(shown: Frames) -> tuple[bytes, bytes]:
    """The description of the shapes, and the table of what moves."""
    root, columns = ElementTree.Element("visualization"), {"time": shown.time}
    for i, (kind, what, attributes) in enumerate(_bodies(shown), 1):
        body = ElementTree.SubElement(root, "shape")
        ElementTree.SubElement(body, "ident").text = f"{kind}{i}"
        ElementTree.SubElement(body, "type").text = what
        colour = list(bytes.fromhex(COLOURS[kind][1:]))
        usual = {"T": _IDENTITY, "r_shape": np.zeros(3), "lengthDir": _ALONG, "widthDir": _ACROSS, "extra": 0.0}
        for name, given in (usual | {"color": colour, "specCoeff": 0.7} | dict(attributes)).items():
            element = ElementTree.SubElement(body, name)
            values = np.asarray(given, dtype=float)
            table = values if values.ndim == 2 else np.broadcast_to(values, (len(shown.time), values.size))
            for k, column in enumerate(table.T):
                if np.ptp(column):
                    columns[f"{kind}{i}_{name}_{k}"] = column
                    ElementTree.SubElement(element, "cref").text = f"{kind}{i}_{name}_{k}"
                else:
                    ElementTree.SubElement(element, "exp").text = repr(float(column[0]))
    ElementTree.indent(root)
    text = io.StringIO()
    head = ",".join(f'"{name}"' for name in columns)
    np.savetxt(text, np.column_stack(list(columns.values())), "%.9g", ",", header=head, comments="")
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True), text.getvalue().encode()


def _bodies(shown: Frames) -> Iterator[tuple[str, str, Attributes]]:
    """Kind of the shape, what OMEdit calls the body, and what that needs."""
    stage = Stage(shown)
    for shape in shown.shapes:
        points, extent = shape.points @ _UP.T, stage.extent
        if shape.kind == "ball":
            across = 2 * (BALL * extent if shape.size is None else shape.size)
            yield "ball", "sphere", _centred(points[:, 0], across, across, across)
        elif shape.kind == "box":
            assert shape.axes is not None  # as for all boxes
            assert shape.size is not None
            turn = (shape.axes @ _UP.T).reshape(-1, 9)
            yield "box", "box", {**_centred(points[:, 0], *shape.size.T[:, :, None]), "T": turn}
        elif shape.kind == "rod":
            yield "rod", "cylinder", _between(points, 2 * (ROD * extent if shape.size is None else shape.size))
        elif shape.kind == "spring":
            wire = {"height": WIRE * extent, "extra": float(stage.coils(shape))}
            yield "spring", "spring", {**_between(points, SPRING * extent), **wire}
        elif shape.kind == "wire":
            yield from _wire(shape, points, 2 * WIRE * extent)


def _wire(shape: Moving, points: NDArray, across: float) -> Iterator[tuple[str, str, Attributes]]:
    places = [*range(points.shape[1]), *([0] if shape.closed else [])]
    return (("wire", "cylinder", _between(points[:, [a, b]], across)) for a, b in pairwise(places))


def _centred(place: NDArray, *sizes: NDArray | float) -> Attributes:
    length, width, height = sizes
    back = -0.5 * np.asarray(length) * np.array(_ALONG)
    return {"r": place, "r_shape": back, "length": length, "width": width, "height": height}


def _between(ends: NDArray, across: NDArray | float) -> Attributes:
    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    return {"r": ends[:, 0], "lengthDir": along, "length": length, "width": across, "height": across}
