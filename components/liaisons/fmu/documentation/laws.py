"""The general form of each kind of equation, which the particular ones of a component follow."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Law:
    """A heading of the page, what to say below it, and the law itself in MathML."""

    title: str
    text: str
    markup: str = ""


def _i(name: str, below: str = "", dots: str = "") -> str:
    """A letter with dots and a subscript."""
    letter = f"<mi>{name}</mi>"
    if dots:
        letter = f"<mover>{letter}<mo>{dots}</mo></mover>"
    return f"<msub>{letter}<mi>{below}</mi></msub>" if below else letter


def _d(above: str, below: str) -> str:
    """A partial derivative."""
    return f"<mfrac><mrow><mo>∂</mo>{above}</mrow><mrow><mo>∂</mo>{below}</mrow></mfrac>"


def _power(base: str, exponent: str) -> str:
    return f"<msup>{base}{exponent}</msup>"


_EQUALS, _PLUS, _MINUS = "<mo>=</mo>", "<mo>+</mo>", "<mo>−</mo>"
_RATE, _PRESCRIBED_RATE = _i("q", "k", "˙"), _i("s", "α", "˙")
_INVERSE = _power(_i("A"), "<mrow><mo>−</mo><mn>1</mn></mrow>")
_TRANSPOSED = _power(_i("B"), "<mi>T</mi>")
_TIME_DERIVATIVE = "<mfrac><mi>d</mi><mrow><mi>d</mi><mi>t</mi></mrow></mfrac>"

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
        _i("Q", "k") + _EQUALS + _MINUS + _d(_i("D"), _RATE),
    ),
    "momenta": Law(
        "Momenta",
        "Conjugate to the free coordinates q; they stay continuous when an operator makes a rate jump.",
        _i("p", "k") + _EQUALS + _d(_i("L"), _RATE),
    ),
    "velocities": Law(
        "Rates",
        "Momenta solved for the rates, p = A q̇ + b; of a quaternion, from the angular velocity.",
        _i("q", dots="˙") + _EQUALS + _INVERSE + "<mo>(</mo>" + _i("p") + _MINUS + _i("b") + "<mo>)</mo>",
    ),
    "motion": Law(
        "Equations of motion",
        "Q are drives, loads with the opposite sign, friction −∂D/∂q̇ and the forces of constraints. "
        "The accelerations of prescribed coordinates s do not enter (M eq. 26, 36).",
        _i("p", "k", "˙") + _EQUALS + _d(_i("L"), _i("q", "k")) + _PLUS + _i("Q", "k"),
    ),
    "internal": Law("Internal states", "They are no coordinates; the component gives their rates."),
    "constraints": Law("Constraints", "Kept by the multipliers λ, and put right after each step."),
    "operators": Law(
        "Forces of the operators",
        "What it takes to prescribe s (M eq. 27); the power is λ ṡ.",
        _i("λ", "α")
        + _EQUALS
        + _TIME_DERIVATIVE
        + _d(_i("L"), _PRESCRIBED_RATE)
        + _MINUS
        + _d(_i("L"), _i("s", "α"))
        + _MINUS
        + _i("Q", "α"),
    ),
    "effective mass": Law(
        "Effective mass at the active ports",
        "What a master needs to solve a loop of forces and accelerations. With A, B, D the second derivatives of L by "
        "q̇ twice, by q̇ and ṡ, and by ṡ twice (M eq. 50); of a coordinate kept by a constraint, from the multiplier.",
        _i("Θ")
        + _EQUALS
        + _d(_i("λ"), _i("s", dots="¨"))
        + _EQUALS
        + _i("D")
        + _MINUS
        + _TRANSPOSED
        + _INVERSE
        + _i("B"),
    ),
    "points": Law("Points", "Where other mechanisms are attached."),
    "outputs": Law("Further outputs", "What the component adds."),
    "signal": Law("Signal", "Its two derivatives are taken from the same expression."),
    "link": Law("One link", "Sums over all links are those of the chain; L = T − V, friction −∂D/∂q̇."),
    "joints": Law("Joints", "Where the next link begins, and the first."),
}
