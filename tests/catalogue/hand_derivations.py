"""Newton's and Euler's laws written down by hand, part by part; a plane vector (x, z) or (x, y) is x + i z.

Nothing here knows of a Lagrangian: accelerations come from the product rule, forces from force and moment balances, the
operator's forces from d'Alembert's principle.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from on_paper import State, cross, defaults, dot, equations_of, random_states, vector
from scipy.spatial.transform import Rotation

from liaisons.language import Mechanism, Orientation
from liaisons.models import (
    CATALOGUE,
    ChargedParticle,
    CircularHoop,
    DoublePendulum,
    EllipticHoop,
    Flywheel,
    FourierHoop,
    FreeParticle,
    Junction,
    KeplerOrbit,
    LinearMolecule,
    NoseHooverOscillator,
    Oscillator,
    Pendulum,
    PlanarCat,
    PlanarOscillator,
    PolarOscillator,
    Satellite,
    Swing,
)
from liaisons_catalogue.hoop import Hoop

Hand = dict[str, Any]  # by quantity or output


def turning(
    radius: float, rate: float, acceleration: float, r_dot: float = 0.0, r_ddot: float = 0.0
) -> tuple[complex, complex]:
    """Velocity and acceleration of radius · e^(iφ) in units of e^(iφ)."""
    return r_dot + 1j * radius * rate, r_ddot - radius * rate**2 + 1j * (radius * acceleration + 2 * r_dot * rate)


def applied(n: State, *coordinates: str) -> NDArray:
    """Drives less loads."""
    return np.array([n[f"{q}_force"] - n[f"{q}_load"] for q in coordinates])


# ---- plane mechanisms --------------------------------------------------------------------------------------------


def pendulum(n: State) -> Hand:
    along = -1j * np.exp(1j * n.theta)  # unit vector of the rod; i · along points the way of growing theta
    across = 1j * along
    velocity = n.pivot_x_dot + 1j * n.pivot_z_dot + along * turning(n.length, n.theta_dot, 0.0, n.length_dot)[0]
    # all forces on the bob but the rod's
    force = -1j * n.mass * n.gravity - n.mass * n.friction * velocity - (n.bob_x_load + 1j * n.bob_z_load)

    def acceleration(theta_ddot: float) -> complex:
        pivot = n.pivot_x_ddot + 1j * n.pivot_z_ddot
        return pivot + along * turning(n.length, n.theta_dot, theta_ddot, n.length_dot, n.length_ddot)[1]

    missing = dot(across, force - n.mass * acceleration(0.0)) + applied(n, "theta")[0] / n.length
    theta_ddot = missing / (n.mass * n.length)
    needed = n.mass * acceleration(theta_ddot) - force  # from the operator, and through the couple
    return {
        "accelerations": theta_ddot,
        "momenta": n.mass * n.length * dot(across, velocity),
        "operator_forces": [dot(along, needed), needed.real, needed.imag],
        "tension": -dot(along, needed),
    }


def oscillator(n: State) -> Hand:
    """K eq. 114."""
    spring = -n.stiffness * (n.x - n.support)
    return {
        "accelerations": (spring + applied(n, "x")[0]) / n.mass - n.damping * n.x_dot,
        "momenta": n.mass * n.x_dot,
        "operator_forces": spring,  # the support has no mass: what holds it pulls the mass
    }


def flywheel(n: State) -> Hand:
    return {
        "accelerations": applied(n, "angle")[0] / n.inertia - n.friction * n.angle_dot,
        "momenta": n.inertia * n.angle_dot,
        "operator_forces": [],
    }


def junction(n: State) -> Hand:
    weight = n.mass * (n.x_ddot + 1j * (n.z_ddot + n.gravity))
    force = weight + n.first_x_load + n.second_x_load + 1j * (n.first_z_load + n.second_z_load)
    return {
        "accelerations": applied(n, "angle")[0] / n.inertia,
        "momenta": n.inertia * n.angle_dot,
        "operator_forces": [force.real, force.imag],
    }


def swing(n: State) -> Hand:
    along, back = -1j * np.exp(1j * n.theta), -1j * np.exp(1j * (n.theta + n.lean))
    seat, torso = n.rope * along, n.rope * along + n.torso_length * back

    def motion(theta_ddot: float) -> NDArray:
        """Velocities and accelerations of seat and torso."""
        first = along * np.array(turning(n.rope, n.theta_dot, theta_ddot, n.rope_dot, n.rope_ddot))
        turn, turn_rate = n.theta_dot + n.lean_dot, theta_ddot + n.lean_ddot
        return np.array([first, first + back * np.array(turning(n.torso_length, turn, turn_rate))]).T

    masses = np.array([n.mass_seat, n.mass_torso])
    loads = np.array([n.seat_x_load + 1j * n.seat_z_load, n.torso_x_load + 1j * n.torso_z_load])

    def missing(theta_ddot: float) -> NDArray:
        """Force on each mass beside gravity and load that this acceleration asks for."""
        return masses * (motion(theta_ddot)[1] + 1j * n.gravity) + loads

    def moment(theta_ddot: float) -> float:
        return cross([seat, torso], missing(theta_ddot)).sum()

    # Balance of angular momentum about the pivot: rope and child exert no moment there but the couple.
    theta_ddot = (applied(n, "theta")[0] - moment(0.0)) / (moment(1.0) - moment(0.0))
    on_seat, on_torso = missing(theta_ddot)
    return {
        "accelerations": theta_ddot,
        "momenta": masses @ cross([seat, torso], motion(0.0)[0]),
        # virtual work: a longer rope shifts both masses along it, a lean turns the torso about the seat
        "operator_forces": [dot(along, on_seat + on_torso), dot(1j * n.torso_length * back, on_torso)],
    }


def double_pendulum(n: State) -> Hand:
    """Both bobs and both massless rods cut free: angular accelerations and tensions from four balances of forces.

    A couple on a massless rod is a pair of forces across it, at its ends.
    """
    m_1, m_2, l_1, l_2, g = n.mass_1, n.mass_2, n.length_1, n.length_2, n.gravity
    along_1, along_2 = -1j * np.exp(1j * n.theta_1), -1j * np.exp(1j * n.theta_2)
    w_1, w_2 = n.theta_1_dot, n.theta_2_dot
    pivot = n.pivot_x_ddot + 1j * n.pivot_z_ddot
    load_1, load_2 = (n[f"bob_{i}_x_load"] + 1j * n[f"bob_{i}_z_load"] for i in (1, 2))
    push_1, push_2 = applied(n, "theta_1", "theta_2") / [l_1, l_2] * 1j * [along_1, along_2]

    def accelerations(alpha_1: float, alpha_2: float) -> tuple[complex, complex]:
        first = pivot + l_1 * along_1 * (1j * alpha_1 - w_1**2)
        return first, first + l_2 * along_2 * (1j * alpha_2 - w_2**2)

    def missing(alpha_1: float, alpha_2: float, pull_1: float, pull_2: float) -> NDArray:
        """Mass × acceleration - force of both bobs, as four real numbers."""
        a_1, a_2 = accelerations(alpha_1, alpha_2)
        first = m_1 * (a_1 + 1j * g) + load_1 + pull_1 * along_1 - pull_2 * along_2 - push_1 + push_2
        second = m_2 * (a_2 + 1j * g) + load_2 + pull_2 * along_2 - push_2
        return np.array([first.real, first.imag, second.real, second.imag])

    zero = missing(0, 0, 0, 0)
    columns = [missing(*unit) - zero for unit in np.eye(4)]
    alpha_1, alpha_2, *_ = np.linalg.solve(np.array(columns).T, -zero)
    a_1, a_2 = accelerations(alpha_1, alpha_2)
    held = m_1 * (a_1 + 1j * g) + load_1 + m_2 * (a_2 + 1j * g) + load_2  # what is not weight or load: the pivot's
    v_1 = n.pivot_x_dot + 1j * n.pivot_z_dot + 1j * l_1 * along_1 * w_1
    v_2 = v_1 + 1j * l_2 * along_2 * w_2
    return {
        "accelerations": [alpha_1, alpha_2],
        "operator_forces": [held.real, held.imag],
        "momenta": [dot(1j * l_1 * along_1, m_1 * v_1 + m_2 * v_2), dot(1j * l_2 * along_2, m_2 * v_2)],
    }


class Bodies:
    """The three bodies of a cat in a state: masses, inertias, and their motion about the common centre of mass."""

    def __init__(self, n: Mapping[str, float]) -> None:
        self.mass, self.inertia = vector(n, "mass_{}", "012"), vector(n, "inertia_{}", "012")
        self.angle, self.spin, self.angular_acceleration = (
            np.array([0.0, n[f"psi_1{order}"], n[f"psi_2{order}"]]) + n[f"phi{order}"]
            for order in ("", "_dot", "_ddot")
        )
        h, c_1, c_2 = n["hinge"], n["arm_1"], n["arm_2"]
        rods = np.array([[0, 0, 0], [h, c_1, 0], [-h, 0, -c_2]]) * np.exp(1j * self.angle)
        self.arms = rods.diagonal()  # from each hinge to the limb's centre of mass
        self.position = self.about_the_centre(rods.sum(1))
        self.velocity = self.about_the_centre(rods @ (1j * self.spin))
        self.acceleration = self.about_the_centre(rods @ (1j * self.angular_acceleration - self.spin**2))

    def about_the_centre(self, vectors: NDArray) -> NDArray:
        return vectors - self.mass @ vectors / self.mass.sum()

    def angular_momentum(self) -> float:
        return float(self.mass @ cross(self.position, self.velocity) + self.inertia @ self.spin)

    def moment(self) -> float:
        """Rate of the angular momentum."""
        return float(self.mass @ cross(self.position, self.acceleration) + self.inertia @ self.angular_acceleration)

    def hinge_torques(self) -> NDArray:
        """Balance of each limb about its hinge; weight and drives of the centre of mass pull on all parts alike."""
        return (self.inertia * self.angular_acceleration + self.mass * cross(self.arms, self.acceleration))[1:]


def planar_cat(n: State) -> Hand:
    total = n.mass_0 + n.mass_1 + n.mass_2
    x, z, couple = applied(n, "com_x", "com_z", "phi")
    without, one_more = (Bodies(n | {"phi_ddot": phi_ddot}).moment() for phi_ddot in (0.0, 1.0))
    phi_ddot = (couple - without) / (one_more - without)
    cat = Bodies(n | {"phi_ddot": phi_ddot})
    energy = (cat.mass @ np.abs(cat.velocity) ** 2 + cat.inertia @ cat.spin**2) / 2
    energy += total * (n.com_x_dot**2 + n.com_z_dot**2) / 2 + total * n.gravity * n.com_z
    return {
        "accelerations": [x / total, z / total - n.gravity, phi_ddot],
        "momenta": [total * n.com_x_dot, total * n.com_z_dot, cat.angular_momentum()],
        "operator_forces": cat.hinge_torques(),
        "energy": energy,
        "angular_momentum": cat.angular_momentum(),
    }


# ---- hoops: curves and their derivatives by the parameter u ------------------------------------------------------

Curve = Callable[[Any], tuple[Any, Any, Any]]  # u, one or many -> OP, dOP/du, d²OP/du²
COEFFICIENTS = [f"{wave}_{k}" for wave in ("cos", "sin") for k in range(1, 5)]


def circle(n: Mapping[str, float]) -> Curve:
    """By the arc length."""

    def curve(xi: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        out = np.exp(1j * xi / n["radius"])
        return n["offset"] + n["radius"] * out, 1j * out, -out / n["radius"]

    return curve


def ellipse(n: Mapping[str, float]) -> Curve:
    a, b, centre = n["semi_axis_a"], n["semi_axis_b"], n["centre_x"] + 1j * n["centre_y"]

    def curve(u: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        radius = a * np.cos(u) + 1j * b * np.sin(u)
        return centre + radius, -a * np.sin(u) + 1j * b * np.cos(u), -radius

    return curve


def fourier(n: Mapping[str, float]) -> Curve:
    k = np.arange(1, 5)
    amplitude = np.array([n.get(f"cos_{i}", 0) - 1j * n.get(f"sin_{i}", 0) for i in k])
    radius = n.get("radius", 1.0)

    def curve(u: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        waves = amplitude * np.exp(1j * np.multiply.outer(u, k))
        r, dr, ddr = (radius * np.sum((1j * k) ** order * waves, axis=-1).real for order in range(3))
        r = r + radius
        out = np.exp(1j * u)
        return r * out, (dr + 1j * r) * out, (ddr + 2j * dr - r) * out

    return curve


HOOPS: dict[type[Mechanism], Callable[[Mapping[str, float]], Curve]] = {
    CircularHoop: circle,
    EllipticHoop: ellipse,
    FourierHoop: fourier,
}


def p_xi(component: type[Mechanism]) -> ca.SX:
    """Its expression."""
    equations = equations_of(component)
    return equations.momenta if component is CircularHoop else equations.mechanism.p_xi  # type: ignore[attr-defined]


def on_the_hoop(n: State) -> tuple[Curve, float, float]:
    """Its curve, u and the rate of u, whatever the hoop calls it."""
    q = n.component.coordinates[0].name
    return HOOPS[n.component](n), n[q], n[f"{q}_dot"]


def hoop(n: State) -> Hand:
    curve, u, u_dot = on_the_hoop(n)
    position, first, second = (np.exp(1j * n.beta) * part for part in curve(u))
    load = n.bead_x_load + 1j * n.bead_y_load
    tangent, speed = first / abs(first), abs(first)
    velocity = first * u_dot + 1j * n.beta_dot * position
    without = second * u_dot**2 + 2j * n.beta_dot * first * u_dot + (1j * n.beta_ddot - n.beta_dot**2) * position
    push = applied(n, n.component.coordinates[0].name)[0] / speed  # along the tangent, between hoop and bead
    u_ddot = (push - dot(tangent, n.mass * without + load)) / (n.mass * speed)
    acceleration = without + first * u_ddot
    return {
        "accelerations": u_ddot,
        "momenta": n.mass * dot(first, velocity),
        "operator_forces": n.hoop_inertia * n.beta_ddot + cross(position, n.mass * acceleration + load),
        "normal_force": dot(1j * tangent, n.mass * acceleration),
        **({} if n.component is CircularHoop else {"p_xi": n.mass * dot(tangent, velocity)}),
    }


# ---- points in space and on lines --------------------------------------------------------------------------------


def lorentz_force(n: State) -> NDArray:
    """K eq. 21."""
    return n.charge * (vector(n, "E_{}") + np.cross(vector(n, "{}_dot"), vector(n, "B_{}")))


def free_particle(n: State) -> Hand:
    a = applied(n, *"xyz") / n.mass - n.friction * vector(n, "{}_dot")
    return {"accelerations": a - [0, 0, n.gravity]}


def charged_particle(n: State) -> Hand:
    return {"accelerations": (lorentz_force(n) + applied(n, *"xyz")) / n.mass}


def kepler_orbit(n: State) -> Hand:
    r = vector(n, axes="xy")
    return {"accelerations": applied(n, *"xy") / n.mass - n.mu * r / np.hypot(*r) ** 3}


def planar_oscillator(n: State) -> Hand:
    return {"accelerations": (applied(n, *"xy") - n.stiffness * vector(n, axes="xy")) / n.mass}


def polar_oscillator(n: State) -> Hand:
    """In the complex plane: (r e^iφ)'' e^-iφ = r'' - r φ'² + i (r φ'' + 2 r' φ')."""
    push, couple = applied(n, "r", "phi")
    return {
        "accelerations": [
            (push - n.stiffness * n.r) / n.mass + n.r * n.phi_dot**2,
            (couple / n.r / n.mass - 2 * n.r_dot * n.phi_dot) / n.r,  # the couple as a force
        ],
        "momenta": [n.mass * n.r_dot, n.mass * n.r**2 * n.phi_dot],  # K eq. 42
    }


ATOMS = (1, 2, 3)


def molecule_matrices(n: Mapping[str, float]) -> tuple[NDArray, NDArray]:
    """M and K of K eq. 155 and 154."""
    M = np.diag([n["mass_outer"], n["mass_inner"], n["mass_outer"]])
    return M, n["stiffness"] * np.array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])


def displacements(n: State) -> NDArray:
    """u = X - X⁰ with X⁰ = (0, L, 2L)."""
    return np.array([n[f"x_{i}"] - (i - 1) * n.spacing for i in ATOMS])


def linear_molecule(n: State) -> Hand:
    """M u'' + K u = F (K eq. 137), the spacing only shifting the positions."""
    (M, K), u = molecule_matrices(n), displacements(n)
    force = applied(n, "x_1", "x_2", "x_3") - K @ u
    return {"accelerations": np.linalg.solve(M, force), "potential_energy": u @ K @ u / 2}  # K eq. 153


def nose_hoover_oscillator(n: State) -> Hand:
    force = applied(n, "q")[0] - n.stiffness * n.q - n.xi * n.mass * n.q_dot
    heat = n.mass * n.q_dot**2 - n.thermal_energy
    return {"accelerations": force / n.mass, "internal_rates": [heat / n.thermostat_mass, n.xi]}


# ---- satellite ---------------------------------------------------------------------------------------------------

QUATERNION, RATES, MOMENTA = Orientation.quaternion, Orientation.rates, Orientation.momenta
WHEELS = ("wheel_1", "wheel_2", "wheel_3")


def numbers(n: Any, names: Any) -> NDArray:
    return np.array([n[name] for name in names])


def rotation(n: Any) -> Rotation:
    """Body to inertial frame; one, or one a sample."""
    return Rotation.from_quat(np.moveaxis(numbers(n, QUATERNION), 0, -1), scalar_first=True)


def tensor(n: Mapping[str, float]) -> NDArray:
    n = defaults(Satellite) | dict(n)
    return np.array([numbers(n, [f"J_{''.join(sorted(i + j))}" for j in "xyz"]) for i in "xyz"])


def satellite(n: State) -> Hand:
    """J ω' + J_w φ'' = (J ω + J_w φ') × ω;  λ_k = J_w (φ_k'' + a_k·ω')."""
    omega = numbers(n, RATES)
    spin, push = (np.array([n[w + end] for w in WHEELS]) for end in ("_dot", "_ddot"))
    J = tensor(n)
    omega_dot = np.linalg.solve(J, np.cross(J @ omega + n.J_wheel * spin, omega) - n.J_wheel * push)
    body = J - n.J_wheel * np.eye(3)
    return {
        "accelerations": omega_dot,
        "operator_forces": n.J_wheel * (push + omega_dot),
        "momentum_rates": np.zeros(3),
        "momenta": J @ omega + n.J_wheel * spin,  # in the body frame
        "kinetic_energy": (omega @ body @ omega + n.J_wheel * np.sum((omega + spin) ** 2)) / 2,
    }


# ---- all ---------------------------------------------------------------------------------------------------------

BY_HAND: dict[type[Mechanism], Callable[[State], Hand]] = {
    Pendulum: pendulum,
    Oscillator: oscillator,
    Flywheel: flywheel,
    Junction: junction,
    Swing: swing,
    DoublePendulum: double_pendulum,
    PlanarCat: planar_cat,
    CircularHoop: hoop,
    EllipticHoop: hoop,
    FourierHoop: hoop,
    FreeParticle: free_particle,
    ChargedParticle: charged_particle,
    KeplerOrbit: kepler_orbit,
    PlanarOscillator: planar_oscillator,
    PolarOscillator: polar_oscillator,
    LinearMolecule: linear_molecule,
    NoseHooverOscillator: nose_hoover_oscillator,
    Satellite: satellite,
}


def states(component: type[Mechanism], count: int = 20, /, **fixed: float) -> Iterator[State]:
    """Random states off singularities: hoops go round O, r > 0, quaternions have the norm 1."""
    for n in random_states(component, count, **fixed):
        if issubclass(component, Hoop):
            scale = 0.1 if component is EllipticHoop else 0.05
            n.update({name: n[name] * scale for name in ("centre_x", "centre_y", *COEFFICIENTS) if name in n})
        if "mu_static" in n:
            n["mu_static"] += n.mu_sliding
        if "r" in n:
            n["r"] = abs(n.r) + 0.1
        for orientation in component.orientations:
            q = np.array([n[name] for name in orientation.quaternion])
            n.update(zip(orientation.quaternion, q / np.linalg.norm(q), strict=True))
        yield n


MECHANISMS = [  # those whose coordinates may take any values; the others have tests of their own
    c
    for c in CATALOGUE
    if issubclass(c, Mechanism) and not (c.constraints or c.non_holonomic or c.rheonomic_constraints)
]
WITHOUT_ORIENTATION = [c for c in MECHANISMS if not c.orientations]
SMOOTH = [c for c in WITHOUT_ORIENTATION if not c.contact_names()]  # no contacts, and so no events
