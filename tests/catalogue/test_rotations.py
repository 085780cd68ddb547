"""Satellite and SpatialCat: attitude, momentum, motor torques, and the turns that shape alone brings about, M 8.2-8.3.

Rotations are compared as matrices (q and -q are the same one), by SciPy and not by the package's own algebra.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hand_derivations import MOMENTA, QUATERNION, RATES, numbers, rotation, satellite, states, tensor
from numpy.typing import ArrayLike, NDArray
from on_paper import Values, algebra, run, smooth_step, unloaded
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from liaisons.check import max_error
from liaisons_catalogue.satellite import Satellite
from liaisons_catalogue.solutions import rotations
from liaisons_catalogue.solutions.euler_top import euler_top
from liaisons_catalogue.spatial_cat import SpatialCat


def turns(n: Any) -> NDArray:
    return rotation(n).as_matrix()


# ---- satellite: Euler's equations ---------------------------------------------------------------------------------


def test_rates_of_the_satellite_follow_from_its_momentum() -> None:
    for n in states(Satellite, 10):
        n.update(zip(MOMENTA, rotation(n).apply(satellite(n)["momenta"]), strict=True))
        assert n("velocities") == algebra(numbers(n, RATES))


# ---- satellite: wheels locked -------------------------------------------------------------------------------------

TOPS: dict[str, Values] = {
    "about the least axis": {"omega_x_0": 0.2, "omega_y_0": 0.3, "omega_z_0": 1.0},
    "about the largest axis": {"omega_x_0": -0.2, "omega_y_0": -1.0, "omega_z_0": 0.3},
    "nearly about the middle axis": {"omega_x_0": 1.0, "omega_y_0": 1e-3, "omega_z_0": 2e-3},
    "symmetric": {"J_xx": 10.0, "J_yy": 10.0, "omega_x_0": 0.5, "omega_y_0": -0.3, "omega_z_0": 0.8},
    "flat": {"J_xx": 6.0, "J_yy": 6.0, "J_zz": 11.0, "omega_x_0": 0.5, "omega_y_0": -0.3, "omega_z_0": -0.8},
    "sphere": {"J_xx": 9.0, "J_yy": 9.0, "J_zz": 9.0, "omega_x_0": 0.5, "omega_y_0": -0.3, "omega_z_0": 0.8},
    "steady": {"omega_y_0": 0.7},
    "any axes": {"J_xy": 1.0, "J_xz": -0.5, "J_yz": 0.3, "omega_x_0": 0.5, "omega_y_0": 0.6, "omega_z_0": -0.8}
    | {"q_w_0": 0.5, "q_x_0": -0.5, "q_y_0": 0.1, "q_z_0": 0.7},
}


@pytest.mark.parametrize("start", TOPS.values(), ids=TOPS)
def test_euler_top_solves_the_equations_of_motion(start: Values) -> None:
    """ω and attitude by Jacobi's functions and Legendre's third integral, against an integration at 1e-13."""
    times = np.linspace(-5, 60, 66)
    exact = Satellite.exact(times, **start)
    J = tensor(start)

    def rates(_: float, y: NDArray) -> NDArray:
        (w, x, b, z), omega = y[:4], y[4:]
        spin = np.array([[-x, -b, -z], [w, -z, b], [z, w, -x], [-b, x, w]]) @ omega / 2
        return np.array([*spin, *np.linalg.solve(J, np.cross(J @ omega, omega))])

    names = (*QUATERNION, *RATES)
    at_start = numbers(exact, names)[:, 0]
    reference = solve_ivp(rates, (-5, 60), at_start, "DOP853", times, rtol=1e-13, atol=1e-15).y
    # A hundred of its tolerances over 65 s; passing the middle axis four times multiplies errors by 1000 each way.
    allowed = 1e-9 if start == TOPS["nearly about the middle axis"] else 2e-12
    for name, values in zip(names, reference, strict=True):
        np.testing.assert_allclose(exact[name], values, rtol=0, atol=allowed, err_msg=name)
    given = np.array([start.get(f"{name}_0", float(name == "q_w")) for name in names])
    given[:4] /= np.linalg.norm(given[:4])
    here = Satellite.exact(0.0, **start)
    np.testing.assert_allclose(numbers(here, names), given, rtol=0, atol=1e-14)  # a few roundings
    norm = np.linalg.norm(numbers(exact, QUATERNION), axis=0)
    np.testing.assert_allclose(norm, 1, rtol=1e-14)  # a product of five unit quaternions


@pytest.mark.parametrize(("along", "tilt"), [(11.0, 1e-9), (11.0, 0.7), (3.0, 0.7), (3.0, np.pi / 2)])
def test_symmetric_top_precesses_regularly(along: float, tilt: float) -> None:
    """Two equal moments A: a turn by H/A about H after one by (1 - C/A) ω·n about the axis n, which may point anywhere.

    ω and H have nearly one direction next to it, and one at a right angle.
    """
    across, t, size = 7.0, np.linspace(-20, 20, 41), 0.9
    to_body = Rotation.from_rotvec([0.4, -1.1, 0.3])
    axis, rate = to_body.apply([0, 0, 1]), size * to_body.apply([np.sin(tilt), 0, np.cos(tilt)])
    inertia = across * np.eye(3) + (along - across) * np.outer(axis, axis)
    omega, q = euler_top(t, inertia, rate, np.array([0.5, 0.5, -0.5, 0.5]))
    spin = np.outer((1 - along / across) * (rate @ axis) * t, axis)
    np.testing.assert_allclose(omega.T, Rotation.from_rotvec(-spin).apply(rate), rtol=0, atol=1e-12)
    precession = Rotation.from_rotvec(np.outer(t, inertia @ rate / across))
    expected = Rotation.from_quat([0.5, -0.5, 0.5, 0.5]) * precession * Rotation.from_rotvec(spin)
    found = Rotation.from_quat(q[[1, 2, 3, 0]].T)
    np.testing.assert_allclose(found.as_matrix(), expected.as_matrix(), rtol=0, atol=1e-12)  # 18 rad, rounded


# ---- cat: its parts ----------------------------------------------------------------------------------------------


def halves(n: Any, bend: NDArray, azimuth: NDArray, twist: NDArray) -> tuple[Rotation, Rotation, NDArray, NDArray]:
    """Attitudes of A and B and positions of their centres relative to the joint; d = 0.2 m."""
    attitude_a = rotation(n)
    shape = Rotation.from_euler("ZXZ", np.stack([azimuth, bend, twist - azimuth], axis=-1))
    attitude_b = attitude_a * shape
    return attitude_a, attitude_b, -attitude_a.apply([0, 0, 0.2]), attitude_b.apply([0, 0, 0.2])


@pytest.mark.parametrize("seed", range(5))
def test_kinetic_energy_of_the_cat_is_that_of_its_parts(seed: int) -> None:
    """From finite differences of two rigid bodies' positions and attitudes: no formula for an angular velocity."""
    n = [*states(SpatialCat, 5, joint_distance=0.2)][seed]
    h, half = 1e-5, 1e-5 / 2

    def at(t: float) -> tuple[Rotation, Rotation, NDArray, NDArray]:
        turned = rotation(n) * Rotation.from_rotvec(t * numbers(n, RATES))
        q = dict(zip(QUATERNION, turned.as_quat(scalar_first=True), strict=True))
        return halves(q, *(np.array(n[s] + t * n[f"{s}_dot"]) for s in ("bend", "azimuth", "twist")))

    after, before = at(half), at(-half)
    energy = n.mass * sum(n[f"com_{q}_dot"] ** 2 for q in "xyz")
    apart = ((after[3] - after[2]) - (before[3] - before[2])) / h
    energy += n.mass / 4 * apart @ apart
    moments = np.array([n.inertia_transverse, n.inertia_transverse, n.inertia_axial])
    for then, now in ((before[0], after[0]), (before[1], after[1])):
        omega = (then.inv() * now).as_rotvec() / h  # in the body frame
        energy += moments @ omega**2 / 2
    assert n("kinetic_energy") == pytest.approx(energy, rel=1e-8)  # h² = 1e-10, and roundings/h = 1e-11


def test_angular_momentum_of_the_cat_is_free_of_torque() -> None:
    for n in states(SpatialCat, 5, **unloaded(SpatialCat)):
        assert n("momentum_rates") == algebra([0, 0, -2 * n.mass * n.gravity, 0, 0, 0])


# ---- cat: turns by shape alone -----------------------------------------------------------------------------------


def bent(bend: float, azimuth: Callable) -> dict[str, Callable]:
    return {"bend": lambda _: (bend, 0.0, 0.0), "azimuth": azimuth}


@pytest.mark.parametrize("distance", [0.0, 0.2, 1.0])
def test_where_the_joint_lies_does_not_matter(fmu, distance: float) -> None:
    """The trap of Kane and Scher: I is about each half's own centre, and r_B - r_A keeps its direction."""
    inputs = bent(1.0, smooth_step(2 * np.pi, 0.1, 1.5))
    result = run(fmu(SpatialCat), stop_time=2.0, step_size=0.02, inputs=inputs, bend=1.0, joint_distance=distance)
    exact = SpatialCat.exact(result.time, azimuth=result["azimuth"], bend=1.0)
    assert max_error(turns(result), turns(exact)) <= 1e-8  # a hundred tolerances


def test_twisting_straight_turns_each_half_by_half_of_it(fmu) -> None:
    result = run(fmu(SpatialCat), stop_time=2.0, step_size=0.02, inputs={"twist": smooth_step(3.0, 0.1, 1.5)})
    expected = Rotation.from_rotvec(-np.outer(result["twist"], [0, 0, 0.5])).as_matrix()
    assert max_error(turns(result), expected) <= 1e-9  # ten tolerances


def cone(theta: ArrayLike, alpha: float, beta: float) -> tuple[NDArray, NDArray]:
    """κ and χ, unwrapped, of Kane and Scher: the axis b goes round a cone of half angle β, tilted by α from a."""
    theta = np.asarray(theta, dtype=float)
    b_x = np.sin(alpha) * np.cos(beta) + np.cos(alpha) * np.sin(beta) * np.cos(theta)
    b_y = np.sin(beta) * np.sin(theta)
    ahead = np.arctan2(b_y * np.cos(theta) - b_x * np.sin(theta), b_x * np.cos(theta) + b_y * np.sin(theta))
    kappa = np.arccos(np.cos(alpha) * np.cos(beta) - np.sin(alpha) * np.sin(beta) * np.cos(theta))
    return kappa, theta + ahead + np.pi / 2


ALPHA, BETA = 0.4, 1.1


def test_kane_and_schers_formula_is_that_of_the_cat() -> None:
    """Φ = ∮ J c χ'/(I s² + J c²) dθ along their cone, with χ' by differentiating a spectrum."""
    theta = 2 * np.pi * np.arange(512) / 512
    kappa, chi = cone(theta, ALPHA, BETA)
    wave = np.fft.fftfreq(512, 1 / 512)
    chi_dash = 1 + np.real(np.fft.ifft(1j * wave * np.fft.fft(chi - theta)))
    c, s = np.cos(kappa / 2), np.sin(kappa / 2)
    turn = 2 * np.pi * np.mean(0.3 * c * chi_dash / (s**2 + 0.3 * c**2))
    found = SpatialCat.cone_turn(tilt=ALPHA, half_angle=BETA, inertia_axial=0.15, inertia_transverse=0.5)
    assert found == pytest.approx(turn, rel=1e-11)  # the trapezoidal rule of analytic functions


# ---- quaternions -------------------------------------------------------------------------------------------------


def test_quaternion_algebra_is_scipys() -> None:
    rng = np.random.default_rng(5)
    first, second = (Rotation.random(rng=rng) for _ in range(2))
    a, b = (r.as_quat(scalar_first=True) for r in (first, second))
    as_matrix = [
        turns(dict(zip(QUATERNION, q, strict=True))) for q in (rotations.product(a, b), rotations.conjugate(a))
    ]
    np.testing.assert_allclose(as_matrix[0], (first * second).as_matrix(), rtol=0, atol=1e-15)  # a few roundings each
    np.testing.assert_allclose(as_matrix[1], first.as_matrix().T, rtol=0, atol=1e-15)
    by = rng.normal(size=3)
    exponential = dict(zip(QUATERNION, rotations.exponential(by), strict=True))
    np.testing.assert_allclose(turns(exponential), Rotation.from_rotvec(by).as_matrix(), rtol=0, atol=1e-15)
