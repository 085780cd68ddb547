"""A motion for OpenModelica's editor: ``NAME_visual.xml`` beside ``NAME_res.csv``, which its animation window opens.

The elements are those of OMEdit's ``Animation/Visualization.cpp``: ``exp`` has a number, ``cref`` the name of a column
of the table.  Cylinders and springs start at ``r`` and go along ``lengthDir``, spheres and boxes are shifted along it
by half their length, y is up, and there are no trails.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from liaisons_pages.pictures.frames import Frames
from liaisons_pages.pictures.stage import COLOURS, SIZES, Stage

_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
_IDENTITY = np.eye(3).ravel()
_ALONG, _ACROSS = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)

Attributes = Mapping[str, object]
"""Numbers, or arrays (n,) or (n, k) over the frames, by element."""


def openmodelica_files(shown: Frames) -> tuple[bytes, bytes]:
    """Contents of both files: the description of the shapes, and the table of what moves."""
    root, columns = ElementTree.Element("visualization"), {"time": shown.time}
    for i, (kind, body_type, attributes) in enumerate(_visual_bodies(shown), 1):
        body = ElementTree.SubElement(root, "shape")
        ElementTree.SubElement(body, "ident").text = f"{kind}{i}"
        ElementTree.SubElement(body, "type").text = body_type
        colour = list(bytes.fromhex(COLOURS[kind][1:]))
        usual = {"T": _IDENTITY, "r_shape": np.zeros(3), "lengthDir": _ALONG, "widthDir": _ACROSS, "extra": 0.0}
        for name, value in (usual | {"color": colour, "specCoeff": 0.7} | dict(attributes)).items():
            element = ElementTree.SubElement(body, name)
            values = np.asarray(value, dtype=float)
            table = values if values.ndim == 2 else np.broadcast_to(values, (len(shown.time), values.size))
            for k, column in enumerate(table.T):
                if np.ptp(column):
                    reference = f"{kind}{i}_{name}_{k}"
                    columns[reference] = column
                    ElementTree.SubElement(element, "cref").text = reference
                else:
                    ElementTree.SubElement(element, "exp").text = repr(float(column[0]))
    ElementTree.indent(root)
    text = io.StringIO()
    head = ",".join(f'"{name}"' for name in columns)
    np.savetxt(text, np.column_stack(list(columns.values())), "%.9g", ",", header=head, comments="")
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True), text.getvalue().encode()


def _visual_bodies(shown: Frames) -> Iterator[tuple[str, str, Attributes]]:
    """Yield kind, type in OMEdit, and attributes of each visible body; of a polyline those of each segment."""
    stage = Stage(shown)
    for shape in shown.shapes:
        points = shape.closed_points @ _UP.T
        if shape.axes is not None:
            assert shape.size is not None
            rotation = (shape.axes @ _UP.T).reshape(-1, 9)
            yield shape.kind, "box", {**_centred_body(points[:, 0], *shape.size.T[:, :, None]), "T": rotation}
        elif shape.kind in ("ball", "flash"):
            yield shape.kind, "sphere", _centred_body(points[:, 0], *3 * [2 * stage.radius(shape)])
        elif shape.kind == "spring":
            wire = {"height": SIZES["wire"] * stage.extent, "extra": float(stage.coil_count(shape))}
            yield "spring", "spring", {**_body_between(points, stage.radius(shape)), **wire}
        elif shape.kind != "trail":
            for k in range(points.shape[1] - 1):
                yield shape.kind, "cylinder", _body_between(points[:, k:], 2 * stage.radius(shape))


def _centred_body(centre: NDArray, length: NDArray, width: NDArray, height: NDArray) -> Attributes:
    """Attributes of a body about its centre."""
    start = -0.5 * length * np.array(_ALONG)
    return {"r": centre, "r_shape": start, "length": length, "width": width, "height": height}


def _body_between(ends: NDArray, across: NDArray | float) -> Attributes:
    """Attributes of a body from one end to the other."""
    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    return {"r": ends[:, 0], "lengthDir": along, "length": length, "width": across, "height": across}
