"""Measured tables, ``ca.interpolant``, in energies, points and constraints, against SciPy's splines of the same points.

CasADi's "bspline" has no knot at the second and the last but one point, as SciPy's ``make_interp_spline`` of degree 3.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import make_interp_spline

from liaisons import (
    ActiveCoordinate,
    Coordinate,
    Gravity,
    Mechanism,
    Parameter,
    build,
    constraint,
    derive,
    point,
    simulate,
)
from liaisons.errors import ComponentError
from liaisons.mechanics import assemble

X = np.linspace(-2, 2, 41)
HEIGHTS = 0.3 * X**4 - 0.5 * X**2
CURVE = ca.interpolant("curve", "bspline", [X], HEIGHTS)
SURFACE = ca.interpolant("surface", "bspline", [X, X], np.add.outer(HEIGHTS, np.sin(X)).ravel(order="F"))
KINKED = ca.interpolant("kinked", "linear", [X], HEIGHTS)
F = make_interp_spline(X, HEIGHTS, k=3)
G = 9.81


class MeasuredWire(Mechanism):
    """Bead on a measured wire z = f(x), turned about the vertical."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    gravity = Gravity()
    x = Coordinate("m", "distance from the axis", start=0.4)
    turn = ActiveCoordinate("rad", "turn of the wire")

    @point("m", "bead")
    def bead(self) -> dict[str, ca.SX]:
        return {"x": self.x * ca.cos(self.turn), "y": self.x * ca.sin(self.turn), "z": CURVE(self.x)}

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self.bead)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.bead["z"]


class Particle(Mechanism):
    """A particle in space."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    gravity = Gravity()
    x = Coordinate("m", "distance", start=0.4)
    z = Coordinate("m", "height", start=float(F(0.4)))

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * (self.dot(self.x) ** 2 + self.dot(self.z) ** 2)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.z


class OnWire(Particle):
    @constraint("m", "height over the wire")
    def wire(self) -> ca.SX:
        return self.z - CURVE(self.x)


class OnSurface(Mechanism):
    """A particle on a measured surface z = h(x, y)."""

    mass = Parameter(2.0, "kg", "mass", above=0)
    x = Coordinate("m", "distance", start=0.4)
    y = Coordinate("m", "distance", start=-0.3)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared({"x": self.x, "y": self.y, "z": SURFACE(ca.vertcat(self.x, self.y))})


def slopes(x: float) -> tuple[float, float]:
    return float(F(x, 1)), float(F(x, 2))


def test_the_reference_is_the_same_curve() -> None:
    for x in np.linspace(-2, 2, 301):
        assert float(CURVE(x)) == pytest.approx(float(F(x)), abs=1e-14)  # rounding of a linear system of 41 points


def test_a_bead_on_a_measured_wire_has_the_equations_worked_out_by_hand() -> None:
    """A = m (1 + f'²), p = A x'; A x'' = m x φ'² - m f' f'' x'² - m g f'."""
    wire = derive(MeasuredWire)
    for x, v, w in ((0.4, 0.7, 1.3), (-1.9, -2.0, 0.0), (1.234, 0.1, -0.5)):
        state = {"x": x, "x_dot": v, "turn_dot": w, "mass": 3.0}
        first, second = slopes(x)
        A = 3.0 * (1 + first**2)
        assert wire.evaluate("mass_matrix", **state) == pytest.approx(A, rel=1e-13)
        assert wire.evaluate("momenta", **state) == pytest.approx(A * v, rel=1e-13)
        expected = 3.0 * (x * w**2 - first * second * v**2 - G * first) / A
        assert wire.evaluate("accelerations", **state) == pytest.approx(expected, rel=1e-11)  # f'' of 41 points
        assert wire.evaluate("velocities", **state, p_x=A * v) == pytest.approx(v, rel=1e-13)


def test_a_constraint_and_a_point_on_it_give_one_motion() -> None:
    wire, held = derive(MeasuredWire), derive(OnWire)
    for x, v in ((0.4, 0.7), (1.5, -2.0)):
        along = wire.evaluate("accelerations", x=x, x_dot=v)[0]
        state = {"x": x, "z": float(F(x)), "x_dot": v, "z_dot": slopes(x)[0] * v}
        assert held.evaluate("accelerations", **state)[0] == pytest.approx(along, rel=1e-13)
    assemble(OnWire)  # no symbol of rates is left over in a function of the state


def test_the_mass_matrix_of_a_measured_surface() -> None:
    """A = m (1 + ∇h ∇hᵀ), ∇h = (f'(x), cos y) up to the spline of sin: 1e-6 of 41 points."""
    first, _ = slopes(0.4)
    slope = np.array([first, np.cos(-0.3)])
    matrix = derive(OnSurface).evaluate("mass_matrix", x=0.4, y=-0.3, x_dot=5.0)
    np.testing.assert_allclose(matrix, 2.0 * (np.eye(2) + np.outer(slope, slope)), rtol=0, atol=5e-6)


def test_a_table_with_kinks_is_refused_where_rates_would_jump() -> None:
    class Polygon(MeasuredWire):
        @point("m", "bead")
        def bead(self) -> dict[str, Any]:
            return {"x": self.x, "z": CURVE(self.x)}

    with pytest.raises(ComponentError, match=r"KinkedWire: the kinetic energy contains the slope of .*'kinked'"):

        class KinkedWire(Polygon):
            @point("m", "bead")
            def bead(self) -> dict[str, Any]:
                return {"x": self.x, "z": KINKED(self.x)}

    with pytest.raises(ComponentError, match=r"KinkedConstraint.wire: contains the table 'kinked'.*by 'bspline'"):

        class KinkedConstraint(Particle):
            @constraint("m", "height over the wire")
            def wire(self) -> ca.SX:
                return self.z - KINKED(self.x)

    class KinkedPotential(Particle):
        def potential_energy(self) -> ca.SX:
            return self.mass * self.gravity * (self.z + KINKED(self.x))

    first = (np.interp(0.45, X, HEIGHTS) - np.interp(0.41, X, HEIGHTS)) / 0.04  # between two points: no kink
    force = derive(KinkedPotential).evaluate("momentum_rates", x=0.43)[0]
    assert force == pytest.approx(-G * first, rel=1e-12)  # a force may jump


def test_the_account_of_a_turned_measured_wire_closes() -> None:
    """Calls in the generated code leave the runtime's pointers as they are."""
    turned = {"turn": lambda t: (3 * t, 3.0, 0.0)}
    run = simulate(MeasuredWire, stop_time=0.2, step_size=0.1, tolerance=1e-10, inputs=turned)
    assert abs(run["work"][-1]) > 1e-3
    assert run["work"][0] == 0
    assert np.max(np.abs(run["energy_balance"])) < 1e-9  # ten times the tolerance, of energies below 1 J


@pytest.mark.slow
def test_motions_on_a_measured_wire(tmp_path) -> None:
    """Native and Python FMUs, wire as point and as constraint, against SciPy's DOP853 on SciPy's spline."""

    def rates(_: float, y: Any) -> list[float]:
        first, second = slopes(y[0])
        return [y[1], -(first * second * y[1] ** 2 + G * first) / (1 + first**2)]

    t = np.linspace(0, 1, 21)
    x = solve_ivp(rates, (0, 1), [0.4, 0.0], "DOP853", t, rtol=1e-12, atol=1e-13).y[0]
    python = build(MeasuredWire, output=tmp_path, backend="python")
    # At a knot f''' jumps: the order of a step there is 4, and tolerances are met, not surpassed.
    for subject in (MeasuredWire, OnWire, python):
        run = simulate(subject, stop_time=1.0, step_size=0.05, tolerance=1e-10)
        np.testing.assert_allclose(run["x"], x, rtol=0, atol=1e-8)
        assert np.max(np.abs(run["energy_balance"])) < 1e-8
