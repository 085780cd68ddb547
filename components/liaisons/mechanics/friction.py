"""Friction by Rayleigh's dissipation function D: the forces Q = −∂D/∂q̇ on free and active coordinates alike."""

from dataclasses import dataclass

import casadi as ca

from liaisons.algebra import gradient


@dataclass(frozen=True, eq=False)
class Dissipation:
    """D = η T + D′ [W]; of η T alone the forces are those of K eq. 66, Q = −η ∂T/∂q̇."""

    coefficient: ca.SX  # η, no function of the rates
    kinetic_energy: ca.SX  # T, quadratic in the rates
    further: ca.SX  # D′, what a component declares beside it

    @property
    def function(self) -> ca.SX:
        """Dissipation function D = η T + D′ [W]."""
        return self.coefficient * self.kinetic_energy + self.further

    def forces_against(self, rates: ca.SX) -> ca.SX:
        """Forces ∂D/∂q̇ with which friction opposes these rates, a column."""
        return self.coefficient * gradient(self.kinetic_energy, rates) + gradient(self.further, rates)

    def power(self, rates: ca.SX) -> ca.SX:
        """Power Σ q̇ ∂D/∂q̇ lost to friction, 2 η T of η T (K eq. 67); negative where friction drives."""
        return 2 * self.coefficient * self.kinetic_energy + ca.jtimes(self.further, rates, rates)
