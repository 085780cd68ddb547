"""HTML documentation of a system in its archive: components with start values, connections, experiment."""

from __future__ import annotations

from html import escape

from liaisons.cosim import SystemDocument

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
{parts}
</table>
<h2>Connections</h2>
<table><tr><th>output</th><th>input</th><th>unit</th></tr>
{connections}
</table>
</body>
</html>
"""


def system_page(document: SystemDocument) -> str:
    """HTML page of a system: components with start values, connections, experiment."""
    experiment = document.experiment
    times = [f"starts at t = {experiment.start_time:g} s"]
    if experiment.stop_time is not None:
        times.append(f"stops at t = {experiment.stop_time:g} s")
    if experiment.step_size is not None:
        times.append(f"communicates every {experiment.step_size:g} s")
    return _PAGE.format(
        title=escape(document.name),
        experiment=f"The experiment {', '.join(times)}.",
        parts="\n".join(
            _table_row(
                c.name,
                f"{c.fmu.model_name} (FMI {c.fmu.version}.0)",
                ", ".join(f"{n} = {f'{len(v)} values' if isinstance(v, tuple) else v}" for n, v in c.starts.items()),
            )
            for c in document.parts.values()
        ),
        connections="\n".join(
            _table_row(*str(connection).split(" -> "), connection.source.variable.unit)
            for connection in document.connections
        ),
    )


def _table_row(*cells: str) -> str:
    """A row of an HTML table, its cells escaped."""
    return f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in cells)}</tr>"
