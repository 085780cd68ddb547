"""Models joined into one: the loops between them solved, nothing of the single models lost."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from liaisons.composition import compose
from liaisons.errors import ComponentError
from liaisons.mechanics import Model, assemble
from liaisons.models import (
    DoublePendulum,
    DrivenChain,
    Flywheel,
    Oscillator,
    OscillatorChain,
    Pendulum,
    PendulumChain,
    Sinusoid,
)

STATES = ("x", "p_x", "work", "dissipated", "angle", "p_angle", "work", "dissipated")
ROUNDING = 1e-12  # some hundred operations on terms of order 10


def triple(target: str, source: str) -> dict[str, str]:
    return {f"{target}{end}": f"{source}{end}" for end in ("", "_dot", "_ddot")}


def hung(lower: str, upper: str) -> dict[str, str]:
    """The pivot of one pendulum on the bob of another, both ways."""
    wires: dict[str, str] = {}
    for axis in "xz":
        wires |= triple(f"{lower}.pivot_{axis}", f"{upper}.bob_{axis}")
        wires[f"{upper}.bob_{axis}_load"] = f"{lower}.pivot_{axis}_force"
    return wires


def values(model: Model, state: Any, u: dict[str, float], k: dict[str, float]) -> dict[str, float]:
    """All outputs, at the start or at a given state."""
    inputs = [u.get(v.name, v.starts[0]) for v in model.inputs]
    parameters = [k.get(v.name, v.starts[0]) for v in model.parameters]
    y, m = model.start(0, inputs, parameters)
    z = model.outputs_function(0, y if state is None else state, inputs, parameters, m).full().ravel()
    return {v.name: value for v, value in zip(model.outputs, z, strict=True)}


def test_what_no_part_has_the_whole_has_not() -> None:
    pair = compose("Pair", {"one": assemble(Flywheel), "other": assemble(Oscillator)}, {})
    assert (pair.conditions.size_out(0), pair.condition_texts, pair.project) == ((0, 1), (), None)


def test_two_pendulums_are_the_double_pendulum() -> None:
    """Accelerations, forces and energies at random states: the loop of acceleration and force is solved exactly."""
    pendulum = assemble(Pendulum)
    pair = compose("Pair", {"upper": pendulum, "lower": pendulum}, hung("lower", "upper"))
    double = assemble(DoublePendulum)
    rng = np.random.default_rng(1)
    parts = {"upper": 1, "lower": 2}
    for _ in range(10):
        k, K, u, U = {}, {}, {}, {}
        for part, i in parts.items():
            for name in ("mass", "theta_0", "theta_dot_0"):
                number = rng.uniform(0.3, 2)
                k[f"{part}.{name}"] = number
                K[name.replace("theta", f"theta_{i}") if "theta" in name else f"{name}_{i}"] = number
            u[f"{part}.length"] = K[f"length_{i}"] = rng.uniform(0.5, 2)
            u[f"{part}.theta_force"] = U[f"theta_{i}_force"] = rng.normal()
        for end in ("", "_dot", "_ddot"):
            u[f"upper.pivot_x{end}"] = U[f"pivot_x{end}"] = rng.normal()
        u["lower.bob_z_load"] = U["bob_2_z_load"] = rng.normal()
        found, expected = values(pair, None, u, k), values(double, None, U, K)
        for part, i in parts.items():
            for end in ("", "_dot", "_ddot"):
                assert found[f"{part}.theta{end}"] == pytest.approx(expected[f"theta_{i}{end}"], rel=ROUNDING)
        for name in ("pivot_x_force", "pivot_z_force", "pivot_x_power"):
            assert found[f"upper.{name}"] == pytest.approx(expected[name], rel=ROUNDING, abs=ROUNDING * 100)
        assert found["upper.energy"] + found["lower.energy"] == pytest.approx(expected["energy"], rel=ROUNDING)
        # What one end gives the other takes.
        power = sum(found[f"lower.pivot_{axis}_force"] * found[f"upper.bob_{axis}_dot"] for axis in "xz")
        assert power == pytest.approx(sum(found[f"lower.pivot_{axis}_power"] for axis in "xz"), rel=ROUNDING)


def test_three_pendulums_have_a_loop_through_all_of_them() -> None:
    pendulum = assemble(Pendulum)
    wires = hung("b", "a") | hung("c", "b")
    chain = compose("Three", {"a": pendulum, "b": pendulum, "c": pendulum}, wires)
    single = assemble(PendulumChain, 3).flat()
    k = {f"{p}.theta_0": 0.3 * i for i, p in enumerate("abc", start=1)}
    k |= {f"{p}.theta_dot_0": 0.5 * i for i, p in enumerate("abc", start=1)}
    K = {f"theta{end}_0[{i}]": size * i for i in (1, 2, 3) for end, size in (("", 0.3), ("_dot", 0.5))}
    found, expected = values(chain, None, {}, k), values(single, None, {}, K)
    for i, p in enumerate("abc", start=1):
        assert found[f"{p}.theta_ddot"] == pytest.approx(expected[f"theta_ddot[{i}]"], rel=ROUNDING)
    assert found["a.pivot_z_force"] == pytest.approx(expected["pivot_z_force"], rel=ROUNDING)


def test_an_operator_drives_from_inside() -> None:
    """Driven oscillator against its closed form, by an integrator that has nothing to do with FMUs."""
    drive = {"amplitude": 0.2, "angular_frequency": 1.7}
    model = compose(
        "Shaken",
        {"mass": assemble(Oscillator), "shaker": assemble(Sinusoid)},
        triple("mass.support", "shaker.y"),
        starts={f"shaker.{name}": value for name, value in drive.items()} | {"mass.x_0": 0.0},
    )
    assert [v.name for v in model.inputs] == ["mass.x_force", "mass.x_load", "mass.x_impulse"]
    assert model.active == ()
    assert {port.name for port in model.ports} == {"mass.x", "shaker.y"}
    k = [v.starts[0] for v in model.parameters]
    y_0, _ = model.start(0, [0, 0, 0], k)
    run = solve_ivp(
        lambda t, y: model.derivatives(t, y, [0, 0, 0], k).full().ravel(),
        (0, 10),
        y_0.full().ravel(),
        method="DOP853",
        rtol=1e-11,
        atol=1e-12,
    )
    exact = Oscillator.exact(run.t, x_0=0.0, amplitude=0.2, angular_frequency=1.7)
    assert np.max(np.abs(run.y[0] - exact["x"])) <= 1e-9  # a hundred tolerances


def test_names_of_the_parts_stand_before_everything_and_the_longest_experiment_is_that_of_all() -> None:
    model = compose("Both", {"a": assemble(Oscillator), "b": assemble(Flywheel)}, {})
    assert [s.name for s in model.states] == [f"{p}.{s}" for p, s in zip("aaaabbbb", STATES, strict=True)]
    assert model.memory == (
        "a.energy_start",
        "a.energy_booked",
        "a.support_mismatch",
        "a.support_derived",
        "b.energy_start",
        "b.energy_booked",
    )
    assert next(v for v in model.outputs if v.name == "b.angle_dot").derivative_of == "b.angle"
    assert model.experiment.stop_time == Oscillator.experiment.stop_time > Flywheel.experiment.stop_time


def test_elements_of_arrays_can_be_connected() -> None:
    """The grip of one chain on the last mass of another, both ways: twice three masses are six."""
    wires = triple("right.drive", "left.u") | {"left.u_load": "right.drive_force"}
    wires = {f"{t}[3]" if "load" in t else t: s if "force" in s else f"{s}[3]" for t, s in wires.items()}
    joined = compose("Joined", {"left": assemble(OscillatorChain, 3), "right": assemble(DrivenChain, 3)}, wires)
    start = [0.3, -0.1, 0.5, 0.2, 0.0, -0.4]
    k = {f"{p}.u_0[{i}]": start[i - 1 + 3 * j] for j, p in enumerate(("left", "right")) for i in (1, 2, 3)}
    found = values(joined, None, {}, k)
    whole = assemble(OscillatorChain, 6).flat()
    expected = values(whole, None, {}, {f"u_0[{i}]": x for i, x in enumerate(start, start=1)})
    for i in range(1, 7):
        name = f"left.u_ddot[{i}]" if i <= 3 else f"right.u_ddot[{i - 3}]"
        assert found[name] == pytest.approx(expected[f"u_ddot[{i}]"], abs=ROUNDING)


def test_connected_inputs_stay_in_their_domains() -> None:
    """The domain of an input that is set is the importer's to keep; of one that is connected it is a condition."""
    wires = triple("a.length", "b.y")
    model = compose("Short", {"a": assemble(Pendulum), "b": assemble(Sinusoid)}, wires, starts={"b.offset": 0.3})
    assert model.condition_texts[0] == "a.length must stay > 0 m"
    k = [v.starts[0] for v in model.parameters]
    inputs = [v.starts[0] for v in model.inputs]
    y, _ = model.start(0, inputs, k)
    assert float(model.conditions(0, y, inputs, k)[0]) == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("wires", "starts", "message"),
    [
        ({"a.lenght": "b.y"}, {}, "Odd: no input is called 'a.lenght'.*a.length"),
        ({"a.length": "b.z"}, {}, "no output is called 'b.z'"),
        ({}, {"a.mas": 1.0}, "no parameter or input is called 'a.mas'.*a.mass"),
        # A length that is the kinetic energy p²/2ml²: its own cube root.
        ({"a.length": "a.kinetic_energy"}, {}, r"Odd: a\.length depend on each other, and not linearly"),
        ({"c.angle_force": "a.work"}, {}, "Odd: work and energy_balance cannot be connected"),
    ],
)
def test_what_cannot_be_connected(wires: dict[str, str], starts: dict[str, float], message: str) -> None:
    parts = {"a": assemble(Pendulum), "b": assemble(Sinusoid), "c": assemble(Flywheel)}
    with pytest.raises(ComponentError, match=message):
        compose("Odd", parts, wires, starts=starts)
