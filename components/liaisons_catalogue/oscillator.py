"""The damped linear oscillator on a movable support."""

import casadi as ca

from liaisons.language import (
    ActiveCoordinate,
    Box,
    Coordinate,
    Experiment,
    Friction,
    Mechanism,
    Parameter,
    Rod,
    Shapes,
    Spring,
    output,
    turned,
)


class Oscillator(Mechanism):
    """Mass on a spring whose other end, the support, an operator may move.

    ::

        m x'' = -K (x - x_0) - m γ x' + F(t)                              K eq. 114
        u'' + γ u' + ω_0² u = F/m,    ω_0² = K/m                          K eq. 115

    x_0 is the position of the support (not the start value), F the force on the port of x, and u the displacement of
    the mass from a support at rest.  Under F = |F_0| cos ωt the steady-state oscillation of u is |u_0| cos(ωt + φ) with

        |u_0| = (|F_0|/m) / √((ω² - ω_0²)² + γ²ω²)                        K eq. 121
        φ = -atan2(γω, ω_0² - ω²) in (-π, 0)                              K eq. 123, its branch corrected
        ω_res = √(ω_0² - γ²/2)  if  γ < √2 ω_0                            K eq. 122, corrected

    Source: K 5.1.
    """

    mass = Parameter(1.0, "kg", "mass", above=0)
    stiffness = Parameter(1.0, "N/m", "stiffness of the spring; 0 is a free mass", minimum=0, symbol="K")
    damping = Friction("damping gamma of K eq. 114, on the absolute velocity", "γ")
    x = Coordinate("m", "position of the mass", start=1.0)
    support = ActiveCoordinate("m", "position of the support, the x_0 of K eq. 114")
    experiment = Experiment(stop_time=20.0)

    @output("m", "elongation of the spring, x - support")
    def elongation(self) -> ca.SX:
        return self.x - self.support

    def picture(self) -> Shapes:
        wall, mass = self.support - 2, {"x": self.x}  # at rest the spring is drawn 2 m long
        edge = Rod({"x": wall, "z": -0.4}, {"x": wall, "z": 0.4})
        return [edge, Spring({"x": wall}, mass), Box(mass, turned("y", 0), (0.4, 0.4, 0.4))]

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.x) ** 2

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * self.elongation**2

    from liaisons_catalogue.solutions.oscillator import exact, resonance, response
