"""The picture of a system."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import pytest
from making import FmuPaths, wired

from liaisons.cosim import System, sampled
from liaisons.errors import SimulationError

SVG = "{http://www.w3.org/2000/svg}"
HOSTILE = "</title></script><img onerror='alert(1)'>&"


def _drawn(system: System) -> ElementTree.Element:
    return ElementTree.fromstring(system.diagram().svg)


def _texts(picture: ElementTree.Element) -> list[str]:
    return [text.text or "" for text in picture.iter(f"{SVG}text")]


def _blocks(picture: ElementTree.Element) -> dict[str, tuple[float, float, float, float]]:
    """Left, top, right and bottom by name."""
    found = {}
    for group in picture.iter(f"{SVG}g"):
        box, name = group.find(f"{SVG}rect"), group.find(f"{SVG}text")
        if box is not None and name is not None:
            x, y, width, height = (float(box.get(key, "")) for key in ("x", "y", "width", "height"))
            found[name.text or ""] = x, y, x + width, y + height
    return found


def _arrows(picture: ElementTree.Element) -> list[ElementTree.Element]:
    return [path for path in picture.iter(f"{SVG}path") if path.get("marker-end")]


def test_a_system_draws_its_fmus_and_what_is_connected(fmu: FmuPaths) -> None:
    system = wired("mass.q -> spring.length", spring=fmu("Spring"), cubic=fmu("Cubic"), mass=fmu("Mass"))
    picture = _drawn(system)
    blocks = ["mass", "1", "Mass", "q", "spring", "1", "Spring", "length", "cubic", "2", "Cubic", "y"]
    legend = "numbers: the order in which the FMUs are stepped; those with the same number feed each other"
    assert _texts(picture) == ["wired", *blocks, legend]
    faint = {text.text for text in picture.iter(f"{SVG}text") if text.get("fill-opacity")}
    assert faint == {"1", "2", "Mass", "Spring", "Cubic", "y", legend}  # y feeds nothing
    places = _blocks(picture)
    assert places["mass"][0] == places["cubic"][0] < places["spring"][0]
    (arrow,) = _arrows(picture)
    assert arrow.get("marker-start")  # the force goes back
    (variables,) = [title.text for title in picture.iter(f"{SVG}title") if "->" in (title.text or "")]
    assert (variables or "").splitlines() == [str(connection) for connection in system.connections]
    picture = _drawn(wired("cubic.y -> spring.length", spring=fmu("Spring"), cubic=fmu("Cubic")))
    assert [arrow.get("marker-start") for arrow in _arrows(picture)] == [None]
    assert _texts(picture)[-1] == "numbers: the order in which the FMUs are stepped"
    assert _texts(_drawn(wired(cubic=fmu("Cubic"))))[-2:] == ["y", ""]  # one alone has no order


def test_no_block_lies_on_another(component: FmuPaths) -> None:
    names = [f"p{k}" for k in range(15)]
    system = System("chain")
    parts = [system.add(name, component("Pendulum")) for name in names]
    for upper, lower in pairwise(parts):
        system.connect(upper["bob"], lower["pivot"])
    reads = ["p0.theta", "p14.theta_dot"]
    system.add("reader", sampled(lambda *_: 0.0, period=0.1, reads=reads, writes=["y"]))
    picture = _drawn(system)
    assert len(_arrows(picture)) == 16
    places = list(_blocks(picture).values())
    (line,) = [path for arrow in _arrows(picture) if "V" in (path := arrow.get("d", ""))]  # from the first to the last
    below = float(line.partition("V")[2].partition("H")[0])
    assert (
        max(bottom for *_, bottom in places) < below < float(picture.get("viewBox", "").split()[3]) - 20
    )  # the legend
    for k, (left, top, right, bottom) in enumerate(places):
        for other in places[:k]:
            assert left >= other[2] or right <= other[0] or top >= other[3] or bottom <= other[1]
    assert {text for text in _texts(picture) if text.isdigit()} == {"1", "2"}  # the pendulums feed each other


def test_isolated_blocks_are_dashed(fmu: FmuPaths) -> None:
    picture = _drawn(wired(a=(fmu("Cubic"), {"isolated": True}), b=fmu("Cubic")))
    assert [box.get("stroke-dasharray") for box in picture.iter(f"{SVG}rect")] == ["5 3", None]


def test_names_of_any_make_are_text(fmu: FmuPaths) -> None:
    system = System(HOSTILE)
    system.add(HOSTILE, fmu("Cubic"))
    assert "<img" not in system._repr_html_()
    assert f"{HOSTILE[:21]}…" in _texts(_drawn(system))


def test_of_many_fmus_the_first_ones_are_drawn(fmu: FmuPaths) -> None:
    system = System("many")
    for number in range(70):
        system.add(f"part{number}", fmu("Cubic"))
    picture = _drawn(system)
    assert len(list(picture.iter(f"{SVG}rect"))) == 60
    assert _texts(picture)[0] == "many, and 10 more FMUs"
    assert _texts(_drawn(System("none")))[0] == "none"


def test_it_is_written_and_shown(fmu: FmuPaths, tmp_path: Path) -> None:
    system = wired(cubic=fmu("Cubic"))
    shown = system.diagram(tmp_path / "cubic.svg")
    assert (tmp_path / "cubic.svg").read_text(encoding="utf-8") == shown._repr_svg_() == system._repr_html_()
    with pytest.raises(SimulationError, match=r"no/such/cubic\.svg"):
        system.diagram(tmp_path / "no/such/cubic.svg")
