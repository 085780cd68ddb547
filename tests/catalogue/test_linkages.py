"""Linkages of the catalogue against textbooks: closed forms, and Newton's and Euler's laws body by body."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from on_paper import State, equations_of, random_states
from scipy.spatial.transform import Rotation

from liaisons.base.project import load_module
from liaisons.errors import ValidityError
from liaisons.models import (
    Arm,
    Bricard,
    CarAxis,
    FourBar,
    FurutaPendulum,
    Gyroscope,
    LinkedCat,
    Scara,
    SlewingCrane,
)

LINKAGES = [SlewingCrane, Arm, Scara, FurutaPendulum, Gyroscope, FourBar, Bricard, CarAxis, LinkedCat]


@pytest.mark.parametrize("component", LINKAGES)
def test_a_linkage_is_declared_in_forty_lines(component) -> None:
    assert len([line for line in inspect.getsource(component).splitlines() if line.strip()]) <= 40


# ---- slewing crane --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rate", [0.05, 0.3, 0.6])
@pytest.mark.parametrize("radius", [3.0, 20.0])
def test_load_is_at_rest_in_the_turning_frame_at_the_steady_deflection(rate: float, radius: float) -> None:
    steady = SlewingCrane.steady_deflection(rate, travel=radius)
    state: Any = {"slew_dot": rate, "travel": radius, **steady}
    # 2 roundings of g l/(l²) at most.
    assert equations_of(SlewingCrane).evaluate("accelerations", **state) == pytest.approx(0.0, abs=1e-14)


def test_deflection_of_a_point_mass_and_at_slow_rates() -> None:
    slow = SlewingCrane.steady_deflection(1e-3, travel=8.0)["rope_y"]
    assert slow == pytest.approx(-(1e-3**2) * 8.0 / 9.81, rel=1e-5)  # the next term is of order Ω² l/g
    small = {f"load_inertia_{axis}": 1e-9 for axis in ("xx", "yy", "zz")}
    alpha = -SlewingCrane.steady_deflection(0.5, travel=8.0, **small)["rope_y"]
    assert np.tan(alpha) == pytest.approx(0.25 * (8.0 + 20.0 * np.sin(alpha)) / 9.81, rel=1e-14)


def test_crane_moves_as_a_point_mass_on_a_rope_by_newton() -> None:
    """The load without moments of inertia: m (r'' + g) is along the rope, whose end moves as the operator says."""
    equations = equations_of(SlewingCrane)
    m = equations.mechanism
    small = {f"load_inertia_{axis}": 1e-12 for axis in ("xx", "yy", "zz")}
    for loaded in random_states(SlewingCrane, 10, rope_damping=0.0, **small):
        n = loaded | {name: 0.0 for name in loaded if name.endswith(("_load", "_force"))}
        hook, pivot = m.hook, m.trolley.origin
        second = np.array([n(m.dot(m.dot(x))) for x in hook.values()])
        along = np.array([n(pivot[i] - x) for i, x in enumerate(hook.values())])
        # The centre of mass lies where the hook is: at the same distance below the trolley.
        along, second = _of_centre(n, along, second)
        force = second + np.array([0, 0, n["gravity"]])
        across = np.cross(force, along) / np.linalg.norm(along)
        assert np.linalg.norm(across) <= 1e-9 * np.linalg.norm(force)  # of the rest of inertia, 1e-12/(m l²)


def _of_centre(n: Any, along: NDArray, second: NDArray) -> tuple[NDArray, NDArray]:
    """Vector to the trolley and acceleration of the centre of mass, from those of the hook on the same line."""
    m = equations_of(SlewingCrane).mechanism
    ratio = n["load_centre_z"] / n["hook_at_z"]
    top = np.array([n(m.dot(m.dot(m.trolley.origin[i]))) for i in range(3)])
    return along * ratio, top + ratio * (second - top)


# ---- arm ------------------------------------------------------------------------------------------------------------


def hanging(pose: dict[str, float]) -> dict[str, float]:
    """The load's attitude against the flange while it hangs."""
    flange = _chain([pose[f"axis_{k}"] for k in range(1, 7)])[-1]
    return dict(zip((f"grip_q_{x}" for x in "wxyz"), flange.inv().as_quat(scalar_first=True), strict=True))


def _chain(angles: Any) -> list[Rotation]:
    """Attitudes of the six bodies."""
    attitudes, turn = [], Rotation.identity()
    for angle, twist in zip(angles, ("", "X", "", "Y", "X", "-X"), strict=True):
        if twist:
            turn = turn * Rotation.from_euler(twist[-1], -np.pi / 2 if twist[0] == "-" else np.pi / 2)
        turn = turn * Rotation.from_euler("Z", angle)
        attitudes.append(turn)
    return attitudes


@pytest.mark.parametrize("seed", range(10))
def test_torques_at_rest_are_the_moments_of_the_weights(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pose = {f"axis_{k}": float(rng.uniform(-3, 3)) for k in range(1, 7)}
    torques = equations_of(Arm).evaluate("operator_forces", **pose, **hanging(pose))
    expected = [*Arm.static_torques(**pose).values()]
    assert torques == pytest.approx(expected, abs=1e-11)  # sums of moments of 300 N m


def test_torques_are_those_of_newton_and_euler() -> None:
    """Rates of the momenta of all bodies about each axis, by differences of a motion, and moments of the weights."""
    coefficients = np.random.default_rng(3).normal(size=(3, 6))
    equations = equations_of(Arm)
    number = {p.name: p.start for p in equations.mechanism.parameters} | {"load_mass": 1e-9}
    number |= {f"load_inertia_{axis}": 1e-12 for axis in ("xx", "yy", "zz")}
    names = ["base", "upper", "fore", "wrist_1", "wrist_2", "flange"]

    def vector(name: str) -> NDArray:
        return np.array([number.get(f"{name}_{axis}", 0.0) for axis in "xyz"])

    def motion(t: float) -> tuple[list[NDArray], list[Rotation], list[NDArray]]:
        attitudes = _chain(coefficients[0] + coefficients[1] * t + coefficients[2] * t**2 / 2)
        centres, origins, origin, before = [], [], np.zeros(3), Rotation.identity()
        for k, (name, attitude) in enumerate(zip(names, attitudes, strict=True), 1):
            origin = origin + before.apply(vector(f"axis_{k}_at"))
            origins.append(origin)
            centres.append(origin + attitude.apply(vector(f"{name}_centre")))
            before = attitude
        return centres, attitudes, origins

    def momenta(t: float, h: float = 1e-4) -> list[tuple[NDArray, NDArray]]:
        (c_0, R_0, _), (c_1, R_1, _), (_, R, _) = motion(t - h), motion(t + h), motion(t)
        pairs = []
        for k, name in enumerate(names):
            tensor = np.diag([number[f"{name}_inertia_{axis}"] for axis in ("xx", "yy", "zz")])
            omega = (R_1[k] * R_0[k].inv()).as_rotvec() / (2 * h)
            matrix = R[k].as_matrix()
            pairs.append((number[f"{name}_mass"] * (c_1[k] - c_0[k]) / (2 * h), matrix @ tensor @ matrix.T @ omega))
        return pairs

    h = 1e-3
    centres, attitudes, origins = motion(0.0)
    early, late = momenta(-h), momenta(h)
    expected = []
    for i in range(6):
        moment = np.zeros(3)
        for k in range(i, 6):
            force = (late[k][0] - early[k][0]) / (2 * h) + number[f"{names[k]}_mass"] * np.array([0, 0, 9.81])
            moment += np.cross(centres[k] - origins[i], force) + (late[k][1] - early[k][1]) / (2 * h)
        expected.append(attitudes[i].as_matrix()[:, 2] @ moment)
    ends = ("", "_dot", "_ddot")
    state = {f"axis_{k}{end}": coefficients[j, k - 1] for k in range(1, 7) for j, end in enumerate(ends)}
    torques = equations.evaluate("operator_forces", **number, **state)
    # Differences of the second order with h = 1e-3: 1e-6 of third derivatives of some thousand.
    assert torques == pytest.approx(expected, abs=2e-3, rel=1e-5)


# ---- the others ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("elbow", [-2.0, 0.0, 1.1])
def test_scara_has_the_mass_matrix_of_the_textbook(elbow: float) -> None:
    changed = {"outer_mass": 5.0, "quill_inertia_zz": 0.02, "shift_at_x": 0.35}
    metric = equations_of(Scara).evaluate("mass_matrix", elbow=elbow, **changed)
    assert metric == pytest.approx(Scara.mass_matrix(elbow, **changed), abs=1e-14)


def test_furuta_pendulum_accelerates_by_the_published_equations() -> None:
    """The closed form ahead and back in time from each state: the sum of its rates is 2 h of the acceleration."""
    h = 1e-4
    own = ("bob_at_z", "arm_inertia_xx", "arm_inertia_yy")  # of the motion no part
    for n in random_states(FurutaPendulum, 5):
        values = {p.name: n[p.name] for p in FurutaPendulum.parameters}
        values["pendulum_inertia_yy"] = values["pendulum_inertia_xx"]
        unloaded = n | values | {name: 0.0 for name in n if name.endswith(("_load", "_force"))}
        start = {f"{name}_0": n[name] for name in ("turn", "swing", "turn_dot", "swing_dot")}
        back = start | {f"{name}_dot_0": -n[f"{name}_dot"] for name in ("turn", "swing")}
        used = {name: value for name, value in values.items() if name not in own}
        ahead, behind = (FurutaPendulum.exact(h, **used, **at) for at in (start, back))
        second = [(float(ahead[f"{q}_dot"]) + float(behind[f"{q}_dot"])) / (2 * h) for q in ("turn", "swing")]
        accelerations = np.asarray(unloaded("accelerations"))
        # h² times the fourth derivative, and rounding divided by h.
        assert accelerations == pytest.approx(second, rel=1e-5, abs=1e-5 * np.abs(accelerations).max())


@pytest.mark.parametrize("theta", [0.3, 1.0, 2.0])
@pytest.mark.parametrize("rate", [1.0, -4.0])
def test_gyroscope_precesses_steadily_at_the_rate_of_its_equation(theta: float, rate: float) -> None:
    changed = {"inner_inertia_xx": 2e-3, "rotor_mass": 1.5}
    state = {"nutation": theta, "precession_dot": rate, "spin_dot": Gyroscope.steady_precession(theta, rate, **changed)}
    # Torques of 0.5 N m cancel, divided by a moment of 5e-3 kg m2.
    assert equations_of(Gyroscope).evaluate("accelerations", **changed, **state) == pytest.approx(0.0, abs=1e-11)


def test_steady_precession_needs_a_rate() -> None:
    with pytest.raises(ValidityError, match=r"rate = 0\.0 must not be 0"):
        Gyroscope.steady_precession(1.0, 0.0)


def test_four_bar_is_closed_where_freudenstein_says() -> None:
    equations = equations_of(FourBar)
    function = ca.Function("residuals", [*equations.symbols.values()], [equations.constraints.residuals])
    for turn in np.linspace(0.0, 6.0, 13):
        loop = {name: float(x) for name, x in FourBar.freudenstein(turn).items()}
        values = [*equations.numbers({"turn": turn, **loop}).values()]
        assert np.array(function(*values)).ravel() == pytest.approx(0.0, abs=1e-14)


def test_four_bar_that_does_not_close_is_refused() -> None:
    with pytest.raises(ValidityError, match=r"the loop does not close at turn = 3\.0"):
        FourBar.freudenstein(3.0, swing_at_x=3.0)


def test_conditions_of_both_loops_that_follow_from_the_others_are_named() -> None:
    assert [len(FourBar.constraints), len(FourBar.redundant)] == [2, 3]  # parallel axes
    assert [len(Bricard.constraints), len(Bricard.redundant)] == [5, 1]  # 5 coordinates, 1 degree of freedom


def test_squeezer_starts_as_the_ivp_test_set_says() -> None:
    """Accelerations and multipliers at t = 0 of Mazzia and Magherini, II-13."""
    squeezer = load_module(Path(__file__).parents[2] / "scenarios" / "andrews_squeezer.py").Squeezer
    assert [len(squeezer.constraints), len(squeezer.redundant)] == [6, 9]  # 7 coordinates, 1 degree of freedom
    equations = equations_of(squeezer)
    expected = [14222.4439199541138705911625887, -10666.8329399655854029433719415, 0, 0, 0, 0, 0]
    assert equations.evaluate("accelerations", beta_force=0.033) == pytest.approx(expected, abs=1e-9)
    state = State(squeezer, equations.numbers({"beta_force": 0.033}))
    along_z, along_minus_x = np.ravel(state("multipliers"))[:2]
    force = np.exp(1j * squeezer.beta.start) * complex(-along_minus_x, along_z)
    assert force == pytest.approx(98.5668703962410896057654982170 - 6.12268834425566265503114393122j, rel=1e-13)


def test_linked_cat_with_locked_limbs_falls_and_turns_as_one_body() -> None:
    """Second differences of the trunk's motion are the accelerations of the linkage."""
    pose = {"psi_1": 0.7, "psi_2": -0.4}
    start = {"fall_angle_0": 0.2, "fall_angle_dot_0": 1.5, "fall_x_dot_0": 0.3, "fall_y_dot_0": -0.2}
    state = {name.removesuffix("_0"): value for name, value in start.items()}
    accelerations = equations_of(LinkedCat).evaluate("accelerations", **pose, **state)
    h = 1e-3
    motion = LinkedCat.exact([0.0, h, 2 * h], **pose, **start)
    rows = np.array([motion[name] for name in ("fall_x", "fall_y", "fall_angle")])
    # Between h and the start, h times a third derivative of 1.5³ x 0.02 m.
    assert (rows @ [1, -2, 1]) / h**2 == pytest.approx(accelerations, abs=1e-3)
