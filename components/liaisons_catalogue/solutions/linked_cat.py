"""The linked cat with its limbs held still."""

import numpy as np
from numpy.typing import NDArray

from liaisons.closed_forms import Values, closed_form


@closed_form("with the limbs held still a parabola of the centre of mass, and a uniform turn about it")
def exact(t: NDArray, at: Values) -> dict[str, NDArray]:
    m_0, m_1, m_2 = at.array("trunk_mass", "limb_1_mass", "limb_2_mass")
    limbs = m_1 * (at.psi_1_at_x + at.limb_1_centre_x * np.exp(1j * at.psi_1))
    limbs += m_2 * (at.psi_2_at_x + at.limb_2_centre_x * np.exp(1j * at.psi_2))
    centre = limbs / (m_0 + m_1 + m_2)  # from the trunk's, along its axes

    angle, rate = at.fall_angle_0, at.fall_angle_dot_0
    turned = angle + rate * t
    lever = centre * np.exp(1j * angle)
    velocity = complex(at.fall_x_dot_0, at.fall_y_dot_0) + 1j * rate * lever
    mass_centre = complex(at.fall_x_0, at.fall_y_0) + lever + velocity * t - 0.5j * at.gravity * t**2
    position = mass_centre - centre * np.exp(1j * turned)
    return {"fall_x": position.real, "fall_y": position.imag, "fall_angle": turned}
