"""The flywheel: one angle, one inertia."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from liaisons.mechanics import Coordinate, Experiment, Mechanism, Parameter
from liaisons.models._linear import oscillation
from liaisons.models._validity import require_not_negative, require_positive


class Flywheel(Mechanism):
    """Wheel on a fixed shaft; the motor's shaft in a composition.

    ::

        I φ'' = τ - η I φ'

    φ [rad] angle, I [kg.m2] moment of inertia, τ [N.m] torque on the port of the angle, η [1/s] friction.
    The simplest case of K eq. 65 and 66: T = I φ'²/2, V = 0.
    """

    inertia = Parameter(1.0, "kg.m2", "moment of inertia about the shaft", above=0)
    friction = Parameter(0.0, "1/s", "friction coefficient eta of K eq. 61", minimum=0, tunable=True)
    angle = Coordinate("rad", "angle of the wheel", start_rate=1.0)
    experiment = Experiment(stop_time=10.0, step_size=0.01, reference={"angle_force": 1.0, "friction": 0.2})

    def kinetic_energy(self) -> ca.SX:
        return self.inertia / 2 * self.dot(self.angle) ** 2

    def friction_coefficient(self) -> ca.SX:
        return self.friction

    @staticmethod
    def exact(
        t: ArrayLike,
        *,
        angle_0: float = 0.0,
        angle_dot_0: float = 1.0,
        inertia: float = 1.0,
        friction: float = 0.0,
        angle_force: float = 0.0,
    ) -> dict[str, NDArray]:
        """Motion under a constant torque ``angle_force``; without it an exponential run-down.

        :param t: times since the start [s], any shape, >= 0.
        :returns: ``angle`` [rad], ``angle_dot`` [rad/s].
        :raises ValidityError: for inertia <= 0, negative friction or times.
        """
        require_positive("Flywheel.exact", inertia=inertia)
        require_not_negative("Flywheel.exact", friction=friction, t=float(np.min(t)))
        forces = [(angle_force / inertia, 0.0)]
        angle, rate = oscillation(t, angle_0, angle_dot_0, omega_squared=0.0, gamma=friction, forces=forces)
        return {"angle": angle, "angle_dot": rate}
