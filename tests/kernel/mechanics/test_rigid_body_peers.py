"""Linkages against Pinocchio and MuJoCo, which derive the dynamics of bodies on their own."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from linkages import ALL, random_state, random_tree
from rigid_body_peers import Mujoco, Peer, Pinocchio

from liaisons import Free, Linkage, Screw, Spherical, derive

ROBOTS = Path(__file__).parents[1] / "language" / "robots"
PEERS: dict[str, tuple[Any, tuple[type, ...]]] = {
    "pinocchio": (Pinocchio, ALL),
    "mujoco": (Mujoco, tuple(kind for kind in ALL if kind is not Screw)),  # MuJoCo has none
}
"""By module: peer, and joints that it has."""

SEEDS = [*range(3), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(3, 50))]


@pytest.fixture(params=PEERS)
def peer(request: pytest.FixtureRequest) -> Any:
    """Function of a linkage or a robot's file, and joints that the peer has."""
    kind, joints = PEERS[request.param]
    return partial(kind, pytest.importorskip(request.param)), joints


def assert_equal(got: np.ndarray, expected: np.ndarray, factor: float = 1.0, what: str = "") -> None:
    """Equal to 1e-12 of the largest entry, times a factor."""
    largest = np.abs(expected).max(initial=0.0)
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-12 * largest * factor, err_msg=what)


def assert_agree(tree: type[Linkage], peer: Peer, seed: int) -> None:
    """Mass matrix, bias, accelerations and forces of the operators at a random state."""
    equations = derive(tree)
    m, state = equations.mechanism, random_state(equations, seed)
    state = dict.fromkeys(m.symbols, 0.0) | m.start_values() | state
    free = [f"{q.name}_dot" for q in m.coordinates] + [name for o in m.orientations for name in o.rates]
    active = [f"{s.name}_dot" for s in m.actives]
    assert sorted(peer.names) == sorted(free + active)
    rows, driven = ([peer.names.index(name) for name in names] for names in (free, active))

    # What acts at the joints: springs and dampers, drives and loads.
    laws = {name: state.get(f"{name.removesuffix('_dot')}_stiffness", 0.0) for name in peer.names}
    dampings = {name: state.get(f"{name.removesuffix('_dot')}_damping", 0.0) for name in peer.names}
    passive = np.array([-laws[n] * state.get(n.removesuffix("_dot"), 0.0) - dampings[n] * state[n] for n in peer.names])
    applied = np.zeros(len(peer.names))
    applied[[peer.names.index(f"{q.name}_dot") for q in m.coordinates]] = [
        state[f"{q.name}_force"] - state[f"{q.name}_load"] for q in m.coordinates
    ]

    function = ca.Function("f", [ca.vertcat(*equations.symbols.values())], [ca.densify(equations.forces)])
    forces = np.array(function([state[name] for name in equations.symbols])).ravel()
    metric, expected = np.array(equations.evaluate("mass_matrix", **state)), peer.mass_matrix(state)
    metric = metric.reshape(len(free), len(free))
    assert_equal(metric, expected[np.ix_(rows, rows)], what="mass matrix")

    accelerations = np.zeros(len(peer.names))
    accelerations[driven] = [state[f"{s.name}_ddot"] for s in m.actives]
    needed = peer.inverse(state, accelerations)
    assert_equal((applied + passive)[rows] - forces, needed[rows], what="bias")

    condition = np.linalg.cond(metric) if free else 1.0
    if not active:
        forward = peer.forward(state, applied + passive)[rows]
    else:  # the peers prescribe no acceleration
        forward = np.linalg.solve(metric, (applied + passive - needed)[rows])
    assert_equal(np.array(equations.evaluate("accelerations", **state)), forward, condition, "accelerations")

    accelerations[rows] = forward
    operators = (peer.inverse(state, accelerations) - passive)[driven]
    assert_equal(np.array(equations.evaluate("operator_forces", **state)), operators, condition, "operator forces")


@pytest.mark.parametrize("prescribed", [None, False, True], ids=["some", "forward", "inverse"])
@pytest.mark.parametrize("seed", SEEDS)
def test_random_trees(peer: Any, seed: int, prescribed: bool | None) -> None:
    """Trees of up to 12 bodies: with a third of the joints prescribed, with none, and with all."""
    model, joints = peer
    chosen = tuple(joint for joint in joints if not (prescribed and joint in (Spherical, Free)))
    tree = random_tree(seed, joints=chosen, prescribed=prescribed)
    assert_agree(tree, model(tree), seed)


@pytest.mark.parametrize("name", ["ur5.urdf", "panda.urdf", "panda.xml", "a1_leg.urdf"])
def test_robots(peer: Any, name: str) -> None:
    """Robots as the peers read their files, but for one free joint: Pinocchio's has rates along other axes."""
    model, _ = peer
    file = ROBOTS / name
    robot = (Linkage.from_urdf if name.endswith(".urdf") else Linkage.from_mjcf)(file)
    assert_agree(robot, model(robot if model.func is Pinocchio and name == "a1_leg.urdf" else file), 0)
