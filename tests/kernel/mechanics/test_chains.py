"""Chains: the sweeps along the links against the dense derivation of the same chain, and what is refused."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np
import pytest

from liaisons.chains import link_of
from liaisons.errors import ComponentError
from liaisons.language import (
    ActiveCoordinate,
    Chain,
    Component,
    Coordinate,
    Joint,
    Mechanism,
    Parameter,
    Size,
    output,
    point,
)
from liaisons.mechanics import Model, assemble
from liaisons.models import DrivenChain, OscillatorChain, Pendulum, PendulumChain

ROUNDING = 1e-12
"""Of sums of some hundred terms of order 1 to 10, solved with matrices of condition < 1e2."""


class Telescope(Chain):
    """Links that turn against each other and slide along themselves; friction; everything that a chain can have."""

    mass = Parameter(1.3, "kg", "mass of each body", above=0)
    inertia = Parameter(0.4, "kg.m2", "its moment of inertia", above=0)
    stiffness = Parameter(2.0, "N/m", "of the telescope's spring", above=0)
    gravity = Parameter(9.81, "m/s2", "gravitational acceleration")
    rest = Parameter(1.0, "m", "length at rest of the spring, and of the lever", above=0)
    bending = Parameter(2.0, "N.m", "of the joint's spring")
    friction = Parameter(0.3, "1/s", "coefficient of friction", minimum=0)
    angle = Coordinate("rad", "angle against the link before", start=(0.3, -0.2), start_rate=0.1)
    reach = Coordinate("m", "length of the link", start=1.0, nominal=2.0)
    lever = ActiveCoordinate("rad", "angle of the base", start=0.4)
    lift = ActiveCoordinate("m", "height of the base")
    joint = Joint("m", "x", "z", phi="rad")

    def turned(self) -> Any:
        return self.joint["phi"] + self.angle

    @point("m", "the far end of each link")
    def end(self) -> dict[str, ca.SX]:
        phi = self.turned()
        return {"x": self.joint["x"] + self.reach * ca.sin(phi), "z": self.joint["z"] - self.reach * ca.cos(phi)}

    def base(self) -> dict[str, ca.SX]:
        return {
            "x": self.rest * ca.cos(self.lever),
            "z": self.lift + self.rest * ca.sin(self.lever),
            "phi": self.lever * 2,
        }

    def tip(self) -> dict[str, ca.SX]:
        return {**self.end, "phi": self.turned()}

    def kinetic_energy(self) -> ca.SX:
        middle = {axis: (self.end[axis] + self.joint[axis]) / 2 for axis in ("x", "z")}
        return self.mass / 2 * self.speed_squared(middle) + self.inertia / 2 * self.dot(self.turned()) ** 2

    def potential_energy(self) -> ca.SX:
        return self.gravity * self.mass * self.end["z"]

    def bond_energy(self) -> ca.SX:
        return self.stiffness / 2 * (self.reach - self.rest) ** 2 + self.bending * ca.cos(self.angle)

    def friction_coefficient(self) -> ca.SX:
        return self.friction

    def dissipation_function(self) -> ca.SX:
        return self.friction * self.mass / 2 * self.dot(self.end["x"]) ** 2

    def bond_dissipation(self) -> ca.SX:
        return self.bending / self.friction * self.dot(self.turned() * self.angle) * self.dot(self.joint["phi"])


def unrolled(component: type[Chain], n: int) -> type[Mechanism]:
    """Mechanism with one coordinate a link, ``theta_1`` ... ``theta_n``, derived by its dense mass matrix."""
    chain = component(n)
    links, base = range(1, chain.sizes["n"] + 1), chain.base()
    link = link_of(chain)

    def at(m: Mechanism, i: int, expression: ca.SX) -> ca.SX:
        """An expression of one link, of link i of the mechanism."""
        q, q_dot = (ca.vertcat(*(m.symbols[f"{c.name}_{i}{end}"] for c in chain.coordinates)) for end in ("", "_dot"))
        if i > 1:
            w = at(m, i - 1, link.tip)
        else:
            w = ca.substitute(chain.joint_column(base), _all(chain), _all(m)) if base else ca.SX.zeros(*link.w.shape)
        symbols = [link.q, link.v, link.w, link.w_dot, link.bonded, chain.parameter_column]
        values = [q, q_dot, w, m.dot(w), ca.SX(base is not None or i > 1), m.parameter_column]
        return ca.substitute(expression, ca.vertcat(*symbols), ca.vertcat(*values))

    names: dict[str, Any] = {p.name: p for p in component.parameters} | {s.name: s for s in component.actives}
    for q in component.coordinates:
        starts = (*q.leading, *(q.start for _ in links))
        for i, start in zip(links, starts, strict=False):
            text = f"{q.description}, link {i}"
            names[f"{q.name}_{i}"] = Coordinate(q.unit, text, start=start, start_rate=q.start_rate, nominal=q.nominal)
    for item in component.points:
        axes = getattr(chain, item.name)
        for i in links:
            names[f"{item.name}_{i}"] = point(item.unit, f"{item.description}, link {i}")(
                lambda m, axes=axes, i=i: {axis: at(m, i, ca.SX(value)) for axis, value in axes.items()}
            )
    return type(
        component.__name__,
        (Mechanism,),
        names
        | {
            "__module__": component.__module__,
            "__doc__": component.__doc__,
            "experiment": component.experiment,
            "kinetic_energy": lambda m: sum(at(m, i, link.kinetic) for i in links),
            "potential_energy": lambda m: sum(at(m, i, link.potential) for i in links),
            "dissipation_function": lambda m: sum(at(m, i, link.friction.function) for i in links),
        },
    )


def _all(m: Chain | Mechanism) -> ca.SX:
    """Parameters and active coordinates."""
    return ca.vertcat(m.parameter_column, m.s if isinstance(m, Chain) else m.active.s)


def unrolled_name(name: str, component: type[Chain]) -> str:
    """``p_theta[2]`` of a chain is ``p_theta_2`` of its unrolled mechanism, ``bob_x_dot[2]`` is ``bob_2_x_dot``."""
    found = re.fullmatch(r"(.*)\[(\d+)\]", name)
    if not found:
        return name
    declared = "|".join(item.name for item in (*component.coordinates, *component.points))
    return re.sub(rf"^(p_)?({declared})", rf"\1\2_{found[2]}", found[1])


def random_vectors(model: Model, rng: np.random.Generator) -> dict[str, dict[str, float]]:
    """Values near the starts for parameters and inputs, by name, and a state."""
    return {
        "k": {v.name: (v.starts[0] or 0.5) * rng.uniform(0.7, 1.3) for v in model.parameters},
        "u": {v.name: v.starts[0] + rng.uniform(-1, 1) for v in model.inputs},
        "y": {state.name: rng.uniform(-1.5, 1.5) for state in model.states},
    }


def evaluated(model: Model, values: Mapping[str, Mapping[str, float]], name_of: Any) -> dict[str, float]:
    y = [values["y"][name_of(state.name)] for state in model.states]
    u = [values["u"][name_of(v.name)] for v in model.inputs]
    k = [values["k"][name_of(v.name)] for v in model.parameters]
    m = [0.1, 0.2, *[0.3] * (len(model.memory) - 2)]
    z = model.outputs_function(0, y, u, k, m).full().ravel()
    found = {name_of(v.name): value for v, value in zip(model.outputs, z, strict=True)}
    start, memory = model.start(0, u, k)
    found |= {f"start of {name_of(s.name)}": value for s, value in zip(model.states, start.full().ravel(), strict=True)}
    rates, sizes = model.derivatives(0, y, u, k), model.nominals(0, y, u, k)
    found |= {f"rate of {name_of(s.name)}": value for s, value in zip(model.states, rates.full().ravel(), strict=True)}
    found |= {f"size of {name_of(s.name)}": value for s, value in zip(model.states, sizes.full().ravel(), strict=True)}
    return found | {"energy at start": float(memory[0])}


CHAINS = [(PendulumChain, 2), (PendulumChain, 6), (OscillatorChain, 2), (OscillatorChain, 12), (DrivenChain, 7)]
CHAINS += [(Telescope, 2), (Telescope, 3)]


@pytest.mark.parametrize(("component", "n"), CHAINS)
def test_sweeps_agree_with_the_dense_derivation(component: type[Chain], n: int) -> None:
    """Two derivations, one by sweeps link by link, one by the mass matrix: motion, forces, energies, starts."""
    dense, swept = assemble(unrolled(component, n)), assemble(component, n).flat()
    rng = np.random.default_rng(n)
    for _ in range(3):
        values = random_vectors(dense, rng)
        expected = evaluated(dense, values, str)
        found = evaluated(swept, values, lambda name: unrolled_name(name, component))
        assert set(expected) <= set(found)
        for name, value in expected.items():
            assert found[name] == pytest.approx(value, rel=ROUNDING, abs=ROUNDING * n), name


@pytest.mark.parametrize("component", [OscillatorChain, PendulumChain])
def test_code_does_not_grow_with_the_chain(component: type[Chain]) -> None:
    """A hundred times the links: C code less than four times as long (it grows with the logarithm)."""

    def length(n: int) -> int:
        generator = ca.CodeGenerator("chain", {"with_header": False})
        generator.add(assemble(component, n).derivatives)
        return len(generator.dump())

    assert length(10_000) < 4 * length(100)


@pytest.mark.parametrize("n", [0, 1, -3, 2.5, 10.0, "10", True, float("nan")])
def test_sizes_that_are_refused(n: object) -> None:
    with pytest.raises(ComponentError, match=re.escape(f"PendulumChain: n = {n!r}") + ": give a whole number"):
        assemble(PendulumChain, n)


def test_sizes() -> None:
    class Short(OscillatorChain):
        """Three masses."""

        n = Size(3, "number of masses")

    assert assemble(PendulumChain).dimensions[0].count == 10
    assert assemble(PendulumChain, np.int64(3)).dimensions[0].count == 3
    starts = {v.name: v.start for v in assemble(Short).flat().parameters if v.name.startswith("u_0")}
    assert starts == {"u_0[1]": 1.0, "u_0[2]": 0.0, "u_0[3]": 0.0}


REFUSED: list[tuple[type[Component], dict[str, Any], str]] = [
    (PendulumChain, {"base": lambda _: None}, r"Odd: .*need the joint.*define base\(\)"),
    (OscillatorChain, {"angle": Coordinate("rad", "of nothing")}, "Odd: angle moves no mass"),
    (
        PendulumChain,
        {"base": lambda m: {"x": m.pivot_x, "y": m.pivot_z}},
        r"Odd\.base returns \['x', 'y'\]; it must give \['x', 'z'\]",
    ),
    (
        OscillatorChain,
        {
            "speed": Parameter(3.0, "m/s", "of sound", above=0),
            "kinetic_energy": lambda m: m.mass * m.dot(m.u) ** 4 / m.speed**2,
        },
        r"Odd\.kinetic_energy must be quadratic",
    ),
    (OscillatorChain, {"kinetic_energy": lambda m: m.massive * m.dot(m.u) ** 2}, r"unknown symbol self\.massive.*mass"),
    (
        OscillatorChain,
        {"speed": output("m/s", "of a mass")(lambda m: m.dot(m.u))},
        "Odd.speed: a Chain has no output; write a Mechanism",
    ),
    (Pendulum, {"theta": Coordinate("rad", "angle", start=(0.1, 0.2))}, "only an array does; say size='n'"),
]


@pytest.mark.parametrize(("base", "namespace", "words"), REFUSED)
def test_what_is_wrong_about_a_link_is_refused_by_name(
    base: type[Component], namespace: dict[str, Any], words: str
) -> None:
    with pytest.raises(ComponentError, match=words):
        type("Odd", (base,), namespace | {"__module__": __name__})


def test_more_start_values_than_links() -> None:
    class Row(OscillatorChain):
        """With a wave at its begin."""

        u = Coordinate("m", "displacements", start=(1.0, 2.0, 3.0))

    with pytest.raises(ComponentError, match=r"Row: n = 2: u starts with 3 values; take a longer chain"):
        assemble(Row, n=2)


def test_only_chains_have_a_size() -> None:
    with pytest.raises(ComponentError, match=r"Pendulum: n = 3: only what declares n = Size\(...\) has a size"):
        assemble(Pendulum, 3)
