"""Rows, tables and the page of the benchmarks; what they measure is no test."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from _check import compared, medians, report
from _measure import HERE, Row, Section, claims, interleaved, markdown
from _page import BEGIN, END, page, tables

SCRIPT = '''
"""A script."""

import sys

sys.path.insert(0, sys.argv.pop(1))

from _measure import Row, command


def measure(quick, plots):
    (plots / "script.png").write_bytes(b"")
    return [Row("Topic", "case", 2.0 if quick else 3.0, "ns")]


command(measure)
'''


@pytest.fixture
def row() -> Row:
    return Row.of("Steps", "ours", [2.0, 3.0, 8.0], "ns", yardstick="by hand", beside=[1.0, 3.0, 2.0], asked="<= 1.9")


@pytest.fixture
def section(row: Row) -> Section:
    rows = (row, Row("Energy", "drift", 3e-12, "J", asked="<= 1e-11", remark="1e6 steps"))
    return Section("A title", rows, "2026-01-31", "abc1234", "A machine", busy=0.25, seconds=12.3, quick=False)


def test_a_ratio_is_the_median_of_the_ratios_of_the_rounds(row) -> None:
    # Ratios 2, 1, 4: not the ratio of the medians, 3/2.
    assert (row.figure, row.ratio, row.spread) == (3.0, 2.0, (1.5, 3.0))


def test_a_bound_is_on_the_ratio_and_without_one_on_the_figure(row) -> None:
    assert row.met is False
    assert replace(row, asked=">= 2").met is True
    assert Row("Slopes", "derive", 1.05, "", asked="<= 1.1").met is True
    assert replace(row, asked="").met is None


def test_rounds_are_interleaved_after_one_to_warm_up() -> None:
    calls: list[str] = []

    def run(name: str) -> float:
        calls.append(name)
        return float(len(calls))

    values = interleaved({"a": lambda: run("a"), "b": lambda: run("b")}, rounds=2)
    assert calls == ["a", "b"] * 3
    assert values == {"a": [3.0, 5.0], "b": [4.0, 6.0]}


def test_tables_have_one_topic_each_and_no_empty_columns(row) -> None:
    other = Row("Energy", "drift", 3.24e-12, "J")
    tables = markdown([row, other, replace(row, case="theirs", figure=12345.6)])
    steps, energy = tables.split("\n\n### Energy\n\n")
    assert [line.split(" | ")[0] for line in steps.splitlines()[4:]] == ["| ours", "| theirs"]
    assert "| 12300 ns | 2 | by hand | 1.5 .. 3 | ≤ 1.9 | no |" in steps
    assert markdown([Row("Energy", "drift", float("nan"), "", remark="refused")]).endswith("| drift | - | refused |")
    assert energy.splitlines() == ["|  | median |", "|---|---|", "| drift | 3.2e-12 J |"]


def test_claims_have_a_line_for_what_is_asked_with_the_worst_case(row, section) -> None:
    better = replace(row, case="better", ratio=1.5)
    table = claims({"first": [better, *section.rows], "second": [replace(row, asked="")], "third": [better]})
    assert table.splitlines()[2:] == [
        "| [first](#first) | Steps: ours, the worst of 2 | 2 × by hand | ≤ 1.9 | 1 of 2 |",
        "| [first](#first) | Energy: drift | 3.0e-12 J | ≤ 1e-11 | yes |",
        "| [third](#third) | Steps: better | 1.5 × by hand | ≤ 1.9 | yes |",
    ]


def test_a_section_is_read_back_as_it_was_written(section, tmp_path) -> None:
    section.write(tmp_path / "section.json")
    assert Section.read(tmp_path / "section.json") == section


def test_the_page_keeps_what_stands_around_its_marks(section, tmp_path) -> None:
    (tmp_path / "first_more.png").touch()
    (tmp_path / "second.png").touch()
    template = f"# Head\n\n{BEGIN}what was here before\n{END}tail\n"
    written = page(template, {"first": section}, tmp_path)
    assert written.startswith("# Head\n\n")
    assert written.endswith(f"{END}tail\n")
    assert "what was here before" not in written
    facts = "*2026-01-31, commit abc1234, 12 s, 0.25 cores busy before*"
    assert f"## first\n\nA title\n\n{facts}" in written
    assert markdown(section.rows, "##") in tables("first", section)
    assert "![A title](results/first_more.png)" in written
    assert "second.png" not in written
    assert page(written, {"first": section}, tmp_path) == written


def test_the_page_of_this_repository_has_the_marks() -> None:
    text = (HERE / "README.md").read_text(encoding="utf-8")
    assert text.index(BEGIN) < text.index(END)


def test_every_script_that_measures_is_a_section() -> None:
    order = re.findall(r'^    "(\w+)",$', (HERE / "__main__.py").read_text(encoding="utf-8"), re.MULTILINE)
    texts = {path.stem: path.read_text(encoding="utf-8") for path in HERE.glob("*.py")}
    assert sorted(order) == sorted(name for name, text in texts.items() if text.endswith("\n    command(measure)\n"))


def test_a_check_names_ratios_that_are_worse_than_on_the_page(row) -> None:
    faster = replace(row, case="faster", asked=">= 1")
    written = [row, faster, replace(row, case="not asked", asked=""), replace(row, case="not measured")]

    def measured(*ratios: float) -> list[list[Row]]:
        return [[replace(it, ratio=x, spread=(0.9 * x, 1.1 * x)) for it in written[:3]] for x in ratios]

    def worse(*ratios: float) -> list[tuple[str, bool]]:
        return [(it.row.case, it.clear) for it in compared(written, measured(*ratios)) if it.worse]

    assert len(compared(written, measured(2.0))) == 2
    assert worse(2.2) == worse(1.8) == []
    assert worse(3.0) == [("ours", True)]
    assert worse(2.4) == [("ours", False)]  # 2.3 is allowed, the first quartile is 2.16
    assert worse(1.5) == [("faster", True)]
    assert worse(3.0, 2.0, 2.0) == []  # the median of the tries
    assert worse(3.0, 2.0, 3.0) == [("ours", False)]
    page = Section("A title", tuple(written), "2026-01-01", "abc1234", "a processor, a compiler", 0.0, 1.0, quick=False)
    words = "steps: 2 ratios, measured 1 times, 1 worse than at commit abc1234\n  Steps: ours: 3 × by hand, there 2"
    found = compared(written, measured(3.0))
    assert report("steps", page, found, [replace(page, machine="a processor model 7, a compiler")]) == words
    assert report("steps", page, found, [replace(page, machine="another, a compiler", busy=1.5)]) == (
        f"{words}\n  the page is of another processor, a processor; this one is another\n"
        "  other work kept up to 1.5 cores busy"
    )
    assert "processor" not in report("steps", page, found[1:], [replace(page, machine="another, a compiler", busy=1.5)])


def test_a_check_beside_another_checkout_compares_medians_and_figures(row) -> None:
    slow = Row("Calls", "slow", 4.0, "µs", asked="<= 9")
    rows = [row, slow, replace(slow, case="unbounded", asked=""), replace(slow, case="slope", unit="")]
    page = Section("A title", (), "2026-01-01", "abc1234", "a processor", 0.0, 1.0, quick=True)

    def section(ratio: float, figure: float) -> Section:
        changed = (replace(rows[0], ratio=ratio), *(replace(it, figure=figure) for it in rows[1:]))
        return replace(page, rows=changed)

    there = medians([section(1.0, 5.0), section(9.0, 4.0), section(2.0, 3.0)])
    assert [it.bounded for it in there.rows] == [2.0, 4.0, 4.0, 4.0]
    here = [section(1.0, 4.8)]
    assert [it.row.case for it in compared(there.rows, [it.rows for it in here])] == ["ours"]
    found = compared(there.rows, [it.rows for it in here], figures=True)
    assert [(it.row.case, it.worse) for it in found] == [("ours", False), ("slow", True)]
    assert report("calls", there, found, here).splitlines()[1] == "  Calls: slow: 4.8 µs, there 4"


@pytest.mark.parametrize(("words", "figure"), [([], 3.0), (["--quick"], 2.0)])
def test_a_script_leaves_its_figures_and_diagrams_where_it_is_told(
    words: list[str], figure: float, tmp_path: Path
) -> None:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.lstrip(), encoding="utf-8")
    output = tmp_path / "results"
    command = [sys.executable, script, HERE, *words, "--output", output]
    printed = subprocess.run(command, check=True, capture_output=True, text=True, encoding="utf-8").stdout
    section = Section.read(output / "script.json")
    assert (section.title, section.rows, section.quick) == (
        "A script.",
        (Row("Topic", "case", figure, "ns"),),
        bool(words),
    )
    assert markdown(section.rows, "##") in printed
    assert sorted(path.name for path in output.iterdir()) == ["script.json", "script.png"]
