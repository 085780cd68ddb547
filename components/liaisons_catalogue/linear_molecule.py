"""The linear molecule of three atoms, for example CO2, moving along its axis."""

import casadi as ca

from liaisons.language import Ball, Coordinate, Experiment, Mechanism, Parameter, Shapes, Spring, calculated, output
from liaisons_catalogue.solutions.linear_molecule import frequencies, normal_coordinates

_OUTER, _INNER = "outer atoms against each other", "inner atom against the outer ones"


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

    def picture(self) -> Shapes:
        left, inner, right = ({"x": x} for x in (self.x_1, self.x_2, self.x_3))
        atoms = [Ball(left, radius=0.02), Ball(inner, radius=0.03), Ball(right, radius=0.02)]
        return [Spring(left, inner), Spring(inner, right), *atoms]

    def kinetic_energy(self) -> ca.SX:
        outer = self.dot(self.x_1) ** 2 + self.dot(self.x_3) ** 2
        return self.mass_outer / 2 * outer + self.mass_inner / 2 * self.dot(self.x_2) ** 2

    def potential_energy(self) -> ca.SX:
        left, right = self.x_2 - self.x_1 - self.spacing, self.x_3 - self.x_2 - self.spacing
        return self.stiffness / 2 * (left**2 + right**2)

    def _normal_coordinates(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Normal coordinates q_1, q_2, q_3 of the displacements."""
        u = (self.x_1, self.x_2 - self.spacing, self.x_3 - 2 * self.spacing)
        return normal_coordinates(u, self.mass_outer, self.mass_inner)

    omega_1, omega_2, omega_3 = (
        calculated("rad/s", f"normal frequency of the {mode} (K eq. 157)")(
            lambda m, k=k: frequencies(m.mass_outer, m.mass_inner, m.stiffness)[k]
        )
        for k, mode in enumerate(("translation, 0", _OUTER, _INNER))
    )
    mode_1, mode_2, mode_3 = (
        output("m", f"normal coordinate of the {mode}")(lambda self, k=k: self._normal_coordinates()[k])
        for k, mode in enumerate(
            ("translation (1, 1, 1)/sqrt(3)", f"{_OUTER}, (-1, 0, 1)/sqrt(2)", f"{_INNER}, (1, -2 m/M, 1) normalised")
        )
    )

    from liaisons_catalogue.solutions.linear_molecule import exact, modes
