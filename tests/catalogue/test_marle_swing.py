"""The general swing of M 8.1 from its four functions: it is Swing and Pendulum, and refuses what is no swing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest
from hand_derivations import applied
from on_paper import State, Values, assert_follows, equations_of, random_states, run, unloaded

from liaisons.cosim import simulate
from liaisons.errors import ComponentError, SimulationError, ValidityError
from liaisons.language import ActiveCoordinate
from liaisons.models import Pendulum, Swing
from liaisons_catalogue.general_swing import GeneralSwing, marle_swing

GRAVITY, SEAT, TORSO, B = 9.81, 20.0, 15.0, 0.5
SHAPE = {
    "rope": ActiveCoordinate("m", "distance from the pivot to the seat", start=2.0, above=0),
    "lean": ActiveCoordinate("rad", "angle of the torso", start=1.5),
}
MASSES: Values = {"mass_seat": SEAT, "mass_torso": TORSO, "torso_length": B, "gravity": GRAVITY}


# ---- the child on the swing, in the frame of its centre of mass (erratum MC1) ------------------------------------


def moment(rope: Any, lean: Any) -> tuple[Any, Any]:
    """Mass times centre of mass, along the rope and across it."""
    return (SEAT + TORSO) * rope + TORSO * B * ca.cos(lean), TORSO * B * ca.sin(lean)


def delta(rope: Any, lean: Any) -> Any:
    """Angle from the rope to the centre of mass."""
    along, across = moment(rope, lean)
    return ca.atan2(across, along)


def delta_rates(rope: Any, lean: Any) -> tuple[Any, Any]:
    """∂δ/∂rope, ∂δ/∂lean, by hand."""
    along, across = moment(rope, lean)
    square = along**2 + across**2
    return -across * (SEAT + TORSO) / square, (along * TORSO * B * ca.cos(lean) + across**2) / square


def inertia(rope: Any, lean: Any) -> Any:
    return SEAT * rope**2 + TORSO * (rope**2 + B**2 + 2 * rope * B * ca.cos(lean))


def couplings_of_the_rope(rope: Any, lean: Any) -> tuple[Any, Any]:
    return -TORSO * B * ca.sin(lean), TORSO * (B**2 + rope * B * ca.cos(lean))


def metric_of_the_rope(rope: Any, lean: Any) -> list[list[Any]]:  # noqa: ARG001
    mixed = -TORSO * B * ca.sin(lean)
    return [[SEAT + TORSO, mixed], [mixed, TORSO * B**2]]


def couplings(rope: Any, lean: Any) -> list[Any]:
    """J_α - I ∂_α δ."""
    I, J, d = inertia(rope, lean), couplings_of_the_rope(rope, lean), delta_rates(rope, lean)  # noqa: E741
    return [J[i] - I * d[i] for i in range(2)]


def metric(rope: Any, lean: Any) -> list[list[Any]]:
    """g_αβ - J_α ∂_β δ - J_β ∂_α δ + I ∂_α δ ∂_β δ."""
    I, J, d = inertia(rope, lean), couplings_of_the_rope(rope, lean), delta_rates(rope, lean)  # noqa: E741
    g = metric_of_the_rope(rope, lean)
    return [[g[i][j] - J[i] * d[j] - J[j] * d[i] + I * d[i] * d[j] for j in range(2)] for i in range(2)]


def weight(rope: Any, lean: Any) -> Any:
    along, across = moment(rope, lean)
    return GRAVITY * ca.sqrt(along**2 + across**2)


Child = marle_swing(inertia, couplings, metric, weight, shape=SHAPE, name="Child")


def rates_of_theta_com(n: dict[str, float]) -> tuple[float, float, np.ndarray]:
    """δ, δ' and ∂δ/∂s in numbers."""
    s = ca.SX.sym("s", 2)
    angle = delta(s[0], s[1])
    function = ca.Function("delta", [s], [angle, ca.jacobian(angle, s)])
    value, gradient = function([n["rope"], n["lean"]])
    gradient = np.asarray(gradient).ravel()
    return float(value), float(gradient @ [n["rope_dot"], n["lean_dot"]]), gradient


def in_both(component: type[GeneralSwing], n: State) -> State:
    """A state of Swing, without what it has beyond a general swing, in the angle of the centre of mass."""
    shift, rate, _ = rates_of_theta_com(n)
    same = {name: n[name] for name in equations_of(component).symbols}
    return State(component, same | {"theta": n.theta + shift, "theta_dot": n.theta_dot + rate})


def swing_states(count: int = 20, **fixed: float) -> list[State]:
    """Random states of Swing without loads on its points."""
    loads = {name: 0.0 for name in unloaded(Swing) if name.startswith(("seat_", "torso_"))}
    return random_states(Swing, count, **(MASSES | loads | fixed))


def test_four_functions_reproduce_the_swing() -> None:
    for n in swing_states():
        child = in_both(Child, n)
        # Two coordinate systems: sums of ten terms of a few hundred, some roundings each; Θ is g - J Jᵀ/I in either.
        for quantity in ("momenta", "momentum_rates", "mass_matrix", "energy", "effective_mass"):
            np.testing.assert_allclose(child(quantity), n(quantity), rtol=1e-11, atol=1e-10)
        # A couple on θ works on the shape, too, where θ is that of the rope: its power is couple · (θ_com' - δ').
        couple = applied(n, "theta") * rates_of_theta_com(n)[2]
        np.testing.assert_allclose(
            child("operator_forces"), n("operator_forces") - couple, rtol=1e-11, atol=1e-9
        )  # as above


def test_mc1_in_the_frame_of_the_rope_equation_54_does_not_hold() -> None:
    """P = -D cos θ with θ the angle of the rope: the weight pulls wrongly unless the torso lies on the rope."""
    wrong = marle_swing(inertia, couplings_of_the_rope, metric_of_the_rope, weight, shape=SHAPE)

    def in_the_frame_of_the_rope(n: State) -> State:
        return State(wrong, {name: n[name] for name in equations_of(wrong).symbols})

    for n in swing_states(5):
        same = in_the_frame_of_the_rope(n)
        assert same("momenta") == pytest.approx(n("momenta"), rel=1e-12)  # algebra
        assert abs(same("momentum_rates") - n("momentum_rates")) > 0.1  # N.m, of some hundred
    for n in swing_states(5, lean=0.0):
        assert in_the_frame_of_the_rope(n)("momentum_rates") == pytest.approx(n("momentum_rates"), 1e-12)


# ---- one shape coordinate, without declarations ------------------------------------------------------------------

Crouching = marle_swing(
    I=lambda length=1.3: 60 * length**2,
    J=lambda length: 0,  # noqa: ARG005
    g=lambda length: 60,  # noqa: ARG005
    D=lambda length: 60 * GRAVITY * length,
)


def test_point_mass_is_the_pendulum() -> None:
    fixed = {"mass": 60.0, "gravity": GRAVITY, "friction": 0.0, "bob_x_load": 0.0, "bob_z_load": 0.0}
    fixed |= {f"pivot_{axis}{order}": 0.0 for axis in "xz" for order in ("", "_dot", "_ddot")}
    for n in random_states(Pendulum, **fixed):
        same = State(Crouching, {name: n[name] for name in n if name in equations_of(Crouching).symbols})
        for quantity in ("momenta", "accelerations"):
            assert same(quantity) == pytest.approx(n(quantity), rel=1e-12)  # algebra
        assert same("operator_forces") == pytest.approx(n("operator_forces")[0], rel=1e-11)  # algebra


def test_shape_coordinates_are_the_arguments_of_the_moment_of_inertia() -> None:
    assert [(s.name, s.start, s.unit) for s in Crouching.actives] == [("length", 1.3, "1")]
    assert Crouching.__name__ == "MarleSwing"
    assert Crouching.__module__ == __name__  # so that a user's file that makes one defines it


def test_posture_that_is_kept_swings_like_the_compound_pendulum(fmu) -> None:
    start: Values = {"theta_0": 1.2, "theta_dot_0": 0.5}
    shapes: dict[type[GeneralSwing], Values] = {Child: {"rope": 1.8, "lean": 2.0}, Crouching: {"length": 1.7}}
    for component, shape in shapes.items():
        result = run(fmu(component), stop_time=50.0, step_size=0.5, **start, **shape)
        assert_follows(result, component.exact(result.time, **start, **shape), 1e-7)  # κ of a hundred over 50 s


# ---- bad input ---------------------------------------------------------------------------------------------------


Functions = dict[str, Callable[..., Any]]


@pytest.mark.parametrize(
    ("functions", "words"),
    [
        ({"I": lambda s: s}, "no mass moves with theta_dot at s = 0, where the start lies on a singularity"),
        ({"I": lambda: 1}, "I takes no argument"),
        ({"I": lambda theta=1: theta}, "cannot be called 'theta'"),
        ({"I": lambda D=1: D}, "cannot be called 'D'"),
        ({"J": lambda s: [0, s]}, r"J returns shape \(2, 1\).* s it must be \(1, 1\)"),
        ({"g": lambda s: [[1, s], [s, 1]]}, r"g returns shape \(2, 2\)"),
        ({"D": lambda: 1}, "D must take the shape coordinates s"),
        ({"J": lambda s, psi: s * psi}, "J must take the shape coordinates s"),
    ],
)
def test_functions_that_make_no_swing_are_named(functions: Functions, words: str) -> None:
    good: Functions = {"I": lambda s=1: s, "J": lambda s: 0 * s, "g": lambda s: 1 + 0 * s, "D": lambda s: s}
    made = good | functions
    with pytest.raises(ComponentError, match=words):
        marle_swing(made["I"], made["J"], made["g"], made["D"])


def test_fmu_watches_the_weight_and_the_metric(fmu) -> None:
    with pytest.raises(SimulationError, match="D > 0"):
        simulate(fmu(Crouching), stop_time=0.1, length=0.0)
    indefinite = marle_swing(
        lambda s=0.5: 1 + s**2, lambda s: 2 * s, lambda s: 1 + 0 * s, lambda s: 1 + 0 * s, name="Indefinite"
    )
    simulate(fmu(indefinite), stop_time=0.1, s=0.5)
    with pytest.raises(SimulationError, match="positive definite"):
        simulate(fmu(indefinite), stop_time=0.1, s=1.0)  # 2 · 1 - 2² < 0


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: Crouching.exact(1.0, length=0.0), "I = 0.0 and D = 0.0 must be > 0"),
        (lambda: Crouching.exact(1.0, lean=0.0), "MarleSwing.exact: nothing is called 'lean'; did you mean 'length'"),
    ],
)
def test_closed_form_names_what_it_does_not_cover(call: Callable[[], object], words: str) -> None:
    with pytest.raises(ValidityError, match=words):
        call()
