"""Many degrees of freedom: the sparse ways to solve by the mass matrix against the dense one, and what they cost."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest

from liaisons.language import Coordinate, Mechanism, Parameter, point
from liaisons.mechanics import assemble, derive
from liaisons.mechanics import inertia as structure
from liaisons.models import PendulumChain
from liaisons_catalogue.parallelograms import four_bars

ROUNDING = 1e-11  # systems of condition 1e3, a hundred operations each


def hanging(count: int, above: Callable[[int], int]) -> type[Mechanism]:
    """Bobs on rods, each hung on the bob ``above(i)``, 0 being a fixed point: written as a user would."""
    names: dict[str, Any] = {
        "__doc__": "A tree of pendulums.",
        "__module__": __name__,
        "mass": Parameter(1.0, "kg", "mass of each bob", above=0),
        "length": Parameter(1.0, "m", "length of each rod", above=0),
        "gravity": Parameter(9.81, "m/s2", "gravitational acceleration"),
    }
    links = range(1, count + 1)
    for i in links:
        names[f"theta_{i}"] = Coordinate("rad", f"angle of rod {i}", start=0.1 * i)

        def bob(self: Any, i: int = i) -> dict[str, Any]:
            angle, upper = self.symbols[f"theta_{i}"], above(i)
            hook = getattr(self, f"bob_{upper}") if upper else {"x": 0.0, "z": 0.0}
            return {"x": hook["x"] + self.length * ca.sin(angle), "z": hook["z"] - self.length * ca.cos(angle)}

        names[f"bob_{i}"] = point("m", f"bob {i}")(bob)
    bobs = [f"bob_{i}" for i in links]
    names["kinetic_energy"] = lambda m: sum(m.mass / 2 * m.speed_squared(getattr(m, name)) for name in bobs)
    names["potential_energy"] = lambda m: sum(m.mass * m.gravity * getattr(m, name)["z"] for name in bobs)
    return type("Tree", (Mechanism,), names)


TREES: dict[str, Callable[[int], int]] = {
    "chain": lambda i: i - 1,
    "comb": lambda i: max(i - 2, 0),
    "binary": lambda i: i // 2,
    "star": lambda i: 0 if i == 1 else 1,
}


@pytest.mark.parametrize("tree", TREES.values(), ids=TREES.keys())
def test_sparse_and_dense_ways_give_one_motion(tree: Callable[[int], int], monkeypatch: pytest.MonkeyPatch) -> None:
    component = hanging(9, tree)
    sparse = derive(component)
    monkeypatch.setattr(structure, "MANY", 1000)
    dense = derive(component)
    rng = np.random.default_rng(9)
    for _ in range(5):
        state = {f"theta_{i}{end}": rng.normal() for i in range(1, 10) for end in ("", "_dot")}
        state |= {f"p_theta_{i}": rng.normal() for i in range(1, 10)} | {"bob_7_x_load": rng.normal()}
        for quantity in ("velocities", "accelerations", "momentum_rates", "power"):
            found, expected = sparse.evaluate(quantity, **state), dense.evaluate(quantity, **state)
            np.testing.assert_allclose(found, expected, atol=ROUNDING * (1 + np.abs(expected).max()), rtol=0)


@pytest.mark.parametrize("tree", TREES.values(), ids=TREES.keys())
@pytest.mark.variants(core=0)
def test_cost_grows_with_the_number_of_links_not_with_its_cube(tree: Callable[[int], int]) -> None:
    """Twice the links: about twice the operations; four times would be a matrix, eight times its factorization."""
    small, large = (assemble(hanging(n, tree)).derivatives.n_instructions() for n in (20, 40))
    assert large <= 2.4 * small


def test_chain_of_the_user_is_the_chain_of_the_catalogue() -> None:
    n = 12
    tree, chain = assemble(hanging(n, TREES["chain"])), assemble(PendulumChain, n)
    rng = np.random.default_rng(12)
    y = [*rng.normal(size=2 * n), 0.0, 0.0]
    k = [1.3, 1.0, 9.81, *[0.0] * 2 * n]
    found = tree.derivatives(0, y, [0.0] * len(tree.inputs), k).full()
    inputs = sum(v.count for v in chain.inputs)
    expected = chain.derivatives(0, y, [0.0] * inputs, k).full()
    np.testing.assert_allclose(found, expected, atol=ROUNDING * np.abs(expected).max(), rtol=0)


def test_four_bars_that_are_pulled_apart_are_put_together_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    """At a random state what the constraints ask of the accelerations is not zero."""
    sparse = derive(four_bars(9))
    monkeypatch.setattr(structure, "MANY", 1000)
    dense = derive(four_bars(9))
    rng = np.random.default_rng(4)
    state = {f"theta_{i}{end}": rng.normal() for i in range(10) for end in ("", "_dot")}
    found, expected = (equations.evaluate("accelerations", **state) for equations in (sparse, dense))
    np.testing.assert_allclose(found, expected, atol=ROUNDING * (1 + np.abs(expected).max()), rtol=0)


@pytest.mark.parametrize("count", [4, 10])
def test_four_bars_move_as_one_coordinate(count: int) -> None:
    """(N + 1 rods that turn, N that are carried): J θ'' = -G cos θ, J = (N + 1)/3 + N, G = g ((N + 1)/2 + N)."""
    state = {f"theta_{i}{end}": value for i in range(count + 1) for end, value in (("", 1.1), ("_dot", 0.7))}
    expected = -9.81 * ((count + 1) / 2 + count) * np.cos(1.1) / ((count + 1) / 3 + count)
    accelerations = derive(four_bars(count)).evaluate("accelerations", **state)
    np.testing.assert_allclose(accelerations, expected, atol=ROUNDING * 100, rtol=0)


def test_cost_of_constraints_grows_with_their_number() -> None:
    small, large = (assemble(four_bars(n)).derivatives.n_instructions() for n in (6, 18))
    assert large <= 3.6 * small
