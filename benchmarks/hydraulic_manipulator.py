"""The hydraulic manipulator of the co-simulation benchmarks of the Laboratorio de Ingeniería Mecánica.

F. González et al., Universidade da Coruña, cosim-benchmarks, doc/hydraulicManipulator, manoeuvre of steps, by pressures
and displacements: the arm by bodies and joints, with the friction of its actuator, and both chambers of the cylinder.
"""

from __future__ import annotations

from math import pi, sqrt

import casadi as ca

from liaisons import System
from liaisons.language import ActiveCoordinate, Coordinate, InternalState, Mechanism, Parameter
from liaisons.linkages import Body, Linkage, Prismatic, Revolute, ground

AREA, PUMP, TANK, LOAD = 0.0065, 7.6e6, 0.1e6, 8829.0  # of the piston [m2], pressures [Pa], force at rest [N]
START = 0.5  # of the actuator [m]
PUBLISHED = {"arm.stroke": 0.51536899, "cylinder.p_1": 3422258.8, "cylinder.p_2": 4277740.9}  # at 10 s
PUBLISHED_STROKE = 0.59609912  # at 6.04 s, soon after the second step
OTHERS = {"H = 1 ms, steps of 1 and 0.2 ms": 0.59611872, "H = 0.2 ms": 0.59610004}  # Jacobi and Euler, likewise


def _at_rest() -> tuple[float, float, float]:
    """Position of the valve, and both pressures, at which the piston carries the load and nothing flows."""
    ratio = LOAD / AREA / (PUMP - TANK)
    # ratio = (1 - 2 κ)/(1 - 2 κ + 2 κ²)
    valve = ((ratio - 1) + sqrt((1 - ratio) ** 2 + 2 * ratio * (1 - ratio))) / (2 * ratio)
    into, out = valve**2, (1 - valve) ** 2
    return valve, (into * PUMP + out * TANK) / (into + out), (out * PUMP + into * TANK) / (into + out)


VALVE, FIRST, SECOND = _at_rest()


class Arm(Linkage):
    """Two links, the first of them lifted by a piston."""

    barrel, piston = Body(), Body()
    lower = Body(mass=450.0, inertia=(0, *[200 / 12 + 200 * 250 / 450 * 0.25] * 2), centre=(350 / 450 - 0.5, 0, 0))
    upper = Body(mass=100.0, centre=(0.5, 0, 0))
    foot = Revolute(ground, barrel, axis="-y", at=(sqrt(3) / 2, 0, 0), start=5 * pi / 6)
    stroke = Prismatic(barrel, piston, axis="x", start=START, damping=1e5)
    eye = Revolute(piston, lower, axis="-y", start=-2 * pi / 3)
    elbow = Revolute(lower, upper, axis="-y", at=(0.5, 0, 0), start=-2 * pi / 3)
    shoulder = Revolute(ground, lower, axis="-y", at_child=(-0.5, 0, 0))


class Cylinder(Mechanism):
    """Two chambers that press on a piston; a valve moves by ramps, its spool is a mass on a spring at rest."""

    area = Parameter(AREA, "m2", "area of the piston")
    length = Parameter(0.442, "m", "length of the cylinder")
    opening = Parameter(5e-4, "m2", "area of the valve")
    discharge = Parameter(0.67, "1", "discharge coefficient of the valve")
    density = Parameter(850.0, "kg/m3", "density of the oil")
    pump = Parameter(PUMP, "Pa", "pressure of the pump")
    tank = Parameter(TANK, "Pa", "pressure of the tank")
    valve = Parameter(VALVE, "1", "position of the valve at the start")
    middle = Parameter(START, "m", "stroke at which both chambers are equal")
    softness = Parameter(6.53e-10, "1/Pa", "first coefficient of the bulk modulus")
    softening = Parameter(-1.19e-18, "1/Pa2", "second coefficient of the bulk modulus")
    second = Parameter(1.0, "s", "unit of time")
    mass = Parameter(1.0, "kg", "of the spool")
    stiffness = Parameter(1.0, "N/m", "of the spring of the spool")
    spool = Coordinate("m", "place of the spool")
    stroke = ActiveCoordinate("m", "stroke of the piston", start=START)
    elapsed = InternalState("s", "time since the start")
    p_1 = InternalState("Pa", "pressure that the load lowers", start=FIRST)
    p_2 = InternalState("Pa", "pressure that carries the load", start=SECOND)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.spool) ** 2

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * self.spool**2

    def dissipation_function(self) -> ca.SX:
        return (self.p_1 - self.p_2) * self.area * self.dot(self.stroke)  # its slope is the force

    def internal_rates(self) -> dict[str, ca.SX]:
        t = self.elapsed / self.second
        step, jump = (ca.fmin(ca.fmax((t - begin) / size, 0), 1) for begin, size in ((2.0, 1e-3), (6.0, 2e-3)))
        valve = self.valve - 0.01 * step + 0.03 * jump
        moved, half = self.stroke - self.middle, self.length / 2
        rates = {"elapsed": ca.SX(1)}
        for name, sign, share in (("p_1", 1, valve), ("p_2", -1, 1 - valve)):
            p = self.symbols[name]
            modulus = (1 + self.softness * p + self.softening * p**2) / (self.softness + 2 * self.softening * p)
            into, out = (self._flow(*pair) for pair in ((self.pump, p), (p, self.tank)))
            flow = sign * self.area * self.dot(self.stroke) + share * into - (1 - share) * out
            rates[name] = modulus / (self.area * (half - sign * moved)) * flow
        return rates

    def _flow(self, high: ca.SX, low: ca.SX) -> ca.SX:
        return self.opening * self.discharge * ca.sqrt(ca.fmax(2 * (high - low) / self.density, 0))


COMPONENTS = {"Arm": Arm, "Cylinder": Cylinder}


def manipulator(arm: str, cylinder: str) -> System:
    """The system of two FMUs."""
    system = System("manipulator")
    mechanics, hydraulics = system.add("arm", arm), system.add("cylinder", cylinder)
    system.connect(mechanics["stroke"], hydraulics["stroke"])
    return system
