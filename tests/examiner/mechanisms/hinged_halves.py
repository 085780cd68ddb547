"""Two equal halves of a cat with a hinge between them."""

from __future__ import annotations

import casadi as ca
from numpy.typing import NDArray

from liaisons import ActiveCoordinate, Coordinate, Experiment, Mechanism, Parameter, Values, closed_form, output


class HingedHalves(Mechanism):
    """Two bodies on one axis, turned against each other by an operator: α is the first one's angle, α + h the other's.

    The angular momentum I_1 α' + I_2 (α' + h') stays what it was: from rest α = -I_2 h/(I_1 + I_2).
    Source: J. E. Marsden, R. Montgomery, T. Ratiu, Reduction, Symmetry and Phases in Mechanics (1990).
    """

    front = Parameter(0.04, "kg.m2", "moment of inertia of the front half", above=0, symbol="I_1")
    hind = Parameter(0.06, "kg.m2", "moment of inertia of the hind half", above=0, symbol="I_2")
    alpha = Coordinate("rad", "angle of the front half", start_rate=-0.6)
    hinge = ActiveCoordinate("rad", "angle of the hind half from the front half", symbol="h")
    experiment = Experiment(reference={"hinge_dot": 1.0})

    def kinetic_energy(self) -> ca.SX:
        hind = self.dot(self.alpha + self.hinge)
        return self.front / 2 * self.dot(self.alpha) ** 2 + self.hind / 2 * hind**2

    @output("rad", "angle of the hind half")
    def hind_angle(self) -> ca.SX:
        return self.alpha + self.hinge

    @closed_form("the turn while the hinge moves evenly, from an angular momentum of zero")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        rate = -at.hind / (at.front + at.hind) * at.hinge_dot
        at.require(abs(at.alpha_dot_0 - rate) < 1e-12, "alpha_dot_0 must be -hind hinge_dot/(front + hind)")
        alpha = at.alpha_0 + rate * t
        return {"alpha": alpha, "hind_angle": alpha + at.hinge + at.hinge_dot * t}
