"""The picture of a system."""

from __future__ import annotations

from xml.etree import ElementTree

from making import FmuPaths

from liaisons.cosim import System

SVG = "{http://www.w3.org/2000/svg}"
HOSTILE = "</title></script><img onerror='alert(1)'>&"


def _drawn(system: System) -> ElementTree.Element:
    return ElementTree.fromstring(system._repr_html_())


def _texts(picture: ElementTree.Element) -> list[str | None]:
    return [text.text for text in picture.iter(f"{SVG}text")]


def test_a_system_draws_its_fmus_and_what_is_connected(fmu: FmuPaths) -> None:
    system = System("swing")
    spring, _, mass = (system.add(name.lower(), fmu(name)) for name in ("Spring", "Cubic", "Mass"))
    system.connect(mass["q"], spring["length"])
    picture = _drawn(system)
    assert _texts(picture) == ["swing", "q → length", "mass", "Mass", "cubic", "Cubic", "spring", "Spring"]
    mass_x, cubic_x, spring_x = (float(box.get("x", "")) for box in picture.iter(f"{SVG}rect"))
    assert mass_x == cubic_x < spring_x
    (arrow,) = (path for path in picture.iter(f"{SVG}path") if path.get("marker-end"))
    assert arrow.get("marker-start")  # the force goes back
    system = System("operator")
    spring, cubic = (system.add(name.lower(), fmu(name)) for name in ("Spring", "Cubic"))
    system.connect(cubic["y"], spring["length"])
    (arrow,) = (path for path in _drawn(system).iter(f"{SVG}path") if path.get("marker-end"))
    assert arrow.get("marker-start") is None


def test_names_of_any_make_are_text(fmu: FmuPaths) -> None:
    system = System(HOSTILE)
    system.add(HOSTILE, fmu("Cubic"))
    assert "<img" not in system._repr_html_()
    assert _texts(_drawn(system))[1] == f"{HOSTILE[:25]}…"


def test_of_many_fmus_the_first_ones_are_drawn(fmu: FmuPaths) -> None:
    system = System("many")
    for number in range(70):
        system.add(f"part{number}", fmu("Cubic"))
    picture = _drawn(system)
    assert len(list(picture.iter(f"{SVG}rect"))) == 60
    assert _texts(picture)[0] == "many, and 10 FMUs more"
    assert _texts(_drawn(System("none"))) == ["none"]
