"""What every benchmark here shares: rows of a table, interleaved rounds, and the command line of a script.

A benchmark is a script with a function ``measure(quick, plots)`` that returns rows and writes its diagrams, if it has
any, as ``plots / "NAME.png"`` or ``plots / "NAME_more.png"``; it ends in ``command(measure)``.  The first line of its
docstring is its title.  Timings are ratios of interleaved rounds: a machine whose speed drifts favours nobody.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal, TypeVar

HERE = Path(__file__).parent
T = TypeVar("T")
QUIET = 0.2  # cores that others may keep busy
PACKAGES = ("casadi", "fmpy", "numpy", "scipy", "pythonfmu")


@dataclass(frozen=True, slots=True)
class Row:
    """A line of a table: a median, and its ratio to the median of a yardstick that was measured in the same rounds.

    ``topic`` is the heading of the table that it belongs to.  ``ratio`` is figure / yardstick; ``spread`` has the
    quartiles of the ratio, or of the figure where there is no yardstick.  ``asked`` is a bound such as "<= 1.1" or
    ">= 20" on the ratio, or on the figure where there is no yardstick.  ``better`` says which ratios are, of those that
    a quick measurement is held against (``--check``) though nothing is asked of them.
    """

    topic: str
    case: str
    figure: float
    unit: str
    yardstick: str = ""
    ratio: float | None = None
    spread: tuple[float, float] | None = None
    asked: str = ""
    remark: str = ""
    better: Literal["", "less", "more"] = ""

    @staticmethod
    def of(
        topic: str, case: str, values: Sequence[float], unit: str, *, beside: Sequence[float] | None = None, **more: Any
    ) -> Row:
        """From one value a round, and those of the yardstick in the same rounds; ``more`` are other fields."""
        ratios = [a / b for a, b in zip(values, beside, strict=True)] if beside is not None else None
        ratio, spread = statistics.median(ratios) if ratios else None, quartiles(ratios or values)
        return Row(topic, case, statistics.median(values), unit, ratio=ratio, spread=spread, **more)

    @property
    def bounded(self) -> float:
        """What the bound is on."""
        return self.figure if self.ratio is None else self.ratio

    @property
    def best(self) -> Literal["", "less", "more"]:
        """Which ratios, or figures, are better, by the bound if there is one; empty where neither is said."""
        return "less" if self.asked.startswith("<") else "more" if self.asked.startswith(">") else self.better

    @property
    def met(self) -> bool | None:
        """Whether the bound holds; None if there is none."""
        if not self.asked:
            return None
        relation, bound = self.asked.split()
        return self.bounded <= float(bound) if relation == "<=" else self.bounded >= float(bound)


def quartiles(values: Sequence[float]) -> tuple[float, float] | None:
    """First and third; None of less than two values."""
    if len(values) < 2:
        return None
    first, _, third = statistics.quantiles(values, n=4, method="inclusive")
    return first, third


def interleaved(runs: Mapping[str, Callable[[], T]], rounds: int) -> dict[str, list[T]]:
    """What each run returns (a time, say), round by round; one more round goes before, to warm up."""
    for run in runs.values():
        run()
    values: dict[str, list[T]] = {name: [] for name in runs}
    for _ in range(rounds):
        for name, run in runs.items():
            values[name].append(run())
    return values


# ---- tables ------------------------------------------------------------------------------------------------------


def markdown(rows: Iterable[Row], heading: str = "###") -> str:
    """Tables, one a topic, in the order in which topics come up first."""
    topics: dict[str, list[Row]] = {}
    for row in rows:
        topics.setdefault(row.topic, []).append(row)
    return "\n\n".join(f"{heading} {topic}\n\n{_table(group)}" for topic, group in topics.items())


def claims(rows: Mapping[str, Iterable[Row]]) -> str:
    """One table of what is asked, by section: rows that differ in nothing but the case are one line, with the worst."""
    groups: dict[tuple[str, ...], list[Row]] = {}
    for section, found in rows.items():
        for row in found:
            if row.asked:
                groups.setdefault((section, row.topic, row.yardstick, row.asked, row.unit), []).append(row)
    lines = []
    for (section, topic, *_), group in groups.items():
        worst = (max if group[0].asked.startswith("<=") else min)(group, key=lambda row: row.bounded)
        measured = _figure(worst) if worst.ratio is None else f"{number(worst.ratio)} × {worst.yardstick}"
        met = {0: "no", len(group): "yes"}.get(n := sum(row.met is True for row in group), f"{n} of {len(group)}")
        claim = f"{topic}: {worst.case}" + (f", the worst of {len(group)}" if len(group) > 1 else "")
        lines.append([f"[{section}](#{section})", claim, measured, _bound(worst), met])
    return grid([["section", "", "measured", "asked", "met"], *lines])


def _table(rows: list[Row]) -> str:
    head = ["", "median", "ratio", "to", "quartiles", "asked", "met", ""]
    cells = [
        [
            row.case,
            _figure(row),
            "" if row.ratio is None else number(row.ratio),
            row.yardstick,
            "" if row.spread is None else " .. ".join(map(number, row.spread)),
            _bound(row),
            {True: "yes", False: "no", None: ""}[row.met],
            row.remark,
        ]
        for row in rows
    ]
    used = [k for k in range(len(head)) if any(line[k] for line in cells)]
    return grid([[line[k] for k in used] for line in [head, *cells]])


def grid(lines: list[list[str]]) -> str:
    head, *body = (f"| {' | '.join(line)} |" for line in lines)
    return "\n".join([head, "|---" * len(lines[0]) + "|", *body])


def _figure(row: Row) -> str:
    return f"{number(row.figure)} {row.unit}".strip()


def _bound(row: Row) -> str:
    return row.asked.replace("<=", "≤").replace(">=", "≥")


def number(value: float) -> str:
    """Three digits, in full where that is short; a dash for what has no value."""
    if not math.isfinite(value):
        return "-"
    rounded = float(f"{value:.3g}")
    if rounded == 0 or 1e-3 <= abs(rounded) < 1e6:
        return f"{rounded:.15g}"
    mantissa, exponent = f"{value:.1e}".split("e")
    return f"{mantissa}e{int(exponent)}"


# ---- sections: what a script leaves behind -----------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Section:
    """What one script measured, when, of what, and where."""

    title: str
    rows: tuple[Row, ...]
    date: str
    commit: str
    machine: str
    busy: float  # cores that others kept busy before
    seconds: float
    quick: bool

    @property
    def processor(self) -> str:
        """The first words of the machine."""
        return self.machine.partition(",")[0]

    def write(self, path: Path) -> None:
        path.write_text(json.dumps(asdict(self), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")

    @staticmethod
    def read(path: Path) -> Section:
        found = json.loads(path.read_text(encoding="utf-8"))
        rows = ({**row, "spread": row["spread"] and tuple(row["spread"])} for row in found.pop("rows"))
        return Section(rows=tuple(Row(**row) for row in rows), **found)


Measure = Callable[[bool, Path], list[Row]]


def command(measure: Measure) -> None:
    """The command line of a script: measure, print the tables, and keep them if there is a folder for that."""
    script = sys.modules["__main__"]
    parser = argparse.ArgumentParser(description=script.__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few rounds, small sizes: to try, not to quote")
    parser.add_argument("--output", type=Path, help="folder for NAME.json and diagrams; without it nothing is kept")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.output or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        title = (script.__doc__ or "").partition("\n")[0]
        section = measured(title, lambda: measure(options.quick, folder), quick=options.quick)
        section.write(folder / f"{Path(sys.argv[0]).stem}.json")
    print(f"# {title}\n\n{markdown(section.rows, '##')}")


def measured(title: str, measure: Callable[[], list[Row]], *, quick: bool) -> Section:
    """The rows that it returns, and under what conditions."""
    busy, begin = busy_cores(), time.monotonic()
    rows = measure()
    return Section(
        title=title,
        rows=tuple(rows),
        date=f"{datetime.now(UTC):%Y-%m-%d}",
        commit=_commit(),
        machine=_machine(),
        busy=busy,
        seconds=round(time.monotonic() - begin, 1),
        quick=quick,
    )


def busy_cores(seconds: float = 1.0) -> float:
    """Cores that others keep busy while this process sleeps; the load average where the system has no /proc/stat."""
    counters = Path("/proc/stat")
    if not counters.exists():
        return round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else 0.0

    def idle() -> float:
        ticks = counters.read_text(encoding="ascii").split("\n", 1)[0].split()
        return (int(ticks[4]) + int(ticks[5])) / os.sysconf("SC_CLK_TCK")

    before, begin = idle(), time.monotonic()
    time.sleep(seconds)
    idle_cores = (idle() - before) / (time.monotonic() - begin)
    return max(0.0, round((os.cpu_count() or 1) - idle_cores, 2))


def _commit() -> str:
    git = shutil.which("git")
    if git is None:
        return "unknown"

    def ask(*words: str) -> str:
        return subprocess.run(
            [git, "-C", str(HERE), *words], capture_output=True, text=True, check=False
        ).stdout.strip()

    # What the benchmarks write themselves is no change.
    sources = (":/components", ":(glob,top)benchmarks/**/*.py", ":/benchmarks/by_hand")
    changed = ask("status", "--porcelain", "--", *sources)
    return (ask("rev-parse", "--short", "HEAD") or "unknown") + (" with changes" if changed else "")


def _machine() -> str:
    """Processor, compiler and versions."""
    words = [_processor(), f"{os.cpu_count()} cores", _compiler(), f"Python {platform.python_version()}"]
    return ", ".join([*words, *(f"{name} {version(name)}" for name in PACKAGES)])


def _processor() -> str:
    """Its name, its model's number, since processors of several generations share a name, and its widest vectors."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    found = {key.strip(): value.strip() for key, _, value in (line.partition(":") for line in lines)}
    vectors = [name for name in ("avx512f", "avx2", "avx") if name in found.get("flags", "").split()]
    model = [f"model {found['model']}"] if "model" in found else []
    return " ".join([found.get("model name", platform.machine()), *model, *vectors[:1]])


def _compiler() -> str:
    compiler = shutil.which("cc")
    if compiler is None:
        return "no C compiler"
    return subprocess.run([compiler, "--version"], capture_output=True, text=True, check=True).stdout.splitlines()[0]
