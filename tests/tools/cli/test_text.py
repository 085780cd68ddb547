"""``liaisons text``, and numbers of the two texts as arguments of ``run`` and ``equations``."""

from __future__ import annotations

import pytest
import typer.main

from liaisons import equations
from liaisons.library import catalogue
from liaisons.scenario_files import scenario_files
from liaisons_pages.companion import entries
from liaisons_tools.cli._command import application
from liaisons_tools.cli._texts import requested_component, requested_scenarios

from .conftest import Cli, Runs, is_misuse


def test_a_number_says_what_it_is_and_what_verifies_it(runs: Runs, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    lines = runs("text", "K122").splitlines()
    assert lines[0] == "K eq. 122   Kneller, Mécanique analytique; section 5.1, oscillateur harmonique forcé, résonance"
    assert lines[2] == "    ωᵣₑₛ = √(ω₀² − γ²/2)"
    assert "printed     ωᵣₑₛ = √(ω₀² − γ²/4)" in lines
    assert "lives in    Oscillator.resonance" in lines
    assert "equations   liaisons equations Oscillator" in lines
    assert "            liaisons run resonance" in lines
    assert lines[-1] == "page        reference/texts.html#K-equations-122"
    assert any(line.startswith("misprint    √(ω_0² - γ²/2); printed with γ²/4") for line in lines)
    assert any(line.startswith("verified by pytest tests/catalogue/test_formulas_of_the_texts.py::") for line in lines)


def test_words_apart_are_one_number_and_latex_is_for_documents(runs: Runs) -> None:
    assert runs("text", "K", "Ex.", "9") == runs("text", "KEx.9") == runs("text", "Kneller example 9")
    assert r"    \omega_{res} = \sqrt{\omega_0^2 - \frac{\gamma^2}{2}}" in runs("text", "K122", "--latex").splitlines()


def test_a_condition_is_told_as_one(runs: Runs) -> None:
    out = runs("text", "K26")
    assert "holds if    B is uniform" in out
    assert "misprint" not in out


def test_each_number_of_a_range_has_its_formula(runs: Runs) -> None:
    out = runs("text", "K10-13")
    assert out.count("\nsays ") == 4
    assert "    aₖₗ(q) = Σ_(α=1)ᴺ m_α ∂r_α/∂qₖ · ∂r_α/∂qₗ" in out


@pytest.mark.parametrize("kind", ["equations", "examples", "figures", "propositions", "statements"])
@pytest.mark.variants(core=0)
def test_every_number_is_printed(runs: Runs, kind: str) -> None:
    for entry in entries():
        if entry.kind == kind:
            assert runs("text", entry.citation).startswith(f"{entry.citation}   "), entry.citation


def test_words_are_searched_and_sections_listed(runs: Runs, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    found = runs("text", "moment", "conjugué")
    assert "K eq. 32-33" in found
    assert "K eq. 78" in found
    assert "d'Alembert" in runs("text")
    assert "anneau sur un cerceau" in runs("text")


def test_misuse_is_one_line_with_the_nearest(liaisons: Cli) -> None:
    assert is_misuse(liaisons("text", "K170"), "K170", "nearest: K eq. 165, K eq. 164")
    assert is_misuse(liaisons("text", "vriel"), "did you mean viriel")
    assert is_misuse(liaisons("run", "K170"), "nearest: K eq. 165")
    assert is_misuse(liaisons("run", "K9"), "K9: no scenario verifies it; pytest tests/catalogue/test_constrained.py::")
    assert is_misuse(liaisons("equations", "K76"), "K76: no component has it", "liaisons text K76")
    assert is_misuse(liaisons("equations", "M68"), "nearest: M eq. 67")


def test_numbers_name_scenarios_and_components() -> None:
    assert requested_scenarios("K122") == ["resonance"]
    assert requested_scenarios("K118-121") == ["resonance", "resonance_surface"]
    assert requested_scenarios("kepler") == ["kepler"]
    assert requested_component("M50") == ("Pendulum", "effective_mass")
    assert requested_component("M 8.4") == ("CircularHoop", "lagrangian")
    assert requested_component("K43") == ("PolarOscillator", "accelerations")
    assert requested_component("Swing") == ("Swing", None)


def test_equations_of_a_number_are_the_part_that_has_it(runs: Runs) -> None:
    assert runs("equations", "M50") == runs("equations", "Pendulum", "--part", "effective_mass")
    assert "r̈ = r φ̇² − K r/m" in runs("equations", "K43")


def test_what_the_table_names_is_there() -> None:
    parts = {(requested_component(e.citation)[0], e.part) for e in entries() if e.part}
    assert all(part in equations(name).parts for name, part in parts)
    assert {name for name, _ in parts} <= set(catalogue())
    assert {scenario for entry in entries() for scenario in entry.scenarios} <= set(scenario_files())


def test_numbers_complete() -> None:
    command = typer.main.get_command(application).commands["text"]  # type: ignore[attr-defined]
    context = command.make_context("text", [], resilient_parsing=True)
    found = [item.value for item in command.params[0].shell_complete(context, "K12")]
    assert found == ["K12", *(f"K12{i}" for i in range(10))]
