"""The mass matrix of a SCARA robot."""

import numpy as np
from numpy.typing import NDArray

from liaisons.closed_forms import Values, closed_form


@closed_form("the mass matrix of shoulder, elbow and turn (Spong, Hutchinson, Vidyasagar, 6.4)")
def mass_matrix(elbow: float, at: Values) -> NDArray:
    """Return the mass matrix at the angle of the elbow [rad], (3, 3)."""
    a_1, a_2, c_1, c_2 = at.elbow_at_x, at.shift_at_x, at.inner_centre_x, at.outer_centre_x
    m_1, m_2, m, J = at.inner_mass, at.outer_mass, at.quill_mass, at.quill_inertia_zz
    second = at.outer_inertia_zz + m_2 * c_2**2 + m * a_2**2 + J
    h = (m_2 * c_2 + m * a_2) * a_1 * np.cos(elbow)
    first = at.inner_inertia_zz + m_1 * c_1**2 + (m_2 + m) * a_1**2 + second + 2 * h
    return np.array([[first, second + h, J], [second + h, second, J], [J, J, J]])
