"""Problems of others as they set them: what is published of their start, and exact solutions."""

from __future__ import annotations

import hydraulic_manipulator
import numpy as np
import pytest
import two_masses
from iftomm_linkages import BricardMechanism, FlyballGovernor, jointed_four_bars

from liaisons.mechanics import derive


def test_the_manipulator_rests_as_published() -> None:
    valve, *pressures = hydraulic_manipulator.VALVE, hydraulic_manipulator.FIRST, hydraulic_manipulator.SECOND
    assert valve == pytest.approx(0.45434559, abs=5e-9)
    assert tuple(pressures) == pytest.approx((3170846.2, 4529153.8), abs=0.05)
    # The piston carries 8829 N; a newton more accelerates it.
    arm = derive(hydraulic_manipulator.Arm)
    assert arm.evaluate("accelerations", stroke_force=8829.0) == pytest.approx(0.0, abs=1e-12)
    assert arm.evaluate("accelerations", stroke_force=8830.0)[1] > 1e-4


def test_oil_presses_as_the_pressures_say_and_does_not_flow_at_rest() -> None:
    cylinder = derive(hydraulic_manipulator.Cylinder)
    state = {"p_1": hydraulic_manipulator.FIRST, "p_2": hydraulic_manipulator.SECOND}
    # The operator draws the piston in with the force that the arm takes.
    assert cylinder.evaluate("operator_forces", **state) == pytest.approx(-8829.0, rel=1e-12)


@pytest.mark.parametrize("damping", [0.0, 0.01])
def test_masses_by_the_exponential_keep_or_lose_energy_as_their_dampers_say(damping: float) -> None:
    z = two_masses.exact(20000, damping)
    rates = z[2:]
    power = damping * (rates[0] ** 2 + rates[1] ** 2 + (rates[0] - rates[1]) ** 2)
    lost = np.trapezoid(power, dx=two_masses.DURATION / 20000)
    energy = two_masses.energy(z)
    assert energy[0] == 1e4
    # Trapezoids of 0.5 ms of what oscillates at 67/s: (0.0005 · 67)²/12.
    assert energy[0] - energy[-1] == pytest.approx(lost, rel=1e-4, abs=1e-8)


def test_both_masses_move_as_the_matrix_says() -> None:
    x_1, x_2, v_1, v_2 = z = np.array([0.3, -0.2, 5.0, 7.0])
    near = {"x": x_1, "x_dot": v_1, "far": x_2, "far_dot": v_2, "damping": 0.5}
    first, second = derive(two_masses.FirstMass), derive(two_masses.SecondMass)
    force = first.evaluate("operator_forces", **near)[0]
    away = second.evaluate("accelerations", x=x_2, x_dot=v_2, x_load=force, damping=0.5)
    expected = (two_masses.matrix(0.5) @ z)[2:]
    assert [*first.evaluate("accelerations", **near), *away] == pytest.approx(expected, rel=1e-13)


def test_the_program_of_the_benchmark_is_of_second_order_at_the_end_of_a_period() -> None:
    errors = [
        np.abs(two_masses.by_jacobi_and_euler(n, 0.01) - two_masses.exact(n, 0.01))[:2].max() for n in (4000, 8000)
    ]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


def test_loops_of_the_iftomm_benchmarks_close_with_the_conditions_that_depend_on_others() -> None:
    four_bars = jointed_four_bars(2)
    assert [len(four_bars.constraints), len(four_bars.redundant)] == [4, 6]
    turning = {f"pivot_{i}_dot": -1.0 for i in range(3)} | {f"left_{i}_dot": 1.0 for i in range(2)}
    # Three rods turn about their ends, two move along.
    assert derive(four_bars).evaluate("kinetic_energy", **turning) == pytest.approx((3 / 3 + 2) / 2, rel=1e-14)
    assert [len(BricardMechanism.constraints), len(BricardMechanism.redundant)] == [5, 1]


def test_governor_starts_with_its_couplers_at_rest_and_its_angular_momentum() -> None:
    governor = derive(FlyballGovernor)
    spin = governor.evaluate("momenta", spin_dot=2 * np.pi)[0] / (2 * np.pi)
    arms = 2 * (0.3 * (0.05 + 0.5 * np.cos(np.pi / 6)) ** 2 + 0.3 * np.cos(np.pi / 6) ** 2 * 1.0001 / 12)
    balls = 2 * 5.0 * (0.05 + np.cos(np.pi / 6)) ** 2
    assert spin == pytest.approx(arms + balls + 3.0 * 0.01 / 6, rel=1e-5)  # widths of rods neglected
    fall = governor.evaluate("accelerations")[1]  # no coupler pushes yet
    assert fall == pytest.approx(-9.81, rel=1e-12)
