"""What tests of live pages share: a browser, and what the native FMU reaches."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import fmpy
from fmpy.fmi2 import FMU2Slave
from playwright.sync_api import Browser, Page, sync_playwright

BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
HANG = 60_000.0  # [ms]
Triple = Callable[[float, float], tuple[float, float, float]]
"""Of a start and a time [s]: the coordinate and its rates."""


@contextmanager
def browser() -> Iterator[Browser]:
    """A headless Chromium."""
    with sync_playwright() as driver:
        found = driver.chromium.launch(executable_path=BROWSER, args=["--no-sandbox", "--disable-gpu"])
        try:
            yield found
        finally:
            found.close()


@dataclass
class Live:
    """A page that is open, and everything that it complained of."""

    page: Page
    complaints: list[str] = field(default_factory=list)

    def evaluate(self, script: str, argument: object = None) -> Any:
        return self.page.evaluate(script, argument)

    @property
    def plan(self) -> dict[str, Any]:
        return self.evaluate("window.page.plan")

    @property
    def time(self) -> float:
        return self.evaluate("window.page.machine.time")

    def run(self, count: int) -> dict[str, float]:
        return self.evaluate("count => window.page.run(count)", count)

    def run_for(self, seconds: float) -> dict[str, float]:
        return self.run(round(seconds / self.plan["step_size"]))

    def signal(self, name: str) -> float:
        return self.evaluate("n => { const p = window.page; return p.now[p.machine.place.get(n)]; }", name)

    def text(self, selector: str) -> str:
        return self.page.locator(selector).text_content() or ""

    def enter(self, name: str, value: float, place: str = '[data-number="{}"]') -> None:
        """Enter a number beside a slider."""
        field = self.page.locator(place.format(name))
        field.fill(str(value))
        field.dispatch_event("change")

    def wait_until(self, holds: Callable[[], bool]) -> None:
        """As playwright's own, which evaluates a string, as the page's policy forbids."""
        for _ in range(int(HANG / 50)):
            if holds():
                return
            self.page.wait_for_timeout(50)
        raise TimeoutError(self.text("#said"))


@contextmanager
def opened(found: Browser, path: Path, **context: Any) -> Iterator[Live]:
    """A page from file://, in a browser session of its own."""
    session = found.new_context(**context)
    live = Live(session.new_page())
    live.page.set_default_timeout(HANG)
    live.page.on("console", lambda said: live.complaints.append(said.text))
    live.page.on("pageerror", lambda error: live.complaints.append(str(error)))
    live.page.on("dialog", lambda dialog: live.complaints.append(f"dialog: {dialog.message}"))
    try:
        live.page.goto(path.as_uri())
        live.wait_until(lambda: live.evaluate("window.page !== undefined"))
        yield live
    finally:
        session.close()


def smooth_step(start: float, time: float, height: float = 0.1, duration: float = 2.0) -> tuple[float, float, float]:
    """The page's preset of that name."""
    x = min(time / duration, 1.0)
    rise = x**4 * (35 - 84 * x + 70 * x**2 - 20 * x**3)
    rate = 140 * (x * (1 - x)) ** 3 / duration
    return start + height * rise, height * rate, height * 420 * (x * (1 - x)) ** 2 * (1 - 2 * x) / duration**2


def native(path: Path, plan: Mapping[str, Any], count: int, moved: Triple) -> tuple[dict[str, float], dict[str, float]]:
    """What fmpy reaches with the same starts and communication points, handing over the operator's coordinates.

    :returns: each signal at the end, and the largest size that signals of its unit ever had.
    """
    (component,) = plan["components"]
    variables, size = component["variables"], plan["step_size"]
    reference = {v["name"]: v["reference"] for v in variables}
    start = {v["name"]: v["start"] for v in variables if "start" in v}
    shown = sorted((v for v in variables if v.get("read")), key=lambda v: "type" in v)  # real ones first
    references = [v["reference"] for v in shown if "type" not in v]
    with tempfile.TemporaryDirectory() as folder:
        fmpy.extract(path, folder)
        description = fmpy.read_model_description(folder)
        assert description.coSimulation is not None
        fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="native",
        )
        fmu.instantiate()

        def move(time: float) -> None:
            for members in component["free"]:
                triple = moved(start[members[0]], time)
                fmu.setReal([reference[m] for m in members], triple[: len(members)])

        fmu.setReal([reference[name] for name in start], list(start.values()))
        for number, value in component["settings"].items():
            fmu.setInteger([int(number)], [value])
        move(0.0)
        fmu.setupExperiment(tolerance=plan["tolerance"], startTime=0.0)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        get = {"Integer": fmu.getInteger, "Boolean": fmu.getBoolean}
        largest: dict[str, float] = {}
        values: list[float] = []
        for k in range(count + 1):
            if k > 0:
                move((k - 1) * size + size)
                fmu.doStep(currentCommunicationPoint=(k - 1) * size, communicationStepSize=size)
            values = [*fmu.getReal(references), *(get[v["type"]]([v["reference"]])[0] for v in shown if "type" in v)]
            for v, value in zip(shown, values, strict=True):
                unit = v.get("unit", "")
                largest[unit] = max(largest.get(unit, 0.0), abs(value))
        fmu.terminate()
        fmu.freeInstance()
    names = [v["name"] for v in shown]
    scales = [largest[v.get("unit", "")] or 1.0 for v in shown]
    return dict(zip(names, values, strict=True)), dict(zip(names, scales, strict=True))


def difference(one: Mapping[str, float], other: Mapping[str, float], scales: Mapping[str, float]) -> float:
    """The largest of all signals, relative to the largest value of its unit."""
    return max(abs(one[name] - other[name]) / scales[name] for name in scales)


def preset(live: Live, name: str, choice: str, **fields: float) -> None:
    """Choose what moves a coordinate, by the page's own menu."""
    menu = live.page.locator(f'select[data-preset="{name}"]')
    menu.select_option(choice)
    for key, value in fields.items():
        live.enter(key, value, f'.preset:has(select[data-preset="{name}"]) input[title="{{}}"]')
