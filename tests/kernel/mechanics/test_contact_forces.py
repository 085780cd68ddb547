"""Forces of contacts in modes, against NumPy: least norm in the range of what is held."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from liaisons.contacts import Compliance
from liaisons.contacts.forces import orthonormal_columns, solve_without_pivoting

GAPS, FRICTIONS = 5, 3
NORMALS = [*[-1] * GAPS, 2, 0, -1]
"""Two frictions that gaps press, and one with a threshold that is a force."""
MODES = {
    "all closed, and stuck": ([1] * 8, [0] * 8),
    "one slides under its gap": ([1, 1, 1, 1, 1, 0, 1, 1], [0] * 5 + [-0.2, 0, 0]),
    "all slide": ([1, 0, 1, 1, 1, 0, 0, 0], [0] * 5 + [0.3, -0.1, 1.5]),
    "few are closed": ([1, 0, 0, 0, 0, 0, 1, 0], [0] * 8),
    "nothing is": ([0] * 8, [0] * 7 + [-2.0]),
}


def values(expression: ca.SX) -> NDArray[np.float64]:
    return np.array(ca.evalf(expression)).squeeze()


def problem(momenta: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """U and V of contacts of a body with so many momenta, and consistent rates."""
    random = np.random.default_rng(momenta)
    V = random.normal(size=(momenta, len(NORMALS)))
    root = random.normal(size=(momenta, momenta))
    U = V.T @ (root @ root.T + np.eye(momenta))
    return U, V, U @ random.normal(size=momenta)


@pytest.mark.parametrize("name", MODES)
@pytest.mark.parametrize("momenta", [2, 3, 6])
def test_redundant_contacts_share_by_least_norm(momenta: int, name: str) -> None:
    """x = P ζ + d with ζ by the pseudoinverse, where the matrix is symmetric; else ζ is in its range."""
    (U, V, rate), (held, drag) = problem(momenta), map(np.array, MODES[name])
    target = U @ np.full(momenta, 0.1)
    numbers = {"v": ca.DM(rate), "rates_by_momenta": U.T.ravel(), "momenta_by_forces": V.T.ravel()}
    compliance = Compliance.of_numbers({key: ca.SX(value) for key, value in numbers.items()})
    assert compliance.is_redundant
    x, wrong = map(values, compliance.forces(ca.SX(rate), ca.SX(held), ca.SX(drag), NORMALS, ca.SX(target)))
    G, P, d = U @ V, np.eye(len(NORMALS)), np.zeros(len(NORMALS))
    for i, normal in enumerate(NORMALS):
        if normal >= 0:
            P[i, normal] = drag[i]
        else:
            d[i] = drag[i]
    rows = held == 1
    zeta = np.zeros(len(NORMALS))
    K = (G @ P)[np.ix_(rows, rows)]
    basis = np.linalg.svd(K)[0][:, : np.linalg.matrix_rank(K)]
    right = (target - rate - G @ d)[rows]
    zeta[rows] = basis @ np.linalg.solve(basis.T @ K @ basis, basis.T @ right) if rows.any() else 0
    np.testing.assert_allclose(x, P @ zeta + d, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose((rate + G @ x)[rows], target[rows], rtol=1e-9, atol=1e-11)
    assert np.abs(wrong).max() < 1e-11


def test_redundant_contacts_that_contradict_each_other_are_told() -> None:
    """By what is left of their rates, orthogonal to what forces can do; of what is held, without the target."""
    U, V, rate = problem(3)
    held, wrong_rate = np.array([1, 1, 1, 1, 1, 0, 0, 1]), rate + np.arange(8.0)
    compliance = Compliance(ca.SX(U), ca.SX(V), is_redundant=True)
    none = ca.SX.zeros(8)
    for target in (0.0, 7.0):
        x, wrong = map(values, compliance.forces(ca.SX(wrong_rate), ca.SX(held), none, NORMALS, target))
        C = V.T * held[:, None]
        np.testing.assert_allclose(
            wrong, held * wrong_rate - C @ np.linalg.lstsq(C, held * wrong_rate)[0], rtol=0, atol=1e-12
        )
        assert np.abs(wrong).max() > 0.1
        right = held * (target - wrong_rate)
        reached = C @ np.linalg.lstsq(C, right)[0]  # as near as forces come
        np.testing.assert_allclose((U @ V @ x)[held == 1], reached[held == 1], rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", MODES)
def test_independent_contacts_are_told_by_the_same_equations(name: str) -> None:
    random, (held, drag) = np.random.default_rng(8), map(np.array, MODES[name])
    root = random.normal(size=(8, 8))
    G, rate = root @ root.T + np.eye(8), random.normal(size=8)
    compliance = Compliance.of_numbers({"v": ca.SX(rate), "G": ca.SX(G.T.ravel())})
    assert not compliance.is_redundant
    x, wrong = compliance.forces(ca.SX(rate), ca.SX(held), ca.SX(drag), NORMALS)
    x = values(x)
    np.testing.assert_allclose((rate + G @ x)[held == 1], 0, rtol=0, atol=1e-12)
    gap_of = {5: 2, 6: 0}
    for i in np.flatnonzero(held == 0).tolist():
        assert x[i] == pytest.approx(drag[i] * (x[gap_of[i]] if i in gap_of else 1), abs=1e-14)
    assert wrong.nnz() == 0


@pytest.mark.parametrize("is_redundant", [True, False])
def test_numbers_of_a_compliance_are_those_that_it_is_read_from(is_redundant: bool) -> None:
    U, V, rate = problem(3)
    compliance = Compliance(ca.SX(U), ca.SX(V), is_redundant) if is_redundant else Compliance.from_matrix(ca.SX(U @ V))
    again = Compliance.of_numbers({"v": ca.SX(rate), **compliance.numbers()})
    assert again.is_redundant is is_redundant
    np.testing.assert_allclose(values(again.matrix), U @ V, rtol=1e-14)
    np.testing.assert_allclose(values(again.matrix), U @ V, rtol=1e-14)


@pytest.mark.parametrize("shape", [(7, 3), (3, 7), (4, 4)])
def test_orthonormal_columns_leave_out_what_depends_on_others(shape: tuple[int, int]) -> None:
    matrix = np.random.default_rng(1).normal(size=shape)
    matrix[:, 1] = 2 * matrix[:, 0]
    matrix[0] = 0
    Q, lasting = map(values, orthonormal_columns(ca.SX(matrix)))
    rank = np.linalg.matrix_rank(matrix)
    assert Q.shape == (shape[0], min(shape))
    assert sum(lasting) == rank
    np.testing.assert_allclose(Q.T @ Q, np.diag(lasting), rtol=0, atol=1e-12)
    np.testing.assert_allclose(Q @ (Q.T @ matrix), matrix, rtol=0, atol=1e-12)


def test_derivatives_of_shares_are_finite_where_nothing_is_held() -> None:
    """A column that becomes 0 has no direction, and no derivative of it."""
    U, V, rate = problem(3)
    held, moved = ca.SX.sym("held", 8), ca.SX.sym("moved")
    compliance = Compliance(moved * U, moved * V, is_redundant=True)
    x, _ = compliance.forces(ca.SX(rate), held, ca.SX.zeros(8), NORMALS)
    slope = ca.Function("slope", [moved, held], [x, ca.jacobian(x, moved)])
    forces, slopes = slope(1.0, [1] * 8)
    np.testing.assert_allclose(slopes, -2 * np.array(forces), rtol=1e-9)  # G grows with its square
    for one in slope(1.0, [0] * 8):
        assert np.array_equal(np.array(one).ravel(), np.zeros(8))


def test_elimination_solves_what_has_zeros() -> None:
    K = np.array([[2.0, 0, 1], [0, 3, 1], [1, 1, 4]])
    np.testing.assert_allclose(
        values(solve_without_pivoting(ca.SX(K), ca.SX([1.0, 2, 3]))), np.linalg.solve(K, [1, 2, 3]), rtol=1e-14
    )
