"""The FMUs of both back ends against the derived equations, and against each other."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from hand_derivations import SMOOTH, WITHOUT_ORIENTATION, states
from on_paper import BACKENDS, HOLD, State, Values, assert_follows, equations_of

from liaisons.check import max_error
from liaisons.cosim import simulate
from liaisons.language import Mechanism, Operator
from liaisons.mechanics import Equations, assemble
from liaisons.models import CATALOGUE

OPERATORS = [c for c in CATALOGUE if issubclass(c, Operator) and not c.inputs]  # functions of time alone


def suffixed(name: str, suffix: str) -> str:
    """``x_dot[2]`` of ``x[2]``."""
    stem, bracket, index = name.partition("[")
    return f"{stem}{suffix}{bracket}{index}"


def expressions(equations: Equations) -> dict[str, ca.SX]:
    """What the outputs of an FMU are, in the symbols of the mechanism."""
    m = equations.mechanism
    found: dict[str, ca.SX] = {
        name: getattr(equations, name) for name in ("kinetic_energy", "potential_energy", "energy")
    }
    for i, q in enumerate(map(str, ca.vertsplit(m.free.q))):
        found |= {suffixed(q, "_ddot"): equations.accelerations[i], f"p_{q}": equations.momenta[i]}
    for i, s in enumerate(m.actives):
        found |= {f"{s.name}_force": equations.operator_forces[i]}
        found |= {f"{s.name}_power": equations.operator_forces[i] * m.active.s_dot[i]}
    for name, position in equations.applied.points.items():
        found |= {name: position, f"{name}_dot": m.dot(position), f"{name}_ddot": m.dot(m.dot(position))}
    return found | {item.name: getattr(m, item.name) for item in m.outputs}


def apart(component: type[Mechanism], count: int) -> list[State]:
    """States in which nothing touches, and what rubs slides."""
    m, found = equations_of(component).mechanism, []
    for state in states(component, 20 * count):
        if any(np.min(state(getattr(m, item.name))) <= 0 for item in component.unilaterals):
            continue
        state.update(dict.fromkeys(map(str, ca.vertsplit(m.contact_forces)), 0.0))
        for item in component.dry_frictions:
            bound = state(m.contact_coefficient(item.sliding))
            state[f"{item.name}_force"] = -np.sign(state(getattr(m, item.name))) * bound
        found.append(state)
    assert len(found) >= count
    return found[:count]


@pytest.mark.parametrize(
    ("component", "backend"),
    [(c, b) for c in WITHOUT_ORIENTATION for b in BACKENDS if b == "native" or c in SMOOTH],  # contacts are native only
)
def test_outputs_at_the_start_are_the_derived_equations(component, backend: str, fmu) -> None:
    model, found = assemble(component).flat(), expressions(equations_of(component))
    inputs = [variable for variable in model.inputs if variable.variability == "continuous"]  # no sums of impulses
    settable = [variable.name for variable in (*model.parameters, *inputs)]
    for state in apart(component, 3):
        starts: Values = {name: state[name if name in state else name.replace("_0", "")] for name in settable}
        result = simulate(fmu(component, backend), stop_time=1e-3, step_size=1e-3, **starts)
        for name, expression in found.items():
            expected = float(state(expression))
            # p → q' → everything, a few dozen roundings of terms of size 1e3 N.
            assert result[name][0] == pytest.approx(expected, rel=1e-11, abs=1e-10), name


@pytest.mark.parametrize("component", WITHOUT_ORIENTATION)
def test_inputs_that_do_nothing_are_ones_that_do_hardly_anything(component, fmu) -> None:
    """While loads, or σ̇ and σ̈, are 0 shorter equations hold; with 1e-290, too small for any sum, the whole ones."""
    start: dict[str, Any] = {suffixed(q.name, "_dot_0"): 1.0 for q in component.coordinates}
    moving: dict[str, Any] = {f"{s.name}_{of}": 1e-290 for s in component.actives for of in ("dot", "ddot")}
    loads: dict[str, Any] = {suffixed(q.name, "_load"): 1e-290 for q in component.coordinates}
    free, *others = (
        simulate(fmu(component), stop_time=2.0, step_size=0.1, input_reconstruction=HOLD, **start, **more)
        for more in ({}, *filter(None, (moving, loads, moving and moving | loads)))  # no run against itself
    )
    assert others
    energy = float(np.max(np.abs(free["energy"])))
    for name in free.names:
        # Work and balance are differences of energies, of which a crane has 1e6 J: their roundings are the energy's.
        scale = max(1.0, float(np.max(np.abs(free[name]))), energy if free.units[name] == "J" else 0.0)
        for other in others:
            # Other roundings in a few hundred steps of the solver, and what the motion makes of them.
            assert max_error(free[name], other[name]) <= 1e-11 * scale, name


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("component", OPERATORS)
def test_operator_is_its_closed_form(component, backend: str, fmu) -> None:
    result = simulate(fmu(component, backend), stop_time=2.0, step_size=0.125)
    assert_follows(result, component.exact(result.time), 1e-12)  # roundings of terms of size 5000 (y'' of the step)
