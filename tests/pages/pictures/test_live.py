"""Live pages in a real browser: they run, agree with the native FMUs, answer to hands, and let nothing in."""

from __future__ import annotations

import json
import math
import re
import socket
import zipfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from functools import cache
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from liaisons import Ball, Box, Coordinate, Mechanism, Parameter, Shapes, Spring, System, operator, show, tabulated
from liaisons.base import compiler
from liaisons.base.unit_definitions import Conversion
from liaisons.cosim import Connection
from liaisons.errors import BuildError, SimulationError
from liaisons.library import catalogue
from liaisons.results import Picture
from liaisons_exchange.live import live_page
from liaisons_pages.pictures import picture_frames
from liaisons_pages.pictures.stage import COILS, SIZES, Camera, _zigzag_points

from . import _browser as tools
from .conftest import Fmu, Moved

SECONDS = 10.0
AGREEMENT = 1e-12  # no component needs more: none has lost its digits to chaos after 10 s
SCREENSHOTS = Path(__file__).parents[3] / "docs" / "_build" / "screenshots"  # kept for the documentation
HEIGHT = 0.1  # by which an operator moves each coordinate, in its unit
SIZE = 150_000  # bytes
FAST = ["Pendulum", "Satellite"]
PHONE = {"viewport": {"width": 390, "height": 800}, "has_touch": True, "is_mobile": True}
EVIL = "</script><img src=x onerror=alert(1)>"

Subject = str | Path | System
Opened = Callable[..., AbstractContextManager[tools.Live]]

in_a_browser = pytest.mark.skipif(
    tools.BROWSER is None or compiler.zig_compiler() is None, reason="chromium (or google-chrome) or ziglang is missing"
)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with tools.browser() as found:
        yield found


@pytest.fixture(scope="module")
def page_of(fmu: Fmu, tmp_path_factory: pytest.TempPathFactory) -> Callable[[Subject], Path]:
    """The live page of a subject, or of a component of the catalogue, written once."""
    folder = tmp_path_factory.mktemp("pages")

    @cache
    def written(subject: Subject) -> Path:
        path = folder / f"{subject if isinstance(subject, str) else id(subject)}.html"
        path.write_bytes(live_page(fmu(catalogue()[subject]) if isinstance(subject, str) else subject))
        return path

    return written


@pytest.fixture
def opened(browser: Any, page_of: Callable[[Subject], Path]) -> Opened:
    """Opens live pages."""
    return lambda subject, **context: tools.opened(browser, page_of(subject), **context)


@in_a_browser
@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[] if name in FAST else [pytest.mark.slow]) for name in sorted(catalogue())],
)
def test_every_page_runs_as_the_native_fmu(
    name: str, opened: Opened, fmu: Fmu, page_of: Callable[[Subject], Path]
) -> None:
    """Ten seconds in the browser and by fmpy, each coordinate moved by the page's smooth step."""
    with opened(name) as live:
        plan = live.plan
        count = round(SECONDS / plan["step_size"])
        for members in plan["components"][0]["free"]:
            tools.preset(live, members[0], "SmoothStep", height=HEIGHT, duration=2.0)
        reached = live.run(count)
        assert live.time == pytest.approx(SECONDS, abs=0.05)
        assert live.complaints == []
        live.page.screenshot(path=SCREENSHOTS / f"{name}.png")
    expected, scales = tools.native(fmu(catalogue()[name]), plan, count, lambda s, t: tools.smooth_step(s, t, HEIGHT))
    assert tools.difference(reached, expected, scales) <= AGREEMENT
    assert page_of(name).stat().st_size <= SIZE


@in_a_browser
def test_the_comparison_sees_a_ten_millionth(opened: Opened, fmu: Fmu) -> None:
    with opened("Pendulum") as live:
        tools.preset(live, "length", "SmoothStep", height=HEIGHT * (1 + 1e-7), duration=2.0)
        reached = live.run(600)
        expected, scales = tools.native(
            fmu(catalogue()["Pendulum"]), live.plan, 600, lambda s, t: tools.smooth_step(s, t, HEIGHT)
        )
    assert tools.difference(reached, expected, scales) > 1e3 * AGREEMENT


@in_a_browser
def test_the_policy_lets_nothing_in(opened: Opened, page_of: Callable[[Subject], Path]) -> None:
    html = page_of("Pendulum")
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', html.read_text(encoding="utf-8"))
    assert policy is not None
    assert policy[1].startswith("default-src 'none'; script-src 'sha256-")
    with socket.create_server(("127.0.0.1", 0)) as server, opened("Pendulum") as live:
        live.evaluate(
            """address => {
            window.refused = [];
            addEventListener("securitypolicyviolation", (event) => window.refused.push(event.effectiveDirective));
            const image = document.createElement("img"), script = document.createElement("script");
            image.src = `${address}/image.png`;
            script.textContent = "window.injected = true";
            document.body.append(image, script);
            fetch(`${address}/data`).catch(() => {});
        }""",
            f"http://127.0.0.1:{server.getsockname()[1]}",
        )
        live.wait_until(lambda: live.evaluate("window.refused.length") >= 3)
        assert set(live.evaluate("window.refused")) == {"img-src", "script-src-elem", "connect-src"}
        assert live.evaluate("window.injected") is None
        server.setblocking(False)
        with pytest.raises(BlockingIOError):  # nobody has called
            server.accept()


def drag(live: Any, selector: str, part: float) -> None:
    """The thumb of a slider to a part of its length, by the mouse."""
    box = live.page.locator(selector).bounding_box()
    middle = box["y"] + box["height"] / 2
    live.page.locator(selector).scroll_into_view_if_needed()
    live.page.mouse.move(box["x"] + box["width"] / 2, middle)
    live.page.mouse.down()
    live.page.mouse.move(box["x"] + box["width"] * part, middle, steps=5)
    live.page.mouse.up()


def pixels(live: Any) -> str:
    return live.evaluate("document.getElementById('picture').toDataURL()")


@in_a_browser
def test_sliders_buttons_and_keys(opened: Opened) -> None:
    with opened("Pendulum", viewport={"width": 1280, "height": 1400}) as live:
        page = live.page
        before, drawn = live.signal("theta"), pixels(live)
        drag(live, '[data-name="theta_0"]', 0.9)
        assert live.signal("theta") > before + 0.1
        assert pixels(live) != drawn

        page.click("#step")
        one = live.time
        assert one == live.plan["step_size"]
        page.locator("body").press(".")
        assert live.time == 2 * one
        page.locator("body").press("r")
        assert live.time == 0

        page.locator("#speed").fill("1")
        assert page.evaluate("window.page.speed") == 2 * live.plan["speed"]
        page.locator("#speed").fill("0")
        page.click("#run")
        assert page.locator("#run").text_content() == "Pause"
        live.wait_until(lambda: live.time > 0.2)
        length = live.signal("length")
        drag(live, '[data-name="length"]', 0.7)
        live.wait_until(lambda: live.signal("length") > length + 0.1)
        assert abs(live.signal("work")) > 1e-3
        assert "force" in (page.locator('[data-force="length"]').text_content() or "")
        page.locator("body").press(" ")
        assert page.locator("#run").text_content() == "Start"
        assert abs(live.signal("energy_balance")) < 1e-6
        stopped = live.time
        page.wait_for_timeout(100)
        assert live.time == stopped

        page.locator('[data-preset="length"]').select_option("Sinusoid")
        live.run(60)
        assert page.locator('[data-name="length"]').input_value() != str(length)
        drag(live, '[data-name="length"]', 0.4)  # the hand takes over
        assert page.locator('[data-preset="length"]').input_value() == "by hand"
        page.click("#reset")
        assert live.time == 0
        assert live.evaluate("[window.page.times.length, window.page.history.length]") == [1, 1]
        assert live.complaints == []


@in_a_browser
def test_each_slider_moves_its_own_coordinate(opened: Opened) -> None:
    with opened("Pendulum") as live:
        live.enter("pivot_x", 0.3)
        assert live.signal("pivot_x") == 0.3  # before the start, at once
        live.run(1)  # from here on the hand moves on
        for name, value in (("pivot_z", 0.2), ("length", 1.3), ("pivot_x", -0.4)):
            before = {other: live.signal(other) for other in ("length", "pivot_x", "pivot_z")}
            live.enter(name, value)
            reached = live.run_for(4)
            assert {other: reached[other] for other in before} == pytest.approx(before | {name: value}, abs=1e-6)
        live.enter("theta_force", 1.0)
        assert live.time > 0  # the motion goes on
        live.enter("mass", 3)
        assert live.signal("p_theta") == pytest.approx(0, abs=1e-12)  # all begins anew
        assert live.signal("tension") == pytest.approx(3 * 9.81 * math.cos(live.signal("theta")), rel=1e-6)


@in_a_browser
def test_the_view_is_that_of_the_camera(opened: Opened) -> None:
    with opened("Satellite") as live:
        for yaw, pitch in ((-0.6, 0.35), (0.9, -0.4)):
            live.evaluate("([yaw, pitch]) => Object.assign(window.page.view, { yaw, pitch })", [yaw, pitch])
            live.evaluate("window.page.paint()")
            low, high, scale, *size = live.evaluate(
                """() => {
                const { low, high, scale, canvas } = window.page.view;
                return [low, high, scale, canvas.clientWidth, canvas.clientHeight];
            }"""
            )
            corners = Camera(yaw, pitch).project(np.array(list(product(*zip(low, high, strict=True)))))
            assert np.max(scale * np.ptp(corners[:, :2], axis=0) / size) == pytest.approx(0.78)  # of the canvas
            for point in np.eye(3):
                seen, scale, origin, centre = live.evaluate(
                    "p => { const v = window.page.view; return [v.see(p), v.scale, v.origin, v.centre]; }",
                    point.tolist(),
                )
                right, up, depth = Camera(yaw, pitch).project(point - centre)
                assert (seen[0] - origin[0]) / scale == pytest.approx(right, abs=1e-12)
                assert (origin[1] - seen[1]) / scale == pytest.approx(up, abs=1e-12)
                assert seen[2] == pytest.approx(depth, abs=1e-12)


@in_a_browser
def test_of_a_box_the_faces_towards_the_eye_are_painted(opened: Opened, fmu: Fmu) -> None:
    with opened(fmu(_Boxed)) as live:
        for yaw, pitch in ((-0.6, 0.35), (2.5, -0.4)):
            painted, radii, lines, ends, unit = live.evaluate(
                """([yaw, pitch]) => {
                const radii = [], lines = [];
                const view = Object.assign(window.page.view, { yaw, pitch }), faces = [];
                let corners = [];
                view.context.beginPath = () => { corners = []; };
                view.context.moveTo = view.context.lineTo = (x, y) => corners.push([x, y]);
                view.context.fill = () => corners.length && faces.push(corners);
                view.context.stroke = () => lines.push(corners);
                view.context.arc = (x, y, radius) => radii.push(radius / view.scale);
                window.page.paint();
                const middle = (k) => (f) => f.reduce((sum, p) => sum + p[k] / 4, 0);
                const place = (f) => [(middle(0)(f) - view.origin[0]) / view.scale,
                  (view.origin[1] - middle(1)(f)) / view.scale];
                const { shapes: [, , spring], scale, extent } = view, { now } = window.page;
                return [faces.map(place), radii, lines, [spring.from, spring.to].map((end) => view.see(end(now))),
                  scale * extent];
            }""",
                [yaw, pitch],
            )
            assert radii == pytest.approx([0.2])
            start, end = np.array(ends)
            zigzag = _zigzag_points(start, end, SIZES["spring"] * unit, max(COILS))
            assert np.array(max(lines, key=len)) == pytest.approx(zigzag[:, :2], abs=1e-9)
            half = np.array([0.5, 1.0, 1.5])  # the faces' distances from the centre
            right, up, towards = Camera(yaw, pitch).axes
            expected = [side * h * e for e, h in zip(np.eye(3), half, strict=True) for side in (1, -1)]
            expected = [[face @ right, face @ up] for face in expected if face @ towards > 0]
            assert sorted(painted) == pytest.approx(np.array(sorted(expected)), abs=1e-9)


@in_a_browser
def test_the_bars_of_the_account_end_at_the_same_place(opened: Opened, fmu: Fmu) -> None:
    with opened(fmu(catalogue()["Pendulum"])) as live:
        for name, value in (("theta_0", 1.0), ("friction", 0.5)):
            live.enter(name, value)
        tools.preset(live, "length", "SmoothStep", height=0.3, duration=0.5)
        reached = live.run_for(1)
        spans: dict[str, np.ndarray] = {}
        for bar in ("work", "gain", "lost"):
            begin, width = (float(live.page.get_attribute(f"#bar-{bar}", name) or "") for name in ("x", "width"))
            spans[bar] = np.array([begin, begin + width]) - 50
        terms = live.page.locator("#account span").all_text_contents()
        labels = live.page.locator(".row span:first-child").all_inner_texts()
        assert live.page.locator('[data-name="theta_dot_0"]').count() == labels.count("theta_dot_0") == 1
        pieces = "s => [...s.childNodes].filter(n => n.nodeName === '#text').map(n => n.data)"
        assert live.page.locator('[data-name="theta_dot_0"]').locator("..").locator("span").first.evaluate(pieces) == [
            "theta_",
            "dot_",
            "0",
        ]  # between which alone it is broken
    assert [term.split()[0] for term in terms] == ["work", "energy", "dissipated"]  # each beside its bar's colour
    work, lost = reached["work"], reached["dissipated"]
    assert lost > 0.1 * abs(work) > 0
    unit = np.abs(spans["work"]).max() / abs(work)
    gain = work - lost
    for bar, ends in {"work": (0, work), "gain": (0, gain), "lost": (gain, work)}.items():
        assert spans[bar] / unit == pytest.approx(np.sort(ends), abs=1e-6), bar


@in_a_browser
def test_a_recorded_motion_is_played(browser: Any, moved: Moved, tmp_path: Path) -> None:
    path = tmp_path / "Pendulum.html"
    moved("Pendulum").animate(path, speed=0.5)
    session = browser.new_context()
    page = session.new_page()
    complaints: list[str] = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(path.as_uri())
    page.click("#run")
    assert page.locator("#run").text_content() == "Start"
    assert page.get_attribute("#place", "max") == "36"  # 0.6 s at half speed, 30 frames a second
    drawn: list[str] = []
    for frame, said in (("0", "t = 0.00 s"), ("18", "t = 0.30 s"), ("36", "t = 0.60 s")):
        page.locator("#place").fill(frame)
        assert page.locator("#time").text_content() == said
        drawn.append(page.evaluate("document.getElementById('picture').toDataURL()"))
    assert len(set(drawn)) == 3
    page.click("#run")
    tools.Live(page).wait_until(lambda: page.locator("#place").input_value() not in {"36", "0"})  # it begins anew
    assert complaints == []
    session.close()


@in_a_browser
def test_recorded_motions_stand_side_by_side(browser: Any, fmu: Fmu, tmp_path: Path) -> None:
    system = System("two")
    for name in ("left", "right"):
        system.add(name, fmu(catalogue()["Pendulum"]), theta_0=0.5)
    system.simulate(1.0, step_size=0.02).animate(tmp_path / "two.html")
    session = browser.new_context()
    page = session.new_page()
    page.goto((tmp_path / "two.html").as_uri())
    page.click("#run")
    page.locator("#place").fill("12")
    page.screenshot(path=SCREENSHOTS / "recorded_side_by_side.png")
    plan = json.loads(page.locator("#plan").text_content() or "")
    assert list(dict.fromkeys(plan["shifts"])) == [
        0.0,
        pytest.approx(2 * 1.1 * math.cos(0.5), abs=1e-4),
    ]  # their height
    dark = page.evaluate(
        """() => {
        const canvas = document.getElementById("picture"), { width, height } = canvas;
        const pixels = canvas.getContext("2d").getImageData(0, 0, width, height).data;
        return Array.from({ length: width }, (_, x) => {
          for (let y = 0; y < height * 0.9; y += 1) if (pixels[4 * (y * width + x) + 3]) return true;
          return false;
        });
    }"""
    )
    runs = [before for before, after in pairwise(dark) if before != after]
    assert runs == [False, True, False, True]  # empty, a pendulum, empty, a pendulum
    session.close()


@in_a_browser
def test_a_refused_step_is_said_and_the_page_goes_on(opened: Opened) -> None:
    with opened("Pendulum") as live:
        live.run(20)
        live.enter("length", -1)
        live.run(400)
        refused = live.time
        assert refused < 2
        assert re.search(r"^length = -?[\d.e-]+ at t = 0\.[\d]+: it must be .* (refused|Reset)", live.text("#said"))
        live.page.click("#run")
        live.wait_until(lambda: live.time > refused + 0.1)
        assert live.text("#said") == ""
        live.enter("mass", -1)  # while it runs
        live.page.wait_for_timeout(100)
        assert re.search("^mass.* Reset to begin anew.$", live.text("#said"))
        live.enter("mass", 1)
        live.enter("length", -1)
        said = live.text("#said")
        assert re.search("^length.* Reset to begin anew.$", said)
        live.page.click("#run")  # it cannot begin
        assert (live.text("#said"), live.text("#run")) == (said, "Start")
        live.enter("length", 1)
        assert live.text("#said") == ""
        live.page.click("#run")
        live.wait_until(lambda: live.time > 0)
        assert live.complaints == []


@in_a_browser
@pytest.mark.variants(core=0)
def test_impacts_are_counted_and_a_table_that_jumps_through_the_ball_is_refused(opened: Opened) -> None:
    fall, impacts = math.sqrt(2 / 9.81), np.arange(100)
    instants = fall * (1 + 2 * np.cumsum(np.where(impacts, 0.8**impacts, 0)))
    with opened("BouncingBall") as live:
        reached = live.run_for(3)
        count = np.sum(instants < live.time)
        assert [reached[f"gap_{end}"] for end in ("impacts", "closed")] == [count, 0]
        assert reached["impact_loss"] == pytest.approx(9.81 * (1 - 0.64**count), rel=1e-9)
        assert live.run_for(1.2)["gap_closed"] == 1  # after 9 times the fall
        live.page.click("#reset")
        live.page.click("#run")
        live.wait_until(lambda: live.time > 0)
        live.evaluate("Object.assign(window.page.machine.parts[0].sources.get('table'), { from: 3, aim: 3 })")
        live.wait_until(lambda: live.text("#run") == "Start")
        assert re.search(r"^gap = -.* at t = .*: bodies overlap.* Reset to begin anew\.$", live.text("#said"))
        live.page.click("#run")
        live.wait_until(lambda: live.time > 0.5)
        assert live.text("#said") == ""
        assert live.complaints == []


@in_a_browser
def test_the_view_is_dragged_and_zoomed_also_in_the_dark(opened: Opened) -> None:
    with opened("Satellite", color_scheme="dark") as live:
        dark = live.evaluate("getComputedStyle(document.body).backgroundColor")
        live.page.emulate_media(color_scheme="light")
        assert live.evaluate("getComputedStyle(document.body).backgroundColor") != dark
        view = "(() => { const v = window.page.view; return [v.yaw, v.pitch, v.zoom]; })()"
        before, drawn = live.evaluate(view), pixels(live)
        live.page.mouse.move(300, 300)
        live.page.mouse.down()
        live.page.mouse.move(380, 340, steps=4)
        live.page.mouse.up()
        live.page.mouse.wheel(0, -300)
        live.wait_until(lambda: live.evaluate(view)[2] > 1)
        after = live.evaluate(view)
        assert after[:2] == pytest.approx([before[0] - 0.008 * 80, before[1] + 0.008 * 40])
        assert pixels(live) != drawn
        live.page.mouse.dblclick(300, 300)
        assert live.evaluate(view) == before


def drawn_in_the_plot(live: Any) -> tuple[list[list[list[float]]], list[list[float]], list[str]]:
    """Curves, dots and words that the page paints into its plot, in pixels."""
    return live.evaluate(
        """() => {
        const context = document.getElementById("plot").getContext("2d"), paths = [], dots = [], words = [];
        context.beginPath = () => paths.push([]);
        context.moveTo = context.lineTo = (x, y) => paths.at(-1).push([x, y]);
        context.arc = (x, y) => dots.push([x, y]);
        context.fillText = (text) => words.push(text);
        window.page.paint();
        for (const name of ["beginPath", "moveTo", "lineTo", "arc", "fillText"]) delete context[name];
        window.page.paint();
        return [paths.filter((path) => path.length > 2), dots, words];
    }"""
    )


@in_a_browser
def test_one_signal_over_another(opened: Opened) -> None:
    """A phase portrait: pixels to the right go with the one signal, pixels up with the other."""
    with opened("Pendulum", viewport={"width": 1280, "height": 1000}) as live:
        live.enter("theta_0", 1.0)
        for button in live.page.locator("#signals button").all():
            button.click()
        live.page.locator("[data-signals]").select_option("theta_dot")
        live.run_for(3)
        (over_time,), dots, words = drawn_in_the_plot(live)
        assert dots == []
        assert "2 s" in words
        live.page.locator("[data-over]").select_option("theta")
        (curve,), (dot,), words = drawn_in_the_plot(live)
        live.page.screenshot(path=SCREENSHOTS / "phase_portrait.png")
        signals = live.evaluate(
            "['theta', 'theta_dot'].map((n) => window.page.history.map((v) => v[window.page.machine.place.get(n)]))"
        )
        assert not [word for word in words if word.endswith("s")]
        assert [y for _, y in curve] == [y for _, y in over_time]
        for pixel, signal, side in zip(np.transpose(curve), signals, (1, -1), strict=True):  # y is down on a canvas
            slope, start = np.polyfit(signal, pixel, 1)
            assert side * slope > 10.0
            assert pixel == pytest.approx(slope * np.array(signal) + start, abs=1e-6)
        assert dot == curve[-1]
        live.page.locator("[data-over]").select_option("over time")
        assert drawn_in_the_plot(live)[0] == [over_time]
        assert {"-2", "2"} <= set(drawn_in_the_plot(live)[2])
        live.page.locator("[data-signals]").select_option("length")
        live.page.locator("#signals button").first.click()
        (constant,), _, _ = drawn_in_the_plot(live)
        top, bottom = np.array(over_time)[:, 1].min(), np.array(over_time)[:, 1].max()
        assert np.array(constant)[:, 1] == pytest.approx((top + bottom) / 2)
        assert live.complaints == []


@in_a_browser
def test_presets_suit_what_they_move(opened: Opened) -> None:
    """Pumped twice a period a pendulum swings ever higher; shaken fast enough it stands upright on its pivot."""
    with opened("Pendulum") as live:
        words = live.page.locator('[data-preset="length"] option').all_text_contents()
        assert words == [
            "by hand",
            "pump it (Sinusoid)",
            "lengthen it evenly (Ramp)",
            "lengthen it smoothly (SmoothStep)",
        ]
        tools.preset(live, "length", "Sinusoid")
        assert live.run_for(8)["work"] > 0.1
        assert live.evaluate("[window.page.times.length, window.page.history.length]") == [900, 900]
        tools.preset(live, "length", "by hand")
        length = live.run_for(4)["length"]
        tools.preset(live, "length", "Ramp")
        assert live.run_for(1)["length"] == pytest.approx(length + 0.1, rel=1e-3)  # a tenth of it a second
        tools.preset(live, "length", "by hand")
        live.enter("theta_0", 3)
        tools.preset(live, "pivot_z", "Sinusoid")
        for _ in range(8):
            assert abs(live.run_for(1)["theta"] - 3.14) < 0.5
        assert live.complaints == []
    with opened("BouncingBall") as live:
        live.enter("height_0", 0)
        live.enter("bounce", 0)
        tools.preset(live, "table", "Sinusoid")
        assert live.run(15)["gap"] > 1e-3  # it leaves where sin ωt = 2/3, at 0.06 s
        assert live.complaints == []
    with opened("CircularHoop") as live:
        tools.preset(live, "beta", "SmoothStep")
        assert live.run_for(4.1)["beta"] == pytest.approx(6.28319, abs=1e-4)


@in_a_browser
def test_two_fingers_zoom(opened: Opened) -> None:
    with opened("Satellite", **PHONE) as live:
        touch = live.page.context.new_cdp_session(live.page)
        for kind, places in (("touchStart", (150, 250)), ("touchMove", (100, 300)), ("touchEnd", ())):
            points = [{"x": x, "y": 300, "id": i} for i, x in enumerate(places)]
            touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
        live.wait_until(lambda: live.evaluate("window.page.view.zoom") != 1)
        assert live.evaluate("window.page.view.zoom") == pytest.approx(2)
        assert live.evaluate("visualViewport.scale") == 1  # the page itself is not zoomed


@in_a_browser
def test_a_telephone(opened: Opened) -> None:
    for name in FAST:
        with opened(name, **PHONE) as live:
            assert live.evaluate("document.documentElement.scrollWidth") <= 390
            live.page.tap("#run")
            assert live.text("#run") == "Pause"
            assert live.complaints == []


@in_a_browser
def test_what_is_not_connected_stands_side_by_side(browser: Any, fmu: Fmu, tmp_path: Path) -> None:
    fmus = [fmu(catalogue()[name]) for name in ("Pendulum", "DoublePendulum", "Pendulum")]
    with tools.opened(browser, show(*fmus, path=tmp_path / "x.html").path) as live:
        assert live.complaints == []
        live.page.screenshot(path=SCREENSHOTS / "side_by_side.png")
        places = live.evaluate("window.page.groups.map(({ shift }) => shift.x)")
        points = live.evaluate(
            "window.page.groups.map(({ shapes }) => shapes.flatMap((s) => [s.from, s.to, s.at].filter(Boolean))"
            ".map((p) => p(window.page.now)))"
        )
    ends = np.array([[np.min(group, axis=0), np.max(group, axis=0)] for group in points])  # group, end, axis
    assert places[0] == 0
    assert np.all(ends[:-1, 1, 0] < ends[1:, 0, 0])
    sizes = np.ptp(ends, axis=1).max(axis=1)  # with a tenth of it as room, each swings on both sides of its centre
    assert np.diff(ends.mean(axis=1)[:, 0]) == pytest.approx(1.1 * (sizes[:-1] + sizes[1:]))


MOVED = {
    "Sinusoid": {"offset": 1.0, "amplitude": 0.1, "angular_frequency": 6.26},
    "PlannedMotion": {
        "instant": np.arange(100) / 20,
        "value": 1 + 0.1 * np.sin(np.arange(100) / 8),
    },  # arrays; knots on steps of the page
}


@in_a_browser
@pytest.mark.parametrize("moved", MOVED)
@pytest.mark.parametrize("archived", [False, True])
def test_a_system_runs_as_its_simulation(
    opened: Opened, fmu: Fmu, tmp_path: Path, moved: str, *, archived: bool
) -> None:
    system = System(EVIL)
    pumped = operator(fmu(catalogue()[moved]), start_values=MOVED[moved])
    system.add("swing", fmu(catalogue()["Pendulum"]), theta_0=0.5, length=pumped)
    if archived:  # its FMUs read their start values from files, which a page has not
        system.write_ssp(tmp_path / "system.ssp")
        system = System.from_ssp(tmp_path / "system.ssp")
    with opened(system) as live:
        plan = live.plan
        reached = live.run(600)
        assert live.text("h1") == system.name  # an archive has another one
        assert live.page.locator("img").count() == 0
        assert live.complaints == []
    size = plan["step_size"]
    result = system.simulate(times=[k * size for k in range(601)], tolerance=plan["tolerance"])
    for name in ("swing.theta", "swing.theta_dot", "swing.energy", "swing.length"):
        assert reached[name] == pytest.approx(result[name][-1], rel=1e-11), name


@in_a_browser
@pytest.mark.variants(core=0)
def test_a_page_whose_forces_go_back_is_that_of_one_fmu(browser: Any, tmp_path: Path) -> None:
    system = System("two ways")
    upper = system.add("upper", "Oscillator", x_0=0.3)
    lower = system.add("lower", "Pendulum", mass=2.0, theta_0=0.5)
    system.connect(upper["x"], lower["pivot_x"])
    page = show(system, path=tmp_path / "page.html").path
    with tools.opened(browser, page) as live:
        reached = live.run_for(2.0)
        result = system.simulate(live.time, 0.005, coupling="implicit", tolerance=1e-10)
    for name in ("upper.x", "lower.theta"):
        assert reached[name] == pytest.approx(result[name][-1], abs=1e-7), name  # the page's tolerance is 1e-8


def test_a_page_whose_forces_go_back_to_a_foreign_fmu_is_refused(fmu: Fmu, tmp_path: Path) -> None:
    foreign = changed(
        fmu(catalogue()["Oscillator"]),
        tmp_path / "Other.fmu",
        lambda n, c: c.replace(b'modelName="Oscillator"', b'modelName="Other"') if n == "modelDescription.xml" else c,
    )
    system = System("two ways")
    upper, lower = system.add("upper", foreign), system.add("lower", "Pendulum")
    system.connect(upper["x"], lower["pivot_x"])
    words = r"^show: two ways: a force goes back by lower\.pivot_x_force -> upper\.x_load, [^\n]*'Other'"
    with pytest.raises(SimulationError, match=words):
        show(system, path=tmp_path / "page.html")
    assert not (tmp_path / "page.html").exists()


@in_a_browser
@pytest.mark.variants(core=0)
def test_what_is_fed_by_a_later_component_extrapolates(fmu: Fmu, tmp_path: Path) -> None:
    system = System("loop")
    swing = system.add("swing", fmu(catalogue()["Pendulum"]), theta_0=0.3)
    coarse = changed(
        fmu(catalogue()["SwingPump"]),
        tmp_path / "SwingPump.fmu",
        lambda n, c: re.sub(rb' tolerance="[^"]*"', b' tolerance="0.001"', c) if n == "modelDescription.xml" else c,
    )
    pump = system.add("pump", coarse)
    system.connect(pump["y"], swing["length"])
    for name in ("theta", "theta_dot"):
        system.connect(swing[name], pump[name])
    plan = re.search(r'<script[^>]*id="plan"[^>]*>(.*?)</script>', live_page(system).decode(), re.DOTALL)
    assert plan is not None
    parts = json.loads(plan[1])["components"]
    assert [part["reconstruction"] for part in parts] == [1, 2]
    assert sorted(name for part in parts for name, *_ in part["free"]) == ["pivot_x", "pivot_z"]  # not the length
    assert json.loads(plan[1])["tolerance"] == 1e-8  # the finest
    system.add("held", fmu(catalogue()["Regulator"]), period=0.02)
    plan = re.search(r'"step_size": ?([^,]*)', live_page(system).decode())
    assert plan is not None
    assert float(plan[1]) == pytest.approx(0.02 / 3, rel=1e-12)  # of which there are three in a period


@in_a_browser
def test_what_is_converted_on_its_way(opened: Opened, fmu: Fmu) -> None:
    system = System("converted")
    motor = system.add("motor", fmu(catalogue()["Sinusoid"]), offset=0.2, amplitude=0.05, angular_frequency=5.0)
    swing = system.add("swing", fmu(catalogue()["Pendulum"]), theta_0=0.5)
    system.join(
        Connection.between(motor[f"y{rate}"], swing[f"length{rate}"], Conversion(2.0, 0.0 if rate else 0.7))
        for rate in ("", "_dot", "_ddot")
    )
    with opened(system) as live:
        size, reached = live.plan["step_size"], live.run(60)
    assert reached["swing.length"] == pytest.approx(2 * reached["motor.y"] + 0.7, rel=1e-15)
    assert reached["motor.y"] == pytest.approx(0.2 + 0.05 * math.sin(5 * 60 * size), rel=1e-12)


class _Boxed(Mechanism):
    """A box on a line, with a ball and a spring inside."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    x = Coordinate("m", "position")

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.x) ** 2

    def picture(self) -> Shapes:
        left, right = ({"x": self.x + side * 0.4, "z": side * 0.5} for side in (-1, 1))
        return [Box({"x": self.x}, ca.SX.eye(3), (1.0, 2.0, 3.0)), Ball({"x": self.x}, 0.2), Spring(left, right)]


class _Toy(Mechanism):
    """A mass </script><img src=x onerror=alert(1)> on a line, <b>bold</b>."""

    mass = Parameter(1.0, "kg", "mass, " + EVIL, minimum=0.5, maximum=1.5)
    x = Coordinate("m", "position", start=1.0)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.x) ** 2


@in_a_browser
def test_text_of_an_fmu_is_text(opened: Opened, fmu: Fmu, tmp_path: Path) -> None:
    quoted = EVIL.replace("<", "&lt;").replace(">", "&gt;").encode()
    name = rb'(<fmiModelDescription[^>]*?modelName=")[^"]*', rb"\g<1>" + quoted
    renamed = changed(fmu(_Toy), tmp_path / "evil.fmu", lambda n, c: re.sub(*name, c) if n.endswith(".xml") else c)
    with opened(renamed) as live:
        live.run(10)
        slider = live.page.locator('[data-name="mass"]')
        assert [slider.get_attribute(end) for end in ("min", "max")] == ["0.5", "1.5"]
        assert live.text("h1") == EVIL
        assert "<b>bold</b>" in live.text("header p")
        assert live.page.locator("img, b").count() == 0
        assert live.complaints == []


def changed(path: Path, output: Path, change: Callable[[str, bytes], bytes | None]) -> Path:
    """An FMU with other members; None leaves one out."""
    with zipfile.ZipFile(path) as given, zipfile.ZipFile(output, "w") as written:
        for name in given.namelist():
            content = change(name, given.read(name))
            if content is not None:
                written.writestr(name, content)
    return output


def test_what_has_no_sources_is_refused(fmu: Fmu, tmp_path: Path) -> None:
    pendulum = catalogue()["Pendulum"]
    bare = changed(fmu(pendulum), tmp_path / "bare.fmu", lambda n, c: None if n.startswith("sources/") else c)
    for path in (bare, fmu(pendulum, fmi="3")):
        with pytest.raises(SimulationError, match=rf"^{re.escape(str(path))}.*FMI 2\.0"):
            live_page(path)
    times = np.linspace(0, 1, 200)
    system = System("long")
    system.add("swing", fmu(pendulum), length=tabulated(times, 1 + times))
    with pytest.raises(SimulationError, match=r"^PlannedMotion\.fmu: a live page reads no files"):
        live_page(system)


def test_without_a_compiler_it_says_what_to_install(fmu: Fmu, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    same = changed(fmu(catalogue()["Pendulum"]), tmp_path / "other.fmu", lambda _, content: content)
    monkeypatch.setattr(compiler, "zig_compiler", lambda: None)
    with pytest.raises(BuildError, match=r"no C compiler for WebAssembly is found: pip install 'liaisons\[cross\]'"):
        live_page(same)


@pytest.mark.parametrize(
    "content",
    [
        b'{"version": "9.0", "shapes": []}',
        b'{"version": "1.0", "shapes": [{"shape": "ball", "at": ["nobody_x", 0, 0]}]}',
    ],
)
def test_a_damaged_picture_is_refused(content: bytes, fmu: Fmu, tmp_path: Path) -> None:
    damaged = changed(
        fmu(catalogue()["Pendulum"]),
        tmp_path / "damaged.fmu",
        lambda name, was: content if name == "resources/picture.json" else was,
    )
    with pytest.raises(SimulationError, match=r"^[^\n]*picture\.json[^\n]*$"):
        live_page(damaged)


@pytest.mark.parametrize(
    ("zig", "cure"),
    [(None, r"as our native FMUs have them: pip install 'liaisons\[cross\]'"), (["zig"], "as our FMUs have them")],
)
@pytest.mark.variants(core=0)
def test_an_fmu_without_sources(fmu: Fmu, monkeypatch: pytest.MonkeyPatch, zig: list[str] | None, cure: str) -> None:
    """Such as are built where there is no compiler."""
    monkeypatch.setattr("liaisons_exchange.live.page.zig_compiler", lambda: zig)
    with pytest.raises(
        SimulationError, match=rf"Ramp\.fmu: a live page needs the C sources of FMI 2\.0 inside, {cure}$"
    ):
        live_page(fmu(catalogue()["Ramp"], "python"))


CONTACTS = [
    {"shape": "rope", "from": ["pivot_x", 0, "pivot_z"], "to": ["bob_x", 0, "bob_z"], "length": 1.5},
    {"shape": "floor", "at": [0.5, 0, -1], "normal": [1, 0, 2], "width": "length"},
    {"shape": "flash", "at": ["bob_x", 0, "bob_z"], "count": "theta"},
    {"shape": "spring", "from": ["pivot_x", 0, "pivot_z"], "to": ["bob_x", 0, "bob_z"]},
]


@in_a_browser
@pytest.mark.variants(core=0)
def test_ropes_floors_and_flashes_are_those_of_the_frames(opened: Opened, fmu: Fmu, tmp_path: Path) -> None:
    document = json.dumps({"version": "1.1", "shapes": CONTACTS}).encode()
    turning = changed(
        fmu(catalogue()["Pendulum"]),
        tmp_path / "turning.fmu",
        lambda name, was: document if name == "resources/picture.json" else was,
    )
    with opened(turning) as live:
        live.enter("theta_dot_0", 9.0)
        live.run(1)
        values, curve, corners, ends, coils, unit = live.evaluate(
            """() => {
            const { machine, view, now } = window.page, [rope, floor, , spring] = view.shapes, paths = [];
            view.context.beginPath = () => paths.push([]);
            view.context.moveTo = view.context.lineTo = (x, y) => paths.at(-1).push([x, y]);
            window.page.paint();
            for (const name of ["beginPath", "moveTo", "lineTo"]) delete view.context[name];
            return [machine.signals.map((name, i) => [name, now[i]]), rope.curve(now),
              [floor.at(now), ...floor.axes.map((axis) => axis(now)), floor.size.map((size) => size(now))],
              [spring.from(now), spring.to(now)].map((end) => view.see(end)), paths.at(-1), view.scale * view.extent];
        }"""
        )
        lit, angles = live.evaluate(
            """() => {
            const { page } = window, lit = [], angles = [page.now[page.machine.place.get("theta")]];
            page.view.context.fill = () => { lit[lit.length - 1] = true; };
            for (let k = 0; k < 40; k += 1) {
              page.step();
              lit.push(false);
              page.paint();
              angles.push(page.now[page.machine.place.get("theta")]);
            }
            return [lit, angles];
        }"""
        )
        assert live.complaints == []
    seen = picture_frames(
        Picture(tuple(CONTACTS)), np.zeros(1), lambda name: np.array([dict(values)[name]]), title="it"
    )
    rope, floor, *_ = seen.shapes
    assert np.array(curve) == pytest.approx(rope.points[0], abs=1e-12)
    assert floor.axes is not None
    assert floor.size is not None
    assert np.array(corners) == pytest.approx(np.array([floor.points[0, 0], *floor.axes[0], floor.size[0]]), abs=1e-12)
    start, end = np.array(ends)
    zigzag = _zigzag_points(start, end, SIZES["spring"] * unit, max(COILS))
    assert np.array(coils) == pytest.approx(zigzag[:, :2], abs=1e-9)
    turns = picture_frames(Picture(tuple(CONTACTS[2:3])), np.arange(41.0), lambda _: np.array(angles), title="it")
    assert turns.shapes[0].size is not None
    assert lit == (turns.shapes[0].size[1:, 0] > 0).tolist()
    assert 10 < sum(lit) < 40
