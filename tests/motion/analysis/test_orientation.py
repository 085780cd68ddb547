"""The analysis of mechanisms with an orientation: a top with a weight, a satellite, a cat in space.

An orientation has three momenta, conjugate to turns about the axes of the inertial frame, which do not commute.
"""

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from liaisons.errors import ComponentError
from liaisons.language import Mechanism, Orientation, Parameter
from liaisons.models import Satellite
from liaisons_motion import analysis

QUATERNION, RATES, MOMENTA = (list(names) for names in (Orientation.quaternion, Orientation.rates, Orientation.momenta))
ROUNDING = 1e-13  # a few dozen operations on numbers of order 1


class HeavyTop(Mechanism):
    """Top with a fixed point, its centre of mass at (0, 0, arm) in its own frame; the weight turns it."""

    inertia_x = Parameter(1.0, "kg.m2", "about its first axis", above=0)
    inertia_y = Parameter(1.3, "kg.m2", "about its second axis", above=0)
    inertia_z = Parameter(0.6, "kg.m2", "about its third axis", above=0)
    moment = Parameter(2.0, "N.m", "weight times arm")
    attitude = Orientation("attitude of the top")

    def kinetic_energy(self) -> ca.SX:
        return ca.dot(ca.vertcat(self.inertia_x, self.inertia_y, self.inertia_z), self.attitude.rate**2) / 2

    def potential_energy(self) -> ca.SX:
        return self.moment * self.attitude.matrix[2, 2]


INERTIA = np.array([1.0, 1.3, 0.6])


def states(count: int = 10, *names: str) -> list[tuple[dict[str, float], Rotation]]:
    """Random attitudes, momenta, and whatever else is named; and the turns that the attitudes are."""
    random, found = np.random.default_rng(5), []
    for _ in range(count):
        q = random.normal(size=4)
        values = (*(q / np.linalg.norm(q)), *random.normal(size=3 + len(names)))
        n = dict(zip((*QUATERNION, *MOMENTA, *names), values, strict=True))
        found.append((n, Rotation.from_quat(q, scalar_first=True)))
    return found


def momentum(n: dict[str, float]) -> NDArray:
    return np.array([n[name] for name in MOMENTA])


def test_hamiltonian_and_its_equations_are_those_of_euler() -> None:
    """H = ½ Π J⁻¹ Π + V with Π = Rᵀ H; q' = q (0, ω)/2, H' is the moment of the weight."""
    energy, equations = analysis.hamiltonian(HeavyTop), analysis.hamilton_equations(HeavyTop)
    for n, R in states():
        omega = R.inv().apply(momentum(n)) / INERTIA
        e = R.apply([0, 0, 1])
        assert energy.evaluate(**n) == pytest.approx(omega**2 @ INERTIA / 2 + 2 * e[2], rel=ROUNDING)
        after, before = ((R * Rotation.from_rotvec(sign * 1e-6 * omega)).as_matrix() for sign in (1, -1))
        q = np.array([n[name] for name in QUATERNION])
        rates = equations.evaluate(**n)
        forth, back = (
            Rotation.from_quat(q + sign * 1e-6 * rates[:4], scalar_first=True).as_matrix() for sign in (1, -1)
        )
        np.testing.assert_allclose(
            (forth - back) / 2e-6, (after - before) / 2e-6, rtol=0, atol=1e-9
        )  # 1e-6², 1e-16/1e-6
        np.testing.assert_allclose(rates[4:], np.cross(e, [0, 0, -2.0]), rtol=0, atol=ROUNDING)
        np.testing.assert_allclose(analysis.phase_velocity(HeavyTop).evaluate(**n), rates, rtol=0, atol=ROUNDING)


def test_brackets_of_momenta_are_those_of_turns() -> None:
    """{H_x, H_y} = -H_z (K's sign), {H_i, e_j} turns the vector e, and da/dt = {H, a}."""
    H = [analysis.observable(HeavyTop, lambda m, i=i: m.attitude.momentum[i]) for i in range(3)]
    e = [analysis.observable(HeavyTop, lambda m, i=i: m.attitude.matrix[i, 2]) for i in range(3)]
    energy, flow = analysis.hamiltonian(HeavyTop), analysis.hamilton_equations(HeavyTop)
    for n, R in states():
        axis, h = R.apply([0, 0, 1]), momentum(n)
        for i, unit in enumerate(np.eye(3)):
            turned = [analysis.poisson_bracket(H[i], component).evaluate(**n) for component in e]
            np.testing.assert_allclose(turned, np.cross(unit, axis), rtol=0, atol=ROUNDING)
            among = [analysis.poisson_bracket(H[i], other).evaluate(**n) for other in H]
            np.testing.assert_allclose(among, np.cross(unit, h), rtol=0, atol=ROUNDING)
        rates = [analysis.poisson_bracket(energy, component).evaluate(**n) for component in H]
        np.testing.assert_allclose(rates, flow.evaluate(**n)[4:], rtol=0, atol=ROUNDING)
        spin = R.apply(R.inv().apply(h) / INERTIA)
        rates = [analysis.poisson_bracket(energy, component).evaluate(**n) for component in e]
        np.testing.assert_allclose(rates, np.cross(spin, axis), rtol=0, atol=1e-13)


def test_noether_on_turns() -> None:
    """A weight leaves the turns about the vertical; without it all three are symmetries, moving wheels or not."""
    about_z = analysis.noether(HeavyTop, lambda _: {"attitude": (0, 0, 1)})
    axis = (0.6, 0.0, 0.8)
    total = analysis.noether(Satellite, lambda _: {"attitude": axis})
    for n, R in states(10, *RATES):
        rates, q = {name: n[name] for name in RATES}, {name: n[name] for name in QUATERNION}
        omega = np.array(list(rates.values()))
        assert about_z.evaluate(**q, **rates) == pytest.approx(R.apply(INERTIA * omega)[2], rel=1e-13)
        found = total.evaluate(**q, **rates, wheel_2_dot=3.0)
        assert found == pytest.approx(R.apply([10, 12, 8] * omega + [0, 0.3, 0]) @ axis, rel=1e-13)
    with pytest.raises(ComponentError, match="is no symmetry"):
        analysis.noether(HeavyTop, lambda _: {"attitude": (1, 0, 0)})


def test_flow_of_a_top_keeps_volume_energy_and_the_vertical_momentum() -> None:
    """Liouville: the divergence vanishes, det J = 1, though the quaternion has four components."""
    divergence = analysis.divergence(HeavyTop)
    for n, _ in states():
        assert divergence.evaluate(**n) == pytest.approx(0.0, abs=ROUNDING)
    start = {"omega_x": 0.3, "omega_y": -0.5, "omega_z": 2.0, "q_w": np.cos(0.4), "q_x": np.sin(0.4)}
    flow = analysis.flow(HeavyTop, 3.0, **start)
    assert flow.determinant == pytest.approx(1.0, abs=1e-8)  # integration at 1e-11, entries of J up to ten
    assert sum(flow.state[name] ** 2 for name in QUATERNION) == pytest.approx(1.0, abs=1e-9)
    energy = analysis.hamiltonian(HeavyTop)
    assert energy.evaluate(**flow.state) == pytest.approx(float(energy.evaluate(**start)), abs=1e-10)
    begin = R_z(start) @ (INERTIA * [0.3, -0.5, 2.0])
    assert flow.state["H_z"] == pytest.approx(begin, abs=1e-9)  # integration
    assert abs(flow.state["H_x"]) > 0.1  # while the others change


def R_z(n: dict[str, float]) -> NDArray:  # noqa: N802
    q = [n.get(name, 0.0) for name in QUATERNION]
    return Rotation.from_quat(q, scalar_first=True).as_matrix()[2]
