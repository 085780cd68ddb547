"""A pendulum on a cart that rolls freely."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons import Coordinate, Gravity, Mechanism, Parameter, Values, closed_form, output, point


class CartWithPendulum(Mechanism):
    """Pendulum on a cart without friction: the centre of mass moves evenly.

    Source: L. D. Landau, E. M. Lifshitz, Mechanics, 5, problem 2.
    """

    cart = Parameter(2.0, "kg", "mass of the cart", above=0, symbol="M")
    bob_mass = Parameter(1.0, "kg", "mass of the bob", above=0, symbol="m")
    length = Parameter(0.8, "m", "length of the rod", above=0, symbol="l")
    gravity = Gravity()
    x = Coordinate("m", "position of the cart", start_rate=0.3)
    theta = Coordinate("rad", "angle of the rod from the downward vertical", start=1.0)

    @point("m", "the bob")
    def bob(self) -> dict[str, ca.SX]:
        return {"x": self.x + self.length * ca.sin(self.theta), "z": -self.length * ca.cos(self.theta)}

    def kinetic_energy(self) -> ca.SX:
        return self.cart / 2 * self.dot(self.x) ** 2 + self.bob_mass / 2 * self.speed_squared(self.bob)

    def potential_energy(self) -> ca.SX:
        return self.bob_mass * self.gravity * self.bob["z"]

    @output("m", "horizontal position of the centre of mass")
    def centre_x(self) -> ca.SX:
        return (self.cart * self.x + self.bob_mass * self.bob["x"]) / (self.cart + self.bob_mass)

    @closed_form("the centre of mass, on which no horizontal force acts")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        share = at.bob_mass / (at.cart + at.bob_mass) * at.length
        start = at.x_0 + share * np.sin(at.theta_0)
        rate = at.x_dot_0 + share * np.cos(at.theta_0) * at.theta_dot_0
        return {"centre_x": start + rate * t}
