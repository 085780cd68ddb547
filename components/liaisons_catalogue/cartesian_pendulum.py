"""The plane pendulum in Cartesian coordinates: constraints instead of an angle."""

import casadi as ca
import numpy as np

from liaisons.language import (
    Ball,
    Coordinate,
    Gravity,
    Mechanism,
    Parameter,
    Rod,
    Shapes,
    Trail,
    constraint,
    output,
    rheonomic_constraint,
)

_START = 0.1  # rad, angle of the rod from the downward vertical


class CartesianPendulum(Mechanism):
    """Point mass in space, held in the plane y = 0 and at the distance from its pivot that an operator prescribes.

    With r = (x, y, z), the pivot at (0, 0, h), d = r - (0, 0, h) and the constraints |d| = l(t), y = 0::

        m r'' = -m g e_z + Z,    Z = 2 λ_1 d + λ_2 e_y                                   K eq. 3, 7
        |d| |d|'' = d·r'' + r'² - |d|'² = l l'',    y'' = 0                              K eq. 9, l(t) included
        constant l = h:    λ_1 = -m (g (l - z) + r'²) / 2 l²,    λ_2 = 0                 K Ex. 1
        Gauss:             μ_1 = -2 λ_1 = tension / l                                    K Ex. 9, the 2 removed

    λ_1 [N/m] and λ_2 [N] are in K's normalisation, that is, of σ_1 = |d|² - l² and σ_2 = y; the operator's force on the
    port ``rod`` is 2 l λ_1.  K's multipliers have "no function of regulation", so an error of the constraints would
    persist; here it decays, and every step ends on the constraints.

    Source: K Ex. 1, Ex. 9; M eq. 20-22 for the rod.
    """

    mass = Parameter(1.0, "kg", "mass of the bob", above=0)
    height = Parameter(1.0, "m", "height of the pivot, which is (0, 0, height)", symbol="h")
    gravity = Gravity()
    x = Coordinate("m", "horizontal position in the plane of the motion", start=float(np.sin(_START)))
    y = Coordinate("m", "distance from the plane of the motion")
    z = Coordinate("m", "height", start=float(1 - np.cos(_START)))

    @rheonomic_constraint("m", "distance from the pivot to the bob", start=1.0, above=0)
    def rod(self) -> ca.SX:
        return ca.norm_2(ca.vertcat(self.x, self.y, self.z - self.height))

    @constraint("m", "distance from the plane of the motion")
    def plane(self) -> ca.SX:
        return self.y

    _r = property(lambda self: {"x": self.x, "y": self.y, "z": self.z})

    def picture(self) -> Shapes:
        return [Trail(self._r), Rod({"z": self.height}, self._r), Ball(self._r)]

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self._r)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.z

    @output("N/m", "multiplier of x^2 + y^2 + (z - height)^2 - rod^2 (K Ex. 1); negative when the rod pulls")
    def lambda_1(self) -> ca.SX:
        return self.operator_force("rod") / (2 * self.rod)

    @output("N", "multiplier of y (K Ex. 1)")
    def lambda_2(self) -> ca.SX:
        return self.constraint_force("plane")

    from liaisons_catalogue.solutions.cartesian_pendulum import exact
