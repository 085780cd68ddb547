"""A satellite turned by its wheels (M 8.3): Euler's top with locked wheels, slews from rest, and any rates."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.closed_forms import Values, closed_form
from liaisons.language import Orientation
from liaisons_catalogue.solutions import rotations
from liaisons_catalogue.solutions.euler_top import euler_top
from liaisons_catalogue.solutions.integration import integrate

TENSOR = ("J_xx", "J_xy", "J_xz", "J_xy", "J_yy", "J_yz", "J_xz", "J_yz", "J_zz")
"""Elements of the inertia tensor, row by row."""


def _inertia(at: Values) -> NDArray:
    """Inertia tensor J [kg.m2], (3, 3); raise a ValidityError unless it is positive definite."""
    J = at.array(*TENSOR).reshape(3, 3)
    at.require(np.all(np.linalg.eigvalsh(J) > 0), f"J = {J.tolist()} must be positive definite")
    return J


def _start_attitude(at: Values) -> NDArray:
    """Unit quaternion of the attitude at the start, (4,)."""
    return rotations.unit_quaternion(at.array(*(f"{name}_0" for name in Orientation.quaternion)))


@closed_form("with the wheels locked Euler's top, by elliptic functions, attitude included")
def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
    omega, q = euler_top(t, _inertia(at), at.array("omega_x_0", "omega_y_0", "omega_z_0"), _start_attitude(at))
    return dict(zip((*Orientation.rates, *Orientation.quaternion), (*omega, *q), strict=True))


@closed_form("from rest, the wheels turned in proportion: a rotation by -J⁻¹ J_wheel Δφ")
def slew(
    turn_1: ArrayLike = 0,
    turn_2: ArrayLike = 0,
    turn_3: ArrayLike = 0,
    *,
    at: Values,
    start: ArrayLike = (1.0, 0.0, 0.0, 0.0),
) -> dict[str, NDArray]:
    """Return the attitude, ``start`` before, after turns (turn_1, turn_2, turn_3) [rad] of the wheels, any shape."""
    turns = np.stack(np.broadcast_arrays(turn_1, turn_2, turn_3))
    vector = -at.J_wheel * np.tensordot(np.linalg.inv(_inertia(at)), turns, 1)
    q = rotations.product(rotations.unit_quaternion(start), rotations.exponential(vector))
    return dict(zip(Orientation.quaternion, q, strict=True))


@closed_form("the motors' torques in a slew, λ = J_wheel (φ'' + ω') = J_wheel (1 - J_wheel J⁻¹) φ''")
def slew_torque(
    push_1: ArrayLike = 0, push_2: ArrayLike = 0, push_3: ArrayLike = 0, *, at: Values
) -> dict[str, NDArray]:
    """Return the torques [N.m] that accelerate the wheels by φ'' = (push_1, push_2, push_3) [rad/s2], of any shape."""
    push = np.stack(np.broadcast_arrays(push_1, push_2, push_3)).astype(float)
    turning = np.tensordot(np.linalg.inv(_inertia(at)), at.J_wheel * push, 1)
    return {f"wheel_{k}_force": row for k, row in enumerate(at.J_wheel * (push - turning), 1)}


@closed_form("without angular momentum, the wheels turned at any rates: ω = -J⁻¹ J_wheel φ', integrated at 1e-13")
def steered(t: NDArray, at: Values, *, wheels: Callable[[float], ArrayLike]) -> dict[str, NDArray]:
    """Return the attitude; ``wheels`` takes an instant to the rates φ' [rad/s], (3,), without jumps."""
    follows = -at.J_wheel * np.linalg.inv(_inertia(at))

    def rates(t: float, q: NDArray) -> NDArray:
        """Rate of the attitude."""
        return rotations.product(q, np.concatenate([[0.0], follows @ np.asarray(wheels(t), dtype=float) / 2]))

    q = integrate(at, rates, _start_attitude(at), t, longest=float(np.max(t, initial=1e-300)) / 400)
    return dict(zip(Orientation.quaternion, q, strict=True))
