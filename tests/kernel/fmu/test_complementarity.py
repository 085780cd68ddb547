"""The choice of modes in C: many contacts, redundant ones, friction, against SciPy and the conditions themselves."""

from __future__ import annotations

from importlib import resources
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import nnls

from liaisons.base.compiled_code import call_c_function, compiled_library
from liaisons.base.contact_limits import HEADER

Floats = NDArray[Any]
TOLERANCE = 1e-13
REASONS = ("", "no force keeps them", "they contradict each other")
CHOICE = """
long choose_modes(long gaps, long contacts, const double *G, const double *stick, const double *slide,
                  const long *normal, const double *rate, const double *tolerance, long n, const long *contact,
                  long *modes, double *forces, double *rates)
{
    Complementarity p = {.gaps = gaps, .contacts = contacts, .G = G, .stick = stick, .slide = slide};
    Modes chosen = {0};
    p.n = n;
    for (long i = 0; i < contacts; ++i) {
        if (i >= gaps)
            p.normal[i - gaps] = normal[i];
        p.rate[i] = rate[i];
        p.tolerance[i] = tolerance[i];
        chosen[i] = modes[i];
    }
    for (long i = 0; i < n; ++i)
        p.contact[i] = contact[i];
    const Choice choice = complementarity_choose(&p, chosen, forces, rates);
    for (long i = 0; i < contacts; ++i)
        modes[i] = chosen[i];
    return choice;
}
"""


def _choice() -> Any:
    """The code of an FMU, with a function that ctypes can call."""
    runtime = resources.files("liaisons.fmu") / "runtime"
    header, code = ((runtime / f"complementarity.{end}").read_text("utf-8") for end in "hc")
    header = header.replace('#include "contact_limits.h"', HEADER.read_text("utf-8"))
    return compiled_library(code.replace('#include "complementarity.h"', header) + CHOICE, "-ffp-contract=off")


def chosen(
    G: Floats,
    rate: Floats,
    normals: list[int] | None = None,
    stick: float = 0.0,
    slide: float = 0.0,
    *,
    sliding: int = 0,
) -> tuple[str, Floats, Floats, Floats]:
    """Why there are no modes, modes, forces and rates; of contacts that were all open, the last ones sliding."""
    count, frictions = len(rate), len(normals or [])
    gaps = count - frictions
    bounds = np.repeat([[stick], [slide]], max(frictions, 1), axis=1)
    modes, choices = np.repeat([0, 1], [count - sliding, sliding]), np.arange(count - sliding)
    x, rates, tolerance = np.empty(count), np.empty(count), TOLERANCE * (1 + np.abs(rate))
    normal = np.array([*(-1,) * gaps, *(normals or [])])
    problem = [gaps, count, np.ascontiguousarray(G.T), *bounds, normal, rate.copy(), tolerance]
    why = call_c_function(_choice(), "choose_modes", *problem, len(choices), choices, modes, x, rates)
    return REASONS[why], modes, x, rates


@pytest.mark.parametrize("count", [3, 8, 9, 20, 40, 64])
def test_many_contacts_are_least_squares_that_are_not_negative(count: int) -> None:
    """x ≥ 0 ⊥ C (Cᵀ x + b) ≥ 0 are the conditions of the least |Cᵀ x + b| (Lawson and Hanson)."""
    random = np.random.default_rng(count)
    for _ in range(10):
        C = random.normal(size=(count, count + 5))
        rate = random.normal(size=count)
        why, modes, x, rates = chosen(C @ C.T, rate)
        assert not why
        expected, _ = nnls(C.T, -np.linalg.lstsq(C, rate, rcond=None)[0])
        np.testing.assert_allclose(x, expected, rtol=0, atol=1e-9 * (1 + x.max()))  # both solve by the same active set
        assert ((modes == 1) == (expected > 0)).all()
        assert rates.min() > -1e-11


@pytest.mark.parametrize("count", [4, 7, 20, 60])
def test_a_body_on_many_supports_shares_its_weight_by_least_norm(count: int) -> None:
    """The least |x|² with C A⁻¹ Cᵀ x = -C w and x ≥ 0: x = C ν where it pushes, and C ν ≤ 0 elsewhere."""
    random = np.random.default_rng(count)
    partly = 0
    for _ in range(20):
        C = np.column_stack([np.ones(count), random.uniform(-1, 1, (count, 2))])
        A = np.diag(random.uniform(0.2, 2, 3))
        w = -9.81 * np.linalg.solve(A, C.T @ random.dirichlet(np.full(count, 2 / count)))  # between supports
        why, _, x, rates = chosen(C @ np.linalg.solve(A, C.T), C @ w)
        assert not why
        pushes = x > 1e-9
        np.testing.assert_allclose(C.T @ x, -A @ w, rtol=0, atol=1e-9)
        np.testing.assert_allclose(rates, 0, rtol=0, atol=1e-10)
        nu, *_ = np.linalg.lstsq(C[pushes], x[pushes], rcond=None)
        np.testing.assert_allclose(C[pushes] @ nu, x[pushes], rtol=0, atol=1e-9)
        assert (C[~pushes] @ nu < 1e-9).all()
        assert x.min() > -1e-12
        partly += not pushes.all()
    assert partly > 0


def satisfies(x: Floats, rates: Floats, stick: float, slide: float) -> bool:
    """Whether Coulomb's conditions hold for as many tangents as normals."""
    (normal, tangent), (opens, slips) = np.split(x, 2), np.split(rates, 2)
    size = 1e-9 * (1 + np.abs(x).max())
    sliding = np.abs(slips) > size
    bound = np.where(sliding, slide, stick) * normal
    dissipates = ~sliding | (np.abs(tangent + np.sign(slips) * bound) < size)
    return bool(
        normal.min() > -size
        and opens.min() > -size
        and (np.abs(normal * opens) < size).all()
        and (np.abs(tangent) <= bound + size).all()
        and dissipates.all()
    )


@pytest.mark.parametrize("count", [3, 12, 32])
def test_a_block_on_many_rough_points_sticks_slides_or_tips(count: int) -> None:
    random = np.random.default_rng(count)
    tips = slides = rests = 0
    for _ in range(40):
        places = random.uniform(-1, 1, count)
        normal = np.column_stack([0 * places, 1 + 0 * places, places])
        tangent = np.column_stack([1 + 0 * places, 0 * places, 0.3 + 0 * places])
        C = np.vstack([normal, tangent])
        w = np.array([random.normal(0, 6), -9.81, random.normal(0, 25)])
        mu = random.uniform(0.2, 0.8)
        G = C @ np.diag([1, 1, 3]) @ C.T
        why, _, x, rates = chosen(G, C @ w, [*range(count)], 1.1 * mu, mu)
        assert not why
        assert satisfies(x, rates, 1.1 * mu, mu)
        opening = bool((rates[:count] > 1e-9).any())
        tips, slides = tips + opening, slides + bool((np.abs(rates[count:]) > 1e-9).all() and not opening)
        rests += bool((np.abs(rates) < 1e-9).all())
    assert min(tips, slides, rests) > 2


def test_pivots_and_combinations_choose_the_same() -> None:
    """Of contacts with friction, alone and beside five that do not touch them."""
    random = np.random.default_rng(1)
    for _ in range(60):
        C = random.normal(size=(8, 12))
        G, rate = C @ C.T / 12, random.normal(size=8)
        why, modes, x, _ = chosen(G, rate, [0, 1, 2, 3], 0.2, 0.2)
        assert not why
        more, order = np.eye(13), [*range(4), *range(9, 13)]
        more[np.ix_(order, order)] = G
        rates = np.full(13, 1.0)
        rates[order] = rate
        why, many, forces, _ = chosen(more, rates, [0, 1, 2, 3], 0.2, 0.2)
        assert not why
        assert (many[order] == modes).all()
        np.testing.assert_allclose(forces[order], x, rtol=0, atol=1e-12 * (1 + np.abs(x).max()))


@pytest.mark.parametrize("beside", [0, 20])
def test_what_has_no_solution_is_told(beside: int) -> None:
    """A ball that two walls press from both sides, and Painlevé's rod; alone, and beside others."""
    G, rate = np.eye(2 + beside), np.ones(2 + beside)
    G[:2, :2], rate[:2] = [[1, -1], [-1, 1]], -1
    assert chosen(G, rate)[0].startswith("they contradict each other")
    rate[1] = 1  # it gives way
    assert chosen(G, rate)[0] == ""
    G, rate = np.eye(2 + beside), np.ones(2 + beside)
    ends = np.ix_([0, -1], [0, -1])
    G[ends], rate[0], rate[-1] = [[1, 0.9], [0.9, 1]], -1, 5
    assert chosen(G, rate, [0], 2.0, 2.0, sliding=1)[0].startswith("no force keeps them")
    assert chosen(G, rate, [0], 0.5, 0.5, sliding=1)[0] == ""
