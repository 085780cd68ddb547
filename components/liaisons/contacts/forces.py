"""Forces of contacts in modes: x = P ζ + d, where ζ is 0 but for what is held (closed, sticks).

P makes the force of a gap also that of what slides under it, and d are the forces of what slides at a threshold.  Where
contacts are redundant ζ lies in the range of G, restricted to what is held: the shortest one where nothing slides.
With orthonormal columns Q of that range ζ = Q s, and Qᵀ G P Q s = Qᵀ (target - rate - G d) has as many rows as contacts
can be independent, however many there are.
Source: docs/explanation/unilateral.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import final

import casadi as ca

DEPENDENT = 1e-10
"""A column of which less than this part of its square is left depends on others."""


@final
@dataclass(frozen=True, eq=False)
class Compliance:
    """Delassus matrix G = U V, by which contact forces change the rates of contacts.

    :param U: change of rates by momenta, (contacts, momenta), or G.
    :param V: change of momenta by forces, (momenta, contacts), or 1.
    :param is_redundant: whether rows of G depend on others somewhere; Vᵀ then spans the range of G.
    """

    U: ca.SX
    V: ca.SX
    is_redundant: bool

    @classmethod
    def from_matrix(cls, G: ca.SX) -> Compliance:
        """Compliance of contacts that are independent in all configurations."""
        return cls(G, ca.SX.eye(G.shape[0]), is_redundant=False)

    @classmethod
    def of_numbers(cls, numbers: Mapping[str, ca.SX]) -> Compliance:
        """Compliance from the numbers of contacts that the function ``contact`` of a model returns, by name."""
        n = numbers["v"].numel()
        if "G" in numbers:
            return cls.from_matrix(ca.reshape(numbers["G"], n, n))
        U, V = (numbers[name] for name in ("rates_by_momenta", "momenta_by_forces"))
        return cls(ca.reshape(U, n, U.numel() // n), ca.reshape(V, V.numel() // n, n), is_redundant=True)

    def numbers(self) -> dict[str, ca.SX]:
        """Columns that the function ``contact`` of a model returns, by name."""
        if self.is_redundant:
            return {"rates_by_momenta": ca.vec(self.U), "momenta_by_forces": ca.vec(self.V)}
        return {"G": ca.vec(self.U)}

    @property
    def matrix(self) -> ca.SX:
        """Matrix G."""
        return self.U @ self.V

    def forces(
        self, rate: ca.SX, held: ca.SX, drag: ca.SX, normals: Sequence[int], target: ca.SX | float = 0.0
    ) -> tuple[ca.SX, ca.SX]:
        """Forces x with rate + G x = target in rows that are held, and what redundant contacts miss of these (c,).

        :param rate: of each contact without forces, a velocity if x are impulses, else an acceleration (c,).
        :param held: 1 where a contact is closed or sticks, else 0.
        :param drag: of what slides its force, or part of the force of its gap; else 0.
        :param normals: of each contact the index of the gap whose force bounds it, or -1.
        """
        n, U, V = len(normals), self.U, self.V
        P, d = ca.SX.eye(n), ca.SX.zeros(n, 1)
        for i, normal in enumerate(normals):
            if normal >= 0:
                P[i, normal] = drag[i]
            else:
                d[i] = drag[i]
        free, held_rows = rate + U @ (V @ d), ca.diag(held)
        right = held * (target - free)
        if not self.is_redundant:
            return P @ solve_without_pivoting(held_rows @ U @ (V @ P) + ca.diag(1 - held), right) + d, ca.SX(n, 1)
        Q, lasting = orthonormal_columns(held_rows @ V.T)
        K = (Q.T @ U) @ (V @ (P @ Q)) + ca.diag(1 - lasting)
        wrong = held * free
        return P @ (Q @ ca.solve(K, Q.T @ right)) + d, wrong - Q @ (Q.T @ wrong)


def orthonormal_columns(matrix: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Orthonormal columns that span the range of a matrix, at most as many as its rows; and 1 or 0 for each.

    By Gram's and Schmidt's method; a column that depends on those before it becomes 0.
    """
    if matrix.shape[1] > matrix.shape[0]:
        matrix = matrix @ orthonormal_columns(matrix.T)[0]
    columns, lasting = list[ca.SX](), list[ca.SX]()
    for column in ca.horzsplit(matrix):
        rest = column
        for other in columns:
            rest -= other * ca.dot(other, rest)
        size = ca.dot(rest, rest)
        lasts = size > DEPENDENT * ca.dot(column, column)
        columns.append(lasts * rest / ca.sqrt(lasts * size + 1 - lasts))
        lasting.append(lasts)
    return ca.horzcat(*columns), ca.vertcat(*lasting)


def solve_without_pivoting(K: ca.SX, right: ca.SX) -> ca.SX:
    """Solution x of K x = right by Gauss's elimination; modes are chosen such that no pivot is 0."""
    n = K.shape[0]
    rows = [[*ca.horzsplit(K[i, :]), right[i]] for i in range(n)]
    for i in range(n):
        for below in range(i + 1, n):
            factor = rows[below][i] / rows[i][i]
            if not factor.is_zero():
                rows[below] = [a - factor * b for a, b in zip(rows[below], rows[i], strict=True)]
    solved = [ca.SX(0)] * n
    for i in reversed(range(n)):
        later = sum(rows[i][j] * solved[j] for j in range(i + 1, n))
        solved[i] = (rows[i][n] - later) / rows[i][i]
    return ca.vertcat(*solved)
