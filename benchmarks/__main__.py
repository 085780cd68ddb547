"""Measure everything, write the tables of benchmarks/README.md, and the diagrams and figures in benchmarks/results.

    python benchmarks [NAME ...] [--only peers,chains] [--quick] [--output FOLDER]
    python benchmarks --check [--only peers,chains] [--beside FOLDER]

Each script runs as a process of its own.  What is not measured this time keeps its figures from before: --only ""
writes the page anew and measures nothing.  --check measures quickly, writes nothing, and names the ratios that are
worse than those of the page by more than 15 %; then it ends with 1.  The ratio of two programs differs from one
processor to another: with --beside, ratios are compared with those of another checkout, such as a worktree of an older
commit, which are measured here in turn.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from _check import Comparison, compared, is_checked, medians, report
from _measure import HERE, QUIET, Section, busy_cores
from _page import page, tables

ORDER = (
    "fmi_cost",
    "step_cost",
    "peers",
    "work_precision",
    "energy_drift",
    "stiff",
    "chains",
    "composition_cost",
    "stepping",
    "isolated",
    "sweeps",
    "ensembles",
    "environments",
    "derivatives",
    "rewriting",
    "multibody",
    "iftomm",
    "published",
    "plans",
    "planners",
    "identify_peers",
    "contacts",
    "referee",
)
MOST_TRIES = 3  # of a section, when it is checked


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python benchmarks", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", metavar="NAME", nargs="*", help="the same as --only")
    parser.add_argument("--only", metavar="NAME,NAME", default=",".join(ORDER), help="of: %(default)s")
    parser.add_argument("--quick", action="store_true", help="few rounds, small sizes: to try, not to quote")
    parser.add_argument("--output", type=Path, help="for README.md and results/; by default here, if quick nowhere")
    parser.add_argument("--patience", type=float, default=300.0, help="seconds to wait for a quiet machine, each time")
    parser.add_argument("--check", action="store_true", help="name what is worse than on the page")
    parser.add_argument("--beside", metavar="FOLDER", type=Path, help="compare with this checkout, not with the page")
    options = parser.parse_args()
    names = options.names or [name for name in options.only.split(",") if name]
    if unknown := set(names) - set(ORDER):
        parser.error(f"--only: there is no {', '.join(sorted(unknown))}; there are {', '.join(ORDER)}")
    if options.beside and not options.check:
        parser.error("--beside: give --check too, which compares")
    if options.beside and not (options.beside / "benchmarks" / "__main__.py").is_file():
        parser.error(f"--beside: {options.beside} is no checkout of this project: it has no benchmarks/__main__.py")
    if options.check:
        return _checked(names, options.patience, options.beside)
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.output or (Path(scratch) if options.quick else HERE)
        results = folder / "results"
        results.mkdir(parents=True, exist_ok=True)
        failed = [name for name in names if not _measured(name, results, options.quick, options.patience)]
        sections = {name: Section.read(path) for name in ORDER if (path := results / f"{name}.json").exists()}
        template = (HERE / "README.md").read_text(encoding="utf-8")
        for name, section in sections.items():
            (results / f"{name}.md").write_text(tables(name, section), encoding="utf-8")
        (folder / "README.md").write_text(page(template, sections, results), encoding="utf-8")
    if failed:
        print(f"failed, figures from before are kept: {', '.join(failed)}", file=sys.stderr)
    return bool(failed)


def _checked(names: list[str], patience: float, beside: Path | None) -> int:
    """Compare with the page or another checkout; what is worse, or may be, is measured again, and its medians count."""
    status = 0
    for name in names:
        path = HERE / "results" / f"{name}.json"
        written = Section.read(path) if path.exists() and not beside else None
        if not beside and (written is None or not any(map(is_checked, written.rows))):
            print(f"{name}: no ratio to check")
            continue
        quick: list[Section] = []
        others: list[Section] = []
        found: list[Comparison] = []
        while len(quick) < MOST_TRIES and (not quick or any(it.worse for it in found)):
            _wait_for_quiet(patience)
            quick.append(_quickly_measured(name, HERE.parent))
            if beside:
                others.append(_quickly_measured(name, beside))
                written = medians(others)
            assert written is not None
            found = compared(written.rows, [section.rows for section in quick], figures=bool(beside))
        assert written is not None
        print(report(name, written, found, quick), flush=True)
        status |= any(it.worse for it in found)
    return status


def _quickly_measured(name: str, checkout: Path) -> Section:
    """Measure a section by the script and the library of a checkout.

    :raises SystemExit: if the script fails.
    """
    path = os.pathsep.join(filter(None, [str(checkout.absolute() / "components"), os.environ.get("PYTHONPATH")]))
    with tempfile.TemporaryDirectory() as scratch:
        command = [sys.executable, checkout / "benchmarks" / f"{name}.py", "--output", scratch, "--quick"]
        environment = {**os.environ, "PYTHONPATH": path}
        if subprocess.run(command, check=False, stdout=subprocess.DEVNULL, env=environment).returncode:
            raise SystemExit(f"{name}: the script of {checkout} failed")
        return Section.read(Path(scratch) / f"{name}.json")


def _measured(name: str, results: Path, quick: bool, patience: float) -> bool:
    """Run a script; whether it ended well."""
    _wait_for_quiet(0.0 if quick else patience)
    command = [sys.executable, HERE / f"{name}.py", "--output", results, *["--quick"][: int(quick)]]
    return subprocess.run(command, check=False).returncode == 0


def _wait_for_quiet(patience: float) -> None:
    end = time.monotonic() + patience
    while (busy := busy_cores()) > QUIET:
        if time.monotonic() > end:
            print(f"the machine is not quiet: {busy} cores are busy with other work", file=sys.stderr)
            return
        time.sleep(5.0)


if __name__ == "__main__":
    raise SystemExit(main())
