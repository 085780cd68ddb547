"""The child on a swing: two masses, one of them moved about the other."""

import casadi as ca
import numpy as np

from liaisons.language import ActiveCoordinate, Coordinate, Gravity, Mechanism, Parameter, assertion, output, point


class Swing(Mechanism):
    """Child on a swing: the seat on a rope, the torso leaning about it; an operator prescribes rope and lean.

    With rope l, lean ψ, masses m_1 at the seat (l sin θ, -l cos θ) and m_2 at seat + b (sin(θ + ψ), -cos(θ + ψ))::

        L = I θ'²/2 + Σ J_α θ' s_α' + ½ Σ g_αβ s_α' s_β' + D cos θ_com        M eq. 56, the ½ restored
        p_θ = I θ' + J_l l' + J_ψ ψ',    p_θ' = -D sin θ_com

        I = m_1 l² + m_2 (l² + b² + 2 l b cos ψ),  J_l = -m_2 b sin ψ,  J_ψ = m_2 (b² + l b cos ψ)
        D = g |m_1 r_1 + m_2 r_2|                                              M eq. 54, total mass included

    θ_com is the angle of the line to the centre of mass.  I, J, D depend on the posture alone, so X_K = 0 (M 8.4).

    Source: M 8.1, eq. 54-56.
    """

    mass_seat = Parameter(20.0, "kg", "mass at the seat: board and legs", above=0, symbol="m_1")
    mass_torso = Parameter(20.0, "kg", "mass of the torso", minimum=0, symbol="m_2")
    torso_length = Parameter(0.5, "m", "distance from the seat to the torso's mass", minimum=0, symbol="b")
    gravity = Gravity()
    theta = Coordinate("rad", "angle of the rope from the downward vertical", start=0.5)
    rope = ActiveCoordinate("m", "distance from the pivot to the seat", start=2.0, above=0, symbol="l")
    lean = ActiveCoordinate("rad", "angle of the torso from the rope's continuation", start=np.pi / 2, symbol="ψ")

    @point("m", "the seat")
    def seat(self) -> dict[str, ca.SX]:
        return {"x": self.rope * ca.sin(self.theta), "z": -self.rope * ca.cos(self.theta)}

    @point("m", "the torso's mass")
    def torso(self) -> dict[str, ca.SX]:
        direction = self.theta + self.lean
        return {
            "x": self.seat["x"] + self.torso_length * ca.sin(direction),
            "z": self.seat["z"] - self.torso_length * ca.cos(direction),
        }

    def kinetic_energy(self) -> ca.SX:
        seat, torso = self.speed_squared(self.seat), self.speed_squared(self.torso)
        return self.mass_seat / 2 * seat + self.mass_torso / 2 * torso

    def potential_energy(self) -> ca.SX:
        return self.gravity * (self.mass_seat * self.seat["z"] + self.mass_torso * self.torso["z"])

    def _static_moment(self) -> tuple[ca.SX, ca.SX]:
        """Components of mass × centre of mass about the pivot [kg.m], along the rope and to its left."""
        along = (self.mass_seat + self.mass_torso) * self.rope
        lever = self.mass_torso * self.torso_length
        return along + lever * ca.cos(self.lean), lever * ca.sin(self.lean)

    @output("rad", "angle of the centre of mass from the downward vertical, the theta of M eq. 54")
    def theta_com(self) -> ca.SX:
        along, across = self._static_moment()
        return self.theta + ca.atan2(across, along)

    @output("kg.m2", "moment of inertia I about the pivot (M eq. 55)")
    def inertia(self) -> ca.SX:
        l, b = self.rope, self.torso_length  # noqa: E741
        return self.mass_seat * l**2 + self.mass_torso * (l**2 + b**2 + 2 * l * b * ca.cos(self.lean))

    @output("N.m", "gravity times total mass times distance of the centre of mass from the pivot (M eq. 54)")
    def D(self) -> ca.SX:  # noqa: N802
        return self.gravity * ca.hypot(*self._static_moment())

    @output("kg.m", "coupling of theta and rope in the kinetic energy (M eq. 55)")
    def J_rope(self) -> ca.SX:  # noqa: N802
        return -self.mass_torso * self.torso_length * ca.sin(self.lean)

    @output("kg.m2", "coupling of theta and lean in the kinetic energy (M eq. 55)")
    def J_lean(self) -> ca.SX:  # noqa: N802
        return self.mass_torso * self.torso_length * (self.torso_length + self.rope * ca.cos(self.lean))

    @assertion("the centre of mass must stay off the pivot")
    def com_off_the_pivot(self) -> ca.SX:
        return ca.hypot(*self._static_moment())

    from liaisons_catalogue.pictures.swing import picture
    from liaisons_catalogue.solutions.swing import exact, leaning, lift
