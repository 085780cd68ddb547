"""Pictures as data: shapes whose coordinates are numbers or names of variables, as ``resources/picture.json`` has them.

The package ``pictures`` draws them.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, final

from liaisons.base.arguments import shown
from liaisons.base.arrays import Floats
from liaisons.errors import SimulationError

VERSION = "1."
"""How versions of readable files begin."""
_MOST = 10_000
"""Largest number of shapes and points of wires; matplotlib draws these in a second."""

Shape = Mapping[str, Any]
_POINTS, _LISTS = ("from", "to", "at"), ("points", "axes")
_TRIPLES, _NUMBERS = ("size", "normal"), ("radius", "length", "width", "count")
_KINDS = {
    "rod": ("from", "to"),
    "ball": ("at",),
    "box": ("at", "axes", "size"),
    "wire": ("points",),
    "spring": ("from", "to"),
    "trail": ("at",),
    "rope": ("from", "to", "length"),
    "floor": ("at", "normal", "width"),
    "flash": ("at", "count"),
}


@final
@dataclass(frozen=True)
class Picture:
    """Shapes; a coordinate is a number, or the name of a variable."""

    MEMBER: ClassVar = "resources/picture.json"
    """Path in an FMU."""
    LARGEST: ClassVar = 1e18
    """Largest coordinate [m]: its square is finite in single precision."""

    shapes: tuple[Shape, ...]

    @classmethod
    def from_json(cls, text: bytes, owner: str) -> Picture:
        """Picture of an FMU, from the text of its file.

        :param owner: for messages.
        :raises SimulationError: if it has another version, or is not a picture.
        """
        try:
            document = json.loads(text)
            version, shapes = document["version"], document["shapes"]
            if (count := sum(len(shape.get("points", [0])) for shape in shapes)) > _MOST:
                raise ValueError(f"it has {count} points, but at most {_MOST} are drawn")
            for shape in shapes:
                missing = [member for member in _KINDS[shape["shape"]] if member not in shape]
                if missing:
                    raise KeyError(missing[0])
                _check_shape(shape)
        except (AttributeError, KeyError, TypeError, ValueError, RecursionError) as error:
            raise SimulationError(
                f"{owner}: {cls.MEMBER} cannot be read: {type(error).__name__}: {error}; build the FMU anew"
            ) from None
        if not str(version).startswith(VERSION):
            raise SimulationError(f"{owner}: {cls.MEMBER} is of version {version}; this liaisons reads {VERSION}x")
        return cls(tuple(shapes))

    @classmethod
    def from_points(cls, names: Iterable[str]) -> Picture:
        """Picture with a ball and a trail for each point whose coordinates are variables, ``bob_x``, ``bob_z``."""
        ordered = dict.fromkeys(sorted(names))
        points = dict.fromkeys(name[:-2] for name in ordered if name[-2:] in {"_x", "_y", "_z"})
        triples = [[name if (name := f"{point}_{axis}") in ordered else 0.0 for axis in "xyz"] for point in points]
        return cls(tuple({"shape": kind, "at": triple} for triple in triples for kind in ("trail", "ball")))

    @property
    def document(self) -> dict[str, Any]:
        """Content of the file, as a dictionary for JSON."""
        return {"version": "1.0", "shapes": list(self.shapes)}

    @property
    def point_count(self) -> int:
        """Number of points of all shapes."""
        return sum(1 for shape in self.shapes for _ in _point_coordinates(shape))

    @property
    def variables(self) -> list[str]:
        """Names of the variables in coordinates, each once."""
        names: dict[str, None] = {}
        self.renamed(lambda name: names.setdefault(name) or name)
        return list(names)

    def renamed(self, rename: Callable[[str], str]) -> Picture:
        """Picture with other names of variables.

        :param rename: old name -> new one.
        """

        def coordinates(value: Any) -> Any:
            """Coordinates, nested as they are, with names replaced and numbers as floats."""
            if isinstance(value, str):
                return rename(value)
            return [coordinates(item) for item in value] if isinstance(value, list) else float(value)

        numbers = {*_POINTS, *_LISTS, *_TRIPLES, *_NUMBERS}
        return Picture(
            tuple({k: coordinates(v) if k in numbers else v for k, v in shape.items()} for shape in self.shapes)
        )

    @property
    def plane(self) -> str | None:
        """Plane that all points are in, ``"xz"``, ``"xy"`` or ``"yz"``; None for a spatial picture."""
        points = [point for shape in self.shapes for point in _point_coordinates(shape)]
        for plane, across in (("xz", 1), ("xy", 2), ("yz", 0)):
            if points and len({str(point[across]) for point in points}) == 1 and not isinstance(points[0][across], str):
                return plane
        return None


def _point_coordinates(shape: Shape) -> Iterator[list[float | str]]:
    """Yield the three coordinates of each point of a shape."""
    yield from (shape[member] for member in _POINTS if member in shape)
    yield from shape.get("points", ())


def _check_shape(shape: Shape) -> None:
    """Raise a ValueError unless points and axes are triples, as many as a shape needs, of names and finite numbers."""
    for member, least, most in (("points", 2, math.inf), ("axes", 3, 3)):
        if member in shape and not (isinstance(shape[member], list) and least <= len(shape[member]) <= most):
            raise ValueError(f"{member} of a {shape['shape']} are {shown(shape[member])}: {least} triples are needed")
    triples = [
        *_point_coordinates(shape),
        *shape.get("axes", ()),
        *(shape[member] for member in _TRIPLES if member in shape),
    ]
    for triple in triples:
        if not isinstance(triple, list) or len(triple) != 3:
            raise ValueError(f"{shown(triple)} in a {shape['shape']} is not a triple")
    numbers = [number for triple in triples for number in triple]
    for number in [*numbers, *(shape[member] for member in _NUMBERS if member in shape)]:
        if isinstance(number, str) and number:
            continue
        if isinstance(number, bool) or not isinstance(number, (int, float)):
            raise ValueError(f"a coordinate is {shown(number)}: neither a number nor a name")
        if not abs(number) <= Picture.LARGEST:  # not-a-number, too
            raise ValueError(
                f"a coordinate is {shown(number)}: finite numbers up to {Picture.LARGEST:g} m can be drawn"
            )


def combined_pictures(pictures: Mapping[str, Picture], groups: Iterable[Collection[int]] = ()) -> Picture:
    """Picture of a system, from the pictures of its parts.

    :param pictures: prefix of a part's variables -> its picture.
    :param groups: numbers of the parts that are drawn together, each group beside the others; none: all in one.
    """
    parts = [picture.renamed(lambda name, p=prefix: f"{p}{name}") for prefix, picture in pictures.items()]
    group_of = {part: number for number, group in enumerate(groups) for part in group}
    shapes = ({**shape, "group": group_of.get(i, 0)} for i, part in enumerate(parts) for shape in part.shapes)
    return Picture(tuple(shapes))


class Scene(Protocol):
    """A picture and the values of its variables, recorded or calculated."""

    @property
    def picture(self) -> Picture:
        """Shapes whose coordinates are numbers or names of signals."""
        ...

    def values(self, signals: Mapping[str, Floats]) -> Mapping[str, Floats]:
        """All variables of the picture at some frames, from the recorded signals there."""
        ...
