"""Modelica text, compiled and simulated by rumoca, against the FMUs; pymoca reads it, too.

The FMU and rumoca integrate at 1e-11; trajectories of a few seconds amplify that less than a hundredfold.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from liaisons import System, modelica
from liaisons.cosim import Result, simulate
from liaisons.errors import ComponentError, SimulationError
from liaisons.language import (
    ActiveCoordinate,
    Chain,
    Component,
    Coordinate,
    Experiment,
    Gravity,
    MechanicalComponent,
    Mechanism,
    Operator,
    Parameter,
    ParameterArray,
    constraint,
    dry_friction,
    unchecked,
    unilateral,
)
from liaisons.mechanics import assemble
from liaisons.models import (
    CATALOGUE,
    BallRow,
    BouncingBall,
    CartesianPendulum,
    CircularHoop,
    DryOscillator,
    FourierHoop,
    IsokineticOscillator,
    OscillatorChain,
    Pendulum,
    PendulumChain,
    PlannedMotion,
    Regulator,
    Sinusoid,
    SmoothStep,
    SwingPump,
)
from liaisons_exchange.modelica_text import files, modelica_library
from liaisons_exchange.modelica_text.classes import system_text
from liaisons_exchange.modelica_text.standard_library import TYPES
from liaisons_exchange.modelica_text.systems import Composition
from liaisons_tools.cli import main

rumoca = pytest.importorskip("rumoca")
pymoca = pytest.importorskip("pymoca.parser")

BOUND = 1e-8
QUICK = (Pendulum, IsokineticOscillator, OscillatorChain, PlannedMotion, SmoothStep)
# Contacts that act on each other, and samples, are not written.
WRITTEN = [c for c in CATALOGUE if c is not BallRow and not c.is_sampled()]
ALL = [pytest.param(c, marks=() if c in QUICK else pytest.mark.slow, id=c.__name__) for c in WRITTEN]
MECHANICAL = [p for p, c in zip(ALL, WRITTEN, strict=True) if issubclass(c, MechanicalComponent)]
KNOTS = {
    "instant": (0.0, 1.0, 2.5, 2.5, 4.0),
    "value": (0.0, 1.0, -0.5, 0.3, 0.4),
    "rate": (0.1, 0.0, 0.7, 0.0, -0.2),
    "acceleration": (0.0, 1.0, 0.0, -1.0, 0.3),
}
TABLES: dict[type[Component], dict[str, tuple[float, ...]]] = {
    PlannedMotion: KNOTS,
}
FORCE = 0.05
SPANS = {PendulumChain: 1.0, CartesianPendulum: 1.0}  # [s]; large motions are chaotic, projections are dear


def span(component: type[Component]) -> float:
    return SPANS.get(component, min(component.experiment.stop_time, 4.0))


def parameters(component: type[Component]) -> dict[str, float]:
    """Parameters that are 0 by default have another value, so that no term is missing, and what turns freely turns."""
    scalars = [p for p in component.parameters if not isinstance(p, ParameterArray)]
    names = [v.name for v in component().layout().parameters]
    turning = {name: 0.1 + 0.1 * k for k, name in enumerate(n for n in names if re.match("(omega|H)_._0", n))}
    return {p.name: 0.05 for p in scalars if p.start == 0} | turning


def sigma(component: type[MechanicalComponent]) -> dict[str, tuple[float, float, float]]:
    """For each active coordinate a, d, w of a + d (1 - cos wt), which starts at rest."""
    return {s.name: (s.start, 0.05, 2.0 + k) for k, s in enumerate(component.actives)}


def pushed(component: type[MechanicalComponent]) -> list[str]:
    """Free coordinates and components of points, each of which a load pulls."""
    return [port.name for port in assemble(component).ports if port.kind != "active"]


def spread(component: type[Component], values: Mapping[str, Any]) -> dict[str, Any]:
    """Values of arrays in the length that the FMU has."""
    counts = {v.name: v.count for v in assemble(component).variables if v.dimension is not None}
    return {
        name: np.pad(value, (0, counts[name] - len(value)), "edge")
        if isinstance(value, tuple)
        else np.full(counts[name], value)
        if name in counts
        else value
        for name, value in values.items()
    }


def by_fmu(path: Path, component: type[Component]) -> Result:
    values: dict[str, Any] = parameters(component) | TABLES.get(component, {})
    inputs: dict[str, Callable[[float], tuple[float, float, float]]] = {}
    if issubclass(component, MechanicalComponent):
        values |= {f"{name}_load": FORCE for name in pushed(component)}
        for name, (a, d, w) in sigma(component).items():
            inputs[name] = lambda t, a=a, d=d, w=w: (
                a + d * (1 - np.cos(w * t)),
                d * w * np.sin(w * t),
                d * w**2 * np.cos(w * t),
            )
    return simulate(
        path,
        stop_time=span(component),
        step_size=span(component) / 200,
        tolerance=1e-11,
        inputs=inputs,
        start_values=spread(component, values),
    )


def literal(value: Any) -> str:
    return f"{{{', '.join(map(str, value))}}}" if isinstance(value, tuple) else f"{value!r}"


def signals(component: type[Component], force: float = FORCE) -> str:
    """Model of the component with its inputs prescribed."""
    modified = {name: literal(value) for name, value in parameters(component).items()}
    modified |= {name: literal(value) for name, value in TABLES.get(component, {}).items()}
    if issubclass(component, MechanicalComponent):
        for name, (a, d, w) in sigma(component).items():
            modified[f"u_{name}"] = (
                f"{{{a} + {d}*(1 - cos({w}*time)), {d * w}*sin({w}*time), {d * w**2}*cos({w}*time)}}"
            )
        constant = f"fill({force}, 10)" if issubclass(component, Chain) else f"{force}"
        modified |= {f"{name}_load": constant for name in pushed(component)}
    values = ", ".join(f"{name}={value}" for name, value in modified.items())
    return f"model Test\n  {component.__name__}.Signals m({values});\nend Test;\n"


def flanges(component: type[MechanicalComponent]) -> str:
    """Models of the component with sources of motion at its flanges, and nothing at the others."""
    own, units = component.__name__, {v.name: v.unit for v in assemble(component).variables}
    values = ", ".join(f"{name}={value}" for name, value in parameters(component).items())
    lines, joined, sources = [f"{own}.Flanges m({values});"], [], []
    for name, (a, d, w) in sigma(component).items():
        kind, position = ("Rotation", "phi") if units[name] == "rad" else ("Translation", "s")
        motion = f"{own}.{kind} flange({position}={a} + {d}*(1 - cos({w}*time)));"
        sources.append(f"model Move_{name} {motion} end Move_{name};")
        lines.append(f"Move_{name} at_{name};")
        joined.append(f"connect(at_{name}.flange, m.flange_{name});")
    return "\n".join([*sources, "model Test", *lines, "equation", *joined, "end Test;", ""])


def compiled(text: str, model: str) -> Any:
    assert [d.message for d in rumoca.validate_source(text, model=model, filename="text.mo")] == []
    return rumoca.Session().loads(text, model=model, filename="text.mo")


def simulated(text: str, times: np.ndarray, model: str = "Test") -> dict[str, np.ndarray]:
    """Signals at these times; at an event, after it."""
    settings = rumoca.SimConfig(solver="rk-like", rtol=1e-11, atol=1e-11)  # the defaults are looser
    result = compiled(text, model).simulate((0.0, times[-1]), dt=times[1], config=settings)
    rows = np.searchsorted(result.time, times + 1e-9) - 1
    np.testing.assert_allclose(np.asarray(result.time)[rows], times, rtol=0, atol=1e-9)
    return {name: np.asarray(result[name])[rows] for name in result.names}


def differences(result: Mapping[str, np.ndarray], run: Result, names: Mapping[str, str]) -> dict[str, float]:
    """Largest difference of each signal, relative to its largest value above 1, by the names in the FMU."""
    return {
        name: float(np.max(np.abs(result[other] - run[name])) / max(1.0, np.max(np.abs(run[name]))))
        for name, other in names.items()
        if other in result
    }


def names_of(component: type[Component]) -> dict[str, str]:
    if issubclass(component, Operator):
        states = {state.name: f"m.{state.name}" for state in component.internal_states}
        return states | {name: f"m.y[{i}]" for i, name in enumerate(("y", "y_dot", "y_ddot"), start=1)}
    return {v.name: f"m.{v.name}" for v in assemble(component).flat().outputs if v.causality == "output"}


@pytest.mark.parametrize("component", ALL)
def test_signals_move_as_the_fmu(component: type[Component], fmu: Callable[..., Path]) -> None:
    run = by_fmu(fmu(component), component)
    found = differences(simulated(modelica(component) + signals(component), run.time), run, names_of(component))
    expected = {"y", "y_dot", "y_ddot"}
    if issubclass(component, MechanicalComponent):
        first = "[1]" if issubclass(component, Chain) else ""
        expected = {"kinetic_energy", "potential_energy", "energy", *(f"{s.name}_force" for s in component.actives)}
        for q in component.coordinates:
            expected |= {f"{name}{first}" for name in (q.name, f"{q.name}_dot", f"{q.name}_ddot", f"p_{q.name}")}
        if issubclass(component, Mechanism):
            expected |= {name for o in component.orientations for name in (*o.quaternion, *o.rates, *o.momenta)}
    assert expected <= found.keys()
    assert {name: error for name, error in found.items() if error > BOUND} == {}


def test_a_ball_comes_to_rest_as_in_the_closed_form() -> None:
    text = modelica(BouncingBall) + "model Test BouncingBall.Signals m(u_table={0, 0, 0}); end Test;"
    found, times = simulated(text, np.linspace(0, 6, 61)), np.linspace(0, 6, 61)
    exact = BouncingBall.exact(times)
    np.testing.assert_allclose(found["m.height"], exact["height"], rtol=0, atol=BOUND)
    np.testing.assert_allclose(found["m.gap_force"][-1], exact["gap_force"][-1], rtol=1e-12)
    # All impulses: what weight has added until then.
    assert found["m.gap_impulse"][-1] + 9.81 * (6.0 - BouncingBall.rests_at()) == pytest.approx(6 * 9.81, abs=1e-4)


@pytest.mark.parametrize("rest", [0.0, 0.3])
def test_a_ball_follows_a_table_that_jumps_and_drops(rest: float, fmu: Callable[..., Path]) -> None:
    """The table stands, rises at once at 1 m/s, and at 2.5 s falls away faster than the ball can.

    Its clock is a state: at a time event rumoca (0.10.2) does what ``reinit`` says, and forgets the rest of a ``when``.
    """
    rate, start = "(if clock < 2 then 0 elseif clock < 2.5 then 1 else -20)", f"height_0={rest}, bounce={rest}"
    way = "(if clock < 2 then 0 elseif clock < 2.5 then clock - 2 else 0.5 - 20*(clock - 2.5))"
    text = modelica(BouncingBall) + (
        f"model Test Real clock(start=0, fixed=true); BouncingBall.Signals m({start}, u_table={{{way}, {rate}, 0}});"
        "equation der(clock) = 1; end Test;"
    )
    found = simulated(text, np.linspace(0, 3, 301))

    def table(t: float) -> tuple[float, float, float]:
        rates = (0.0, 1.0, -20.0)[int(t >= 2) + int(t >= 2.5)]
        return (0.0 if t < 2 else t - 2 if t < 2.5 else 0.5 - 20 * (t - 2.5)), rates, 0.0

    values: dict[str, Any] = {"height_0": rest, "bounce": rest}
    run = simulate(
        fmu(BouncingBall), stop_time=3.0, step_size=0.01, inputs={"table": table}, start_values=values, tolerance=1e-11
    )
    np.testing.assert_allclose(found["m.height"], run["height"], rtol=0, atol=BOUND)
    assert np.ptp(run["height"]) > 0.4


def test_bodies_that_overlap_at_the_start_are_refused() -> None:
    text = modelica(BouncingBall) + "model Test BouncingBall.Signals m(height_0=-0.1, u_table={0, 0, 0}); end Test;"
    with pytest.raises(rumoca.SimulationError, match="bodies overlap: start with gap >= 0"):
        simulated(text, np.linspace(0, 1, 11))


class _Stops(Mechanism):
    """A mass between two stops."""

    width = Parameter(1.0, "m", "distance of the stops from the middle")
    mass = Parameter(1.0, "kg", "mass", above=0)
    x = Coordinate("m", "position")

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.dot(self.x) ** 2

    @unilateral("m", "distance of the left stop")
    def left(self) -> ca.SX:
        return self.x + self.width

    @unilateral("m", "distance of the right stop")
    def right(self) -> ca.SX:
        return self.width - self.x


class _Ring(Mechanism):
    """A bead on a ring, above a floor."""

    radius = Parameter(1.0, "m", "radius of the ring")
    mass = Parameter(1.0, "kg", "mass", above=0)
    x = Coordinate("m", "position", start=1.0)
    z = Coordinate("m", "height")

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared({"x": self.x, "z": self.z})

    @constraint("m", "on the ring")
    def ring(self) -> ca.SX:
        return ca.norm_2(ca.vertcat(self.x, self.z)) - self.radius

    @unilateral("m", "distance of the floor")
    def gap(self) -> ca.SX:
        return self.z + self.radius


class _RoughFloor(Mechanism):
    """A block on a floor, whose friction its weight bounds."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    grip = Parameter(0.4, "1", "coefficient of friction", minimum=0)
    x = Coordinate("m", "position")
    z = Coordinate("m", "height")

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared({"x": self.x, "z": self.z})

    @unilateral("m", "distance of the floor")
    def gap(self) -> ca.SX:
        return self.z

    @dry_friction("m/s", "sliding on the floor", static="grip", sliding="grip", normal="gap")
    def slip(self) -> ca.SX:
        return self.dot(self.x)


@pytest.mark.parametrize(
    ("component", "words"),
    [
        (
            _RoughFloor,
            "_RoughFloor: Modelica text takes no contacts (gap, slip) that act on each other; import its FMU",
        ),
        (_Stops, "_Stops: Modelica text takes no contacts (left, right) that act on each other; import its FMU"),
        (_Ring, "_Ring: Modelica text takes no contacts (gap) beside constraints or orientations; import its FMU"),
        (BallRow, "BallRow: Modelica text takes no arrays of a mechanism; import its FMU"),
    ],
)
def test_contacts_whose_impacts_are_solved_at_once_are_refused(component: type[Component], words: str) -> None:
    with pytest.raises(ComponentError, match=f"^{re.escape(words)}$"):
        modelica(component)


class _Pair(Mechanism):
    """Two masses that do not act on each other, each above a floor; the lower floor is rough."""

    mass = Parameter(1.0, "kg", "mass", above=0)
    gravity = Gravity()
    bounce = Parameter(0.5, "1", "coefficient of restitution", minimum=0, maximum=1)
    grip = Parameter(1.5, "N", "threshold of sticking", minimum=0)
    x = Coordinate("m", "position of a block")
    left = Coordinate("m", "height of a ball", start=0.5)
    right = Coordinate("m", "height of another", start=0.8)

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * (self.dot(self.x) ** 2 + self.dot(self.left) ** 2 + 2 * self.dot(self.right) ** 2)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * (self.left + 2 * self.right)

    @unilateral("m", "distance of the first floor", restitution="bounce")
    def first(self) -> ca.SX:
        return self.left

    @unilateral("m", "distance of the second floor", restitution="bounce")
    def second(self) -> ca.SX:
        return self.right

    @dry_friction("m/s", "sliding", static="grip", sliding="grip")
    def slip(self) -> ca.SX:
        return self.dot(self.x)


def test_contacts_that_do_not_act_on_each_other_are_written(fmu: Callable[..., Path]) -> None:
    text = modelica(_Pair) + "model Test _Pair.Signals m(x_dot_0=2); end Test;"
    run = simulate(fmu(_Pair), stop_time=2.0, step_size=0.01, tolerance=1e-11, start_values={"x_dot_0": 2.0})
    found = simulated(text, run.time)
    for name in ("x", "left", "right", "p_right"):
        np.testing.assert_allclose(found[f"m.{name}"], run[name], rtol=0, atol=BOUND)


@pytest.mark.parametrize(
    ("values", "belt"),
    [
        ({"mu_static": 0.3, "x_0": 0.0}, 0.2),  # stick-slip
        ({"mu_static": 0.3, "x_0": 0.0}, -0.2),
        ({"mu_static": 0.15, "x_0": 0.1}, 0.0),  # held at the start
        ({"mu_static": 0.15, "x_0": 0.2}, 0.0),  # and not held
        ({"stiffness": 0.0, "x_0": 0.0, "x_force": 0.3}, 1.0),
    ],
)
def test_a_mass_sticks_and_slips_as_the_fmu(values: dict[str, float], belt: float, fmu: Callable[..., Path]) -> None:
    modified = ", ".join(f"{name}={value}" for name, value in values.items())
    moved = f"u_support={{0, 0, 0}}, u_belt={{{belt}*time, {belt}, 0}}"
    text = modelica(DryOscillator) + f"model Test DryOscillator.Signals m({modified}, {moved}); end Test;"
    run = simulate(
        fmu(DryOscillator),
        stop_time=8.0,
        step_size=0.01,
        tolerance=1e-11,
        start_values=values,
        inputs={"belt": lambda t: (belt * t, belt, 0.0)},
    )
    found = simulated(text, run.time)
    for name in ("x", "p_x"):
        np.testing.assert_allclose(found[f"m.{name}"], run[name], rtol=0, atol=BOUND)
    apart = found["m.slip_sticks"] != run["slip_sticks"]
    assert apart.sum() <= 1  # an event at a communication point is before it in one, and after it in the other


class RestingMotion(PlannedMotion):
    """A planned motion that stands still behind its last row."""

    def interval(self, t: ca.SX, *columns: str, rests: bool = True) -> tuple[list[ca.SX], list[ca.SX]]:
        return super().interval(t, *columns, rests=rests)


@pytest.mark.parametrize(("component", "rests"), [(RestingMotion, "true"), (PlannedMotion, "false")])
def test_a_motion_says_what_it_does_behind_all_rows(component: type[Component], rests: str) -> None:
    assert {*re.findall(r"= entry\(.*, (\w+)\);", modelica(component))} == {rests}


@pytest.mark.parametrize("component", MECHANICAL)
def test_flanges_move_as_the_signals(component: type[MechanicalComponent]) -> None:
    """Here the tool differentiates and reduces the index; what the signals do is compared with the FMU."""
    times, text = np.linspace(0, min(span(component), 2.0), 101), modelica(component)
    one, other = simulated(text + signals(component, 0.0), times), simulated(text + flanges(component), times)
    shared = [name for name in one if name.startswith("m.") and name in other]
    assert {f"m.{s.name}_force" for s in component.actives} <= {*shared}
    assert len(shared) > 5
    for name in shared:
        scale = max(1.0, float(np.max(np.abs(one[name]))))
        np.testing.assert_allclose(other[name], one[name], rtol=0, atol=BOUND * scale, err_msg=name)


@pytest.mark.parametrize("component", ALL)
def test_declarations_are_those_of_the_component(component: type[Component]) -> None:
    m = compiled(modelica(component) + signals(component), "Test")
    parameters_of = {v.name: v for v in component().layout().parameters}
    assert {f"m.{name}" for name, v in parameters_of.items() if v.dimension is None} <= {*m.parameters.names}
    for name, v in parameters_of.items():
        if v.dimension is None:
            declared = m.parameters[f"m.{name}"]
            assert (declared.unit or "", declared.min, declared.max) == (v.unit, v.minimum, v.maximum), name
            assert declared.value == pytest.approx(parameters(component).get(name, v.start)), name
            is_start = name not in {p.name for p in component.parameters}
            assert is_start or declared.description == v.description, name
    units = {v.name: v.unit for v in component().layout().outputs}
    for found in (*m.states, *m.algebraics):
        name = found.name.removeprefix("m.")
        assert (found.unit or "") == units.get(name, found.unit or ""), name


@pytest.mark.parametrize("component", ALL)
def test_another_parser_reads_it(component: type[Component]) -> None:
    tree = pymoca.parse(modelica(component))
    assert tree is not None
    assert component.__name__ in tree.classes
    assert {"Signals"} <= {*tree.classes[component.__name__].classes}


def test_a_pendulum_fits_on_a_screen() -> None:
    text = modelica("Pendulum")
    assert len(text.splitlines()) <= 60
    assert max(len(line) for line in text.splitlines() if "annotation" not in line) <= 120
    assert "p_theta = mass*length*(length*theta_dot + pivot_x_dot*cos(theta) + pivot_z_dot*sin(theta));" in text
    assert "Source: K Ex. 3, Ex. 6" in text
    assert "M eq. 27" in text
    assert "Line(points={{-8, 75}, {8, -75}}), Ellipse(extent=" in text


def test_what_is_too_long_is_named() -> None:
    assert "/* Too long, or not to be said in Modelica: star_shaped, xi, hoop_length. */" in modelica(FourierHoop)


def test_a_violated_condition_stops_the_simulation() -> None:
    text = modelica(Pendulum)
    assert 'assert(length > 0, "length > 0 is needed");' in text
    inputs = "u_length={1, 0, 0}, u_pivot_x=zeros(3), u_pivot_z=zeros(3)"
    model = f"model Test\n  Pendulum.Signals m(mass=-1, {inputs});\nend Test;\n"
    with pytest.raises(rumoca.SimulationError, match="mass > 0 is needed"):
        simulated(text + model, np.linspace(0, 2, 21))
    hoop = " ".join(modelica("EllipticHoop").split())
    assert "assert(1 - centre_x^2/semi_axis_a^2 - centre_y^2/semi_axis_b^2 > 0," in hoop


class Functions(Operator):
    """All functions that the language has, or that can be said in it."""

    end = Parameter(0.7, "1", "a reserved word")
    offset = Parameter(-0.25, "1", 'a "quoted" text with a \\')

    @unchecked("numbers for all functions")
    def signal(self, t: ca.SX) -> ca.SX:
        x = self.end * t + self.offset
        smooth = ca.asinh(x) + ca.acosh(2 + x**2) + ca.atanh(x / 5) + ca.atan2(x, 1 + t) + (1 + t) ** x + ca.tanh(x)
        steps = ca.floor(t) + ca.sign(x) + ca.fmod(5 * t, 2) + ca.fabs(x) + ca.if_else(t > 1, 1, 2)
        steps += ca.if_else(t >= 2.5, 1, 3) + ca.if_else(ca.floor(t) == 1, 5, 0) + ca.if_else(ca.floor(t) != 2, 7, 0)
        either = ca.logic_or(t > 3, t < 0.5) + ca.logic_not(t > 2) + ca.logic_and(t > 1, t < 2)
        return smooth + steps + either + ca.fmin(x, 0.3) + ca.fmax(x, 0.9) + np.pi * x - (x - (1 - x)) / (2 - (t - 9))

    def events(self) -> list[Any]:
        return []


def test_every_function_is_printed_right() -> None:
    text = modelica(Functions) + "model Test\n  Functions.Signals m;\nend Test;\n"
    times = np.linspace(0, 4, 38)  # no event is among them
    y = simulated(text, times)["m.y[1]"]
    model = assemble(Functions)
    k = ca.DM([v.starts[0] for v in model.parameters])
    expected = [float(model.outputs_function.call([t, [], [], k, []])[0][0]) for t in times[1:]]
    np.testing.assert_allclose(y[1:], expected, rtol=0, atol=1e-12)


class Lever(Mechanism):
    """Arm whose angle is prescribed: nothing moves by itself."""

    inertia = Parameter(2.0, "kg.m2", "moment of inertia", above=0)
    angle = ActiveCoordinate("rad", "angle")

    def kinetic_energy(self) -> ca.SX:
        return self.inertia / 2 * self.dot(self.angle) ** 2


def test_inverse_dynamics() -> None:
    text = modelica(Lever) + "model Test\n  Lever.Signals m(u_angle={time^2, 2*time, 2});\nend Test;\n"
    found = simulated(text, np.linspace(0, 1, 11))
    np.testing.assert_allclose(found["m.angle_force"], 4.0, rtol=1e-14)


def test_a_force_on_a_flange_has_the_sign_of_the_standard_library() -> None:
    """Sources of force there have flange.f = -f, and push along +s."""
    push = "model Push Flywheel.Rotation flange(tau=-0.3); end Push;\n"
    wheel = "model Test\n  Flywheel.Flanges m(inertia=2, angle_dot_0=0);\n  Push push;\nequation\n"
    text = modelica("Flywheel") + push + wheel + "  connect(push.flange, m.flange_angle);\nend Test;\n"
    times = np.linspace(0, 1, 11)
    np.testing.assert_allclose(simulated(text, times)["m.angle"], 0.3 / 2 * times**2 / 2, rtol=0, atol=1e-14)


def composed() -> dict[str, System]:
    """The examples of the library."""
    systems = {}
    for name, (parts, joined) in files._EXAMPLES.items():
        system = System(name)
        ports = {part: system.add(part, component, start_values=starts) for part, (component, starts) in parts.items()}
        for target, source in joined.items():
            (one, port), (other, signal) = target.split("."), source.split(".")
            system.connect(ports[other][signal], ports[one][port])
        systems[name] = system
    return systems


@pytest.mark.slow
@pytest.mark.parametrize("name", ["PumpedSwing", "CoupledPendulums", "ClosedLoopSwing"])
def test_a_system_moves_as_its_flattened_fmu(name: str, tmp_path: Path) -> None:
    system = composed()[name]
    run = simulate(system.flatten(tmp_path), stop_time=5.0, step_size=0.05, tolerance=1e-11)
    result = simulated(modelica(system), run.time, f"{name}System.{name}")
    theta = [
        signal for signal in run if signal.endswith(("theta", "theta_dot", "_force", "energy")) and signal in result
    ]
    assert len(theta) > 4
    for signal in theta:
        np.testing.assert_allclose(
            result[signal], run[signal], rtol=0, atol=BOUND * max(1.0, np.max(np.abs(run[signal])))
        )


@pytest.mark.variants(core=0)
def test_the_library_has_all_that_can_be_written() -> None:
    packages = re.findall(r"^  package (\w+)", modelica("all"), re.MULTILINE)
    assert {c.__name__ for c in WRITTEN} <= {*packages}
    assert not {"BallRow", "Regulator"} & {*packages}


@pytest.mark.slow
def test_all_examples_of_the_library_move() -> None:
    text = modelica("all")
    session = rumoca.Session()
    for name in (*(component.__name__ for component in WRITTEN), *files._EXAMPLES):
        example = session.loads(text, model=f"Liaisons.Examples.{name}", filename="Liaisons.mo")
        result = example.simulate((0.0, 0.2), dt=0.1)
        assert np.all(np.isfinite(result.to_numpy())), name


STANDARD_LIBRARY = """package Modelica "Of the Modelica Standard Library what the texts use"
  package Units
    package SI
{types}
    end SI;
  end Units;
  package Mechanics
    package Translational
      package Interfaces
        connector Flange_a Units.SI.Position s; flow Units.SI.Force f; end Flange_a;
      end Interfaces;
      package Components
        model Fixed parameter Units.SI.Position s0; Interfaces.Flange_a flange(s=s0); end Fixed;
        model Mass
          parameter Units.SI.Mass m;
          Units.SI.Position s;
          Units.SI.Velocity v;
          Interfaces.Flange_a flange_b(s=s);
        equation
          der(s) = v;
          m*der(v) = flange_b.f;
        end Mass;
      end Components;
    end Translational;
    package Rotational package Interfaces
      connector Flange_a Units.SI.Angle phi; flow Units.SI.Torque tau; end Flange_a;
    end Interfaces; end Rotational;
  end Mechanics;
end Modelica;
"""


def standard_library() -> str:
    types = (f'      type {name} = Real(final unit="{unit}");' for unit, name in TYPES.items())
    return STANDARD_LIBRARY.format(types="\n".join([*types, "      type Length = Position;"]))


@pytest.mark.parametrize("component", ALL)
def test_text_with_the_standard_library_moves_as_without(component: type[Component]) -> None:
    """By the same names and units, through its flanges; of the library there is what the texts use."""
    times, alone = np.linspace(0, min(span(component), 2.0), 51), modelica(component)
    text = modelica(component, standard_library=True)
    assert not re.search(r'unit="(m|rad|kg|N)"', text)
    assert not re.search("connector (Translation|Rotation)", text)
    changed = {*text.splitlines()} - {*alone.splitlines()}
    assert max(len(line) for line in changed if " flange(" not in line) <= 120
    model = flanges(component) if issubclass(component, MechanicalComponent) else signals(component)
    standard = re.sub(r"\w+\.(Translation|Rotation) ", r"Modelica.Mechanics.\1al.Interfaces.Flange_a ", model)
    text = standard_library() + text + standard
    one, other = compiled(alone + model, "Test"), compiled(text, "Test")
    for kind in ("parameters", "states", "algebraics"):
        units, expected_units = ({v.name: v.unit or "" for v in getattr(m, kind)} for m in (other, one))
        assert units == expected_units
    expected, found = simulated(alone + model, times), simulated(text, times)
    assert found.keys() == expected.keys()
    for name, values in expected.items():
        np.testing.assert_allclose(
            found[name], values, rtol=0, atol=BOUND * max(1.0, np.max(np.abs(values))), err_msg=name
        )


def test_examples_with_the_standard_library_move_as_without() -> None:
    chosen, times = [Pendulum, Sinusoid, SwingPump], np.linspace(0, 2, 21)
    alone = modelica_library(chosen)
    text = standard_library() + modelica_library(chosen, standard_library=True)
    for name in files._EXAMPLES:
        expected, found = (simulated(whole, times, f"Liaisons.Examples.{name}") for whole in (alone, text))
        assert found.keys() == expected.keys()
        for signal, values in expected.items():
            np.testing.assert_allclose(found[signal], values, rtol=0, atol=BOUND * max(1.0, np.max(np.abs(values))))


def test_a_pendulum_hangs_on_a_mass_of_the_standard_library() -> None:
    """The example of the documentation: nothing pushes the whole sideways, and nothing takes energy from it."""
    page = (Path(__file__).parents[3] / "docs/howto/modelica.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"model HangingPendulum.*end HangingPendulum;", page, re.DOTALL)
    text = standard_library() + modelica("Pendulum", standard_library=True) + example
    r = simulated(text, np.linspace(0, 3, 61), "HangingPendulum")
    np.testing.assert_allclose(2 * r["cart.s"] + r["pendulum.bob_x"], np.sin(0.5), rtol=0, atol=BOUND)
    np.testing.assert_allclose(r["pendulum.energy"] + r["cart.v"] ** 2, -9.81 * np.cos(0.5), rtol=0, atol=BOUND)
    assert np.ptp(r["cart.s"]) > 0.1


def test_the_command_writes_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "fmus").mkdir()
    (tmp_path / "fmus/fmus.toml").write_text('components = ["Ramp", "Sinusoid", "Pendulum"]', encoding="utf-8")
    assert main(["build", "Pendulum", "Ramp", "--modelica", "--output", "text"]) == 0
    assert (tmp_path / "text/Pendulum.mo").read_text(encoding="utf-8") == modelica("Pendulum")
    assert (tmp_path / "text/Ramp.mo").is_file()
    assert main(["build", "Pendulum", "--modelica", "--standard-library", "--output", "text"]) == 0
    assert (tmp_path / "text/Pendulum.mo").read_text(encoding="utf-8") == modelica("Pendulum", standard_library=True)
    assert main(["build", "Pendulum", "--standard-library"]) == 2
    assert main(["build", "--modelica"]) == 0
    library = (tmp_path / "fmus/Liaisons.mo").read_text(encoding="utf-8")
    example = compiled(library, "Liaisons.Examples.PumpedSwing")  # its components are among them
    assert "swing.theta" in {*example.states.names}
    assert "ClosedLoopSwing" not in library


def test_what_a_system_cannot_say(fmu: Callable[..., Path]) -> None:
    parts = {"bar": (Pendulum, {}), "hoop": (CircularHoop, {}), "motor": (Sinusoid, {})}
    for connections, message in (
        ({"bar.theta_force": "motor.y"}, r"^S: motor\.y -> bar\.theta_force connects no flanges"),
        ({"bar.length": "motor.y", "hoop.beta": "motor.y"}, "^S: motor moves coordinates of two kinds"),
    ):
        with pytest.raises(ComponentError, match=message):
            system_text(Composition("S", parts, connections, Experiment()))
    other = System("other")
    other.add("own", fmu(Lever))
    with pytest.raises(SimulationError, match="is a 'Lever'; a system in Modelica is made of the catalogue's"):
        modelica(other)
    with pytest.raises(ComponentError, match=r"^Regulator: Modelica text takes no samples of inputs; import its FMU$"):
        modelica(Regulator)


class KeywordOscillator(Mechanism):
    """A mass whose names are words of Modelica."""

    model = Parameter(2.0, "kg", "mass", above=0)
    end = Parameter(3.0, "N/m", "stiffness", minimum=0)
    equation = Coordinate("m", "elongation", start=0.5)
    flow = ActiveCoordinate("m", "support")

    def kinetic_energy(self) -> ca.SX:
        return self.model / 2 * self.dot(self.equation) ** 2

    def potential_energy(self) -> ca.SX:
        return self.end / 2 * (self.equation - self.flow) ** 2


def test_keywords_are_quoted_everywhere() -> None:
    text = modelica(KeywordOscillator)
    for statement in (
        "assert('model' > 0, \"model > 0 is needed\");",
        "der('equation') = equation_dot;",
        "'equation' = equation_0;",
        "flange_equation(s='equation', f=Q_equation)",
        "{'flow', flow_dot, flow_ddot} = u_flow;",
        "flow_dot = der('flow');",
    ):
        assert statement in text
    assert pymoca.parse(text)


@pytest.mark.parametrize("broken", ["interpolant", "inf"])
def test_what_modelica_has_not_is_refused(broken: str) -> None:
    table = ca.interpolant("V", "linear", [np.linspace(-2, 2, 9)], np.linspace(-2, 2, 9) ** 2)

    class Tabulated(Mechanism):
        """A mass in a potential."""

        x = Coordinate("1", "position")
        unit = Parameter(1.0, "J", "unit")
        mass = Parameter(1.0, "kg.m2", "mass", above=0)

        def kinetic_energy(self) -> ca.SX:
            return self.mass / 2 * self.dot(self.x) ** 2

        def potential_energy(self) -> ca.SX:
            if broken == "inf":
                return self.unit * ca.if_else(self.x > 9, np.inf, self.x**2)
            return self.unit * table(self.x)

    with pytest.raises(ComponentError, match="has a function or a number that Modelica has not"):
        modelica(Tabulated)
