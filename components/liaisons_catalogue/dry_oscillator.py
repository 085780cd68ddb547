"""The oscillator with dry friction, on a belt."""

import casadi as ca

from liaisons.contacts import dry_friction
from liaisons.language import (
    ActiveCoordinate,
    Box,
    Coordinate,
    Experiment,
    Floor,
    Gravity,
    Mechanism,
    Parameter,
    Shapes,
    Spring,
    turned,
)


class DryOscillator(Mechanism):
    """Mass on a spring, on a belt; operators may move the belt and the other end of the spring, the support.

    With the support x_0 and the belt σ::

        m x'' = -K (x - x_0) + R + F,    x' ≠ σ':  R = -μ_k m g sign(x' - σ'),    x' = σ':  |R| <= μ_s m g
        belt at rest:  a half swing takes π/ω and loses 2 μ_k m g/K, until |x - x_0| <= μ_s m g/K
        belt at v:     stick-slip of period 2δ/v + (2/ω)(π - arctan(δω/v)),  δ = (μ_s - μ_k) m g/K
        K = 0, σ = A sin ωt, Aω² ≫ μ_k g:  mean velocity Aω sin(πF/2μ_k m g)

    The normal force is the weight, so the bounds of the friction force are constant.  ``mu_static`` must not be below
    ``mu_sliding``.
    """

    mass = Parameter(1.0, "kg", "mass", above=0)
    stiffness = Parameter(10.0, "N/m", "stiffness of the spring; 0 is a free block", minimum=0, symbol="K")
    mu_static = Parameter(0.1, "1", "coefficient of static friction", minimum=0, symbol="μ_s")
    mu_sliding = Parameter(0.1, "1", "coefficient of sliding friction", minimum=0, symbol="μ_k")
    gravity = Gravity()
    x = Coordinate("m", "position of the mass", start=1.0)
    support = ActiveCoordinate("m", "position of the support")
    belt = ActiveCoordinate("m", "position of the belt")
    experiment = Experiment(stop_time=20.0)

    def grip(self) -> ca.SX:
        return self.mu_static * self.mass * self.gravity

    def drag(self) -> ca.SX:
        return self.mu_sliding * self.mass * self.gravity

    @dry_friction("m/s", "sliding of the mass on the belt", static="grip", sliding="drag")
    def slip(self) -> ca.SX:
        return self.dot(self.x) - self.dot(self.belt)

    def picture(self) -> Shapes:
        wall, mass = {"x": self.support - 2, "z": 0.2}, {"x": self.x, "z": 0.2}  # at rest the spring is drawn 2 m long
        parts = [Spring(wall, mass), Box(mass, turned("y", 0), (0.4, 0.4, 0.4))]
        belt = {"x": ca.fmod(self.belt, 0.25)}  # as far as its hatching repeats itself
        return [Floor(belt, {"z": 1}, 6.0), Floor(wall, {"x": 1}, 0.8), *parts]

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.x) ** 2

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * (self.x - self.support) ** 2

    from liaisons_catalogue.solutions.dry_oscillator import drift, exact, stick_slip, turning_points
