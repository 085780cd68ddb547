"""Small motions about an equilibrium: M ü = -K u and its normal modes (K 5.2)."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from liaisons.errors import ComponentError
from liaisons_motion.analysis.numeric import with_values
from liaisons_motion.analysis.quantity import (
    Source,
    equations_of,
    require_free_coordinates,
    require_independent_coordinates,
    symbol_values,
)

_ROUNDS = 50  # Newton doubles the digits each round; what has not converged by then does not
_ZERO = 1e-12  # eigenvalues below this part of the largest one are rounding errors of the diagonalisation


@dataclass(frozen=True, eq=False)
class NormalModes:
    """Normal modes about an equilibrium, u = Σ q_k u_k with q̈_k + Ω_k² q_k = 0 (K eq. 141-151)."""

    equilibrium: dict[str, float]  # q by name
    mass: NDArray  # M (f, f)
    stiffness: NDArray  # K = ∂²V/∂q∂q (f, f)
    squares: NDArray  # Ω_k², the eigenvalues of M^(-1/2) K M^(-1/2), ascending (f,) [rad2/s2]; K eq. 157 corrected
    modes: NDArray  # u_k as columns, u_kᵀ M u_l = δ_kl (K eq. 151); K eq. 158 has unit vectors instead (f, f)

    @property
    def frequencies(self) -> NDArray:
        """Ω_k, ascending, (f,) [rad/s]; 0 for a zero mode.

        :raises ComponentError: at an unstable equilibrium, where an Ω_k² is negative.
        """
        if self.squares[0] < 0:
            raise ComponentError(
                f"frequencies: the equilibrium {self.equilibrium} is unstable, Ω² = {self.squares[0]:g}; see squares"
            )
        return np.sqrt(self.squares)

    @property
    def zero_modes(self) -> int:
        """Number of modes without restoring force, along which the system drifts (K Ex. 11: the translation)."""
        return int(np.count_nonzero(self.squares == 0))


def equilibrium(source: Source, **values: float) -> dict[str, float]:
    """Configuration in which the forces vanish at rest, ∂V/∂q = drives - loads, by Newton's method (K eq. 132).

    Along a zero mode it stays where it is.

    :param values: guess by ``q`` (default: the start), active coordinates, parameters, constant forces.
    :returns: q by name.
    :raises ComponentError: for constraints, contacts, an orientation, internal states, rates that are not 0, unknown
        symbols, or if none is found near the guess.
    """
    return _linearized_at_equilibrium(source, values)[0]


def normal_modes(source: Source, **values: float) -> NormalModes:
    """Normal modes K u = Ω² M u about the equilibrium near a guess, with mass and stiffness (K eq. 137-151).

    See :func:`equilibrium` for the arguments and errors; friction and magnetic forces are refused.
    """
    from scipy.linalg import eigh

    rest, M, K, B = _linearized_at_equilibrium(source, values)
    if np.max(np.abs(B)) > _ZERO * np.sqrt(np.max(np.abs(K)) * np.max(np.abs(M))):
        raise ComponentError(
            f"{equations_of(source).name}: its forces depend on the rates (friction, a magnetic field), and M ü = -K u "
            "leaves them out; set them to 0, or take linearize()"
        )
    squares, modes = eigh(K, M)
    squares[np.abs(squares) <= _ZERO * np.max(np.abs(squares))] = 0.0
    return NormalModes(rest, M, K, squares, modes)


def _linearized_at_equilibrium(
    source: Source, values: dict[str, float]
) -> tuple[dict[str, float], NDArray, NDArray, NDArray]:
    """Equilibrium near a guess, and mass, stiffness -∂f/∂q and damping -∂f/∂q̇ of the forces f there (K eq. 15)."""
    equations = equations_of(source)
    require_independent_coordinates(equations, "an equilibrium")
    m, f = equations.mechanism, equations.forces
    still = ca.vertcat(m.free.q_dot, m.active.s_dot, m.active.s_ddot)
    moving = [name for name in map(str, ca.vertsplit(still)) if values.get(name)]
    if moving or m.internal_states:
        moving = moving or [item.name for item in m.internal_states]
        raise ComponentError(
            f"{equations.name}: an equilibrium is at rest, which leaves out {', '.join(moving)}; simulate the mechanism"
        )
    require_free_coordinates(equations, "an equilibrium")
    at_rest = ca.substitute(
        ca.horzcat(f, -ca.jacobian(f, m.free.q), equations.mass_matrix, -ca.jacobian(f, m.free.q_dot)),
        still,
        ca.SX.zeros(still.shape),
    )
    function = ca.Function("at_rest", [m.free.q], [ca.densify(with_values(equations, at_rest, values, m.free.q))])
    names, numbers = [item.name for item in m.coordinates], symbol_values(equations, values)
    q = np.array([float(numbers[name]) for name in names])

    for _ in range(_ROUNDS):
        force, K, M, B = np.split(np.asarray(function(q)), np.arange(3) * q.size + 1, axis=1)
        if not np.all(np.isfinite(K)):
            break
        step = np.linalg.lstsq(K, force[:, 0], rcond=_ZERO)[0]
        q = q + step
        size, rest = np.max(np.abs(step)), np.max(np.abs(force[:, 0] - K @ step))  # along a zero mode forces rest
        balanced = rest <= 1e-9 * (np.max(np.abs(K)) * (1 + size) + 1e-300)
        if size <= 1e-13 * (1 + np.max(np.abs(q))) and balanced:
            return dict(zip(names, q.tolist(), strict=True)), M, (K + K.T) / 2, B
    guess = ", ".join(f"{name} = {numbers[name]:g}" for name in names)
    raise ComponentError(f"{equations.name}: no equilibrium found from the guess {guess}; start nearer to one")
