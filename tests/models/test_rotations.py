"""Satellite and SpatialCat: attitude, momentum, motor torques, and the turns that shape alone brings about, M 8.2-8.3.

Rotations are compared as matrices (q and -q are the same one), by SciPy and not by the package's own algebra.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hand_derivations import MOMENTA, QUATERNION, RATES, WHEELS, numbers, rotation, satellite, states, tensor
from numpy.typing import ArrayLike, NDArray
from on_paper import BACKENDS, Values, algebra, assert_follows, run, smooth_step, unloaded, wave
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from liaisons.check import max_error
from liaisons.models.satellite import Satellite
from liaisons.models.solutions import rotations
from liaisons.models.solutions.euler_top import euler_top
from liaisons.models.spatial_cat import SpatialCat

Signal = Callable[[float], tuple[float, float, float]]


FIRST = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])  # difference of order 8


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


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("start", TOPS.values(), ids=TOPS)
def test_satellite_with_locked_wheels_is_eulers_top(fmu, start: Any, backend: str) -> None:
    norm = np.linalg.norm([start.get(f"{name}_0", float(name == "q_w")) for name in QUATERNION])
    unit = {name: value / norm if name.startswith("q_") else value for name, value in start.items()}
    result = run(fmu(Satellite, backend), stop_time=60.0, step_size=0.5, **unit)
    exact = Satellite.exact(result.time, **unit)
    # κ = 100 over 60 s; 1000 for each pass by the middle axis, once or twice in this time.
    allowed = 1e-5 if start == TOPS["nearly about the middle axis"] else 1e-8
    assert_follows(result, exact, allowed, names=(*QUATERNION, *RATES))
    assert max_error(result["kinetic_energy"], result["kinetic_energy"][0]) <= 10 * 1e-10 * 60 * 10  # energy of 5 J
    for name in MOMENTA:
        assert max_error(result[name], result[name][0]) == 0.0  # no torque: H is not even integrated


@pytest.mark.slow
def test_norm_and_momentum_for_1e5_seconds(fmu) -> None:
    """J ω + J_w φ' in the inertial frame, summed from attitude, rates and wheels; wheels in motion."""
    inputs = {"wheel_1": wave(0.0, 50.0, 0.3), "wheel_3": wave(0.0, 30.0, 0.2, 1.0)}
    start = {"omega_x_0": 0.02, "omega_y_0": -0.01, "omega_z_0": 0.015}
    result = run(fmu(Satellite), stop_time=1e5, step_size=1.0, tolerance=1e-8, inputs=inputs, **start)
    assert max_error(np.linalg.norm(numbers(result, QUATERNION), axis=0), 1.0) <= 1e-15  # asked for: 1e-12
    spin = np.array([result["wheel_1_dot"], np.zeros_like(result.time), result["wheel_3_dot"]])
    moment = np.diag([10.0, 12.0, 8.0]) @ numbers(result, RATES) + 0.1 * spin
    H = rotation(result).apply(moment.T)
    assert max_error(H, np.broadcast_to(H[0], H.shape)) <= 1e-14  # asked for: 1e-10; roundings of 1 kg.m2/s


# ---- satellite: wheels that turn it ------------------------------------------------------------------------------

ODD = {"J_xy": 1.0, "J_xz": -0.5, "J_yz": 0.3}


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("profile", [smooth_step(1.0, 1.0, 15.0), wave(0.0, 1.0, 0.7)], ids=["step", "to and fro"])
def test_slew_from_rest_is_a_turn_about_a_fixed_axis_at_any_pace(fmu, profile: Signal, backend: str) -> None:
    """Wheels in proportion 200 : -120 : 80: R(t) = exp(-J⁻¹ J_w Δφ), for any J.  The sine begins with a jump of φ'."""
    direction = np.array([200.0, -120.0, 80.0])
    scaled = {
        wheel: lambda t, size=size: tuple(size * value for value in profile(t))
        for wheel, size in zip(WHEELS, direction, strict=True)
    }
    begin = {f"{wheel}_dot": size * profile(0.0)[1] for wheel, size in zip(WHEELS, direction, strict=True)}
    turning = {} if profile(0.0)[1] == 0 else _rate_that_makes_H_vanish(begin)
    result = run(fmu(Satellite, backend), step_size=0.02, inputs=scaled, **ODD, **begin, **turning)
    turned = np.array([result[wheel] for wheel in WHEELS])
    expected = Rotation.from_rotvec(-0.1 * np.linalg.solve(tensor(ODD), turned).T).as_matrix()
    # Quintics through samples 0.02 s apart: (0.02 · 0.7)⁶/46080 · 200 rad · J_w/J = 1e-16; solver tolerance 1e-10.
    assert max_error(turns(result), expected) <= 1e-8
    slew = Satellite.slew(*turned, **ODD)
    assert max_error(turns(slew), expected) <= 1e-14  # the package's algebra: roundings
    torques = [result[f"{wheel}_force"] for wheel in WHEELS]
    pushes = np.array([[scaled[wheel](t)[2] for t in result.time] for wheel in WHEELS])
    omega_dot = -0.1 * np.linalg.solve(tensor(ODD), pushes)
    assert max_error(torques, 0.1 * (pushes + omega_dot)) <= 1e-6  # λ_k = J_w (φ'' + ω'), 20 N.m


def _rate_that_makes_H_vanish(begin: Values) -> Values:  # noqa: N802
    omega = -0.1 * np.linalg.solve(tensor(ODD), list(begin.values()))
    return {f"{name}_0": float(value) for name, value in zip(RATES, omega, strict=True)}


@pytest.mark.parametrize("backend", BACKENDS)
def test_wheels_that_return_leave_the_satellite_turned(fmu, backend: str) -> None:
    """Wheel 1, wheel 2, wheel 1 back, wheel 2 back: the product of four rotations, which is not the identity."""
    size, rest = 60.0, 4.0
    sequence = [("wheel_1", 1, 0.0), ("wheel_2", 1, 1.0), ("wheel_1", -1, 2.0), ("wheel_2", -1, 3.0)]

    def wheel(name: str) -> Signal:
        parts = [smooth_step(sign * size, rest * i, rest) for which, sign, i in sequence if which == name]
        return lambda t: tuple(np.sum([part(t) for part in parts], axis=0).tolist())

    inputs = {name: wheel(name) for name in ("wheel_1", "wheel_2")}
    result = run(fmu(Satellite, backend), stop_time=16.0, step_size=0.02, inputs=inputs, tolerance=1e-11)
    expected = Rotation.identity()
    attitude = np.array([1.0, 0, 0, 0])
    for which, sign, _ in sequence:
        axis = 0 if which == "wheel_1" else 1
        by = -0.1 * sign * size / (10.0, 12.0)[axis]
        expected = expected * Rotation.from_rotvec(by * np.eye(3)[axis])
        attitude = numbers(Satellite.slew(*(sign * size * np.eye(3)[axis]), start=attitude), QUATERNION)
    end = turns(result)[-1]
    assert max_error(end, expected.as_matrix()) <= 1e-8  # a hundred tolerances, and quintics of 0.02 s
    assert max_error(turns(dict(zip(QUATERNION, attitude, strict=True))), expected.as_matrix()) <= 1e-15
    assert expected.magnitude() > 0.2  # rad: far from where it was
    assert max_error([result["wheel_1"][-1], result["wheel_2"][-1]], 0.0) == 0.0
    assert max_error(result["energy_balance"], 0.0) <= 1e-9


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


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("H", [(0.0, 0.0, 0.0), (0.05, -0.03, 0.1)], ids=["at rest", "tumbling"])
def test_momentum_of_the_cat_summed_over_positions_and_velocities(fmu, H: Any, backend: str) -> None:
    """Σ m r × r' + Σ (I ω) from attitudes and positions of an FMU run alone, differenced in time."""
    shape = {"bend": wave(0.8, 0.5, 5.0), "azimuth": wave(0.2, 2.0, 3.0), "twist": wave(0.0, 0.7, 4.0, 1.0)}
    start: Any = dict(zip((f"{name}_0" for name in MOMENTA), H, strict=True))
    start |= {f"{name}{end}": shape[name](0.0)[i] for name in shape for i, end in enumerate(("", "_dot"))}
    result = run(fmu(SpatialCat, backend), stop_time=2.0, step_size=0.002, tolerance=1e-12, inputs=shape, **start)
    attitude_a, attitude_b, place_a, place_b = halves(result, *(result[name] for name in shape))

    def rate(values: NDArray) -> NDArray:
        """Central difference of order 8 along the first axis; four samples are lost at either end."""
        windows = np.lib.stride_tricks.sliding_window_view(values, 9, axis=0)
        return windows @ FIRST / 0.002

    apart = place_b - place_a
    moment = np.cross(apart[4:-4], rate(apart))  # m/2 = 1 kg
    for attitude in (attitude_a, attitude_b):
        matrix = attitude.as_matrix()
        spin = np.swapaxes(matrix[4:-4], 1, 2) @ rate(matrix)  # [ω×] in the body frame
        omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=-1)
        moment += attitude[4:-4].apply(omega * [0.10, 0.10, 0.02])
    # Asked for: 1e-10.  Differences: (0.002 · 10)⁸/630 of rates of 10 /s; rounding 1e-16/0.002; quintics of 0.002 s.
    assert max_error(moment, np.broadcast_to(H, moment.shape)) <= 1e-10
    for name, value in zip(MOMENTA, H, strict=True):
        assert max_error(result[name], value) == 0.0
    assert max_error(np.linalg.norm(numbers(result, QUATERNION), axis=0), 1.0) <= 1e-15
    assert max_error(result["com_z"], 9.81 * (1 - result.time / 2) * result.time) <= 1e-11  # M eq. 59; ten tolerances
    assert max_error(result["energy_balance"], 0.0) <= 1e-9


# ---- cat: turns by shape alone -----------------------------------------------------------------------------------


def bent(bend: float, azimuth: Signal) -> dict[str, Signal]:
    return {"bend": lambda _: (bend, 0.0, 0.0), "azimuth": azimuth}


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("bend", [0.0, 0.6, 1.5, 2.8])
def test_rademaker_and_ter_braak_turn_the_cat_by_phi(fmu, bend: float, backend: str) -> None:
    """χ from 0 to 2π at constant bend: turned by Φ = 2π J c/(I s² + J c²) about a + b, and by nothing else."""
    inputs = bent(bend, smooth_step(2 * np.pi, 0.1, 1.5))
    result = run(fmu(SpatialCat, backend), stop_time=2.0, step_size=0.01, inputs=inputs, bend=bend)
    exact = SpatialCat.exact(result.time, azimuth=result["azimuth"], bend=bend)
    # Quintics of 0.01 s through a step of degree 7: (0.01/1.5)⁶ · 1e5/46080 = 1e-13; solver tolerance 1e-10.
    assert max_error(turns(result), turns(exact)) <= 1e-9
    c, s = np.cos(bend / 2), np.sin(bend / 2)
    phi = 2 * np.pi * 0.02 * c / (0.10 * s**2 + 0.02 * c**2)
    bisector = np.array([0, -s, c])  # a + b for χ = 0
    end = turns(result)[-1]
    assert max_error(end, Rotation.from_rotvec(phi * bisector).as_matrix()) <= 1e-9
    # The bisector keeps its direction in space: e = R (Rz(χ) Rx(κ/2) z).
    in_a = np.stack([s * np.sin(result["azimuth"]), -s * np.cos(result["azimuth"]), 0 * result.time + c], axis=-1)
    in_space = rotation(result).apply(in_a)
    assert max_error(in_space, np.broadcast_to(bisector, in_space.shape)) <= 1e-9


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


@pytest.mark.parametrize("backend", BACKENDS)
def test_kane_and_schers_cat_turns_by_their_quadrature(fmu, backend: str) -> None:
    """κ and χ both move, without twist: the cat ends in its first shape, turned by ∮ (dψ/dθ) dθ about a + b."""
    pace = smooth_step(2 * np.pi, 0.0, 2.0)

    def operator(which: int) -> Signal:
        def signal(t: float) -> tuple[float, float, float]:
            theta, rate, acceleration = pace(t)
            h = 1e-2  # differences of order 8 in θ; their error of (h)⁸ is below rounding
            near = np.array([cone(theta + i * h, ALPHA, BETA)[which] for i in range(-4, 5)])
            first = near @ FIRST / h
            even = np.array([-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560])
            second = near @ even / h**2
            return float(near[4]), float(first * rate), float(first * acceleration + second * rate**2)

        return signal

    inputs = {"bend": operator(0), "azimuth": operator(1)}
    start = {name: signal(0.0)[0] for name, signal in inputs.items()}
    result = run(fmu(SpatialCat, backend), stop_time=2.0, step_size=0.005, inputs=inputs, **start)
    psi = SpatialCat.cone_turn(tilt=ALPHA, half_angle=BETA)
    half = start["bend"] / 2
    in_plane = Rotation.from_rotvec([0, 0, start["azimuth"]])
    bisector = in_plane.apply([0, -np.sin(half), np.cos(half)])
    end = turns(result)[-1]
    # Quintics of 0.005 s: (0.005 · 10)⁶/46080 = 3e-13; solver tolerance 1e-10.
    assert max_error(end, Rotation.from_rotvec(psi * bisector).as_matrix()) <= 1e-8


# ---- quaternions -------------------------------------------------------------------------------------------------


def test_quaternion_algebra_is_scipys() -> None:
    rng = np.random.default_rng(5)
    first, second = (Rotation.random(rng=rng) for _ in range(2))
    a, b = (r.as_quat(scalar_first=True) for r in (first, second))
    as_matrix = [
        turns(dict(zip(QUATERNION, q, strict=True))) for q in (rotations.product(a, b), rotations.conjugate(a))
    ]
    np.testing.assert_allclose(as_matrix[0], (first * second).as_matrix(), atol=1e-15)  # a few roundings each
    np.testing.assert_allclose(as_matrix[1], first.as_matrix().T, atol=1e-15)
    by = rng.normal(size=3)
    exponential = dict(zip(QUATERNION, rotations.exponential(by), strict=True))
    np.testing.assert_allclose(turns(exponential), Rotation.from_rotvec(by).as_matrix(), atol=1e-15)
