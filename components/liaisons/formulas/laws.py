"""The general form of each kind of equation, which the particular ones of a component follow."""

from __future__ import annotations

import re
from dataclasses import dataclass

_PART = re.compile(r"(?P<letter>[^\W\d_])(?P<dots>[˙¨])?(?:_(?P<below>\w))?(?:\^(?P<above>−?\w))?|(?P<sign>[^\s\w])|\d")


@dataclass(frozen=True, slots=True)
class Law:
    """A heading of the page, what to say below it, and the law: ``q˙_k = ∂L/∂q_k``, blanks around fractions."""

    title: str
    text: str
    formula: str = ""

    @property
    def markup(self) -> str:
        """The law in MathML."""
        fractions = ([_PART.sub(_part, side) for side in word.split("/")] for word in self.formula.split())
        return "".join(
            f"<mfrac>{''.join(f'<mrow>{side}</mrow>' for side in sides)}</mfrac>" if len(sides) > 1 else sides[0]
            for sides in fractions
        )


def _part(part: re.Match[str]) -> str:
    if part["letter"] is None:
        return f"<mo>{part[0]}</mo>" if part["sign"] else f"<mn>{part[0]}</mn>"
    letter = f"<mi>{part['letter']}</mi>"
    if part["dots"]:
        letter = f"<mover>{letter}<mo>{part['dots']}</mo></mover>"
    if part["below"]:
        letter = f"<msub>{letter}<mi>{part['below']}</mi></msub>"
    return f"<msup>{letter}<mrow>{_PART.sub(_part, part['above'])}</mrow></msup>" if part["above"] else letter


LAWS = {
    "lagrangian": Law(
        "Lagrangian",
        "Everything below follows from it; friction and what is attached come in as forces.",
    ),
    "energy": Law("Energy", "Kinetic and potential (K eq. 61)."),
    "friction": Law(
        "Friction",
        "The dissipation function D. Friction opposes free and prescribed rates alike and takes the power "
        "Σ q̇ ∂D/∂q̇ + Σ ṡ ∂D/∂ṡ; where D = η T, with the coefficient η of K eq. 64, this is 2 η T (K eq. 67).",
        "Q_k = − ∂D/∂q˙_k",
    ),
    "momenta": Law(
        "Momenta",
        "Conjugate to the free coordinates q; they stay continuous when an operator makes a rate jump.",
        "p_k = ∂L/∂q˙_k",
    ),
    "velocities": Law(
        "Rates",
        "Momenta solved for the rates, p = A q̇ + b; of a quaternion, from the angular velocity.",
        "q˙ = A^−1 ( p − b )",
    ),
    "motion": Law(
        "Equations of motion",
        "Q are drives, loads with the opposite sign, friction −∂D/∂q̇ and the forces of constraints. "
        "The accelerations of prescribed coordinates s do not enter (M eq. 26, 36).",
        "p˙_k = ∂L/∂q_k + Q_k",
    ),
    "internal": Law("Internal states", "They are no coordinates; the component gives their rates."),
    "constraints": Law("Constraints", "Kept by the multipliers λ, and put right after each step."),
    "operators": Law(
        "Forces of the operators",
        "What it takes to prescribe s (M eq. 27); the power is λ ṡ.",
        "λ_α = d/dt ∂L/∂s˙_α − ∂L/∂s_α − Q_α",
    ),
    "effective mass": Law(
        "Effective mass at the active ports",
        "What a master needs to solve a loop of forces and accelerations. With A, B, D the second derivatives of L by "
        "q̇ twice, by q̇ and ṡ, and by ṡ twice (M eq. 50); of a coordinate kept by a constraint, from the multiplier.",
        "Θ = ∂λ/∂s¨ = D − B^T A^−1 B",
    ),
    "points": Law("Points", "Where other mechanisms are attached."),
    "outputs": Law("Further outputs", "What the component adds."),
    "signal": Law("Signal", "Its two derivatives are taken from the same expression."),
    "link": Law("One link", "Sums over all links are those of the chain; L = T − V, friction −∂D/∂q̇."),
    "joints": Law("Joints", "Where the next link begins, and the first."),
}
