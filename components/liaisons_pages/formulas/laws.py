"""The general form of each kind of equation, which the particular ones of a component follow."""

import re
from dataclasses import dataclass
from functools import partial

from liaisons_pages.formulas.notation import Letter
from liaisons_pages.formulas.printing import Printer

_PART = re.compile(
    r"(?P<letter>[^\W\d_])(?P<dots>[˙¨])?(?:_(?P<below>\w))?(?:\^(?P<above>−?\w|[+−]))?|(?P<sign>[^\s\w])|\d"
)


@dataclass(frozen=True, slots=True)
class Law:
    """A law in general form, ``q˙_k = ∂L/∂q_k`` with blanks around fractions, its heading and a remark."""

    title: str
    text: str
    formula: str = ""

    def printed_formula(self, printer: Printer) -> str:
        """Return the general form as a printer writes it."""
        fractions = (
            [_PART.sub(partial(_printed_part, printer), side) for side in w.split("/")] for w in self.formula.split()
        )
        return printer.between.join(printer.fraction(*sides) if sides[1:] else sides[0] for sides in fractions)


def _printed_part(printer: Printer, part: re.Match[str]) -> str:
    """Return a letter, number or sign of a law as a printer writes it."""
    if part["letter"] is None:
        return printer.sign(part[0]) if part["sign"] else printer.digits(part[0])
    below = (Letter(part["below"]),) if part["below"] else ()
    letter = printer.letter(Letter(part["letter"], len(part["dots"] or "") and "˙¨".index(part["dots"]) + 1, below))
    if not part["above"]:
        return letter
    return printer.raised(letter, printer.grouped(_PART.sub(partial(_printed_part, printer), part["above"])))


LAWS = {
    "lagrangian": Law(
        "Lagrangian",
        "Everything below follows from it; friction and what is attached come in as forces (K eq. 18, M eq. 41).",
    ),
    "energy": Law("Energy", "Kinetic and potential (K eq. 31)."),
    "friction": Law(
        "Friction",
        "The dissipation function D. Friction opposes free and prescribed rates alike and takes the power "
        "Σ q̇ ∂D/∂q̇ + Σ ṡ ∂D/∂ṡ; where D = η T, with the coefficient η of K eq. 64, this is 2 η T (K eq. 67).",
        "Q_k = − ∂D/∂q˙_k",
    ),
    "spatial_v": Law(
        "Velocities of the frames",
        "Angular velocity ω and velocity v of the origin of each frame, along its axes, from that of the frame before.",
    ),
    "spatial_h": Law(
        "Momenta of the frames",
        "Angular momentum L about the origin of each frame and momentum P, with those of all that it carries.",
    ),
    "spatial_w": Law("Gravity in the frames", "Along the axes of each frame."),
    "spatial_W": Law(
        "Weights of the frames",
        "Moment M and force G of gravity on each frame and all that it carries; loads at points add to them.",
    ),
    "momenta": Law(
        "Momenta",
        "Conjugate to the free coordinates q (K eq. 78, M eq. 10); they stay continuous when an operator makes a rate "
        "jump.",
        "p_k = ∂L/∂q˙_k",
    ),
    "rates": Law(
        "Rates",
        "Momenta solved for the rates, p = A q̇ + b; of a quaternion, from the angular velocity.",
        "q˙ = A^−1 ( p − b )",
    ),
    "motion": Law(
        "Equations of motion",
        "Q are drives, loads with the opposite sign, friction −∂D/∂q̇ and the forces of constraints. "
        "The accelerations of prescribed coordinates s do not enter (K eq. 65, M eq. 26, 36).",
        "p˙_k = ∂L/∂q_k + Q_k",
    ),
    "accelerations": Law(
        "Accelerations",
        "Solved for, without drives and loads (K eq. 19, M eq. 26).",
    ),
    "matrix": Law(
        "Matrix form",
        "A is the metric tensor (K eq. 13); h has gravity, friction, forces of constraints, and what rates and "
        "prescribed motions ask for, without drives and loads.",
        "A q¨ + h = 0",
    ),
    "internal": Law("Internal states", "They are no coordinates; the component gives their rates."),
    "constraints": Law(
        "Constraints", "Kept by the multipliers λ (K eq. 2, 110, M eq. 20), and put right after each step."
    ),
    "unilateral": Law(
        "Unilateral liaisons",
        "Bodies can part, g > 0, and then feel no force λ.",
        "0 ≤ g ⟂ λ ≥ 0",
    ),
    "impacts": Law(
        "Impacts",
        "Of all that is in contact and does not separate; v is the rate of g, e the coefficient of restitution. "
        "Impulses Λ make v jump by G Λ, G = C A⁻¹ Cᵀ, C = ∂v/∂q̇ (Moreau).",
        "0 ≤ Λ ⟂ v^+ + e v^− ≥ 0",
    ),
    "dry_friction": Law(
        "Dry friction",
        "While the force Q that it takes is at most S, the relative velocity is 0; else Q is against it, and is K, or "
        "S where there is no K.",
        "|Q| ≤ S",
    ),
    "forces": Law(
        "Forces of the operators",
        "What it takes to prescribe s (M eq. 27); the power is λ ṡ.",
        "λ_α = d/dt ∂L/∂s˙_α − ∂L/∂s_α − Q_α",
    ),
    "power": Law("Power of the operators", "What they put in (M eq. 28).", "P_α = λ_α s˙_α"),
    "multipliers": Law(
        "Multipliers", "From the constraints in accelerations, C ẍ = c (K eq. 7, 9).", "C A^−1 C^T λ = c − C A^−1 f"
    ),
    "effective_mass": Law(
        "Effective mass at the active ports",
        "What a master needs to solve a loop of forces and accelerations. With A, B, D the second derivatives of L by "
        "q̇ twice, by q̇ and ṡ, and by ṡ twice (M eq. 50); of a coordinate kept by a constraint, from the multiplier.",
        "Θ = ∂λ/∂s¨ = D − B^T A^−1 B",
    ),
    "points": Law("Points", "Where other mechanisms are attached."),
    "outputs": Law("Further outputs", "What the component adds."),
    "signal": Law("Signal", "Its two derivatives are taken from the same expression."),
    "update": Law(
        "Samples",
        "After a sample, from values before it and the inputs at its instant; outputs change after the delay.",
    ),
    "link": Law("One link", "Sums over all links are those of the chain; L = T − V, friction −∂D/∂q̇."),
    "joints": Law("Joints", "Where the next link begins, and the first."),
    "hamiltonian": Law(
        "Hamiltonian",
        "Of all coordinates, prescribed ones included, and their momenta (K eq. 80, M eq. 30).",
        "H = Σ p_k q˙_k − L",
    ),
    "canonical": Law(
        "Canonical equations",
        "λ is the force of the operator (K eq. 81-82, M eq. 36-38).",
        "p˙_k = − ∂H/∂q_k + Q_k + λ_k",
    ),
    "connections": Law("Connections", "Inputs of parts, and the outputs that they take."),
}
