"""The oscillator at constant kinetic energy: a non-holonomic constraint as a thermostat."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.language import Coordinate, Experiment, Mechanism, Parameter, Values, closed_form, non_holonomic, output
from liaisons.models.solutions.isokinetic import Orbit, isokinetic_motion
from liaisons.models.solutions.validity import require


class IsokineticOscillator(Mechanism):
    """Harmonic oscillator in space whose speed is held at m v² = 3 k_B T by Gauss's principle.

    ::

        m r'' = -K r - μ m r',    μ = -K r·r' / m v²   ( = -K r·r' / 3 k_B T on the constraint)      K Ex. 10
        (r × r') exp(-V / 3 k_B T) is constant, V = K r²/2: the motion stays in a plane
        r'² = v² (1 - c² exp(a r²) / r²),    a = K / 3 k_B T,    c = |r × r'| exp(-a r²/2) / v

    μ is a friction of either sign, so that T + V is not conserved; with μ as printed an error of the constraint grows
    as exp(2 V / 3 k_B T), with m v² in its place any speed is kept.  The multiplier of ``kinetic`` is -μ.

    Source: K Ex. 10, eq. 107-113.
    """

    mass = Parameter(1.0, "kg", "mass", above=0)
    stiffness = Parameter(1.0, "N/m", "stiffness of the spring", minimum=0, symbol="K")
    thermal_energy = Parameter(1.0, "J", "Boltzmann's constant times temperature", above=0)
    x = Coordinate("m", "position along x", start=1.0, start_rate=1.0)
    y = Coordinate("m", "position along y", start_rate=1.0)
    z = Coordinate("m", "position along z", start_rate=1.0)
    experiment = Experiment(stop_time=20.0, step_size=0.02)

    def _speed_squared(self) -> ca.SX:
        return self.speed_squared({"x": self.x, "y": self.y, "z": self.z})

    @non_holonomic("J", "kinetic energy less 3/2 of the thermal energy")
    def kinetic(self) -> ca.SX:
        return self.kinetic_energy() - 1.5 * self.thermal_energy

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self._speed_squared()

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * (self.x**2 + self.y**2 + self.z**2)

    @output("1/s", "friction of the thermostat, Gauss's multiplier (K Ex. 10)")
    def mu(self) -> ca.SX:
        return -self.constraint_force("kinetic")

    @closed_form("turning points by Lambert's W, time and angle between them by quadrature, for m v² = 3 k_B T")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        """Not for orbits that are almost circles; through the origin, or without a spring, uniform and straight."""
        position, velocity = at.array("x_0", "y_0", "z_0"), at.array("x_dot_0", "y_dot_0", "z_dot_0")
        speed = np.sqrt(3 * at.thermal_energy / at.mass)
        found = np.linalg.norm(velocity)
        require(
            abs(found - speed) <= 1e-6 * speed,
            f"IsokineticOscillator.exact: the start velocity {found:.9g} m/s must be {speed:.9g} m/s: m v² = 3 k_B T",
        )
        a = at.stiffness / (3 * at.thermal_energy)
        r, v = isokinetic_motion(t.ravel(), position, velocity, speed, a)
        mu = -a * np.sum(r * v, axis=0)
        names = ("x", "y", "z", "x_dot", "y_dot", "z_dot", "mu")
        return {name: row.reshape(t.shape) for name, row in zip(names, (*r, *v, mu), strict=True)}

    @closed_form("smallest and largest r [m], time [s] and angle [rad] from one to the other", stiffness="> 0")
    @staticmethod
    def turning_points(at: Values, *, position: ArrayLike, velocity: ArrayLike) -> tuple[float, float, float, float]:
        """From ``position`` [m], (3,), and ``velocity`` [m/s], (3,), at some instant."""
        r, v = np.asarray(position, dtype=float), np.asarray(velocity, dtype=float)
        area_rate, a = float(np.linalg.norm(np.cross(r, v))), at.stiffness / (3 * at.thermal_energy)
        require(area_rate > 0, "IsokineticOscillator.turning_points: straight through the origin r does not turn")
        speed = float(np.linalg.norm(v))
        orbit = Orbit.of(speed, a, area_rate * float(np.exp(-a * (r @ r) / 2)) / speed)
        return float(np.sqrt(orbit.inner)), float(np.sqrt(orbit.outer)), orbit.half_period, orbit.apsidal_angle
