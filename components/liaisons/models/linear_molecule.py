"""The linear molecule of three atoms, for example CO2, moving along its axis."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons.language import Coordinate, Experiment, Mechanism, Parameter, Values, calculated, closed_form, output
from liaisons.models.solutions import molecule
from liaisons.models.solutions.linear import superposition


class LinearMolecule(Mechanism):
    """Three atoms in a row, the outer ones alike, bound by two equal springs; motion along the axis.

    With the displacements u from X⁰ = (0, L, 2L) and α = m/M::

        V = ½ κ (x_2 - x_1 - L)² + ½ κ (x_3 - x_2 - L)²                               K eq. 152
        Ω_1 = 0,  Ω_2 = √(κ/m),  Ω_3 = √(κ (1/m + 2/M)): roots of the eigenvalues     K eq. 157
        u_1 = (1, 1, 1)/√3,  u_2 = (-1, 0, 1)/√2,  u_3 = (1, -2α, 1)/√(4α² + 2)       K eq. 158
        u = Σ q_k u_k,    q_k'' + Ω_k² q_k = 0                                        K eq. 147, 150

    The q_k are the outputs mode_k.  The u_k are unit vectors, so the mass-weighted normal coordinates of K eq. 149
    are √(u_kᵀ M u_k) q_k.  L only shifts the positions.

    Source: K Ex. 11, eq. 148-158.
    """

    mass_outer = Parameter(
        15.999, "kg", "mass m of each outer atom (any consistent unit: oxygen in u)", above=0, symbol="m"
    )
    mass_inner = Parameter(12.011, "kg", "mass M of the inner atom (carbon in u)", above=0, symbol="M")
    stiffness = Parameter(1.0, "N/m", "stiffness kappa of each bond", above=0, symbol="κ")
    spacing = Parameter(0.116, "m", "length L of a bond at rest", minimum=0, symbol="L")
    x_1 = Coordinate("m", "position of the left outer atom", start=-0.01, nominal=0.1)
    x_2 = Coordinate("m", "position of the inner atom", start=0.116, nominal=0.1)
    x_3 = Coordinate("m", "position of the right outer atom", start=0.232, nominal=0.1)
    experiment = Experiment(stop_time=100.0, step_size=0.1)

    def kinetic_energy(self) -> ca.SX:
        outer = self.dot(self.x_1) ** 2 + self.dot(self.x_3) ** 2
        return self.mass_outer / 2 * outer + self.mass_inner / 2 * self.dot(self.x_2) ** 2

    def potential_energy(self) -> ca.SX:
        left, right = self.x_2 - self.x_1 - self.spacing, self.x_3 - self.x_2 - self.spacing
        return self.stiffness / 2 * (left**2 + right**2)

    @property
    def _frequencies(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        return molecule.frequencies(self.mass_outer, self.mass_inner, self.stiffness)

    @calculated("rad/s", "normal frequency of the translation, 0 (K eq. 157)")
    def omega_1(self) -> ca.SX:
        return self._frequencies[0]

    @calculated("rad/s", "normal frequency of the outer atoms against each other (K eq. 157)")
    def omega_2(self) -> ca.SX:
        return self._frequencies[1]

    @calculated("rad/s", "normal frequency of the inner atom against the outer ones (K eq. 157)")
    def omega_3(self) -> ca.SX:
        return self._frequencies[2]

    @output("m", "normal coordinate of the translation (1, 1, 1)/sqrt(3)")
    def mode_1(self) -> ca.SX:
        return self._normal_coordinates[0]

    @output("m", "normal coordinate of the outer atoms against each other, (-1, 0, 1)/sqrt(2)")
    def mode_2(self) -> ca.SX:
        return self._normal_coordinates[1]

    @output("m", "normal coordinate of the inner atom against the outer ones, (1, -2 m/M, 1) normalised")
    def mode_3(self) -> ca.SX:
        return self._normal_coordinates[2]

    @property
    def _normal_coordinates(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        u = (self.x_1, self.x_2 - self.spacing, self.x_3 - 2 * self.spacing)
        return molecule.normal_coordinates(u, self.mass_outer, self.mass_inner)

    @closed_form("superposition of the three modes (K eq. 148 and 150)", t=">= 0")
    @staticmethod
    def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
        m, M = at.mass_outer, at.mass_inner
        rest = at.spacing * np.arange(3)
        start, rates = at.array("x_1_0", "x_2_0", "x_3_0") - rest, at.array("x_1_dot_0", "x_2_dot_0", "x_3_dot_0")
        u, u_dot = superposition(
            t, np.array(molecule.frequencies(m, M, at.stiffness)), molecule.modes(m, M), start, rates
        )
        names = [f"{form}_{k}{rate}" for form, rate in (("x", ""), ("x", "_dot"), ("mode", "")) for k in (1, 2, 3)]
        modes = molecule.normal_coordinates(list(np.moveaxis(u, -1, 0)), m, M)
        columns = (*np.moveaxis(u + rest, -1, 0), *np.moveaxis(u_dot, -1, 0), *modes)
        return dict(zip(names, columns, strict=True))

    @closed_form("the unit vectors u_k of K eq. 158 as columns, shape (3, 3)")
    @staticmethod
    def modes(at: Values) -> NDArray:
        return molecule.modes(at.mass_outer, at.mass_inner)
