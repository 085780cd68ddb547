"""Two problems of the IVP Test Set, release 2.4, with the digits that it publishes: VDPOL with ε = 1e-6, and HIRES."""

from __future__ import annotations

import casadi as ca

from liaisons import Coordinate, Mechanism, Parameter
from liaisons.language import InternalState

VAN_DER_POL_END, HIRES_END = 2.0, 321.8122  # [s]
VAN_DER_POL_PUBLISHED = {"y": 1.706167732170483, "y_dot": -0.8928097010247975}
HIRES_PUBLISHED = {
    "y_1": 0.7371312573325668e-3,
    "y_2": 0.1442485726316185e-3,
    "y_3": 0.5888729740967575e-4,
    "y_4": 0.1175651343283149e-2,
    "y_5": 0.2386356198831331e-2,
    "y_6": 0.6238968252742796e-2,
    "y_7": 0.2849998395185769e-2,
    "y_8": 0.2850001604814231e-2,
}


class VanDerPol(Mechanism):
    """Oscillator that a negative friction drives where it is near the middle: ε y'' = (1 - y²) y' - y."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    stiffness = Parameter(1e6, "N/m", "stiffness, m/ε", above=0)
    damping = Parameter(1e6, "N.s/m", "damping, m/ε", above=0)
    size = Parameter(1.0, "m", "elongation at which the friction changes its sign", above=0)
    y = Coordinate("m", "elongation", start=2.0)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.y) ** 2

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * self.y**2

    def dissipation_function(self) -> ca.SX:
        return self.damping / 2 * ((self.y / self.size) ** 2 - 1) * self.dot(self.y) ** 2


class Hires(Mechanism):
    """High irradiance responses of photomorphogenesis, eight concentrations, beside an oscillator that rests."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    stiffness = Parameter(1.0, "N/m", "stiffness", above=0)
    second = Parameter(1.0, "s", "unit of time", above=0)
    z = Coordinate("m", "elongation")
    y_1 = InternalState("1", "concentration 1", start=1.0)
    y_2 = InternalState("1", "concentration 2")
    y_3 = InternalState("1", "concentration 3")
    y_4 = InternalState("1", "concentration 4")
    y_5 = InternalState("1", "concentration 5")
    y_6 = InternalState("1", "concentration 6")
    y_7 = InternalState("1", "concentration 7")
    y_8 = InternalState("1", "concentration 8", start=0.0057)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.z) ** 2

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * self.z**2

    def internal_rates(self) -> dict[str, ca.SX]:
        y = [None, *(getattr(self, f"y_{i}") for i in range(1, 9))]
        bound = 280 * y[6] * y[8]
        rates = {
            "y_1": -1.71 * y[1] + 0.43 * y[2] + 8.32 * y[3] + 0.0007,
            "y_2": 1.71 * y[1] - 8.75 * y[2],
            "y_3": -10.03 * y[3] + 0.43 * y[4] + 0.035 * y[5],
            "y_4": 8.32 * y[2] + 1.71 * y[3] - 1.12 * y[4],
            "y_5": -1.745 * y[5] + 0.43 * y[6] + 0.43 * y[7],
            "y_6": -bound + 0.69 * y[4] + 1.71 * y[5] - 0.43 * y[6] + 0.69 * y[7],
            "y_7": bound - 1.81 * y[7],
            "y_8": -bound + 1.81 * y[7],
        }
        return {name: rate / self.second for name, rate in rates.items()}
