"""Unit quaternions in NumPy, scalar first, shape (4, ...): q turns a vector of the body into the fixed frame."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation


def product(*factors: NDArray) -> NDArray:
    """Product q_1 q_2 ... of quaternions, the rotation q_1 after q_2 after ...; factors (4,) and (4, ...) broadcast."""
    w, x, y, z = factors[0]
    for a, b, c, d in factors[1:]:
        w, x, y, z = (
            w * a - x * b - y * c - z * d,
            w * b + x * a + y * d - z * c,
            w * c - x * d + y * a + z * b,
            w * d + x * c - y * b + z * a,
        )
    return np.stack(np.broadcast_arrays(w, x, y, z))


def conjugate(q: NDArray) -> NDArray:
    """Conjugate of a unit quaternion, its inverse."""
    return np.concatenate([q[:1], -q[1:]])


def about_axis(axis: int, angle: ArrayLike) -> NDArray:
    """Quaternion of the rotation by an angle [rad], of any shape, about axis 0, 1 or 2; continuous in the angle."""
    half = np.asarray(angle, dtype=float) / 2
    q = np.zeros((4, *half.shape))
    q[0], q[1 + axis] = np.cos(half), np.sin(half)
    return q


def exponential(vector: NDArray) -> NDArray:
    """Quaternion of the rotation by a rotation vector [rad], shape (3, ...); continuous in the vector."""
    half = np.linalg.norm(vector, axis=0) / 2
    return np.concatenate([np.cos(half)[None], np.sinc(half / np.pi) * vector / 2])


def quaternion_of_matrix(matrix: NDArray) -> NDArray:
    """Unit quaternion of a rotation matrix, shape (3, 3), of either sign."""
    return np.roll(Rotation.from_matrix(matrix).as_quat(), 1)


def unit_quaternion(q: ArrayLike) -> NDArray:
    """Quaternion divided by its norm."""
    q = np.asarray(q, dtype=float)
    return q / np.linalg.norm(q)
