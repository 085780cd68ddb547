"""Pages written at build time from the program itself: its commands, its catalogue; and what references mean."""

from __future__ import annotations

import re
from inspect import ismodule
from pathlib import Path

import typer.cli
import typer.main
from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.errors import ExtensionError

import liaisons
from liaisons_tools.cli import (  # noqa: F401  # the commands
    check,
    compare,
    components,
    equations,
    identify,
    new,
    pictures,
    plan,
    run,
    simulate,
    sweep,
)
from liaisons_tools.cli._command import application

ELSEWHERE = [r"(numpy|casadi|ca|np|jax|pandas|xarray|matplotlib|scipy|distributed|collections|fmpy)\b.*"]
"""Objects of other packages, whose pages are not fetched."""


def setup(app: Sphinx) -> None:
    """Write the pages before they are read; see that every public name has one."""
    app.connect("builder-inited", write_commands)
    app.connect("missing-reference", _by_last_name)
    app.connect("env-check-consistency", _complete)


def write_commands(app: Sphinx) -> None:
    """The command-line reference, from what ``--help`` knows."""
    command = typer.main.get_command(application)
    text = typer.cli.get_docs_for_click(obj=command, ctx=typer.Context(command, info_name="liaisons"), name="liaisons")
    text = text.replace("# `liaisons`\n", "# Command line\n", 1)
    text = re.sub(r"(?m)^\*\*Commands\*\*:\n\n(\* .*\n)+", "", text)
    text = re.sub(r"(?m)^examples:\n((?:  .*\n)+)", _examples, text)
    _write(Path(app.srcdir) / "reference" / "commands.md", text)


def _examples(found: re.Match[str]) -> str:
    lines = "".join(f"$ {line[2:]}\n" for line in found[1].splitlines())
    return f"```console\n{lines}```\n"


def _write(path: Path, text: str) -> None:
    """Write a page if it is another one, so that it is not read anew for nothing."""
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


def _by_last_name(
    app: Sphinx, env: BuildEnvironment, node: pending_xref, content: nodes.TextElement
) -> nodes.reference | None:
    """Docstrings name objects as their module does: ``ValidityError``, ``Mechanism.dot``."""
    if node["refdomain"] != "py":
        return None
    domain = env.domains.python_domain
    name = node["reftarget"].removeprefix("~")
    ends = {name, re.sub(r"^liaisons(\.\w+)+?\.(?=[A-Z]|\w+$)", "", name)}
    found = {
        entry.node_id: entry.docname
        for full, entry in domain.objects.items()
        if not entry.aliased and any(full == end or full.endswith(f".{end}") for end in ends)
    }
    if len(found) != 1:
        return None
    ((place, page),) = found.items()
    return app.builder and nodes.reference(
        "", "", content, internal=True,
        refuri=f"{app.builder.get_relative_uri(node['refdoc'], page)}#{place}",
    )  # fmt: skip


def _complete(app: Sphinx, env: BuildEnvironment) -> None:
    documented = env.domains.python_domain.objects
    public = [n for n in liaisons.__all__ if not n.startswith("__") and not ismodule(getattr(liaisons, n))]
    missing = [n for n in public if f"liaisons.{n}" not in documented]
    if missing:
        raise ExtensionError(f"reference/api.md lacks public names: {', '.join(missing)}")
