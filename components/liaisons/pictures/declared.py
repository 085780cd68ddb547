"""A picture as it stands in an FMU, ``resources/picture.json``: shapes whose coordinates are numbers or names."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, final

from liaisons.errors import SimulationError

MEMBER = "resources/picture.json"
VERSION = "1."
"""What the version of a file that can be read begins with."""

Shape = Mapping[str, Any]
_POINTS, _LISTS = ("from", "to", "at"), ("points", "axes")
_KINDS = {
    "rod": ("from", "to"),
    "ball": ("at",),
    "box": ("at", "axes", "size"),
    "wire": ("points",),
    "spring": ("from", "to"),
    "trail": ("at",),
}


@final
@dataclass(frozen=True)
class Picture:
    """Shapes; a coordinate is a number, or the name of a variable."""

    shapes: tuple[Shape, ...]

    @classmethod
    def of(cls, text: bytes, where: str) -> Picture:
        """Read the file.

        :param where: whose it is, for messages.
        :raises SimulationError: if it is of another version, or no picture.
        """
        try:
            document = json.loads(text)
            version, shapes = document["version"], document["shapes"]
            for shape in shapes:
                missing = [member for member in _KINDS[shape["shape"]] if member not in shape]
                if missing:
                    raise KeyError(missing[0])
            found = cls(tuple(shapes))
            for number in (number for shape in shapes for number in _numbers(shape)):
                if not isinstance(number, str) and not math.isfinite(float(number)):
                    raise ValueError(f"a coordinate is {number}")
        except (AttributeError, KeyError, TypeError, ValueError, RecursionError) as error:
            raise SimulationError(
                f"{where}: {MEMBER} cannot be read: {type(error).__name__}: {error}; build the FMU anew"
            ) from None
        if not str(version).startswith(VERSION):
            raise SimulationError(f"{where}: {MEMBER} is of version {version}; this liaisons reads {VERSION}x")
        return found

    @classmethod
    def of_points(cls, names: Iterable[str]) -> Picture:
        """Balls and trails where variables are called like the coordinates of a point, ``bob_x``, ``bob_z``."""
        known = set(names)
        points = dict.fromkeys(name[:-2] for name in sorted(known) if name[-2:] in {"_x", "_y", "_z"})
        places = [[name if (name := f"{point}_{axis}") in known else 0.0 for axis in "xyz"] for point in points]
        return cls(tuple({"shape": kind, "at": place} for place in places for kind in ("trail", "ball")))

    @property
    def document(self) -> dict[str, Any]:
        """The content of the file."""
        return {"version": "1.0", "shapes": list(self.shapes)}

    @property
    def variables(self) -> list[str]:
        """Names of the variables that it needs, each once."""
        found: dict[str, None] = {}
        self.renamed(lambda name: found.setdefault(name) or name)
        return list(found)

    def renamed(self, rename: Any) -> Picture:
        """The same of variables with other names."""

        def of(value: Any) -> Any:
            if isinstance(value, str):
                return rename(value)
            return [of(item) for item in value] if isinstance(value, list) else float(value)

        numbers = {*_POINTS, *_LISTS, "size", "radius"}
        return Picture(tuple({k: of(v) if k in numbers else v for k, v in shape.items()} for shape in self.shapes))

    @property
    def plane(self) -> str | None:
        """The plane in which it lies, ``"xz"``, ``"xy"`` or ``"yz"``; None: it is spatial."""
        points = [point for shape in self.shapes for point in _points(shape)]
        for plane, across in (("xz", 1), ("xy", 2), ("yz", 0)):
            if points and len({str(point[across]) for point in points}) == 1 and not isinstance(points[0][across], str):
                return plane
        return None


def _points(shape: Shape) -> Iterator[list[float | str]]:
    yield from (shape[member] for member in _POINTS if member in shape)
    yield from shape.get("points", ())


def _numbers(shape: Shape) -> Iterator[Any]:
    """Every coordinate and size.

    :raises ValueError: if a point or an axis has not three of them.
    """
    triples = [*_points(shape), *shape.get("axes", ())]
    for x, y, z in [*triples, shape["size"]] if "size" in shape else triples:
        yield from (x, y, z)
    if "radius" in shape:
        yield shape["radius"]


def together(pictures: Mapping[str, Picture]) -> Picture:
    """The pictures of the parts of a system in one.

    :param pictures: by what stands before the names of each part's variables.
    """
    parts = [picture.renamed(lambda name, p=prefix: f"{p}{name}") for prefix, picture in pictures.items()]
    return Picture(tuple(shape for part in parts for shape in part.shapes))
