"""Conversions between units of a file, and a file that never ends."""

from __future__ import annotations

import io
from xml.etree.ElementTree import Element

import pytest

from liaisons.base.unit_definitions import UnitDefinition
from liaisons.base.xml_documents import parse
from liaisons_exchange.ssp.connectors import add_units
from liaisons_exchange.ssp.xml import unit_definitions

KELVIN, CELSIUS, FAHRENHEIT = (
    UnitDefinition.from_attributes(name, {"K": "1", **attributes})
    for name, attributes in (
        ("K", {}),
        ("degC", {"offset": "273.15"}),
        ("degF", {"factor": repr(5 / 9), "offset": repr(273.15 - 32 * 5 / 9)}),
    )
)


@pytest.mark.parametrize(
    ("unit", "other", "value", "expected"),
    [
        (CELSIUS, FAHRENHEIT, 100.0, 212.0),
        (FAHRENHEIT, CELSIUS, 32.0, 0.0),
        (KELVIN, FAHRENHEIT, 273.15, 32.0),
        (CELSIUS, KELVIN, -273.15, 0.0),
    ],
)
def test_both_units_may_have_an_offset(
    unit: UnitDefinition, other: UnitDefinition, value: float, expected: float
) -> None:
    assert unit.conversion_to(other).apply(value) == pytest.approx(expected, abs=1e-10)


def test_an_archive_says_what_units_are() -> None:
    double = UnitDefinition.from_attributes("double", {"K": "1", "factor": "2.0", "offset": "1.0"})
    root, known = Element("root"), {"K": KELVIN, "degC": CELSIUS, "degF": FAHRENHEIT, "double": double}
    add_units(root, "ssd:Units", known)
    assert unit_definitions(root, "ssd:Units") == known


def test_an_element_without_an_end_is_not_waited_for() -> None:
    with pytest.raises(ValueError, match="an element is longer than 16777216 bytes"):
        parse(io.BytesIO(b"<a " + b" " * (2**24 + 2**22) + b"/>"), lambda *_: None)
