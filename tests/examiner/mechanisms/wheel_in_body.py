"""A body that is turned by a wheel in it."""

from __future__ import annotations

import casadi as ca
from numpy.typing import NDArray

from liaisons import ActiveCoordinate, Coordinate, Experiment, Mechanism, Parameter, Values, closed_form, output


class WheelInBody(Mechanism):
    """Free body with a wheel that an operator turns by w against it: (I + J) β' + J w' is constant.

    Source: H. Goldstein, Classical Mechanics, chapter 5; C. D. Hall on momentum wheels.
    """

    body = Parameter(2.0, "kg.m2", "moment of inertia of the body", above=0, symbol="I")
    wheel = Parameter(0.1, "kg.m2", "moment of inertia of the wheel about its axis", above=0, symbol="J")
    beta = Coordinate("rad", "angle of the body", start_rate=-0.1)
    turn = ActiveCoordinate("rad", "angle of the wheel against the body", symbol="w")
    experiment = Experiment(reference={"turn_dot": 3.0})

    def kinetic_energy(self) -> ca.SX:
        turned = self.dot(self.beta) + self.dot(self.turn)
        return self.body / 2 * self.dot(self.beta) ** 2 + self.wheel / 2 * turned**2

    @output("kg.m2/s", "angular momentum of both")
    def spin(self) -> ca.SX:
        return self.body * self.dot(self.beta) + self.wheel * (self.dot(self.beta) + self.dot(self.turn))

    @closed_form("the motion while the wheel turns evenly: nothing pulls")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        momentum = at.body * at.beta_dot_0 + at.wheel * (at.beta_dot_0 + at.turn_dot)
        return {"beta": at.beta_0 + at.beta_dot_0 * t, "spin": momentum + 0 * t, "turn_force": 0 * t}
