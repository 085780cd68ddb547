"""The falling cat in the plane: a body with two limbs, which turns itself round without angular momentum."""

from collections.abc import Iterator

import casadi as ca

from liaisons.language import ActiveCoordinate, Coordinate, Experiment, Gravity, Mechanism, Parameter, output


class PlanarCat(Mechanism):
    """Falling cat of three rigid bodies in the plane: a trunk and two limbs, whose hinge angles an operator prescribes.

    With e(α) = (cos α, sin α), the limbs' centres of mass lie at h e(φ) + c_1 e(φ + ψ_1) and -h e(φ) - c_2 e(φ + ψ_2)
    from the trunk's.  In reduced masses μ_i = m_i (M - m_i)/M, μ = m_1 m_2/M, with M the total mass and
    A = h c_1 (μ_1 + μ), B = h c_2 (μ_2 + μ), C = c_1 c_2 μ::

        L = ½ M |v_G|² - M g z_G + ½ I φ'² + Σ J_α φ' ψ_α' + ½ Σ g_αβ ψ_α' ψ_β'        M eq. 58
        M x_G'' = 0,  M z_G'' = -M g                                                  M eq. 59
        I = I_0 + I_1 + I_2 + h² (μ_1 + μ_2 + 2 μ) + c_1² μ_1 + c_2² μ_2 + 2 (A cos ψ_1 + B cos ψ_2 + C cos(ψ_1 - ψ_2))
        J_1 = I_1 + c_1² μ_1 + A cos ψ_1 + C cos(ψ_1 - ψ_2),   J_2 alike
        p_φ = I φ' + J_1 ψ_1' + J_2 ψ_2', the angular momentum, is constant

    At p_φ = 0 the trunk turns by Δφ = -∮ (J_1 dψ_1 + J_2 dψ_2)/I in a closed loop of shapes, however fast the loop is
    traversed; this is the holonomy of the kinetic connection (``analysis.holonomy``).

    Source: M 8.2, eq. 57-60.
    """

    mass_0 = Parameter(2.0, "kg", "mass of the trunk", above=0)
    mass_1 = Parameter(1.0, "kg", "mass of limb 1", above=0)
    mass_2 = Parameter(1.0, "kg", "mass of limb 2", above=0)
    inertia_0 = Parameter(0.05, "kg.m2", "moment of inertia of the trunk about its centre of mass", above=0)
    inertia_1 = Parameter(0.02, "kg.m2", "moment of inertia of limb 1 about its centre of mass", above=0)
    inertia_2 = Parameter(0.02, "kg.m2", "moment of inertia of limb 2 about its centre of mass", above=0)
    hinge = Parameter(0.2, "m", "distance from the trunk's centre of mass to either hinge", minimum=0, symbol="h")
    arm_1 = Parameter(0.15, "m", "distance from hinge 1 to the centre of mass of limb 1", minimum=0, symbol="c_1")
    arm_2 = Parameter(0.15, "m", "distance from hinge 2 to the centre of mass of limb 2", minimum=0, symbol="c_2")
    gravity = Gravity()
    com_x = Coordinate("m", "position of the centre of mass along the horizontal", symbol="x_G")
    com_z = Coordinate("m", "height of the centre of mass", start_rate=9.81, symbol="z_G")
    phi = Coordinate("rad", "direction of the trunk, from the x axis towards z", start_rate=1.0)
    psi_1 = ActiveCoordinate("rad", "angle of limb 1 from the trunk's forward direction")
    psi_2 = ActiveCoordinate("rad", "angle of limb 2 from the trunk's backward direction")
    experiment = Experiment(stop_time=2.0)
    _total_mass = property(lambda self: self.mass_0 + self.mass_1 + self.mass_2)

    @property
    def _bodies(self) -> Iterator[tuple[ca.SX, ...]]:
        """Mass, moment of inertia, position x, z, velocity v, w and angular velocity of each body.

        They are relative to the common centre of mass, in the axes of the trunk, so that φ appears in none of them.
        """
        masses, hinge = (self.mass_0, self.mass_1, self.mass_2), ca.vertcat(self.hinge, 0)
        inertias = self.inertia_0, self.inertia_1, self.inertia_2
        limb_1, limb_2 = (ca.vertcat(ca.cos(psi), ca.sin(psi)) for psi in (self.psi_1, self.psi_2))
        positions = ca.SX.zeros(2), hinge + self.arm_1 * limb_1, -hinge - self.arm_2 * limb_2
        centre = sum(mass * r for mass, r in zip(masses, positions, strict=True)) / self._total_mass
        phi_dot = self.dot(self.phi)
        spins = phi_dot, phi_dot + self.dot(self.psi_1), phi_dot + self.dot(self.psi_2)
        for mass, inertia, r, spin in zip(masses, inertias, positions, spins, strict=True):
            x, z = ca.vertsplit(r - centre)
            yield mass, inertia, x, z, self.dot(x) - phi_dot * z, self.dot(z) + phi_dot * x, spin

    def kinetic_energy(self) -> ca.SX:
        fall = self._total_mass * (self.dot(self.com_x) ** 2 + self.dot(self.com_z) ** 2)
        rotation = sum(m * (v**2 + w**2) + inertia * spin**2 for m, inertia, _, _, v, w, spin in self._bodies)
        return (fall + rotation) / 2

    def potential_energy(self) -> ca.SX:
        return self._total_mass * self.gravity * self.com_z

    @output("kg.m2/s", "angular momentum about the centre of mass, summed over the bodies")
    def angular_momentum(self) -> ca.SX:
        parts = (m * (x * w - z * v) + inertia * spin for m, inertia, x, z, v, w, spin in self._bodies)
        return sum(parts, ca.SX(0))

    from liaisons_catalogue.pictures.planar_cat import picture
    from liaisons_catalogue.solutions.planar_cat import exact, turn_rate
