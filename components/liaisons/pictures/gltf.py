"""Frames as binary glTF 2.0 (.glb): one mesh a shape, moved by keyframes; coordinates are ours in single precision.

Khronos Group, glTF 2.0 specification (ISO/IEC 12113:2022).  glTF has y upwards: the root turns z there.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from math import pi, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from liaisons.pictures.frames import Frames, Moving

_FLOAT, _SHORT = 5126, 5123
_ARRAY, _ELEMENTS = 34962, 34963  # what a buffer view is for
_LINES = 3  # a strip of them
_COLOURS = {
    "rod": (0.07, 0.10, 0.14),
    "ball": (0.58, 0.09, 0.03),
    "box": (0.08, 0.22, 0.46),
    "wire": (0.24, 0.29, 0.35),
    "spring": (0.05, 0.27, 0.15),
    "trail": (0.58, 0.09, 0.03),
}  # linear, as glTF has them
_SIDES, _COILS = 12, 9


def glb(frames: Frames, name: str) -> bytes:
    """The scene as the bytes of a .glb file.

    :param name: of the scene.
    """
    scene = _Scene()
    extent = float(np.max(np.linalg.norm(np.ptp(frames.points, axis=1), axis=1))) or 1.0
    parts = [node for shape in frames.shapes for node in _nodes(scene, shape, extent, frames.time)]
    return scene.written(name, parts)


def _nodes(scene: _Scene, shape: Moving, extent: float, time: NDArray) -> list[int]:
    points, kind = shape.points, shape.kind
    radius = shape.size if shape.size is not None and kind in {"rod", "ball"} else None
    if kind == "ball":
        size = np.full((len(time), 1), 0.035 * extent) if radius is None else radius
        return [scene.node(scene.mesh("ball", _sphere), kind, time, points[:, 0], None, np.repeat(size, 3, axis=1))]
    if kind == "box":
        assert shape.axes is not None  # as for all boxes
        turned = _quaternions(np.swapaxes(shape.axes, 1, 2))
        return [scene.node(scene.mesh("box", _cube), kind, time, points[:, 0], turned, shape.size)]
    if kind == "trail":
        return (
            [scene.node(scene.line(points[:, 0]), kind, time[:1], np.zeros((1, 3)), None, None)]
            if len(time) > 1
            else []
        )
    if kind == "wire":
        ends = np.concatenate([points, points[:, :1]], axis=1) if shape.closed else points
        pairs = [(ends[:, i], ends[:, i + 1]) for i in range(ends.shape[1] - 1)]
        return [_stretched(scene, "rod", kind, time, a, b, np.full(len(time), 0.006 * extent)) for a, b in pairs]
    width = np.full(len(time), 0.011 * extent if kind == "rod" else 0.03 * extent) if radius is None else radius[:, 0]
    return [_stretched(scene, kind, kind, time, points[:, 0], points[:, 1], width)]


def _stretched(  # noqa: PLR0917 - a line from a to b
    scene: _Scene, mesh: str, kind: str, time: NDArray, a: NDArray, b: NDArray, width: NDArray
) -> int:
    """A mesh along z from 0 to 1, put between two points."""
    along = b - a
    length = np.linalg.norm(along, axis=1)
    shape = scene.mesh(mesh, _cylinder if mesh == "rod" else _coil, kind)
    return scene.node(shape, kind, time, a, _onto(along), np.column_stack([width, width, np.maximum(length, 1e-9)]))


class _Scene:
    """The parts of the file as they come."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.document: dict[str, list[Any]] = {
            key: [] for key in ("bufferViews", "accessors", "materials", "meshes", "nodes")
        }
        self.samplers: list[dict[str, Any]] = []
        self.channels: list[dict[str, Any]] = []
        self.known: dict[Any, int] = {}

    def add(self, key: str, item: dict[str, Any]) -> int:
        self.document[key].append(item)
        return len(self.document[key]) - 1

    def accessor(self, values: NDArray, kind: str, target: int | None = None) -> int:
        """Numbers in the buffer, (n,) or (n, k)."""
        component = _SHORT if target == _ELEMENTS else _FLOAT
        values = np.ascontiguousarray(values, np.uint16 if component == _SHORT else np.float32)
        self.data += bytes(-len(self.data) % 4)
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": values.nbytes}
        self.data += values.tobytes()
        place = self.add("bufferViews", view | ({"target": target} if target else {}))
        table = values.reshape(len(values), -1)
        limits = {"min": table.min(axis=0).tolist(), "max": table.max(axis=0).tolist()}
        return self.add(
            "accessors", {"bufferView": place, "componentType": component, "count": len(values), "type": kind, **limits}
        )

    def material(self, kind: str) -> int:
        if ("material", kind) not in self.known:
            look = {"baseColorFactor": [*_COLOURS[kind], 1.0], "metallicFactor": 0.1, "roughnessFactor": 0.55}
            self.known["material", kind] = self.add("materials", {"name": kind, "pbrMetallicRoughness": look})
        return self.known["material", kind]

    def mesh(self, name: str, make: Any, kind: str = "") -> int:
        kind = kind or name
        if (name, kind) not in self.known:
            places, normals, triangles = make()
            attributes = {
                "POSITION": self.accessor(places, "VEC3", _ARRAY),
                "NORMAL": self.accessor(normals, "VEC3", _ARRAY),
            }
            indices = self.accessor(triangles.ravel(), "SCALAR", _ELEMENTS)
            primitive = {"attributes": attributes, "indices": indices, "material": self.material(kind)}
            self.known[name, kind] = self.add("meshes", {"name": kind, "primitives": [primitive]})
        return self.known[name, kind]

    def line(self, points: NDArray) -> int:
        attributes = {"POSITION": self.accessor(points, "VEC3", _ARRAY)}
        primitive = {"attributes": attributes, "mode": _LINES, "material": self.material("trail")}
        return self.add("meshes", {"name": "trail", "primitives": [primitive]})

    def node(  # noqa: PLR0917 - three columns, each may be missing
        self, mesh: int, name: str, time: NDArray, place: NDArray, turned: NDArray | None, size: NDArray | None
    ) -> int:
        """A mesh that is moved, turned and stretched; a constant one has no keyframes."""
        node: dict[str, Any] = {"name": name, "mesh": mesh}
        given = {"translation": (place, "VEC3"), "rotation": (turned, "VEC4"), "scale": (size, "VEC3")}
        index = self.add("nodes", node)
        for path, (values, kind) in given.items():
            if values is None:
                continue
            node[path] = np.float32(values[0]).tolist()
            if np.ptp(values, axis=0).any():
                if ("time", len(time)) not in self.known:
                    self.known["time", len(time)] = self.accessor(time - time[0], "SCALAR")
                source = {
                    "input": self.known["time", len(time)],
                    "output": self.accessor(values, kind),
                    "interpolation": "LINEAR",
                }
                self.samplers.append(source)
                self.channels.append({"sampler": len(self.samplers) - 1, "target": {"node": index, "path": path}})
        return index

    def written(self, name: str, parts: Sequence[int]) -> bytes:
        root = self.add("nodes", {"name": name, "rotation": [-sqrt(0.5), 0.0, 0.0, sqrt(0.5)], "children": list(parts)})
        animation = {"animations": [{"name": "motion", "samplers": self.samplers, "channels": self.channels}]}
        document = {
            "asset": {"version": "2.0", "generator": "liaisons"},
            "scene": 0,
            "scenes": [{"name": name, "nodes": [root]}],
            **self.document,
            **(animation if self.channels else {}),
            "buffers": [{"byteLength": len(self.data)}],
        }
        text = json.dumps(document, separators=(",", ":")).encode()
        chunks = [(b"JSON", text + b" " * (-len(text) % 4)), (b"BIN\0", bytes(self.data) + bytes(-len(self.data) % 4))]
        body = b"".join(struct.pack("<I", len(content)) + kind + content for kind, content in chunks)
        return b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body


# ---- rotations ----------------------------------------------------------------------------------------------------


def _onto(along: NDArray) -> NDArray:
    """Quaternions (n, 4), scalar last, that turn z onto directions, without needless spin."""
    unit = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    found = np.column_stack([-unit[:, 1], unit[:, 0], np.zeros(len(unit)), 1 + unit[:, 2]])
    found[1 + unit[:, 2] < 1e-9] = (1.0, 0.0, 0.0, 0.0)  # straight down: about x
    return _continuous(found / np.linalg.norm(found, axis=1, keepdims=True))


def _quaternions(matrices: NDArray) -> NDArray:
    from scipy.spatial.transform import Rotation

    return _continuous(Rotation.from_matrix(matrices).as_quat())


def _continuous(quaternions: NDArray) -> NDArray:
    """Of q and -q, which turn alike, the one that is near the one before."""
    found = quaternions.copy()
    for i in range(1, len(found)):
        if found[i] @ found[i - 1] < 0:
            found[i] = -found[i]
    return found


# ---- meshes: places, normals, triangles -----------------------------------------------------------------------------


def _grid(rows: int, columns: int) -> NDArray:
    """Triangles of a grid of points, row by row."""
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns - 1), indexing="ij")
    a = (i * columns + j).ravel()
    return np.concatenate(
        [np.column_stack([a, a + 1, a + columns]), np.column_stack([a + 1, a + columns + 1, a + columns])]
    )


def _sphere() -> tuple[NDArray, NDArray, NDArray]:
    polar, azimuth = np.meshgrid(np.linspace(0, pi, _SIDES + 1), np.linspace(0, 2 * pi, 2 * _SIDES + 1), indexing="ij")
    unit = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1).reshape(
        -1, 3
    )
    triangles = _grid(_SIDES + 1, 2 * _SIDES + 1)[:, ::-1]
    corners = unit[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return unit, unit, triangles[area > 1e-9]


def _cylinder() -> tuple[NDArray, NDArray, NDArray]:
    """Radius 1, from z = 0 to 1, with lids."""
    angle = np.linspace(0, 2 * pi, _SIDES + 1)
    ring = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    side = np.concatenate([ring, ring + np.array([0, 0, 1])])
    places, normals, triangles = [side], [np.concatenate([ring, ring])], [_grid(2, _SIDES + 1)]
    for z, turn in ((0.0, -1), (1.0, 1)):
        first = sum(map(len, places))
        places.append(np.concatenate([ring + np.array([0, 0, z]), [[0, 0, z]]]))
        normals.append(np.tile([0.0, 0.0, turn], (_SIDES + 2, 1)))
        rim = first + np.arange(_SIDES)
        triangles.append(np.column_stack([rim, rim + 1, np.full(_SIDES, first + _SIDES + 1)])[:, ::turn])
    return np.concatenate(places), np.concatenate(normals), np.concatenate(triangles)


def _coil() -> tuple[NDArray, NDArray, NDArray]:
    """A helix of radius 1 from z = 0 to 1."""
    s = np.linspace(0, 1, 24 * _COILS + 1)
    turn = 2 * pi * _COILS * s
    spine = np.column_stack([np.cos(turn), np.sin(turn), s])
    outward = np.column_stack([np.cos(turn), np.sin(turn), 0 * s])
    angle = np.linspace(0, 2 * pi, 7)[None, :, None]
    normals = np.cos(angle) * outward[:, None] + np.sin(angle) * np.array([0.0, 0.0, 1.0])
    places = spine[:, None] + 0.2 * np.cos(angle) * outward[:, None] + 0.012 * np.sin(angle) * np.array([0.0, 0.0, 1.0])
    return places.reshape(-1, 3), normals.reshape(-1, 3), _grid(len(s), 7)


def _cube() -> tuple[NDArray, NDArray, NDArray]:
    places, normals, triangles = [], [], []
    for axis in range(3):
        for side in (-1.0, 1.0):
            normal = np.zeros(3)
            normal[axis] = side
            u, v = np.roll(np.eye(3), 0, axis=0)[[(axis + 1) % 3, (axis + 2) % 3]]
            first = len(places) * 4
            places.append([(normal + a * u + b * v) / 2 for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
            normals.append([normal] * 4)
            order = ((0, 1, 2), (0, 2, 3)) if side > 0 else ((0, 2, 1), (0, 3, 2))
            triangles += [[first + i for i in corner] for corner in order]
    return np.concatenate(places), np.concatenate(normals), np.array(triangles)
