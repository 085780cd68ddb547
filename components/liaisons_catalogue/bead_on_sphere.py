"""The bead that slides off a sphere."""

import casadi as ca
import numpy as np

from liaisons.contacts import unilateral
from liaisons.language import Ball, Coordinate, Gravity, Mechanism, Parameter, Shapes, Trail, circle, point

_START = 0.1  # rad, angle of the start from the top


class BeadOnSphere(Mechanism):
    """Point mass on a smooth sphere about the origin, in a vertical plane.

    With the distance d from the centre and the angle θ from the top::

        gap = d - r >= 0,    m r'' = -m g e_z + λ r/d,    0 <= λ ⟂ gap >= 0
        on the sphere, from rest at θ_0:  λ = m g (3 cos θ - 2 cos θ_0), which is 0 where cos θ = (2/3) cos θ_0

    From there on the mass follows a parabola.
    """

    mass = Parameter(1.0, "kg", "mass", above=0)
    radius = Parameter(1.0, "m", "radius of the sphere", above=0)
    bounce = Parameter(0.0, "1", "coefficient of restitution", minimum=0, maximum=1, symbol="e")
    gravity = Gravity()
    x = Coordinate("m", "horizontal position of the bead", start=float(np.sin(_START)))
    z = Coordinate("m", "height of the bead above the centre", start=float(np.cos(_START)))

    @point("m", "the bead")
    def bead(self) -> dict[str, ca.SX]:
        return {"x": self.x, "z": self.z}

    @unilateral("m", "distance of bead and sphere", restitution="bounce")
    def gap(self) -> ca.SX:
        return ca.norm_2(ca.vertcat(self.x, self.z)) - self.radius

    def picture(self) -> Shapes:
        across = ca.SX([1, 0, 0]), ca.SX([0, 0, 1])
        return [circle({}, self.radius, across), Trail(self.bead), Ball(self.bead)]

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self.bead)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.z

    from liaisons_catalogue.solutions.bead_on_sphere import exact, leaves
