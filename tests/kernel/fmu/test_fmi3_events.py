"""FMI 3.0 co-simulation: event mode, early return, intermediate update."""

from __future__ import annotations

import numpy as np
import pytest
from driver import CO_SIMULATION, DISCARD, ERROR, OK, Instance, Library
from handmade import breathing, breathing_inputs

from liaisons.models import Ramp

WITH_EVENTS = {"events": True, "early": True}


def stepping(library: Library, **start: float) -> Instance:
    """An instance with event mode that has left it."""
    return library.running(CO_SIMULATION, options=WITH_EVENTS, **start)


# ---- instants of the component -----------------------------------------------------------------------------------


def test_instant_inside_a_step_returns_early(kick3) -> None:
    """x' = 1 up to t_1, then 3: the value before the event first, after it that behind; then the rest of the step."""
    instance = kick3.start(options=WITH_EVENTS, t_1=0.7)
    assert instance.update().next_time == 0.7
    instance.do("EnterStepMode")
    assert instance.advance(0.0, 0.5) == (OK, False, False, 0.5)
    assert instance.advance(0.5, 0.5) == (OK, True, True, 0.7)
    assert instance.get("x_dot", "time").tolist() == [1.0, 0.7]
    assert instance["x"] == pytest.approx(0.7, rel=1e-14)
    instance.do("EnterEventMode")
    assert instance["x_dot"] == 3.0
    assert instance.update().next_time is None
    instance.do("EnterStepMode")
    step = instance.advance(0.7, 0.3)
    assert step == (OK, False, False, pytest.approx(1.0, rel=1e-15))
    assert instance["x"] == pytest.approx(0.7 + 3 * 0.3, rel=1e-14)


@pytest.mark.variants(core=5)
@pytest.mark.parametrize(("t_1", "size"), [(0.5, 0.5), (0.9, 0.3), (0.3, 0.1), (1.4, 0.1), (900.3, 300.1)])
def test_instant_at_the_end_of_a_step(kick3, t_1, size) -> None:
    """Or where rounding puts it beside: 3 · 0.3 < 0.9, 0.2 + 0.1 > 0.3, 3 · 300.1 > 900.3.  That is no early return."""
    instance = stepping(kick3, t_1=t_1)
    steps = [instance.advance(i * size, size) for i in range(round(t_1 / size))]
    assert [step[:3] for step in steps] == [(OK, False, False)] * (len(steps) - 1) + [(OK, True, False)]
    assert steps[-1].time == t_1
    assert instance["x_dot"] == 1.0
    instance.do("EnterEventMode")
    assert instance["x_dot"] == 3.0


def test_operator_without_states_stops_too(library) -> None:
    instance = stepping(library(Ramp, "fmi3"), start_time=0.25)
    assert instance.advance(0.0, 1.0) == (OK, True, True, 0.25)
    assert instance.get("y", "y_dot").tolist() == [0.0, 0.0]
    instance.do("EnterEventMode")
    assert instance.get("y", "y_dot").tolist() == [0.0, 1.0]
    instance.do("EnterStepMode")
    assert instance.advance(0.25, 1.0) == (OK, False, False, 1.25)
    assert instance.get("y", "y_dot").tolist() == [1.0, 1.0]


@pytest.mark.parametrize("options", [{"events": True}, {"early": True}, {}])
def test_instants_are_handled_inside_where_the_importer_cannot(kick3, options) -> None:
    instance = kick3.start(options=options, t_1=0.7)
    if "events" in options:
        instance.do("EnterStepMode")
    assert instance.advance(0.0, 1.0) == (OK, False, False, 1.0)
    assert instance["x"] == pytest.approx(0.7 + 3 * 0.3, rel=1e-14)


# ---- jumps of inputs ---------------------------------------------------------------------------------------------


def test_jump_in_event_mode_while_inputs_are_interpolated(pendulum3) -> None:
    """In step mode values belong to the end of the step to come; in event mode to the present: l' jumps by 0.3 m/s.

    The jump does the work m/2 0.3² (M eq. 28 integrated); angle and momentum stay.
    """
    instance = stepping(pendulum3, input_reconstruction=2, theta_0=0.8)
    instance.step(0.0, 0.5)
    before = instance.get("theta", "p_theta", "work")
    instance.do("EnterEventMode")
    instance.set(length_dot=0.3)
    assert instance.get("theta", "p_theta").tolist() == before[:2].tolist()
    assert instance["work"] == pytest.approx(before[2] + 0.3**2 / 2, rel=1e-14)
    assert instance.update().states_changed
    instance.do("EnterStepMode")
    instance.set(length=1.15)  # at the end of the next step, at the same rate
    instance.step(0.5, 0.5)
    assert instance["length"] == 1.15
    assert abs(instance["energy_balance"]) <= 1e-7  # tolerance 1e-8 of energies of 10 J


def test_early_return_keeps_the_way_that_inputs_were_on(pendulum3) -> None:
    """An interpolated step that is interrupted and completed is the step: a quintic goes on as it is."""

    def run(stop: float | None) -> np.ndarray:
        def observer(_: Instance, time: float) -> float | None:
            return stop if stop is not None and time < stop else None

        options = {"early": True, "observer": observer}
        start = breathing_inputs(0.0)
        instance = pendulum3.start(options=options, tolerance=1e-12, input_reconstruction=2, theta_0=0.8, **start)
        instance.set(breathing_inputs(0.5))
        step = instance.advance(0.0, 0.5)
        if stop is not None:
            assert step == (OK, False, True, stop)
            instance.step(stop, 0.5 - stop)
        assert instance["length"] == breathing(0.5)[0]
        return instance.get("theta", "p_theta", "work", "energy_balance")

    np.testing.assert_allclose(run(0.2), run(None), rtol=0, atol=1e-11)  # two solutions at a tolerance of 1e-12


# ---- intermediate update -----------------------------------------------------------------------------------------


def test_every_step_of_the_solver_is_shown(pendulum3) -> None:
    """Increasing times up to the end, outputs of the motion there, rates of outputs; and the result is not touched."""
    seen: list[tuple[float, float, float, float]] = []

    def observer(instance: Instance, time: float) -> None:
        (rate,) = instance.output_derivatives("theta")
        theta, theta_dot, clock = instance.get("theta", "theta_dot", "time")
        assert clock == time
        assert rate == pytest.approx(theta_dot, rel=1e-13)
        seen.append((time, theta, instance["energy_balance"], instance["energy"]))

    watched = pendulum3.start(options={"observer": observer}, theta_0=2.0)
    alone = pendulum3.start(theta_0=2.0)
    assert watched.advance(0.0, 3.0) == alone.advance(0.0, 3.0) == (OK, False, False, 3.0)
    names = ("theta", "p_theta", "work", "energy_balance")
    assert watched.get(*names).tobytes() == alone.get(*names).tobytes()
    times = np.array([row[0] for row in seen])
    assert len(times) > 5
    assert np.all(np.diff(times) > 0)
    assert times[-1] == 3.0
    energies = np.array([row[3] for row in seen])
    np.testing.assert_allclose(energies, energies[0], rtol=0, atol=1e-7)  # 10 J at a tolerance of 1e-8
    assert set(watched.seen) == {(False, True, True, False)}  # outputs of finished steps, no inputs, no early return


def test_importer_returns_early(pendulum3) -> None:
    """At once, at a later time, or not at all where it has not been allowed."""

    def observer(_: Instance, time: float) -> float | None:
        return time if 1.0 <= time < 2.0 else None

    instance = pendulum3.start(options={"observer": observer, "early": True}, theta_0=2.0)
    step = instance.advance(0.0, 3.0)
    assert step[:3] == (OK, False, True)
    assert 1.0 <= step.time < 3.0
    assert instance["time"] == step.time
    while step.time < 3.0:
        step = instance.advance(step.time, 3.0 - step.time)
        assert not step.status
    reference = pendulum3.start(theta_0=2.0)
    reference.step(0.0, 3.0)
    assert instance["theta"] == pytest.approx(reference["theta"], abs=1e-6)  # two solutions at 1e-8, amplified
    refused = pendulum3.start(options={"observer": observer}, theta_0=2.0)
    assert refused.advance(0.0, 3.0) == (OK, False, False, 3.0)


def test_failure_behind_a_request_to_return(pendulum3) -> None:
    """The length passes zero before the wanted time: the step is refused, not waited for."""
    options = {"observer": lambda *_: 0.9, "early": True}
    instance = pendulum3.start(options=options, theta_0=0.5, length_dot=-2.0)
    before = instance.get("theta", "p_theta", "length")
    instance.step(0.0, 1.0, DISCARD)
    np.testing.assert_array_equal(instance.get("theta", "p_theta", "length"), before)
    instance.set(length_dot=0.0)
    assert instance.advance(0.0, 1.0)[:3] == (OK, False, True)


@pytest.mark.parametrize(
    ("wanted", "calls", "when", "others"),
    [
        ((), ("SetFloat64", "Terminate", "Reset"), "inside a communication step", set()),
        (("length",), ("Terminate", "Reset"), "while inputs are asked for", {"theta is no input", "mass is no input"}),
    ],
    ids=["outputs are read", "inputs are asked for"],
)
def test_what_is_refused_inside_a_step(pendulum3, wanted, calls, when, others) -> None:
    statuses: list[int] = []

    def observer(instance: Instance, _: float) -> None:
        statuses.extend([instance.set({name: 1.0}, None) for name in ("theta", "mass")])
        statuses.extend(map(instance.call, ("Terminate", "Reset")))

    instance = pendulum3.start(options={"observer": observer, "wanted": wanted})
    instance.step(0.0, 0.1)
    assert set(statuses) == {ERROR}
    assert set(instance.messages) == {f"fmi3{call} must not be called {when}" for call in calls} | others


def test_inputs_inside_a_step(pendulum3) -> None:
    """Asked for at its fifths, they follow the polynomial through these: as those of many short steps do."""
    length = np.polynomial.Polynomial([1.0, 0.1, -0.3, 0.2, 0.1, -0.05])  # quintic, as between two communication points
    torque = np.polynomial.Polynomial([0.2, -0.4, 0.3, 0.5])
    given = {"length": length, "length_dot": length.deriv(), "length_ddot": length.deriv(2), "theta_force": torque}
    asked: list[float] = []

    def at(time: float) -> dict[str, float]:
        return {name: float(curve(time)) for name, curve in given.items()}

    def answer(instance: Instance, time: float) -> None:
        asked.append(time)
        instance.set(at(time))

    start = at(0.0) | {"theta_0": 1.0}
    options = {"observer": answer, "wanted": given}
    instance = pendulum3.start(options=options, tolerance=1e-12, **start)
    assert instance.advance(0.0, 1.0) == (OK, False, False, 1.0)
    np.testing.assert_allclose(asked, [0.2, 0.4, 0.6, 0.8, 1.0], rtol=1e-15)
    assert set(instance.seen) == {(True, False, False, False)}  # inputs, no outputs; no step of the solver is finished
    fine = pendulum3.start(tolerance=1e-13, input_reconstruction=2, **start)
    fine.follow(0.001, 1000, at, ahead=True)
    names = ("theta", "p_theta", "work", "energy_balance")
    # the torque is linear in steps of h = 1 ms there: h²/12 · 3.6 N.m/s² · 1 s / (1 kg m²)
    np.testing.assert_allclose(instance.get(*names), fine.get(*names), rtol=0, atol=1e-6)


def test_elements_of_an_array_follow_their_own_polynomials(ring3) -> None:
    def forces(time: float) -> dict[str, list[float]]:
        return {"force": [0.1 * time, -0.2 * time**2, 0.3 * time]}

    options = {"observer": lambda instance, time: instance.set(forces(time)) and None, "wanted": ["force"]}
    instance, fine = ring3.start(options=options), ring3.start(input_reconstruction=2)
    instance.step(0.0, 1.0)
    fine.follow(0.01, 100, forces, ahead=True)
    np.testing.assert_allclose(instance.get("x"), fine.get("x"), rtol=0, atol=1e-4)  # linear in steps of 10 ms there
    still = ring3.start()
    still.step(0.0, 1.0)
    assert np.abs(instance.get("x") - still.get("x")).min() > 1e-3


def test_inputs_that_are_asked_for_and_not_given_move_as_ever(pendulum3) -> None:
    values = {"length_dot": 0.3, "theta_0": 1.0}
    asked = pendulum3.start(options={"observer": lambda *_: None, "wanted": ["length"]}, **values)
    plain = pendulum3.start(**values)
    asked.step(0.0, 1.0)
    plain.step(0.0, 1.0)
    names = ("theta", "p_theta", "length")
    assert asked.get(*names).tobytes() == plain.get(*names).tobytes()


def test_states_of_an_event_belong_to_instances_with_event_mode(kick3) -> None:
    instance = stepping(kick3, t_1=0.7)
    assert instance.advance(0.0, 1.0).early
    content = instance.serialize()
    other = kick3.restored(content, CO_SIMULATION, **WITH_EVENTS)
    assert other["x_dot"] == 1.0  # still before the event
    other.do("EnterEventMode")
    assert other["x_dot"] == 3.0
    message = "the saved state belongs to an instance for co-simulation with events"
    kick3.instantiate().deserialize(content, ERROR, message)
