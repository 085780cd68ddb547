"""The gallery: of each scenario its claim, figure, motion, verdicts and source, all from one run of them; lessons.

sphinx-gallery would run the scripts one after the other and keep what matplotlib shows.  A scenario is a function that
is given ``claim``, has verdicts and one figure, and may simulate for ten seconds; ``liaisons_tools.scenarios`` hands
all of it back, so that a scraper and a reset of one's own would be as long as this file, and would use one core.

``sphinx-build -D scenarios=kepler,helix docs docs/_build/html`` runs only these.
"""

from __future__ import annotations

import multiprocessing
import os
import re
from collections.abc import Collection
from concurrent.futures import ProcessPoolExecutor, as_completed
from html import escape
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch
from zipfile import ZipFile

from PIL import Image
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util.display import status_iterator

import texts
from liaisons import Result, show
from liaisons.cosim import system
from liaisons.errors import LiaisonsError, suggestion
from liaisons.language import Operator
from liaisons.library import catalogue, fmu_file
from liaisons.scenario_files import read_gallery, scenario_files
from liaisons_pages.pictures import motion_page
from liaisons_tools.scenarios import execute, lessons, load, load_lesson

TITLES: dict[str, str] = read_gallery()["titles"]
THEMES = {theme["title"]: theme["scenarios"] for theme in read_gallery()["themes"].values()}
PANELS: dict[str, int] = read_gallery()["panels"]
THUMBNAIL = 420, 300
"""Largest width and height [px]."""

MOTION = 300_000
"""Bytes of the frames of a motion: a picture of many parts is shown in fewer."""


class Entry(NamedTuple):
    """What the gallery says of a scenario; ``error`` says why it has no page."""

    name: str
    claim: str
    error: str


def setup(app: Sphinx) -> None:
    """Write the pages before they are read."""
    app.add_config_value("scenarios", "", "env", str)
    app.connect("builder-inited", write_gallery)


def write_gallery(app: Sphinx) -> None:
    """Write ``gallery/index.md``, a page for every scenario, and live pages of the mechanisms in them.

    :raises ExtensionError: if a scenario fails, or one is asked for that there is not.
    """
    pages, shown = Path(app.srcdir) / "gallery", Path(app.outdir) / "gallery"
    files = scenario_files()
    names = app.config.scenarios.split(",") if app.config.scenarios else list(files)
    taught = Path(app.srcdir) / "lessons"
    for folder in (pages, shown / "live", taught, Path(app.outdir) / "lessons"):
        folder.mkdir(parents=True, exist_ok=True)
    for page in (*pages.glob("*.md"), *taught.glob("*.md")):
        page.unlink()
    if unknown := [name for name in names if name not in files]:
        raise ExtensionError(f"no scenario is called {unknown[0]!r}{suggestion(unknown[0], files)}")
    live = sorted({mechanism for name in names for mechanism in mechanisms(files[name])})
    with ProcessPoolExecutor(os.cpu_count(), multiprocessing.get_context("spawn")) as pool:
        runs = [pool.submit(write_page, name, names, pages, shown) for name in names]
        tasks = [*runs, *(pool.submit(write_live, name, shown / "live") for name in live)]
        tasks.append(pool.submit(write_swing, Path(app.outdir)))
        for task in status_iterator(as_completed(tasks), "gallery... ", length=len(tasks), stringify_func=_done):
            task.result()
    entries = [run.result() for run in runs]
    if failed := [f"{entry.name}: {entry.error}" for entry in entries if entry.error]:
        raise ExtensionError("\n".join(failed))
    (pages / "index.md").write_text(_index(entries, live), encoding="utf-8")
    chosen = [name for name in lessons() if name in names]
    (taught / "index.md").write_text(lesson_index(chosen), encoding="utf-8")


def mechanisms(path: Path) -> list[str]:
    """Names of the mechanisms of the catalogue that a scenario simulates."""
    words = set(re.findall(r"\w+", path.read_text(encoding="utf-8")))
    return [name for name, item in catalogue().items() if name in words and not issubclass(item, Operator)]


def write_page(name: str, names: Collection[str], pages: Path, shown: Path) -> Entry:
    """Run a scenario; write its page and figure, and, where they are shown, its thumbnail and its motion.

    :param names: of all that have a page.
    """
    scenario, results = load(name), []

    def watched(*arguments: Any, **options: Any) -> Result:
        result = run_to_end(*arguments, **options)
        results[1:] = [] if results else [result]  # the first one is shown
        return result

    run_to_end = system.run_to_end
    with patch.object(system, "run_to_end", watched):
        outcome = execute(scenario, pages, thumbnail=shown / f"{name}.png", panel=PANELS.get(name, 0))
    if not outcome.passed:
        failed = [str(verdict) for verdict in outcome.verdicts if not verdict.passed]
        return Entry(name, scenario.claim, outcome.error or "; ".join(failed))
    with Image.open(shown / f"{name}.png") as figure:
        figure.thumbnail(THUMBNAIL)
        figure.save(shown / f"{name}.png")
    motion = _motion(results[0]) if results else b""
    if motion:
        (shown / f"{name}.motion.html").write_bytes(motion)
    rows = [{**v.row(), "because": v.reason} for v in outcome.verdicts]
    source = os.path.relpath(scenario.path, pages)
    text = [
        f"# {_title(name)}",
        _text(scenario.main.__globals__["__doc__"], names),
        f"![{_title(name)}]({name}.png)",
        *([_frame(f"{name}.motion.html", "The first of its simulations; drag and zoom it.")] if motion else []),
        *([f"[A lesson](../lessons/{name}.md) has a question and a live page."] if name in lessons() else []),
        *([_links("Live pages", mechanisms(scenario.path))] if mechanisms(scenario.path) else []),
        _table(rows),
        *([_of_the_texts(name)] if _of_the_texts(name) else []),
        f"With built FMUs this scenario took {outcome.seconds:.1f} s.  `liaisons run {name}` runs it:",
        f"```{{literalinclude}} {source}\n:language: python\n```",
    ]
    (pages / f"{name}.md").write_text("\n\n".join(text) + "\n", encoding="utf-8")
    if name in lessons():
        write_lesson(name, _table(rows), pages.parent / "lessons", shown.parent / "lessons")
    return Entry(name, scenario.claim, "")


def write_live(name: str, folder: Path) -> Entry:
    """Write the live page of a mechanism."""
    show(name, folder / f"{name}.html")
    return Entry(name, "", "")


def write_swing(folder: Path) -> Entry:
    """Write the swing of the first page."""
    show("Pendulum", folder / "swing.html", theta_0=0.3, controls=["length"], plots=[])
    return Entry("swing", "", "")


def write_lesson(name: str, verdicts: str, pages: Path, shown: Path) -> None:
    """Write the lesson of a scenario: question, prediction, live page, answer, verdicts, equations.

    :param verdicts: their table, in Markdown.
    """
    taught = load_lesson(name)
    taught.show(shown / f"{name}.live.html")
    with ZipFile(fmu_file(taught.subject)) as archive:
        page = archive.read("documentation/index.html").decode()
    equations = re.findall(r"<div class=equations>.*?</div>", page, re.DOTALL)
    text = [
        f"# Lesson: {_title(name)}",
        f"**{_escaped(taught.question)}**",
        f"## Predict\n\n{_escaped(taught.predict)}",
        f"## Try it\n\n{_escaped(taught.try_out)}",
        f'<iframe class="lesson" src="{name}.live.html" title="{escape(taught.question)}"></iframe>',
        f'<p><a href="{name}.live.html">Open the live page alone</a></p>',
        "## Compare\n\n<details><summary>Show the answer</summary>",
        _escaped(taught.answer),
        f"![{_title(name)}](../gallery/{name}.png)\n\n</details>",
        f"The claims of [the scenario](../gallery/{name}.md), with the errors of simulated FMUs:",
        verdicts,
        "## Equations",
        f'```{{raw}} html\n<div class="component">\n{chr(10).join(equations)}\n</div>\n```',
        f"Of [{taught.subject}](../catalogue/{taught.subject}.md); `liaisons show {name}` opens the live page.",
    ]
    (pages / f"{name}.md").write_text("\n\n".join(text) + "\n", encoding="utf-8")


def _done(task: Any) -> str:
    return task.result().name


def _motion(result: Result) -> bytes:
    """What was simulated, moving; nothing if it has no picture or was not recorded finely enough."""
    assert result.scene is not None  # as of everything simulated
    signals = dict(zip(result.names, result.values, strict=True))
    try:
        return motion_page(result.scene, result.time, signals, title=result.title, most=MOTION)
    except LiaisonsError:  # some coordinate was not recorded
        return b""


# ---- text --------------------------------------------------------------------------------------------------------


def _index(entries: list[Entry], live: list[str]) -> str:
    parts = ["# Gallery", "Each scenario states a claim; its verdicts compare errors of FMUs with tolerances."]
    for theme, names in THEMES.items():
        cards = "\n".join(_card(entry) for name in names for entry in entries if entry.name == name)
        if cards:
            parts += [f"## {theme}", f'<div class="gallery">\n{cards}\n</div>']
    pages = "\n".join(
        name for names in THEMES.values() for name in names if any(entry.name == name for entry in entries)
    )
    return "\n\n".join([*parts, _links("All live pages", live), f"```{{toctree}}\n:hidden:\n\n{pages}\n```\n"])


def lesson_index(names: list[str]) -> str:
    """The page of all lessons."""
    cards = "\n".join(
        f'<a href="{name}.html"><img src="../gallery/{name}.png" alt="" loading="lazy">'
        f"<b>{_title(name)}</b> {escape(load_lesson(name).question)}</a>"
        for name in names
    )
    pages = "\n".join(names)
    shown = f'<div class="gallery">\n{cards}\n</div>\n\n```{{toctree}}\n:hidden:\n\n{pages}\n```\n' if names else ""
    return (
        "# Lessons\n\nEach lesson asks one question.  Predict the answer, try it on the live page, then compare.  "
        f"To [write your own](../howto/write-a-scenario.md#lessons), add a few lines to a scenario.\n\n{shown}"
    )


def _card(entry: Entry) -> str:
    tags = "".join(f"<i>{name}</i>" for name in mechanisms(scenario_files()[entry.name]))
    return (
        f'<a href="{entry.name}.html"><img src="{entry.name}.png" alt="" loading="lazy">'
        f"<b>{_title(entry.name)}</b> {escape(entry.claim)} {tags}</a>"
    )


def _title(name: str) -> str:
    return TITLES.get(name, name.replace("_", " ").capitalize())


def _links(what: str, names: list[str]) -> str:
    links = ", ".join(f'<a href="live/{name}.html">{name}</a>' for name in names)
    return f"{what}: {links}."


def _of_the_texts(name: str) -> str:
    """What a scenario verifies of both texts."""
    links = texts.links(name)
    return f"<p>Verifies {links}.</p>" if links else ""


def _frame(page: str, caption: str) -> str:
    return f'<iframe class="motion" src="{page}" title="{caption}" loading="lazy"></iframe>\n<p>{caption}</p>'


def _text(docstring: str, names: Collection[str]) -> str:
    """As Markdown; displayed lines are indented in both, and a scenario that is named is linked."""
    parts = re.split(r"(``?[^`]+``?)", docstring.strip())
    return "".join(_code(part.strip("`"), names) if i % 2 else _escaped(part) for i, part in enumerate(parts))


def _code(name: str, names: Collection[str]) -> str:
    return f"[{TITLES.get(name, name.replace('_', ' '))}]({name}.md)" if name in names else f"`{name}`"


def _escaped(text: str) -> str:
    blocks = text.split("\n\n")
    return "\n\n".join(b if b.startswith("    ") else re.sub(r"([*_<>\[\]$#|~^\\])", r"\\\1", b) for b in blocks)


def _table(rows: list[dict[str, str]]) -> str:
    whole = str.maketrans("- ", "\N{NON-BREAKING HYPHEN}\N{NO-BREAK SPACE}")
    rows = [row | {name: row[name].translate(whole) for name in ("error", "tolerance")} for row in rows]
    lines = [list(rows[0]), ["---"] * len(rows[0]), *([_escaped(cell) for cell in row.values()] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
