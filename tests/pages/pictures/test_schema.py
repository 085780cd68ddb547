"""The schema of ``resources/picture.json`` in the documentation is what the components write."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

import liaisons.models
from liaisons.mechanics import assemble
from liaisons.results import Picture

from .conftest import MECHANISMS

SCHEMA = json.loads((Path(__file__).parents[3] / "docs" / "picture.schema.json").read_text(encoding="utf-8"))
TYPES = {"object": dict, "array": list, "string": str, "number": (int, float), "boolean": bool}
SAID = {"$schema", "$id", "$defs", "title", "description"}
ROD = {"shape": "rod", "from": ["a", 0, 0], "to": [0, 0, 1.5]}


def fits(value: Any, schema: dict[str, Any]) -> bool:
    """Whether a value is what a schema says, of whose words these are enough."""
    members = value if isinstance(value, dict) else {}
    size = len(value) if isinstance(value, (str, list)) else 0
    known = schema.get("properties", {})
    checks = {
        "$ref": lambda to: fits(value, SCHEMA["$defs"][to.removeprefix("#/$defs/")]),
        "type": lambda kind: isinstance(value, TYPES[kind]) and (kind == "boolean" or not isinstance(value, bool)),
        "const": lambda constant: value == constant,
        "pattern": lambda pattern: re.search(pattern, str(value)) is not None,
        "required": lambda names: set(names) <= set(members),
        "properties": lambda given: all(fits(members[name], given[name]) for name in given if name in members),
        "additionalProperties": lambda allowed: allowed or set(members) <= set(known),
        "items": lambda item: not isinstance(value, list) or all(fits(element, item) for element in value),
        "minItems": lambda least: size >= least,
        "maxItems": lambda most: size <= most,
        "minLength": lambda least: size >= least,
        "oneOf": lambda choices: sum(fits(value, choice) for choice in choices) == 1,
    }
    return all(checks[word](rule) for word, rule in schema.items() if word not in SAID)


@pytest.mark.parametrize("name", MECHANISMS)
def test_every_picture_fits_the_schema(name: str) -> None:
    picture = assemble(getattr(liaisons.models, name)).picture
    assert picture is not None
    assert picture["shapes"]
    document = json.loads(json.dumps(picture))
    assert fits(document, SCHEMA)
    Picture.from_json(json.dumps(picture).encode(), name)


@pytest.mark.parametrize(
    "wrong",
    [
        {"version": "2.0", "shapes": []},
        {"version": 1.0, "shapes": []},
        {"shapes": []},
        {"version": "1.0", "shapes": [], "more": 1},
        *(
            {"version": "1.0", "shapes": [shape]}
            for shape in (
                {"shape": "cone", "at": [0, 0, 0]},
                {"shape": "ball"},
                {"shape": "ball", "at": [0, 0]},
                {"shape": "ball", "at": [0, 0, ""]},
                {"shape": "ball", "at": [0, 0, True]},
                {"shape": "wire", "points": [[0, 0, 0], [1, 0, 0]], "closed": 1},
                {**ROD, "colour": "red"},
                {**ROD, "radius": [1]},
            )
        ),
    ],
)
def test_what_is_no_picture_does_not_fit(wrong: dict[str, Any]) -> None:
    assert fits({"version": "1.0", "shapes": [ROD]}, SCHEMA)
    assert not fits(wrong, SCHEMA)
