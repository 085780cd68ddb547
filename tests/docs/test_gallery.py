"""The gallery and the contact sheet of the documentation, each of one short motion."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import pytest
from PIL import Image

from liaisons.base import compiler
from liaisons.base.project import load_module
from liaisons.scenario_files import scenario_files

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture(scope="module")
def gallery() -> ModuleType:
    pytest.importorskip("sphinx", reason="the documentation is built by Sphinx: pip install 'liaisons[docs]'")
    return load_module(DOCS / "gallery.py")


def test_a_page_says_and_shows_what_the_scenario_does(gallery: ModuleType, tmp_path: Path) -> None:
    pages, shown = tmp_path / "pages", tmp_path / "shown"
    for folder in (pages, shown):
        folder.mkdir()
    entry = gallery.write_page("thermostat", ["thermostat", "nose_hoover"], pages, shown)
    assert entry.error == ""
    text = (pages / "thermostat.md").read_text(encoding="utf-8")
    assert text.startswith("# Thermostat\n")
    assert "| claim | error | tolerance | verdict | because |" in text
    assert " pass |" in text
    assert '<a href="live/IsokineticOscillator.html">' in text
    assert '<a href="../reference/texts.html#K-examples-10">K Ex. 10</a>' in text
    assert (pages / "thermostat.png").stat().st_size > 10_000
    assert b"</html>" in (shown / "thermostat.motion.html").read_bytes()
    with Image.open(shown / "thermostat.png") as image:
        assert max(image.width / gallery.THUMBNAIL[0], image.height / gallery.THUMBNAIL[1]) == pytest.approx(
            1, abs=0.01
        )


@pytest.mark.variants(core=0)
@pytest.mark.skipif(compiler.zig_compiler() is None, reason="ziglang is not installed")
def test_a_lesson_has_question_prediction_page_answer_verdict_and_equations(
    gallery: ModuleType, tmp_path: Path
) -> None:
    gallery.write_lesson("pumped_swing", "| the verdicts |", tmp_path, tmp_path)
    taught = gallery.load_lesson("pumped_swing")
    text = (tmp_path / "pumped_swing.md").read_text(encoding="utf-8")
    said = (taught.question, taught.predict, taught.try_out, "pumped_swing.live.html", taught.answer)
    order = [text.index(gallery._escaped(part)) for part in said[:3]]
    order += [text.index(said[3]), text.index(gallery._escaped(said[4]))]
    order += [text.index(part) for part in ("| the verdicts |", "## Equations", "<math")]
    assert order == sorted(order)
    assert taught.question in (tmp_path / "pumped_swing.live.html").read_text(encoding="utf-8")
    index = gallery.lesson_index(["pumped_swing"])
    assert '<a href="pumped_swing.html"><img src="../gallery/pumped_swing.png" alt="" loading="lazy">' in index
    assert "toctree" not in gallery.lesson_index([])


def test_each_scenario_has_one_place(gallery: ModuleType) -> None:
    names = [name for theme in gallery.THEMES.values() for name in theme]
    assert sorted(names) == sorted(scenario_files())
    assert gallery.TITLES.keys() <= set(names)
    index = gallery._index([gallery.Entry("co2_modes", "Three modes.", "")], [])
    assert "## Vibrations (K 5)" in index
    assert "<b>CO₂ modes</b> Three modes. <i>LinearMolecule</i>" in index
    assert "## Numerics" not in index  # where nothing is shown


def test_a_claim_that_fails_has_no_page(gallery: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wrong = tmp_path / "wrong.py"
    lines = [
        '"""Two is one."""\n\nfrom liaisons_tools.scenarios import Claims, panels, scenario, within\n\n\n@scenario',
        'def main(claim: Claims) -> None:\n    panels(("", "", ""))',
        '    claim("2 is 1", 2.0, 1.0, within(0.5, because="no"))\n',
    ]
    wrong.write_text("\n".join(lines), encoding="utf-8")
    load = gallery.load
    monkeypatch.setattr(gallery, "load", lambda _: load(str(wrong)))
    entry = gallery.write_page("wrong", [], tmp_path, tmp_path)
    assert entry.error.startswith("FAIL: 2 is 1")
    assert not (tmp_path / "wrong.md").exists()


def test_docstrings_become_markdown(gallery: ModuleType) -> None:
    said = "p_θ = m*l*θ' <b>, |θ|.\n\n    a*b_c\n\nScenario ``kepler`` and ``exact``."
    expected = "p\\_θ = m\\*l\\*θ' \\<b\\>, \\|θ\\|.\n\n    a*b_c\n\nScenario [Kepler's laws](kepler.md) and `exact`."
    assert gallery._text(said, ["kepler"]) == expected


@pytest.mark.skipif(compiler.zig_compiler() is None, reason="ziglang is not installed")
@pytest.mark.variants(core=0)
def test_the_contact_sheet_of_one_component(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sheet = load_module(DOCS / "contact_sheet.py")
    assert sheet.main(["FreeParticle", "--output", str(tmp_path)]) == 0
    head, _, row = capsys.readouterr().out.splitlines()
    assert head.startswith("| component | gif | png | glb | html |")
    assert row.startswith("| FreeParticle |")
    assert row.endswith("| not tried: no --validator |")
    assert {path.name for path in tmp_path.iterdir()} == {
        "contact_sheet.png", "table.md", *(f"FreeParticle.{kind}" for kind in ("gif", "png", "glb", "html")),
    }  # fmt: skip


def test_every_motion_of_the_contact_sheet_is_of_a_mechanism() -> None:
    sheet = load_module(DOCS / "contact_sheet.py")
    assert sheet.MOTIONS.keys() <= set(sheet.names())
