"""The three chains: against closed forms, against Newton's law, and against the same physics described otherwise."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from on_paper import Values, assert_follows, wave
from scipy.special import jv

from liaisons.chains import Chain
from liaisons.check import max_error
from liaisons.cosim import simulate
from liaisons.fmu import build
from liaisons.mechanics import assemble
from liaisons.models import DoublePendulum, DrivenChain, OscillatorChain, PendulumChain


@pytest.fixture(scope="session")
def sized(shared_folder: Path) -> Callable[..., Path]:
    """The FMU of a chain of n links: ``sized(PendulumChain, 2)``."""

    @cache
    def built(component: type[Chain], n: int, backend: Literal["native", "python"] = "native") -> Path:
        return build(assemble(component, n), shared_folder / f"n={n}", backend=backend)

    return built


# ---- closed forms against second ones ----------------------------------------------------------------------------


def difference_matrix(n: int, *, held: bool) -> np.ndarray:
    """-d²/dj² of a row with free ends, or with the left one held, written entry by entry."""
    matrix = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    matrix[-1, -1] = 1
    if not held:
        matrix[0, 0] = 1
    return matrix


@pytest.mark.parametrize("n", [2, 5, 30])
@pytest.mark.parametrize(("component", "held"), [(OscillatorChain, False), (DrivenChain, True)])
def test_modes_of_the_linear_chains(component, held: bool, n: int) -> None:
    frequencies, modes = component.normal_modes(n=n, mass=2.0, stiffness=8.0)
    matrix = 8.0 / 2.0 * difference_matrix(n, held=held)
    # Eigenvectors with entries of order 1, n roundings of terms of size 16.
    np.testing.assert_allclose(matrix @ modes, modes * frequencies**2, rtol=0, atol=16 * n * 1e-15)
    assert np.all(np.diff(frequencies) > 0)


@pytest.mark.parametrize("n", [2, 3, 10, 40])
def test_modes_of_the_hanging_chain(n: int) -> None:
    """Mass matrix and stiffness of small angles: m l² (n + 1 - max(i, j)) and m g l (n + 1 - i)."""
    length, gravity = 0.7, 9.81
    frequencies, modes = PendulumChain.normal_modes(n=n, length=length, gravity=gravity)
    i = np.arange(1, n + 1)
    mass = length**2 * (n + 1 - np.maximum(i[:, None], i))
    stiffness = gravity * length * np.diag(n + 1 - i)
    left, right = stiffness @ modes, mass @ modes * frequencies**2
    scale = np.abs(mass) @ np.abs(modes) * frequencies**2  # size of the terms that cancel
    assert np.max(np.abs(left - right) / scale) <= 1e-12  # Laguerre's recurrence loses some digits of 16 for n = 40
    assert np.all(np.diff(frequencies) > 0)


def test_pulse_in_the_free_chain_is_a_sum_of_bessel_functions() -> None:
    """u_j(t) = Σ J_2(j - l)(2 √(κ/m) t) over the mass that was displaced and its images in both ends."""
    n, struck, omega = 12, 4, 1.5
    t = np.linspace(0, 25, 101)
    start = np.eye(n)[struck - 1]
    images = [place + 2 * n * k for k in range(-5, 6) for place in (struck, 1 - struck)]
    j = np.arange(1, n + 1)
    bessel = sum(jv(2 * (j - place), 2 * omega * t[:, None]) for place in images)
    found = OscillatorChain.exact(t, u_0=start, mass=2.0, stiffness=2.0 * omega**2)
    # The nearest image left out has order 2 · 5 · 12 = 120, where J is below 1e-30 for arguments up to 75.
    np.testing.assert_allclose(found["u"], bessel, rtol=0, atol=1e-12)


@pytest.mark.parametrize("omega", [0.3, 1.0, 3.0])
def test_driven_chain_satisfies_newtons_law(omega: float) -> None:
    n, mass, stiffness, amplitude = 6, 1.3, 2.1, 0.2
    chain: Values = {"n": n, "mass": mass, "stiffness": stiffness}
    settings = chain | {"amplitude": amplitude, "angular_frequency": omega}
    t, h = np.linspace(0.5, 20, 40), 1e-3

    def u(times: np.ndarray) -> np.ndarray:
        return DrivenChain.exact(times, **settings)["u"]

    # Fourth-order difference: error h⁴/90 · Ω⁶ u, rounding 1e-15/h².
    acceleration = (-u(t + 2 * h) + 16 * u(t + h) - 30 * u(t) + 16 * u(t - h) - u(t - 2 * h)) / (12 * h**2)
    grip = amplitude * np.sin(omega * t)
    force = -stiffness * u(t) @ difference_matrix(n, held=True).T
    force[:, 0] += stiffness * grip
    np.testing.assert_allclose(mass * acceleration, force, rtol=0, atol=1e-8)
    exact = DrivenChain.exact(t, **settings)
    np.testing.assert_allclose(exact["drive_force"], stiffness * (grip - exact["u"][:, 0]), rtol=0, atol=1e-14)
    assert max_error(DrivenChain.exact(0.0, **settings)["u"], 0.0) <= 1e-14


# ---- accelerations and forces against a hand-derived form ----------------------------------------------------------


@pytest.mark.parametrize("n", [2, 9])
def test_pendulum_chain_obeys_newtons_law(n: int) -> None:
    """Rods can only pull: m r_j'' = m g + S_j - S_(j+1) along the rods, with the pivot moving as it likes."""
    model = assemble(PendulumChain, n).flat()
    rng = np.random.default_rng(n)
    for _ in range(5):
        mass, length, gravity = rng.uniform(0.5, 2, 3)
        u = {v.name: rng.normal() if v.name.startswith("pivot") else 0.0 for v in model.inputs}
        k = [mass, length, gravity, *rng.normal(size=2 * n)]
        y, _ = model.start(0, list(u.values()), k)
        names = [v.name for v in model.outputs]
        outputs = model.outputs_function(0, y, list(u.values()), k, [0] * len(model.memory))
        z = dict(zip(names, outputs.full().ravel(), strict=True))
        theta, rate = np.array(k[3 : 3 + n]), np.array(k[3 + n :])
        along = np.stack([-np.sin(theta), np.cos(theta)], axis=1)  # from bob j to the one above
        across = np.stack([np.cos(theta), np.sin(theta)], axis=1)
        pivot = np.array([u["pivot_x_ddot"], u["pivot_z_ddot"]])
        # Tensions from the condition that no rod changes its length: a tridiagonal system.
        system, right = np.zeros((n, n)), np.zeros(n)
        for j in range(n):
            # along_j · (r_(j-1)'' - r_j'') = l θ_j'²
            for i, sign in ((j - 1, 1.0), (j, -1.0)):
                if i < 0:
                    right[j] -= sign * along[j] @ pivot
                    continue
                system[j, i] += sign * along[j] @ along[i] / mass
                if i + 1 < n:
                    system[j, i + 1] -= sign * along[j] @ along[i + 1] / mass
                right[j] -= sign * along[j] @ [0, -gravity]
            right[j] -= length * rate[j] ** 2
        tension = np.linalg.solve(system, right)
        pulls = tension[:, None] * along
        bobs = (pulls - np.vstack([pulls[1:], np.zeros((1, 2))])) / mass + [0, -gravity]
        relative = np.diff(np.vstack([pivot, bobs]), axis=0)
        expected = (relative * across).sum(axis=1) / length
        found = np.array([z[f"theta_ddot[{j + 1}]"] for j in range(n)])
        scale = np.abs(tension).max() + gravity
        # Two linear systems of condition some 100 each.
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * scale / (mass * length))
        np.testing.assert_allclose([z["pivot_x_force"], z["pivot_z_force"]], pulls[0], rtol=0, atol=1e-12 * scale)


# ---- the same physics, described otherwise -------------------------------------------------------------------------


def test_two_links_are_the_double_pendulum(sized, fmu) -> None:
    """Moving pivot, a force on one angle, a load on the lower bob; all common outputs, over two seconds: κ < 100."""
    parameters: Values = {"mass": 1.3, "length": 0.8}
    double: Values = {f"{name}_{i}": value for name, value in parameters.items() for i in (1, 2)}
    move = {"pivot_x": wave(0.0, 0.1, 3.0)}
    span: Values = {"stop_time": 2.0, "step_size": 0.02, "tolerance": 1e-12}
    start: Values = {"theta_0": [1.0, -0.4], "theta_dot_0": [0.5, 0.2]}
    loads = {"theta_force[1]": np.sin, "bob_x_load[2]": lambda t: 0.3 * t}
    chain = simulate(sized(PendulumChain, 2), **span, **parameters, **start, inputs=move | loads)
    start = {name.replace("theta", f"theta_{i + 1}"): value[i] for name, value in start.items() for i in (0, 1)}
    loads = dict(zip(("theta_1_force", "bob_2_x_load"), loads.values(), strict=True))
    pair = simulate(fmu(DoublePendulum), **span, **double, **start, inputs=move | loads)
    same = {
        one.format(f"[{i}]"): pair[other.format(i)]
        for i in (1, 2)
        for one, other in (
            *((f"{name}{{}}", name.replace("theta", "theta_{}")) for name in ("theta", "theta_dot", "theta_ddot")),
            ("p_theta{}", "p_theta_{}"),
            ("bob_z{}", "bob_{}_z"),
        )
    }
    shared = ("pivot_x_force", "pivot_x_power", "pivot_z_force", "kinetic_energy", "potential_energy", "work")
    assert_follows(chain, same | {name: pair[name] for name in shared}, 1e-9)
