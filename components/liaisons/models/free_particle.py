"""The free particle: Newton's equations from a Lagrangian, and free fall."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.mechanics import Coordinate, Experiment, Mechanism, Parameter
from liaisons.models._linear import oscillation
from liaisons.models._validity import require_not_negative, require_positive


class FreeParticle(Mechanism):
    """Point mass under its weight, with friction if wanted.

    ::

        L = ½ m (x'² + y'² + z'²) - m g z                     K eq. 20 with V = +m g z
        r'' = -g e_z - η r'                                   K eq. 62

    r = (x, y, z) [m], z upwards; m [kg] mass, g [m/s2] gravity (0 allowed), η [1/s] friction.  A fall from rest
    through L lasts τ = √(2L/g), so that τ'/τ = √(L'/L), K eq. 59: V is homogeneous of degree h = 1.

    Source: K Ex. 2; sec. 2.5 (free fall, the sign of its potential corrected); sec. 2.6.
    """

    mass = Parameter(1.0, "kg", "mass", above=0)
    gravity = Parameter(9.81, "m/s2", "gravitational acceleration")
    friction = Parameter(0.0, "1/s", "friction coefficient eta of K eq. 61", minimum=0, tunable=True)
    x = Coordinate("m", "horizontal position", start_rate=1.0)
    y = Coordinate("m", "horizontal position, across x")
    z = Coordinate("m", "height", start_rate=9.81)
    experiment = Experiment(stop_time=2.0, step_size=0.01)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared({"x": self.x, "y": self.y, "z": self.z})

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.z

    def friction_coefficient(self) -> ca.SX:
        return self.friction

    @staticmethod
    def exact(
        t: ArrayLike,
        *,
        x_0: float = 0.0,
        y_0: float = 0.0,
        z_0: float = 0.0,
        x_dot_0: float = 1.0,
        y_dot_0: float = 0.0,
        z_dot_0: float = 9.81,
        mass: float = 1.0,
        gravity: float = 9.81,
        friction: float = 0.0,
    ) -> dict[str, NDArray]:
        """A parabola; with friction the velocity tends to -g/η e_z exponentially.

        :param t: times since the start [s], any shape, >= 0.
        :returns: ``x``, ``y``, ``z`` [m], ``x_dot``, ``y_dot``, ``z_dot`` [m/s].
        :raises ValidityError: for mass <= 0, negative friction or times.
        """
        require_positive("FreeParticle.exact", mass=mass)
        require_not_negative("FreeParticle.exact", friction=friction, t=float(np.min(t)))
        along = {"x": (x_0, x_dot_0, 0.0), "y": (y_0, y_dot_0, 0.0), "z": (z_0, z_dot_0, -gravity)}
        motion = {
            axis: oscillation(t, start, rate, omega_squared=0.0, gamma=friction, forces=[(acceleration, 0.0)])
            for axis, (start, rate, acceleration) in along.items()
        }
        return {q: r for q, (r, _) in motion.items()} | {f"{q}_dot": v for q, (_, v) in motion.items()}
