"""The linear oscillator of the co-simulation benchmarks of the Laboratorio de Ingeniería Mecánica, as two mechanisms.

F. González et al., Universidade da Coruña, cosim-benchmarks, doc/linearOscillator: cases 0 and 1, by force and
displacement: the first mass has the coupling spring, whose far end the second one moves.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from liaisons import System
from liaisons.language import ActiveCoordinate, Coordinate, Mechanism, Parameter

STIFFNESS = (10.0, 100.0, 1000.0)  # of the first spring, the coupling, the second spring [N/m]
RATE, DURATION = 100.0, 10.0  # the masses start at ± this rate [m/s]
DAMPING = {"case 0, undamped": 0.0, "case 1, damped": 0.01}  # of each damper [N.s/m]


class FirstMass(Mechanism):
    """Mass on a spring and a damper, with a second spring and damper whose far end an operator moves."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    stiffness = Parameter(STIFFNESS[0], "N/m", "stiffness of its spring")
    coupling = Parameter(STIFFNESS[1], "N/m", "stiffness of the spring between the masses")
    damping = Parameter(0.0, "N.s/m", "of each damper")
    x = Coordinate("m", "displacement", start_rate=RATE)
    far = ActiveCoordinate("m", "displacement of the other mass")

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.x) ** 2

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * self.x**2 + self.coupling / 2 * (self.x - self.far) ** 2

    def dissipation_function(self) -> ca.SX:
        return self.damping / 2 * (self.dot(self.x) ** 2 + self.dot(self.x - self.far) ** 2)


class SecondMass(Mechanism):
    """Mass on a spring and a damper."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    stiffness = Parameter(STIFFNESS[2], "N/m", "stiffness of its spring")
    damping = Parameter(0.0, "N.s/m", "of its damper")
    x = Coordinate("m", "displacement", start_rate=-RATE)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.x) ** 2

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * self.x**2

    def dissipation_function(self) -> ca.SX:
        return self.damping / 2 * self.dot(self.x) ** 2


COMPONENTS = {"FirstMass": FirstMass, "SecondMass": SecondMass}


def two_masses(first: str, second: str, damping: float) -> System:
    """The system of two FMUs."""
    system = System("two masses")
    one, two = system.add("first", first, damping=damping), system.add("second", second, damping=damping)
    system.connect(two["x"], one["far"])
    return system


def matrix(damping: float) -> NDArray:
    """A of z' = A z, z = (x_1, x_2, x_1', x_2')."""
    k_1, k_c, k_2 = STIFFNESS
    pull = np.array([[k_1 + k_c, -k_c], [-k_c, k_2 + k_c]])
    drag = damping * np.array([[2.0, -1.0], [-1.0, 2.0]])
    return np.block([[np.zeros((2, 2)), np.eye(2)], [-pull, -drag]])


def exact(steps: int, damping: float) -> NDArray:
    """z at so many equal steps by the matrix exponential, (4, steps + 1)."""
    propagator = expm(matrix(damping) * DURATION / steps)
    found = [np.array([0.0, 0.0, RATE, -RATE])]
    for _ in range(steps):
        found.append(propagator @ found[-1])
    return np.array(found).T


def energy(z: NDArray) -> NDArray:
    """Of both masses and all springs [J]."""
    k_1, k_c, k_2 = STIFFNESS
    kinetic = (z[2] ** 2 + z[3] ** 2) / 2
    return kinetic + (k_1 * z[0] ** 2 + k_c * (z[0] - z[1]) ** 2 + k_2 * z[1] ** 2) / 2


def by_jacobi_and_euler(steps: int, damping: float) -> NDArray:
    """z as the benchmark's own program has it: explicit Jacobi, inputs held, one semi-implicit Euler step each."""
    accelerate, h, found = matrix(damping)[2:], DURATION / steps, [np.array([0.0, 0.0, RATE, -RATE])]
    for _ in range(steps):
        v = found[-1][2:] + h * accelerate @ found[-1]
        found.append(np.concatenate([found[-1][:2] + h * v, v]))
    return np.array(found).T
