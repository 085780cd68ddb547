"""What is asked for on a live page, how fast it runs, what a link says, and what fits on a screen."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from itertools import pairwise
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from liaisons import operator, show, simulate, tabulated
from liaisons.base import compiler
from liaisons.errors import SimulationError
from liaisons.scenarios import lessons, load_lesson

from . import _browser as tools

in_a_browser = pytest.mark.skipif(
    tools.BROWSER is None or compiler.zig_compiler() is None, reason="chromium (or google-chrome) or ziglang is missing"
)
needs_zig = pytest.mark.skipif(compiler.zig_compiler() is None, reason="ziglang is missing")
SHAKEN = operator("Sinusoid", amplitude=0.1, angular_frequency=60.0)
SCREENS = ((1280, 800), (400, 800))
SWING = 90_000
"""Bytes of the page of the pendulum, which the site begins with."""
Page = Callable[..., Path]


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with tools.browser() as found:
        yield found


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Page:
    folder = tmp_path_factory.mktemp("pages")

    def written(subject: str, **contents: Any) -> Path:
        path = folder / f"{len(list(folder.iterdir()))}.html"
        return show(subject, path=path, **contents).path

    return written


def plan_of(path: Path) -> dict[str, Any]:
    found = re.search(r'<script[^>]*id="plan"[^>]*>(.*?)</script>', path.read_text("utf-8"), re.DOTALL)
    assert found is not None
    return json.loads(found[1])


@needs_zig
@pytest.mark.parametrize(
    ("contents", "words"),
    [
        ({"controls": ["pivt_z"]}, r"show: controls: the page has no 'pivt_z'; did you mean 'pivot_z'\?"),
        ({"controls": "theta"}, r"show: controls: the page has no 'theta'; did you mean 'theta_0'\?"),
        ({"plots": ["teta"]}, r"show: plots: the page has no 'teta'; did you mean 'theta'\?"),
        ({"plots": ["theta", "work", "energy", "bob_x", "bob_z"]}, "show: plots: 5 signals; give at most 4"),
    ],
)
def test_what_is_not_on_the_page_is_refused_with_the_nearest_name(
    contents: dict[str, Any], words: str, page: Page
) -> None:
    with pytest.raises(SimulationError, match=f"^{words}$"):
        page("Pendulum", **contents)


@needs_zig
def test_the_page_of_the_pendulum_is_small(page: Page) -> None:
    assert page("Pendulum").stat().st_size <= SWING


@needs_zig
def test_the_same_sources_are_compiled_once(monkeypatch: pytest.MonkeyPatch) -> None:
    stored, made = dict[str, bytes](), iter((b"first", b"for speed", b"second"))
    monkeypatch.setattr(compiler.cache, "read_entry", stored.get)
    monkeypatch.setattr(compiler.cache, "write_entry", stored.__setitem__)
    monkeypatch.setattr(compiler, "_compile_and_link", lambda *_: next(made))
    first, second = ({"page.c": f"int answer(void) {{ return {i}; }}\n".encode()} for i in (1, 2))
    assert compiler.compile_wasm(first) == compiler.compile_wasm(first) == b"first"
    assert compiler.compile_wasm(first, "-O1") == b"for speed"
    assert compiler.compile_wasm(second) == b"second"


@needs_zig
@pytest.mark.parametrize(("subject", "initial"), [("Pendulum", {"theta_0", "theta_dot_0"}), ("PlanarCat", set())])
def test_masses_are_no_starts_and_nobody_moves_impulses(subject: str, initial: set[str], page: Page) -> None:
    variables = plan_of(page(subject))["components"][0]["variables"]
    assert not [v["name"] for v in variables if v.get("set") and v["name"].endswith("_impulse")]
    starts = {v["name"] for v in variables if v.get("initial")}
    assert initial <= starts
    assert not starts & {"mass_0", "inertia_0"}


@in_a_browser
def test_only_what_is_asked_for(browser: Any, page: Page) -> None:
    path = page("Pendulum", controls=["pivot_z", "length"], plots=["theta"], question="Does it <b>stand</b>?")
    with tools.opened(browser, path) as live:
        rows = [row.get_attribute("data-name") for row in live.page.locator("aside input[type=range]").all()]
        assert rows == ["pivot_z", "length"]
        assert live.text("#question") == "Does it <b>stand</b>?"
        assert live.page.locator("#signals button").all_text_contents() == ["theta ×"]
        assert live.page.locator("#signals select").count() == 0
        assert [live.page.locator(f"#{name}").is_visible() for name in ("sigma", "starts", "parameters")] == [
            True,
            False,
            False,
        ]
    with tools.opened(browser, page("Pendulum", plots=[])) as live:
        assert not live.page.locator("#plot").is_visible()


@in_a_browser
def test_a_fast_motion_is_slowed_in_steps_that_suit(browser: Any, page: Page) -> None:
    """At 60 rad/s a period lasts 0.105 s: slowed 10 times, it lasts a second."""
    with tools.opened(browser, page("Pendulum", pivot_z=SHAKEN, theta_0=pi - 0.2)) as live:
        assert live.text("#speed-shown") == "slowed 10 ×"
        whole = live.plan["step_size"]
        live.evaluate("window.page.step()")
        assert live.time == pytest.approx(whole / 10, rel=1e-12)
        live.run(30)  # steps of the plan
        assert live.time == pytest.approx(30 * whole, rel=1e-12)
        tools.preset(live, "pivot_z", "Sinusoid", **{"angular frequency": 6.0})
        assert live.text("#speed-shown") == "real time"
        tools.preset(live, "pivot_z", "Sinusoid", **{"angular frequency": 600.0})
        assert live.text("#speed-shown") == "slowed 100 ×"
        live.page.locator("#speed").fill("0")  # who looks may choose
        tools.preset(live, "pivot_z", "Sinusoid", **{"angular frequency": 60.0})
        assert live.text("#speed-shown") == "real time"


@in_a_browser
def test_operators_move_it_as_they_move_the_fmu(browser: Any, page: Page) -> None:
    times = np.linspace(0.0, 1.0, 150)  # more knots than parameters have room for
    cases: dict[str, Any] = {
        "Sinusoid": operator("Sinusoid", offset=1.0, amplitude=0.1, angular_frequency=6.0, phase=0.5),
        "Ramp": operator("Ramp", offset=1.0, rate=0.2),
        "SmoothStep": operator("SmoothStep", start_value=1.0, end_value=1.3, start_time=0.25, duration=0.5),
        "few knots": tabulated([0.0, 0.5, 1.0], [1.0, 1.2, 0.9]),
        "many knots": tabulated(times, 1 + 0.1 * np.sin(7 * times)),
    }
    for name, moved in cases.items():
        with tools.opened(browser, page("Pendulum", theta_0=0.5, length=moved)) as live:
            assert len(live.plan["components"]) == 1, name
            reached = live.run(110)
            signals = simulate("Pendulum", theta_0=0.5, length=moved, stop_time=live.time, step_size=live.time / 110)
            for signal in ("length", "length_dot", "length_ddot", "theta"):
                bound = 1e-6 if signal == "theta" else 1e-9  # the tolerance of the solver; the same formulas
                assert reached[signal] == pytest.approx(signals[signal][-1], abs=bound), (name, signal)
            assert live.complaints == []


@in_a_browser
def test_after_its_last_knot_a_table_rests(browser: Any, page: Page) -> None:
    with tools.opened(browser, page("Pendulum", length=tabulated([2.0, 2.5], [1.0, 1.2]))) as live:
        assert live.run_for(0.25)["length"] == pytest.approx(1.1)  # the clock begins with the table
        reached = live.run_for(3)
        assert (reached["length"], reached["length_dot"]) == pytest.approx((1.2, 0.0), abs=1e-9)


@in_a_browser
def test_a_parameter_of_an_operator_changes_without_a_jump(browser: Any, page: Page) -> None:
    with tools.opened(browser, page("Pendulum", pivot_z=SHAKEN)) as live:
        live.run(40)
        before = live.signal("pivot_z")
        for key, value in (("angular frequency", 30.0), ("amplitude", 0.05)):
            field = live.page.locator(f'.preset:has(select[data-preset="pivot_z"]) input[title="{key}"]')
            field.fill(str(value))
            field.dispatch_event("change")
        sigma = "t => window.page.machine.parts[0].sources.get('pivot_z').at(t)"
        assert live.evaluate(sigma, live.time)[0] == pytest.approx(before, abs=1e-12)
        values = [live.evaluate(sigma, live.time + k * pi / 30 / 50)[0] for k in range(101)]
        assert np.ptp(values) == pytest.approx(0.1, rel=1e-3)
        assert max(abs(b - a) for a, b in pairwise(values)) < 0.05 * 30 * pi / 30 / 50 * 1.01


@in_a_browser
def test_a_link_carries_what_was_chosen(browser: Any, page: Page) -> None:
    path = page("Pendulum")
    with tools.opened(browser, path) as live:
        live.enter("theta_0", 1.25)
        live.enter("pivot_x", 0.3)
        tools.preset(live, "length", "Sinusoid", amplitude=0.2, **{"angular frequency": 5.0})
        live.page.locator("#speed").fill("-2")
        live.page.locator("[data-signals]").select_option("theta_dot")
        live.page.locator("[data-over]").select_option("theta")
        link, reached = live.evaluate("window.page.link()"), live.run(100)
        live.page.click("#link")
        live.wait_until(lambda: live.evaluate("location.href") == link)
    with tools.opened(browser, path) as live:

        def follow(address: str) -> None:
            live.page.goto("about:blank")
            live.page.goto(address)
            live.wait_until(lambda: live.evaluate("window.page !== undefined"))

        follow(link)
        assert live.text("#speed-shown") == "slowed 4 ×"
        assert live.evaluate("[window.page.chosen, window.page.over]") == [["theta", "theta_dot"], "theta"]
        assert live.page.locator("[data-over]").input_value() == "theta"
        assert live.page.locator('[data-number="theta_0"]').input_value() == "1.25"
        assert live.evaluate("window.page.link()") == link
        assert live.run(100) == reached
        assert live.complaints == []
        follow(path.as_uri() + "#mass=2&run=1")
        live.wait_until(lambda: live.time > 0)
        assert live.evaluate("window.page.machine.parts[0].starts.get('mass')") == 2
        follow(path.as_uri() + "#masss=3&length.by=Nobody")
        assert live.text("#said") == "The link says masss=3, length.by=Nobody, which is not on this page."


@in_a_browser
@pytest.mark.parametrize("screen", SCREENS)
def test_picture_and_sliders_are_on_one_screen(screen: tuple[int, int], browser: Any, page: Page) -> None:
    width, height = screen
    with tools.opened(browser, page("Pendulum"), viewport={"width": width, "height": height}) as live:

        def box(selector: str) -> Any:
            return live.page.locator(selector).bounding_box()

        picture, first = box("#picture"), box('[data-name="length"]')
        assert picture["height"] > 200
        assert picture["y"] + picture["height"] <= height
        assert first["y"] + first["height"] <= height
        assert live.evaluate("document.documentElement.scrollWidth") <= width
        live.page.locator('[data-name="friction"]').scroll_into_view_if_needed()
        picture, last = box("#picture"), box('[data-name="friction"]')
        assert 0 <= picture["y"] < picture["y"] + picture["height"] <= height  # it has stayed
        assert last["y"] + last["height"] <= height
        over = last["y"] >= picture["y"] + picture["height"] or last["x"] >= picture["x"] + picture["width"]
        assert over  # beside or below, not under the picture


@in_a_browser
@pytest.mark.variants(core=0)
def test_a_picture_at_rest_is_not_stretched(browser: Any, page: Page) -> None:
    """Texts that come later, and a window of another size, change the size of the picture."""
    with tools.opened(browser, page("Pendulum"), viewport={"width": 400, "height": 800}) as live:
        for width in (400, 1280, 700):
            live.page.set_viewport_size({"width": width, "height": 800})
            live.page.wait_for_timeout(300)
            drawn, seen = live.evaluate(
                "(c => [[c.width, c.height], [c.clientWidth, c.clientHeight]])(document.getElementById('picture'))"
            )
            assert drawn == [round(side * live.evaluate("devicePixelRatio")) for side in seen]


@in_a_browser
@pytest.mark.variants(core=0)
@pytest.mark.parametrize("name", lessons())
def test_a_lesson_is_its_scenario(name: str, browser: Any, tmp_path: Path) -> None:
    taught = load_lesson(name)
    with tools.opened(browser, taught.show(tmp_path / f"{name}.html").path) as live:
        assert live.text("#question") == taught.question
        assert live.plan["signals"] == list(taught.plots)
        reached = live.run(120)
        if "angular_momentum" in reached:
            assert reached["angular_momentum"] == pytest.approx(0.0, abs=1e-12)
        if name == "kapitza":
            live.run(1200)
            assert abs(live.signal("theta") - pi) < 1
        assert live.complaints == []
