"""``python tests/pictures/live_table.py [COMPONENT ...]``: live pages in a browser, beside the native FMUs."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import _browser as tools

from liaisons import fmu_path
from liaisons.library import catalogue
from liaisons.live import live_page

SECONDS, HEIGHT = 10.0, 0.1
FRAME = """count => {
  const page = window.page, spent = [];
  for (let k = 0; k < count; k += 1) {
    const begin = performance.now();
    page.step(); page.step(); page.paint();
    spent.push(performance.now() - begin);
  }
  return spent.sort((a, b) => a - b)[count >> 1];
}"""
"""Main thread of a frame: two steps and all that is drawn, the median [ms]."""


def main(names: list[str]) -> None:
    """Print a row a component."""
    print("| component | loads | 10 s against native | ms a frame | kB |\n|---|---|---:|---:|---:|")  # noqa: T201
    with tempfile.TemporaryDirectory() as folder, tools.browser() as browser:
        for name in names or sorted(catalogue()):
            fmu, html = fmu_path(name), Path(folder) / f"{name}.html"
            html.write_bytes(live_page(fmu))
            with tools.opened(browser, html) as live:
                plan = live.plan
                count = round(SECONDS / plan["step_size"])
                for members in plan["components"][0]["free"]:
                    tools.preset(live, members[0], "SmoothStep", height=HEIGHT, duration=2.0)
                reached = live.run(count)
                expected, scales = tools.native(fmu, plan, count, lambda s, t: tools.smooth_step(s, t, HEIGHT))
                far = tools.difference(reached, expected, scales)
                loads = "; ".join(live.complaints) or "yes"
                size = html.stat().st_size / 1000
                print(f"| {name} | {loads} | {far:.0e} | {live.page.evaluate(FRAME, 100):.1f} | {size:.0f} |")  # noqa: T201


if __name__ == "__main__":
    main(sys.argv[1:])
