"""The oscillator at constant kinetic energy: a non-holonomic constraint as a thermostat."""

import casadi as ca

from liaisons.language import (
    Ball,
    Coordinate,
    Experiment,
    Mechanism,
    Parameter,
    Shapes,
    Spring,
    Trail,
    non_holonomic,
    output,
)


class IsokineticOscillator(Mechanism):
    """Harmonic oscillator in space whose speed is held at m v² = 3 k_B T by Gauss's principle.

    ::

        m r'' = -K r - μ m r',    μ = -K r·r' / m v²   ( = -K r·r' / 3 k_B T on the constraint)      K Ex. 10
        (r × r') exp(-V / 3 k_B T) is constant, V = K r²/2: the motion stays in a plane
        r'² = v² (1 - c² exp(a r²) / r²),    a = K / 3 k_B T,    c = |r × r'| exp(-a r²/2) / v

    μ is a friction coefficient of either sign, so that T + V is not conserved.  With μ as printed, an error of the
    constraint grows as exp(2 V / 3 k_B T); with m v² in place of 3 k_B T, any speed is kept.  The multiplier of
    ``kinetic`` is -μ.

    Source: K Ex. 10, eq. 107-113.
    """

    mass = Parameter(1.0, "kg", "mass", above=0)
    stiffness = Parameter(1.0, "N/m", "stiffness of the spring", minimum=0, symbol="K")
    thermal_energy = Parameter(1.0, "J", "Boltzmann's constant times temperature", above=0)
    x = Coordinate("m", "position along x", start=1.0, start_rate=1.0)
    y = Coordinate("m", "position along y", start_rate=1.0)
    z = Coordinate("m", "position along z", start_rate=1.0)
    experiment = Experiment(stop_time=20.0, step_size=0.02)

    _r = property(lambda self: {"x": self.x, "y": self.y, "z": self.z})

    @non_holonomic("J", "kinetic energy less 3/2 of the thermal energy")
    def kinetic(self) -> ca.SX:
        return self.kinetic_energy() - 1.5 * self.thermal_energy

    def picture(self) -> Shapes:
        return [Trail(self._r), Spring({}, self._r), Ball(self._r)]

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self._r)

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * (self.x**2 + self.y**2 + self.z**2)

    @output("1/s", "friction of the thermostat, Gauss's multiplier (K Ex. 10)")
    def mu(self) -> ca.SX:
        return -self.constraint_force("kinetic")

    from liaisons_catalogue.solutions.isokinetic_oscillator import exact, turning_points
