"""A page about a system, for the archive: components with their start values, connections, experiment."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

from liaisons.cosim.component import Component
from liaisons.cosim.ports import Link
from liaisons.cosim.ssp.experiment import Experiment

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><title>{title}</title>
<style>body {{ font-family: sans-serif; max-width: 60em; margin: 2em auto; }}
table {{ border-collapse: collapse; }} td, th {{ border: 1px solid #aaa; padding: .2em .6em; text-align: left; }}
</style></head>
<body>
<h1>{title}</h1>
<p>{experiment}</p>
<h2>Components</h2>
<table><tr><th>name</th><th>FMU</th><th>start values</th></tr>
{components}
</table>
<h2>Connections</h2>
<table><tr><th>output</th><th>input</th><th>unit</th></tr>
{connections}
</table>
</body>
</html>
"""


def page(name: str, components: Iterable[Component], links: Iterable[Link], experiment: Experiment) -> str:
    """The page as HTML."""
    times = [f"starts at t = {experiment.start_time:g} s"]
    if experiment.stop_time is not None:
        times.append(f"stops at t = {experiment.stop_time:g} s")
    if experiment.step_size is not None:
        times.append(f"communicates every {experiment.step_size:g} s")
    return _PAGE.format(
        title=escape(name),
        experiment=f"The experiment {', '.join(times)}.",
        components="\n".join(
            _row(c.name, f"{c.fmu.model_name} (FMI {c.fmu.version}.0)", ", ".join(_starts(c))) for c in components
        ),
        connections="\n".join(_row(str(link.source), str(link.target), link.source.variable.unit) for link in links),
    )


def _starts(component: Component) -> list[str]:
    return [f"{n} = {f'{len(v)} values' if isinstance(v, tuple) else v}" for n, v in component.starts.items()]


def _row(*cells: str) -> str:
    return f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in cells)}</tr>"
