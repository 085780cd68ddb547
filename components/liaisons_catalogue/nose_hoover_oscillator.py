"""The oscillator with the thermostat of Nosé and Hoover: constant temperature on the average."""

import casadi as ca

from liaisons.language import (
    Box,
    Coordinate,
    Experiment,
    InternalState,
    Mechanism,
    Parameter,
    Rod,
    Shapes,
    Spring,
    output,
    turned,
)


class NoseHooverOscillator(Mechanism):
    """Harmonic oscillator with a friction ξ, of either sign, that grows while the oscillator is too hot.

    ::

        m q'' = -K q - ξ m q',    ξ' = (m q'² - k_B T) / Q,    η' = ξ
        H' = m q'²/2 + K q²/2 + Q ξ²/2 + k_B T η is constant

    A single oscillator is not ergodic, and parts of its phase space are chaotic, so for long times only H' can be
    compared with a known value.  The area of a piece of phase space (q, p, ξ) shrinks as exp(-(η - η_0)).

    Source: K 4.2, end, with references 10 and 11.
    """

    mass = Parameter(1.0, "kg", "mass", above=0)
    stiffness = Parameter(1.0, "N/m", "stiffness of the spring", minimum=0, symbol="K")
    thermal_energy = Parameter(1.0, "J", "Boltzmann's constant times temperature", above=0)
    thermostat_mass = Parameter(1.0, "kg.m2", "mass of the thermostat", above=0, symbol="Q")
    q = Coordinate("m", "elongation", start=1.0)
    xi = InternalState("1/s", "friction, the state of the thermostat")
    eta = InternalState("1", "integral of the friction")
    experiment = Experiment(stop_time=50.0, step_size=0.05)

    def picture(self) -> Shapes:
        mass = {"x": self.q}  # at rest the spring is drawn 4 m long
        edge = Rod({"x": -4, "z": -0.4}, {"x": -4, "z": 0.4})
        return [edge, Spring({"x": -4}, mass), Box(mass, turned("y", 0), (0.4, 0.4, 0.4))]

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.q) ** 2

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * self.q**2

    def friction_coefficient(self) -> ca.SX:
        return self.xi

    def internal_rates(self) -> dict[str, ca.SX]:
        excess = self.mass * self.dot(self.q) ** 2 - self.thermal_energy
        return {"xi": excess / self.thermostat_mass, "eta": self.xi}

    @output("J", "energy of oscillator and thermostat together; it is constant")
    def extended_energy(self) -> ca.SX:
        thermostat = self.thermostat_mass / 2 * self.xi**2 + self.thermal_energy * self.eta
        return self.kinetic_energy() + self.potential_energy() + thermostat
