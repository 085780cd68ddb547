"""Momentum maps of groups of symmetries: components, brackets, and what they become under finite elements."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from liaisons.errors import ComponentError
from liaisons.models import ChargedParticle, FreeParticle, KeplerOrbit, PlanarOscillator, Satellite
from liaisons_motion.analysis import MomentumMap, momentum_map, noether

AXES = "xyz"
# {J_x, J_y} = -J_z in K's sign, {p, q} = +1
TURNS = -np.array([[[(a - b) * (b - c) * (c - a) / 2 for c in range(3)] for b in range(3)] for a in range(3)])


def turn(axis: int) -> Any:
    """Turn of a particle about an axis: e × r."""
    return lambda m: dict(zip(AXES, np.cross(np.eye(3)[axis], [m.x, m.y, m.z]), strict=True))


ROTATIONS: dict[str, Any] = {f"J_{axis}": turn(i) for i, axis in enumerate(AXES)}
SHIFTS: dict[str, Any] = {f"P_{axis}": lambda m, axis=axis: {axis: 1.0} for axis in AXES}  # noqa: ARG005
WEIGHTLESS: Any = {"gravity": 0.0}


def random_state(seed: int) -> tuple[np.ndarray, np.ndarray]:
    r, v = np.random.default_rng(seed).normal(size=(2, 3))
    return r, v


def at(r: np.ndarray, v: np.ndarray) -> dict[str, float]:
    return dict(zip(AXES, r, strict=True)) | {f"{axis}_dot": x for axis, x in zip(AXES, v, strict=True)}


def test_rotations_of_a_satellite() -> None:
    group: Any = {f"J_{axis}": lambda _, i=i: {"attitude": tuple(np.eye(3)[i])} for i, axis in enumerate(AXES)}
    J = momentum_map(Satellite, group)
    np.testing.assert_allclose(J.structure, TURNS, rtol=0, atol=1e-13)
    single = noether(Satellite, group["J_y"])
    state: Any = {"omega_x": 0.3, "omega_y": -0.7, "omega_z": 0.2}
    assert J.evaluate(**state)["J_y"] == single.evaluate(**state)


def test_motions_of_space() -> None:
    """Six components of the Euclidean group, whose brackets are those of e_a × and of translations."""
    J = momentum_map(FreeParticle, ROTATIONS | SHIFTS, **WEIGHTLESS)
    expected = np.zeros((6, 6, 6))
    expected[:3, :3, :3] = TURNS
    expected[:3, 3:, 3:] = TURNS  # {J_x, P_y} = -P_z
    expected[3:, :3, 3:] = TURNS
    np.testing.assert_allclose(J.structure, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_it_is_equivariant_under_finite_motions(seed: int) -> None:
    """r → R r + a takes P to R P and J to R J + a × R P."""
    J = momentum_map(FreeParticle, ROTATIONS | SHIFTS, **WEIGHTLESS)
    (r, v), R = random_state(seed), Rotation.from_rotvec(random_state(seed + 20)[0]).as_matrix()
    a = random_state(seed + 10)[0]
    before, after = (np.array([*J.evaluate(**at(*state)).values()]) for state in ((r, v), (R @ r + a, R @ v)))
    P = R @ before[3:]
    np.testing.assert_allclose(after[3:], P, rtol=0, atol=1e-14)
    np.testing.assert_allclose(after[:3], R @ before[:3] + np.cross(a, P), rtol=0, atol=1e-14)


def test_what_spans_no_group_is_refused() -> None:
    two = {name: ROTATIONS[name] for name in ("J_x", "J_y")}
    with pytest.raises(ComponentError, match="the bracket of J_x and J_y is no combination of J_x, J_y"):
        momentum_map(FreeParticle, two, **WEIGHTLESS)


def test_what_is_no_symmetry_is_refused() -> None:
    with pytest.raises(ComponentError, match="is no symmetry"):
        momentum_map(FreeParticle, SHIFTS)  # gravity
    with pytest.raises(ComponentError, match="is no symmetry"):
        momentum_map(ChargedParticle, {"P_x": SHIFTS["P_x"]})  # the gauge


def test_a_group_of_one() -> None:
    for body in (PlanarOscillator, KeplerOrbit):
        J = momentum_map(body, {"turn": lambda m: {"x": -m.y, "y": m.x}})
        assert isinstance(J, MomentumMap)
        assert J.structure.shape == (1, 1, 1)
        state: Any = {"x": 0.7, "y": -0.2, "x_dot": 0.1, "y_dot": 0.9}
        single = noether(body, lambda m: {"x": -m.y, "y": m.x})
        assert J.evaluate(**state)["turn"] == single.evaluate(**state)
