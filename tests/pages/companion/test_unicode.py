"""Formulas of the table for terminals and for documents: one LaTeX, which each of its readers takes."""

from __future__ import annotations

import re
import unicodedata

import pytest
from matplotlib.mathtext import MathTextParser

from liaisons_pages.companion import entries, entries_of, unicode_text


@pytest.mark.parametrize(
    ("latex", "text"),
    [
        (r"\frac{1}{2} m \dot{x}^2", "½ m ẋ²"),
        (r"\frac{d}{dt} \frac{\partial L}{\partial \dot{q}_k} = Q_k", "d/dt ∂L/∂q̇ₖ = Qₖ"),
        (r"\frac{a + b}{2 c}", "(a + b)/(2 c)"),
        (r"\frac{(a + b) c}{d}", "(a + b) c/d"),
        (r"\frac{1}{\sqrt{a b}}", "1/√(a b)"),
        (r"\sum_{k=1}^{f} p_k \dot{q}_k - L", "Σₖ₌₁ᶠ pₖ q̇ₖ − L"),
        (r"\sum_{\alpha=1}^{N} m_\alpha", "Σ_(α=1)ᴺ m_α"),
        (r"e^{\lambda_1 t}", "e^(λ₁t)"),
        (r"x_{ext}, \quad y_{k-f}", "xₑₓₜ, y_(k−f)"),
        (r"\begin{pmatrix} a & -b \\ 0 & c \end{pmatrix}", "(a, −b; 0, c)"),
        (r"\delta\mathbf{r} \wedge \delta q", "δr ∧ δq"),
        (r"r'^2 \theta'", "r'² θ'"),
        (r"\left( \cos \phi \right) \text{ if } \Lambda \leq 0", "(cos φ) if Λ ≤ 0"),
    ],
)
def test_latex_as_unicode(latex: str, text: str) -> None:
    assert unicode_text(latex) == unicodedata.normalize("NFC", text)


def test_an_unknown_command_is_refused() -> None:
    with pytest.raises(ValueError, match="mysterious"):
        unicode_text(r"\mysterious x")


@pytest.mark.variants(quick=None)
@pytest.mark.parametrize("entry", entries(), ids=lambda entry: entry.citation)
def test_every_formula_is_read(entry) -> None:
    parser = MathTextParser("path")
    for formula in (*entry.formulas, *entry.printed):
        text = unicode_text(formula)
        assert not set(text) & set("\\{}$") - (set("{}") if r"\{" in formula else set())
        assert text.count("(") == text.count(")")
        assert "  " not in text
        if "pmatrix" not in formula:
            parser.parse(f"${re.sub(r'operatorname', 'mathrm', formula)}$")


def test_formulas_are_corrected_and_the_printed_one_is_another() -> None:
    for entry in entries():
        assert not set(entry.printed) & set(entry.formulas), entry.citation
    (resonance,) = entries_of("K122")
    assert unicode_text(resonance.formulas[0]) == "ωᵣₑₛ = √(ω₀² − γ²/2)"
    assert unicode_text(resonance.printed[0]) == "ωᵣₑₛ = √(ω₀² − γ²/4)"
