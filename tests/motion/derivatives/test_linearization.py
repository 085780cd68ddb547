"""Linear systems of FMUs: of ours against the derivatives of their symbols, of others against their equations."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from making import copied
from numpy.testing import assert_allclose

from exchange import BALL, DAHLQUIST, TANKS, VAN_DER_POL, Made
from liaisons import linearize
from liaisons.base.differences import extrapolated_derivative
from liaisons.errors import LiaisonsError, SimulationError
from liaisons.library import catalogue
from liaisons.mechanics import assemble

ROUNDING = 1e-12
"""Of sums of products, relative to the largest entry of a row or to 1."""


LARGE = ("DrivenChain", "FourierHoop", "PendulumChain", "PlanarCat", "SpatialCat")
"""Two to eight seconds a version; in FMI 3.0 their FMUs have the same C."""


@pytest.mark.parametrize(
    ("name", "fmi"),
    [
        pytest.param(name, fmi, marks=[pytest.mark.slow] * (name in LARGE and fmi == "3"))
        # Off Bricard's loop differences say nothing of multipliers; outputs of a Pid hold, and depend on nothing.
        for name in sorted(catalogue().keys() - {"Bricard", "Pid"})
        for fmi in ("2", "3")
    ],
)
def test_ours_have_the_derivatives_of_their_symbols(name: str, fmi: Any, fmu) -> None:
    component = catalogue()[name]
    model = assemble(component).flat()
    starts: Any = {v.name: v.start or 0.0 for v in (*model.parameters, *model.inputs)}
    random = np.random.default_rng(7)
    path = fmu(component, fmi=fmi)
    # away from rest, where more derivatives are not 0; rates fit constraints only where there are none
    ends = ("_ddot", "_force") if model.project else ("_dot", "_ddot", "_force", "_dot_0")
    moved = {
        name: start + 0.1 * random.uniform(0.5, 1.0)
        for name, start in starts.items()
        if name.partition("[")[0].endswith(ends)
    }
    moved |= {"x_0[3]": 1.3} if name == "BallRow" else {}  # no balls touch
    linear = linearize(path, moved, time=0.25)
    assert linear.method == "directional derivatives"
    continuous = [i for i, v in enumerate(model.inputs) if v.variability == "continuous"]
    assert linear.inputs == tuple(model.inputs[i].name for i in continuous)

    t, k = 0.25, np.array([{**starts, **moved}[v.name] for v in model.parameters])
    u = np.array([linear.values.get(v.name, v.start) for v in model.inputs])
    y, m = (np.array(vector).ravel() for vector in model.start(t, u, k))
    assert_allclose([linear.values[s.name] for s in model.states], y, rtol=1e-14, atol=1e-14)
    symbolic: Any = ca.MX
    states, inputs = symbolic.sym("y", len(y)), symbolic.sym("u", len(u))
    for contact in model.contacts:  # all gaps are open there
        if contact.friction:
            m[model.memory.index(f"{contact.name}_direction")] = np.sign(linear.values[contact.name])
    remembered = model.remember(t, states, inputs, k, m)
    calculated: Any = [
        model.derivatives(t, states, inputs, k, *[remembered][: model.derivatives.n_in() - 4]),
        model.outputs_function(t, states, inputs, k, remembered),
    ]
    jacobian: Any = ca.jacobian(ca.vertcat(*calculated), ca.vertcat(states, inputs))
    exact = np.array(ca.Function("jacobian", [states, inputs], [jacobian])(y, u))
    exact = exact[:, [*range(len(y)), *(len(y) + i for i in continuous)]]
    rows = {v.name: len(y) + i for i, v in enumerate(model.outputs)}
    chosen = [*range(len(y)), *(rows[output] for output in linear.outputs)]
    got = np.block([[linear.A, linear.B], [linear.C, linear.D]])
    scale = np.maximum(1.0, np.abs(exact[chosen]).max(axis=1, keepdims=True, initial=0.0))
    assert_allclose(got / scale, exact[chosen] / scale, rtol=0, atol=ROUNDING)


def test_van_der_pol_by_its_equations(made: Made) -> None:
    x0, x1, mu = 0.7, -1.2, 1.5
    linear = linearize(made(VAN_DER_POL), {"x0": x0, "x1": x1})
    A = [[0, 1], [-2 * x0 * x1 * mu - 1, mu * (1 - x0**2)]]
    assert_allclose(linear.A, A, rtol=1e-14)
    assert_allclose(linear.C, np.eye(2), rtol=1e-14)  # its outputs are its states, of which it gives no derivatives
    assert_allclose(linear.rates, [x1, mu * (1 - x0**2) * x1 - x0], rtol=1e-14)
    assert_allclose(linear.poles, np.sort_complex(np.linalg.eigvals(A)), rtol=1e-14)
    assert linear.B.shape == linear.D.shape == (2, 0)


def test_dahlquist_by_its_equation(made: Made) -> None:
    linear = linearize(made(DAHLQUIST), {"k": 3.0})
    assert (linear.A.item(), linear.C.item(), linear.poles.item()) == (-3.0, 1.0, -3.0)


@pytest.mark.parametrize("method", ["directional derivatives", "differences"])
def test_tanks_by_their_equations(made: Made, method: Any) -> None:
    """Differences are of fourth order in 1e-3 of the size: 1e-11 of what is of order 1."""
    upper, lower, area, g, inflow = 2.5, 1.5, 3.0, 9.81, 4.0
    path = made(TANKS if method == "directional derivatives" else replace(TANKS, partials=None))
    linear = linearize(path, {"upper": upper, "lower": lower, "area": area, "inflow": inflow})
    assert linear.method == method
    fall, drain = np.sqrt(g / 2 / upper), np.sqrt(g / 2 / lower)
    tolerance = 1e-14 if method == "directional derivatives" else 1e-10
    assert_allclose(linear.A, [[-fall / area, 0], [fall, -drain]], rtol=tolerance, atol=tolerance)
    assert_allclose(linear.B, [[1 / area], [0]], rtol=0, atol=tolerance)
    assert_allclose(linear.C, [[1, 0], [0, 1], [0, drain]], rtol=0, atol=tolerance)
    assert_allclose(linear.D, [[0], [0], [0.1]], rtol=0, atol=tolerance)
    assert linear.values["outflow"] == pytest.approx(np.sqrt(2 * g * lower) + 0.1 * inflow, rel=1e-14)
    assert (linear.states, linear.inputs, linear.outputs) == (
        ("upper", "lower"),
        ("inflow",),
        ("upper", "lower", "outflow"),
    )


def test_a_ball_in_flight(made: Made) -> None:
    linear = linearize(made(BALL), {"v": 3.0})
    assert_allclose(linear.A, [[0, 1], [0, 0]], rtol=1e-14)
    assert_allclose(linear.rates, [3.0, -9.81], rtol=1e-14)


def test_wrong_derivatives_are_not_believed(made: Made) -> None:
    wrong = {**(VAN_DER_POL.partials or {}), ("x1'", "x1"): "0"}
    path = made(replace(VAN_DER_POL, partials=wrong))
    with pytest.raises(SimulationError, match=r"^Foreign\.fmu: its derivative of der\(x1\) by x1 is 0, but -4\.5"):
        linearize(path)
    right = linearize(path, method="differences")
    assert_allclose(right.A, [[0, 1], [-2 * 2.0 * 0.5 * 1.5 - 1, 1.5 * (1 - 2.0**2)]], rtol=1e-9)


@pytest.mark.parametrize(("partial", "wrong"), [(("x1'", "x1"), "-4.5 * 1.0013"), (("x0'", "x0"), "6e-6")])
def test_derivatives_that_are_a_little_wrong_are_not_believed(made: Made, partial: tuple[str, str], wrong: str) -> None:
    """By 0.1 %, and by 1e-6 of x0'/x0 = 0.25 and of the 4 by which x1' changes."""
    with pytest.raises(SimulationError, match=r"ask its maker, or take differences"):
        linearize(made(replace(VAN_DER_POL, partials={**(VAN_DER_POL.partials or {}), partial: wrong})))


@pytest.mark.parametrize(("low", "high", "degree"), [(-1, 1, 6), (0, 1, 3), (-1, 0, 3)])
def test_differences_are_exact_for_polynomials_of_their_order(low: float, high: float, degree: int) -> None:
    """Of three sizes: to both sides, and to one at the edge of a domain; one degree more is estimated."""

    def values(h: float) -> np.ndarray:
        if not low <= h <= high:
            raise LiaisonsError("outside")
        return np.array([4 + 3 * h + sum((2 * h) ** k for k in range(2, n + 1)) for n in (degree, degree + 1)])

    slopes, errors = extrapolated_derivative(values, 3.0, (0.1, 0.05, 0.025))
    assert slopes[0] == pytest.approx(1.0, rel=1e-13)
    assert abs(slopes[1] - 1) < errors[1] < 1e-2


def test_a_kink_has_the_derivative_of_one_of_its_sides(made: Made) -> None:
    path = made(replace(DAHLQUIST, rates={"x": "-fabs(x)"}, partials={("x'", "x"): "-1"}))
    assert linearize(path, {"x": 0.0}).A.item() == -1.0


def test_a_pendulum_has_its_frequency(fmu) -> None:
    linear = linearize(fmu(catalogue()["Pendulum"]), {"theta": 0.0, "length": 2.0})
    assert linear.states == ("theta", "p_theta", "work", "dissipated")
    assert_allclose(linear.poles, [-1j * np.sqrt(9.81 / 2), 0, 0, 1j * np.sqrt(9.81 / 2)], rtol=0, atol=1e-14)
    assert_allclose(linear.rates, 0.0, rtol=0, atol=1e-15)
    moving = linearize(fmu(catalogue()["Pendulum"]), {"theta": 0.3, "theta_dot": 2.0, "mass": 3.0})
    assert moving.values["p_theta"] == pytest.approx(6.0)
    assert moving.rates[0] == pytest.approx(2.0)


def test_states_can_be_given(fmu) -> None:
    linear = linearize(fmu(catalogue()["Pendulum"]), {"p_theta": 2.0, "mass": 4.0})
    assert linear.values["theta_dot"] == pytest.approx(0.5)


def test_control_has_the_same_numbers(fmu) -> None:
    pytest.importorskip("control")
    linear = linearize(fmu(catalogue()["Pendulum"]), inputs="theta_force", outputs=["theta", "theta_dot"])
    plant = linear.to_control()
    for name in "ABCD":
        assert_allclose(getattr(plant, name), getattr(linear, name), rtol=1e-14)
    assert plant.state_labels == list(linear.states)
    assert (plant.input_labels, plant.output_labels) == (["theta_force"], ["theta", "theta_dot"])


@pytest.mark.variants(core=8)
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"at": {"thet": 1.0}}, "no variable 'thet'; did you mean 'theta'"),
        ({"at": {"energy": 1.0}}, "energy = 1.0: causality 'output', so it is calculated"),
        ({"at": {"length": -1.0}}, "length"),
        ({"at": 3}, "linearize: at = 3: give a dictionary"),
        ({"inputs": "force"}, "no variable 'force'; did you mean"),
        ({"outputs": 3}, "linearize: outputs = 3: give a name"),
        ({"time": np.nan}, "linearize: time = nan: must be a finite number"),
        ({"method": "guess"}, "linearize: method = 'guess': choose one of"),
    ],
)
def test_refusals_name_what_is_wrong(options: Any, message: str, fmu) -> None:
    with pytest.raises(LiaisonsError, match=message.replace("(", r"\(")):
        linearize(fmu(catalogue()["Pendulum"]), **options)


def test_states_without_names_are_refused(made: Made, tmp_path: Path) -> None:
    with pytest.raises(SimulationError, match="names 0 of its 1 states"):
        linearize(copied(made(DAHLQUIST), tmp_path, rb' derivative="."'))


def test_what_is_made_for_co_simulation_alone_is_refused(fmu) -> None:
    path: Path = fmu(catalogue()["Pendulum"], "python")
    with pytest.raises(SimulationError, match="its states cannot be moved, for it is not made for Model Exchange"):
        linearize(path)


def test_what_holds_its_outputs_between_samples_is_refused(fmu) -> None:
    with pytest.raises(SimulationError, match=r"Pid is sampled: .* linearize what it controls"):
        linearize(fmu(catalogue()["Pid"]))
