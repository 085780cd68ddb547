"""The oscillator in the plane, in polar coordinates."""

import casadi as ca

from liaisons.language import Ball, Coordinate, Experiment, Mechanism, Parameter, Shapes, Spring, Trail


class PolarOscillator(Mechanism):
    """Mass in a plane, attracted to the origin by a force proportional to the distance, in the coordinates r and φ.

    ::

        L = ½ m (r'² + r² φ'²) - ½ K r²                       K eq. 41,  Ω² = K/m
        p_φ = m r² φ' = const                                 K eq. 42: φ is cyclic
        r'' - p_φ²/(m² r³) + Ω² r = 0                         K eq. 43, its centrifugal term restored

    The same motion as :class:`PlanarOscillator`'s, but singular at r = 0, which is reached if p_φ = 0 and only then.
    φ is not wrapped: it grows by π in each half period π/Ω.

    Source: K Ex. 5.
    """

    mass = Parameter(1.0, "kg", "mass", above=0)
    stiffness = Parameter(1.0, "N/m", "stiffness; 0 is a free mass", minimum=0, symbol="K")
    r = Coordinate("m", "distance from the origin", start=1.0, above=0)
    phi = Coordinate("rad", "polar angle", start_rate=0.5)  # at rest the default would fall into the origin
    experiment = Experiment(stop_time=20.0)

    def picture(self) -> Shapes:
        position = {"x": self.r * ca.cos(self.phi), "y": self.r * ca.sin(self.phi)}
        return [Trail(position), Spring({}, position), Ball(position)]

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * (self.dot(self.r) ** 2 + (self.r * self.dot(self.phi)) ** 2)

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * self.r**2

    from liaisons_catalogue.solutions.polar_oscillator import exact
