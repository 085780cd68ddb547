"""A mechanism whose coordinates are all prescribed: forces and power of its operators, by inverse dynamics."""

from __future__ import annotations

from functools import partial

import casadi as ca
import numpy as np
import pytest

from liaisons import build, derive, equations, operator, simulate
from liaisons.chains import Chain
from liaisons.errors import ComponentError
from liaisons.language import ActiveCoordinate, Gravity, Mechanism, Parameter, point


class Arm(Mechanism):
    """Two links with a mass at each end, whose joints are driven."""

    mass = Parameter(2.0, "kg", "mass at each end", above=0)
    length = Parameter(1.5, "m", "length of each link", above=0)
    gravity = Gravity()
    shoulder = ActiveCoordinate("rad", "angle of the upper link from the vertical")
    elbow = ActiveCoordinate("rad", "angle of the lower link from the upper one")

    @point("m", "end of the upper link")
    def joint(self) -> dict[str, ca.SX]:
        return {"x": self.length * ca.sin(self.shoulder), "z": -self.length * ca.cos(self.shoulder)}

    @point("m", "end of the lower link")
    def hand(self) -> dict[str, ca.SX]:
        angle = self.shoulder + self.elbow
        x, z = self.joint["x"] + self.length * ca.sin(angle), self.joint["z"] - self.length * ca.cos(angle)
        return {"x": x, "z": z}

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * (self.speed_squared(self.joint) + self.speed_squared(self.hand))

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * (self.joint["z"] + self.hand["z"])


@pytest.mark.parametrize(("backend", "fmi"), [("native", "2"), ("native", "3"), ("python", "2")])
def test_torques_of_an_arm_are_those_of_newton_and_euler(tmp_path, backend, fmi) -> None:
    fmu = build(Arm, tmp_path, backend=backend, fmi=fmi)
    swing = operator("Sinusoid", amplitude=0.5, angular_frequency=2.0)
    result = simulate(fmu, shoulder=swing, elbow=operator("Ramp", rate=0.3), stop_time=3.0, step_size=0.05)
    a, b, a_dot, b_dot, a_ddot, b_ddot = (
        result[f"{q}{d}"] for d in ("", "_dot", "_ddot") for q in ("shoulder", "elbow")
    )
    # Forces on each mass from its acceleration, then torques about the joints, with m = 2 kg, l = 1.5 m.
    m, length, c = 2.0, 1.5, a + b
    c_dot, c_ddot = a_dot + b_dot, a_ddot + b_ddot
    upper = length * np.array([a_ddot * np.cos(a) - a_dot**2 * np.sin(a), a_ddot * np.sin(a) + a_dot**2 * np.cos(a)])
    lower = upper + length * np.array(
        [c_ddot * np.cos(c) - c_dot**2 * np.sin(c), c_ddot * np.sin(c) + c_dot**2 * np.cos(c)]
    )
    weight = np.array([[0.0], [m * 9.81]])
    on_lower = m * lower + weight
    on_upper = m * upper + weight + on_lower
    elbow = length * (np.cos(c) * on_lower[0] + np.sin(c) * on_lower[1])
    shoulder = elbow + length * (np.cos(a) * on_upper[0] + np.sin(a) * on_upper[1])
    np.testing.assert_allclose(result["elbow_force"], elbow, rtol=0, atol=1e-12)  # rounding of numbers of size 100
    np.testing.assert_allclose(result["shoulder_force"], shoulder, rtol=0, atol=1e-12)
    np.testing.assert_allclose(result["elbow_power"], elbow * b_dot, rtol=0, atol=1e-12)
    assert np.abs(result["energy_balance"]).max() < 1e-6  # the work is integrated, relative tolerance 1e-8 of 60 J
    assert np.ptp(result["energy"]) > 1


def test_an_arm_moves_a_load(tmp_path) -> None:
    """What hangs at the hand is felt by both joints."""
    run = partial(simulate, build(Arm, tmp_path), shoulder=0.3, elbow=0.4, stop_time=0.1, step_size=0.1)
    still, loaded = run(), run(hand_z_load=5.0)
    lever = 1.5 * np.sin(0.7)
    assert loaded["elbow_force"] - still["elbow_force"] == pytest.approx(5.0 * lever, rel=1e-12)


def test_its_equations_are_shown() -> None:
    assert derive(Arm).mass_matrix.shape == (0, 0)
    assert {"forces", "power", "effective_mass", "hamiltonian", "canonical"} <= set(equations(Arm).parts)
    assert "momenta" not in equations(Arm).parts


def test_a_chain_needs_a_coordinate_of_its_links() -> None:
    namespace = {"grip": ActiveCoordinate("m", "grip"), "kinetic_energy": lambda _: ca.SX(0), "tip": lambda _: {}}
    with pytest.raises(ComponentError, match="Rigid: declare at least one Coordinate"):
        type("Rigid", (Chain,), namespace | {"__module__": __name__})
