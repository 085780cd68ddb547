"""The derived equations against Newton's law written down by hand, part by part, in complex plane vectors.

A plane vector (x, z) or (x, y) is the complex number x + i z.  Nothing here knows of a Lagrangian: accelerations come
from the product rule, forces from force and moment balances, the operator's forces from d'Alembert's principle.
"""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest

from liaisons.language import Mechanism
from liaisons.mechanics import derive
from liaisons.models import Flywheel, Junction, Oscillator, Pendulum, Swing

Hand = dict[str, np.ndarray]


def dot(a: complex, b: complex) -> float:
    """Scalar product of two plane vectors."""
    return (a.conjugate() * b).real


def cross(a: complex, b: complex) -> float:
    """Moment a × b, counter-clockwise positive."""
    return (a.conjugate() * b).imag


def turning(radius: float, rate: float, acceleration: float, n: SimpleNamespace) -> tuple[complex, complex]:
    """Velocity and acceleration of radius · e^(iφ) in units of e^(iφ), the radius changing as n.r_dot, n.r_ddot."""
    return (
        n.r_dot + 1j * radius * rate,
        n.r_ddot - radius * rate**2 + 1j * (radius * acceleration + 2 * n.r_dot * rate),
    )


RIGID = SimpleNamespace(r_dot=0.0, r_ddot=0.0)


def pendulum(n: SimpleNamespace) -> Hand:
    along = -1j * np.exp(1j * n.theta)  # unit vector of the rod; i · along points the way of growing theta
    across = 1j * along
    rod = SimpleNamespace(r_dot=n.length_dot, r_ddot=n.length_ddot)
    velocity = n.pivot_x_dot + 1j * n.pivot_z_dot + along * turning(n.length, n.theta_dot, 0.0, rod)[0]
    # all forces on the bob but the rod's
    force = -1j * n.mass * n.gravity - n.mass * n.friction * velocity - (n.bob_x_load + 1j * n.bob_z_load)
    couple = n.theta_force - n.theta_load

    def acceleration(theta_ddot: float) -> complex:
        pivot = n.pivot_x_ddot + 1j * n.pivot_z_ddot
        return pivot + along * turning(n.length, n.theta_dot, theta_ddot, rod)[1]

    missing = dot(across, force - n.mass * acceleration(0.0)) + couple / n.length
    theta_ddot = missing / (n.mass * n.length)
    needed = n.mass * acceleration(theta_ddot) - force  # from the operator, and through the couple
    return {
        "accelerations": np.array([theta_ddot]),
        "momenta": np.array([n.mass * n.length * dot(across, velocity)]),
        "operator_forces": np.array([dot(along, needed), needed.real, needed.imag]),
    }


def oscillator(n: SimpleNamespace) -> Hand:
    spring = -n.stiffness * (n.x - n.support)
    force = spring - n.mass * n.damping * n.x_dot + n.x_force - n.x_load
    return {
        "accelerations": np.array([force / n.mass]),
        "momenta": np.array([n.mass * n.x_dot]),
        "operator_forces": np.array([spring]),  # the support has no mass: what holds it pulls the mass
    }


def flywheel(n: SimpleNamespace) -> Hand:
    torque = n.angle_force - n.angle_load - n.friction * n.inertia * n.angle_dot
    return {
        "accelerations": np.array([torque / n.inertia]),
        "momenta": np.array([n.inertia * n.angle_dot]),
        "operator_forces": np.array([]),
    }


def junction(n: SimpleNamespace) -> Hand:
    weight = n.mass * (n.x_ddot + 1j * (n.z_ddot + n.gravity))
    force = weight + n.first_x_load + n.second_x_load + 1j * (n.first_z_load + n.second_z_load)
    return {
        "accelerations": np.array([(n.angle_force - n.angle_load) / n.inertia]),
        "momenta": np.array([n.inertia * n.angle_dot]),
        "operator_forces": np.array([force.real, force.imag]),
    }


def swing(n: SimpleNamespace) -> Hand:
    along = -1j * np.exp(1j * n.theta)
    back = -1j * np.exp(1j * (n.theta + n.lean))
    rope = SimpleNamespace(r_dot=n.rope_dot, r_ddot=n.rope_ddot)
    seat, torso = n.rope * along, n.rope * along + n.torso_length * back

    def motion(theta_ddot: float) -> list[tuple[complex, complex]]:
        first = [along * part for part in turning(n.rope, n.theta_dot, theta_ddot, rope)]
        turn, turn_rate = n.theta_dot + n.lean_dot, theta_ddot + n.lean_ddot
        second = [back * part for part in turning(n.torso_length, turn, turn_rate, RIGID)]
        return [(first[0], first[1]), (first[0] + second[0], first[1] + second[1])]

    masses = (n.mass_seat, n.mass_torso)
    loads = (n.seat_x_load + 1j * n.seat_z_load, n.torso_x_load + 1j * n.torso_z_load)

    def missing(theta_ddot: float) -> list[complex]:
        """Force on each mass beside gravity and load that this acceleration asks for."""
        return [
            mass * (acceleration + 1j * n.gravity) + load
            for mass, (_, acceleration), load in zip(masses, motion(theta_ddot), loads, strict=True)
        ]

    def moment(theta_ddot: float) -> float:
        on_seat, on_torso = missing(theta_ddot)
        return cross(seat, on_seat) + cross(torso, on_torso)

    # Balance of angular momentum about the pivot: rope and child exert no moment there but the couple.
    couple = n.theta_force - n.theta_load
    theta_ddot = (couple - moment(0.0)) / (moment(1.0) - moment(0.0))
    on_seat, on_torso = missing(theta_ddot)
    velocities = [velocity for velocity, _ in motion(0.0)]
    return {
        "accelerations": np.array([theta_ddot]),
        "momenta": np.array([n.mass_seat * cross(seat, velocities[0]) + n.mass_torso * cross(torso, velocities[1])]),
        # virtual work: a longer rope shifts both masses along it, a lean turns the torso about the seat
        "operator_forces": np.array([dot(along, on_seat + on_torso), dot(1j * n.torso_length * back, on_torso)]),
    }


BY_HAND: dict[type[Mechanism], Callable[[SimpleNamespace], Hand]] = {
    Pendulum: pendulum,
    Oscillator: oscillator,
    Flywheel: flywheel,
    Junction: junction,
    Swing: swing,
}


@pytest.mark.parametrize("component", BY_HAND, ids=lambda component: component.__name__)
def test_motion_and_operator_forces_are_those_of_newton(component, random_states) -> None:
    equations = derive(component)
    for state in random_states(equations):
        by_hand = BY_HAND[component](SimpleNamespace(**state))
        for quantity in ("accelerations", "momenta", "operator_forces"):
            derived = equations.evaluate(quantity, **state)
            # Two evaluation orders of sums of ten terms: some ten roundings of the largest, which random states
            # make up to ten times the result.
            np.testing.assert_allclose(derived, by_hand[quantity].reshape(derived.shape), rtol=1e-12, atol=1e-11)


@pytest.mark.parametrize("component", [c for c in BY_HAND if c.actives], ids=lambda component: component.__name__)
def test_effective_mass_is_the_force_that_one_more_unit_of_acceleration_asks_for(component, random_states) -> None:
    """M eq. 50: the columns of Θ are differences of the forces by hand, which are linear in σ''."""
    equations = derive(component)
    accelerations = [f"{active.name}_ddot" for active in component.actives]
    for state in random_states(equations):
        at_rest = state | dict.fromkeys(accelerations, 0.0)
        zero = BY_HAND[component](SimpleNamespace(**at_rest))["operator_forces"]
        columns = [
            BY_HAND[component](SimpleNamespace(**(at_rest | {name: 1.0})))["operator_forces"] - zero
            for name in accelerations
        ]
        derived = equations.evaluate("effective_mass", **state)
        # Differences of forces of up to 1e4 N: roundings of 1e-12.
        np.testing.assert_allclose(
            np.atleast_2d(derived), np.array(columns).T.reshape(np.atleast_2d(derived).shape), atol=1e-10, rtol=0
        )


def test_tension_is_the_pull_of_the_rod(random_states, number) -> None:
    equations = derive(Pendulum)
    for state in random_states(equations):
        pull = -pendulum(SimpleNamespace(**state))["operator_forces"][0]
        # as above
        assert number(equations, equations.mechanism.tension, state) == pytest.approx(pull, rel=1e-12, abs=1e-11)
