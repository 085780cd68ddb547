"""Frames as binary glTF 2.0 (.glb): one mesh a shape, moved by keyframes; coordinates are ours in single precision.

Khronos Group, glTF 2.0 specification (ISO/IEC 12113:2022).  In glTF the y axis is up: the root node rotates z to it.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from itertools import pairwise
from math import pi, sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons_pages.pictures.frames import Frames, ShapeMotion
from liaisons_pages.pictures.stage import COLOURS, Stage, rgb

_FLOAT, _SHORT = 5126, 5123
_ARRAY_BUFFER, _ELEMENT_ARRAY_BUFFER = 34962, 34963
_LINE_STRIP = 3
_TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
_SIDES, _COILS = 12, 9

Mesh = tuple[NDArray, NDArray, NDArray]
"""Positions and normals (n, 3), and triangles (m, 3) of their indices."""


def glb_file(frames: Frames, name: str) -> bytes:
    """Content of a .glb file.

    :param name: of the scene.
    """
    stage, scene = Stage(frames), _Scene(frames.time)
    for shape in frames.shapes:
        _add_shape(scene, shape, stage)
    return scene.file_content(name)


def _add_shape(scene: _Scene, shape: ShapeMotion, stage: Stage) -> None:
    """Add the nodes of a shape to a scene."""
    centre = shape.points[:, 0]
    if shape.axes is not None:
        scene.add_node(shape.kind, scene.shared_mesh(shape.kind), centre, _quaternions_of_axes(shape.axes), shape.size)
    elif shape.kind == "trail":
        if len(centre) > 1:
            scene.add_node("trail", scene.append_mesh("trail", mode=_LINE_STRIP, POSITION=centre))
    elif shape.kind in ("ball", "flash"):
        scene.add_node(
            shape.kind, scene.shared_mesh(shape.kind), centre, scale=np.repeat(stage.radius(shape), 3, axis=1)
        )
    else:
        radius = stage.radius(shape)
        for start, end in pairwise(np.moveaxis(shape.closed_points, 1, 0)):
            along = end - start
            length = np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
            scale = np.hstack([radius, radius, length])
            scene.add_node(shape.kind, scene.shared_mesh(shape.kind), start, _quaternions_from_z(along / length), scale)


class _Scene:
    """The document and the buffer of a file.

    :param time: of the keyframes [s].
    """

    def __init__(self, time: NDArray) -> None:
        self.buffer = bytearray()
        self.meshes: dict[str, int] = {}
        self.samplers: list[dict[str, Any]] = []
        self.channels: list[dict[str, Any]] = []
        self.document: dict[str, list[Any]] = {
            "bufferViews": [],
            "accessors": [],
            "materials": [_material(kind) for kind in COLOURS],
            "meshes": [],
            "nodes": [],
        }
        self.time = self.append_accessor(time - time[0])

    def append_item(self, key: str, **item: Any) -> int:
        """Append an item to a list of the document; return its index."""
        self.document[key].append(item)
        return len(self.document[key]) - 1

    def append_accessor(self, values: NDArray, **view: int) -> int:
        """Append numbers (n,) or (n, k) to the buffer; return the index of their accessor."""
        component = _SHORT if view.get("target") == _ELEMENT_ARRAY_BUFFER else _FLOAT
        table = values.reshape(len(values), -1).astype(np.uint16 if component == _SHORT else np.float32)
        self.buffer += bytes(-len(self.buffer) % 4)
        view |= {"byteOffset": len(self.buffer), "byteLength": table.nbytes}
        self.buffer += table.tobytes()
        return self.append_item(
            "accessors",
            bufferView=self.append_item("bufferViews", buffer=0, **view),
            componentType=component,
            count=len(table),
            type=_TYPES[table.shape[1]],
            min=table.min(axis=0).tolist(),
            max=table.max(axis=0).tolist(),
        )

    def shared_mesh(self, kind: str) -> int:
        """Index of the mesh that all shapes of a kind share, appended if it is missing."""
        if kind not in self.meshes:
            positions, normals, triangles = _MESHES[kind]()
            indices = self.append_accessor(triangles.ravel(), target=_ELEMENT_ARRAY_BUFFER)
            self.meshes[kind] = self.append_mesh(kind, indices=indices, POSITION=positions, NORMAL=normals)
        return self.meshes[kind]

    def append_mesh(self, kind: str, *, mode: int = 4, indices: int | None = None, **attributes: NDArray) -> int:
        """Append a mesh of one primitive, by default of triangles; return its index."""
        accessors = {name: self.append_accessor(values, target=_ARRAY_BUFFER) for name, values in attributes.items()}
        primitive = {"attributes": accessors, "mode": mode, "material": list(COLOURS).index(kind)}
        return self.append_item(
            "meshes", name=kind, primitives=[primitive | ({} if indices is None else {"indices": indices})]
        )

    def add_node(
        self,
        name: str,
        mesh: int,
        translation: NDArray | None = None,
        rotation: NDArray | None = None,
        scale: NDArray | None = None,
    ) -> None:
        """Add a node that moves, rotates and scales a mesh, with keyframes for what is not constant."""
        node = self.append_item("nodes", name=name, mesh=mesh)
        for path, values in {"translation": translation, "rotation": rotation, "scale": scale}.items():
            if values is None:
                continue
            self.document["nodes"][node][path] = np.float32(values[0]).tolist()
            if np.ptp(values, axis=0).any():
                self.channels.append({"sampler": len(self.samplers), "target": {"node": node, "path": path}})
                output = self.append_accessor(values)
                self.samplers.append({"input": self.time, "output": output, "interpolation": "LINEAR"})

    def file_content(self, name: str) -> bytes:
        """Content of the file, in which all nodes are children of a root node.

        :param name: of the scene.
        """
        children = list(range(len(self.document["nodes"])))
        root = self.append_item("nodes", name=name, rotation=[-sqrt(0.5), 0.0, 0.0, sqrt(0.5)], children=children)
        animation = {"name": "motion", "samplers": self.samplers, "channels": self.channels}
        document = {
            "asset": {"version": "2.0", "generator": "liaisons"},
            "scene": 0,
            "scenes": [{"name": name, "nodes": [root]}],
            **self.document,
            **({"animations": [animation]} if self.channels else {}),
            "buffers": [{"byteLength": len(self.buffer)}],
        }
        text = json.dumps(document, separators=(",", ":")).encode()
        chunks = [(b"JSON", text + b" " * (-len(text) % 4)), (b"BIN\0", self.buffer + bytes(-len(self.buffer) % 4))]
        body = b"".join(struct.pack("<I", len(content)) + kind + content for kind, content in chunks)
        return b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body


def _material(kind: str) -> dict[str, Any]:
    """glTF material of a kind of shape."""
    colour = ((np.array(rgb(kind)) + 0.055) / 1.055) ** 2.4  # from sRGB to linear
    properties = {"baseColorFactor": [*colour.tolist(), 1.0], "metallicFactor": 0.1, "roughnessFactor": 0.55}
    return {"name": kind, "pbrMetallicRoughness": properties}


# ---- rotations ----------------------------------------------------------------------------------------------------


def _quaternions_from_z(unit: NDArray) -> NDArray:
    """Quaternions (n, 4), scalar last, of the shortest rotations from z to unit vectors (n, 3)."""
    quaternions = np.column_stack([-unit[:, 1], unit[:, 0], 0 * unit[:, 0], 1 + unit[:, 2]])
    quaternions[1 + unit[:, 2] < 1e-9] = (1.0, 0.0, 0.0, 0.0)  # straight down: about x
    return _with_continuous_signs(quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True))


def _quaternions_of_axes(axes: NDArray) -> NDArray:
    """Quaternions (n, 4), scalar last, of the rotations to axes (n, 3, 3)."""
    from scipy.spatial.transform import Rotation

    return _with_continuous_signs(Rotation.from_matrix(np.swapaxes(axes, 1, 2)).as_quat())


def _with_continuous_signs(quaternions: NDArray) -> NDArray:
    """Quaternions with the signs, q or -q, that are nearest to the previous keyframe."""
    flips = np.where(np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0, -1.0, 1.0)
    return quaternions * np.cumprod([1.0, *flips])[:, None]


# ---- meshes -------------------------------------------------------------------------------------------------------


def _grid_mesh(positions: NDArray, normals: NDArray) -> Mesh:
    """Mesh of a grid of points (rows, columns, 3), without triangles that have no area."""
    rows, columns = positions.shape[:2]
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).reshape(-1, 1)
    triangles = (first + np.array([0, 1, columns, 1, columns + 1, columns])).reshape(-1, 3)
    positions = positions.reshape(-1, 3)
    a, b, c = positions[triangles].swapaxes(0, 1)
    return positions, normals.reshape(-1, 3), triangles[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-9]


def _revolved_mesh(profile: ArrayLike) -> Mesh:
    """Mesh of a surface of revolution about z.

    :param profile: from below, for each point its radius and z, and radius and z of its normal.
    """
    angle = np.linspace(0, 2 * pi, 2 * _SIDES + 1)
    circle = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    points = [radius * circle + np.array([0.0, 0.0, z]) for radius, z in np.reshape(profile, (-1, 2))]
    return _grid_mesh(np.array(points[::2]), np.array(points[1::2]))


def _sphere() -> Mesh:
    """Mesh of a sphere of radius 1."""
    latitude = np.linspace(-pi / 2, pi / 2, _SIDES + 1)
    return _revolved_mesh(np.column_stack(2 * [np.cos(latitude), np.sin(latitude)]))


def _cylinder() -> Mesh:
    """Mesh of a cylinder of radius 1 from z = 0 to 1, with both discs."""
    bottom, side, top = (0, -1), (1, 0), (0, 1)
    return _revolved_mesh(
        [[(0, 0), bottom], [(1, 0), bottom], [(1, 0), side], [(1, 1), side], [(1, 1), top], [(0, 1), top]]
    )


def _coil() -> Mesh:
    """Mesh of a helix of radius 1 from z = 0 to 1."""
    z = np.linspace(0, 1, 24 * _COILS + 1)
    phase = 2 * pi * _COILS * z
    outward = np.column_stack([np.cos(phase), np.sin(phase), 0 * z])[:, None]
    angle, upward = np.linspace(2 * pi, 0, 7)[:, None], np.array([0.0, 0.0, 1.0])  # so that triangles face outwards
    wire = 0.2 * np.cos(angle) * outward + 0.012 * np.sin(angle) * upward
    return _grid_mesh(outward + z[:, None, None] * upward + wire, np.cos(angle) * outward + np.sin(angle) * upward)


def _cube() -> Mesh:
    """Mesh of a cube of edge 1: six copies of the upper face and of its normal, rotated."""
    face = np.array([[-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1], [0, 0, 2]]) / 2
    faces = np.array([np.roll(face * side, axis, axis=1) for side in ([1, 1, 1], [1, -1, -1]) for axis in range(3)])
    triangles = 4 * np.arange(6)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    return faces[:, :4].reshape(-1, 3), np.repeat(faces[:, 4], 4, axis=0), triangles.reshape(-1, 3)


_MESHES: dict[str, Callable[[], Mesh]] = {
    "rod": _cylinder,
    "wire": _cylinder,
    "spring": _coil,
    "ball": _sphere,
    "box": _cube,
    "floor": _cube,
    "flash": _sphere,
}
