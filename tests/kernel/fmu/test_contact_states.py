"""Modes and counters in saved states, derivatives in the mode of the moment."""

from __future__ import annotations

import struct

import bodies
import numpy as np
import pytest
from driver import ERROR, MODEL_EXCHANGE, Instance, Library
from numpy.typing import NDArray
from test_states import _VECTORS, _patched, _sealed

from liaisons.mechanics import assemble
from liaisons.models import BouncingBall

MEMORY = ("gap_impulse", "impact_loss", "table_impulse", "belt_impulse", "work", "dissipated")
OUTPUTS = ("x", "z", "x_dot", "z_dot", "gap", "gap_force", "slip", "slip_force", "energy_balance", *MEMORY)


@pytest.fixture(params=["fmi2", "fmi3"])
def sledge(request, library) -> Library:
    return library(bodies.Sledge, request.param)


def shaken(t: float) -> dict[str, float]:
    """Motion of belt and table on which the sledge bounces, sticks and slides."""
    c, s = 0.02 * np.cos(30 * t), 0.02 * np.sin(30 * t)
    up = {"table": s - 0.02, "table_dot": 30 * c, "table_ddot": -900 * s}
    return up | {"belt": c, "belt_dot": -30 * s, "belt_ddot": -900 * c}


def run(instance: Instance, begin: int, end: int) -> list[bytes]:
    """Steps of 20 ms; what is said after each: numbers as bytes, modes and counters.

    In mode 0, in which nothing moves inside a step, the belt accelerates alone.
    """
    rows = []
    mode = instance.get_integer("input_reconstruction")
    for i in range(begin, end):
        instance.set(shaken(0.02 * (i + (mode == 2))) if mode else {"belt_dot": np.sin(0.2 * i)})
        instance.step(0.02 * i, 0.02)
        rows.append(instance.get(*OUTPUTS).tobytes() + bytes([instance.get_integer("gap_impacts"), *modes(instance)]))
    return rows


def modes(instance: Instance) -> list[bool]:
    """Whether the gap is closed, and whether the body sticks."""
    flags, references = instance.flags(2), instance.refs(["gap_closed", "slip_sticks"])
    instance.do("GetBoolean", references, 2, flags, 2)
    return [bool(flag) for flag in flags]


def begin(sledge: Library, mode: int) -> Instance:
    instance = sledge.initializing(input_reconstruction=mode, tolerance=1e-9)
    instance.set(z_0=0.05, x_dot_0=0.5, bounce=0.2 if mode else 0.8, **(shaken(0.0) if mode else {}))
    instance.exit_initialization()
    return instance


def test_roll_back_over_impacts_is_exact_to_the_last_bit(sledge, mode) -> None:
    instance = begin(sledge, mode)
    run(instance, 0, 10)
    state, before = instance.save(), instance.get_integer("gap_impacts")
    once = run(instance, 10, 60)
    assert instance.get_integer("gap_impacts") > before + 2
    assert len({row[-2:] for row in once}) > 1  # modes change, too
    for _ in range(2):
        instance.restore(state)
        assert instance.get_integer("gap_impacts") == before
        assert run(instance, 10, 60) == once
    instance.drop(state)


@pytest.mark.parametrize(
    ("slot", "contact", "values"),
    [
        ("gap_closed", "gap", [-1.0, 2.0, 0.5, 1e300]),
        ("gap_impacts", "gap", [-1.0, 0.5]),
        ("slip_direction", "slip", [-2.0, 0.5, 2.0, 1e300]),
        *((slot, "the memory of the component", [np.nan, np.inf]) for slot in ("gap_closed", "gap_rests_from")),
    ],
)
def test_modes_that_cannot_be_are_refused(library, slot, contact, values) -> None:
    model, instance = assemble(bodies.Sledge), begin(library(bodies.Sledge), 1)
    run(instance, 0, 5)
    content, before = instance.serialize(), instance.get(*OUTPUTS)
    states = model.start.numel_out(0)
    offset = _VECTORS + 8 * (len(model.inputs) + 2 * states + model.memory.index(slot))  # u, y, low, m
    (present,) = struct.unpack_from("=d", content, offset)
    assert slot == "gap_rests_from" or present in range(-1, 100)
    for value in values:
        forged = _sealed(_patched(content, offset, struct.pack("=d", value)))
        instance.deserialize(forged, ERROR, f"the saved state is damaged: {contact} is out of range")
    instance.deserialize(content)
    np.testing.assert_array_equal(instance.get(*OUTPUTS), before)


def test_steps_of_fixed_size_are_in_no_state(library) -> None:
    instance = library(BouncingBall).start()
    content = instance.serialize()
    forged = _sealed(_patched(content, 104 + 4 * 6, struct.pack("=i", 3)))
    instance.deserialize(forged, ERROR, "the saved state is damaged: symplectic_steps is out of range")


# ---- derivatives ------------------------------------------------------------------------------------------------

STATES = ("x", "z", "p_x", "p_z")
INPUTS = ("table", "table_dot", "table_ddot", "belt", "belt_dot", "belt_ddot", "x_force", "z_force")
UNKNOWNS = ("gap", "gap_force", "slip", "slip_force", "table_force", "belt_force", "energy")
SITUATIONS = {  # start values, and modes: closed, sticks
    "open": ({"z_0": 1.0, "x_dot_0": 0.3}, (False, False)),
    "sticks": ({"belt_ddot": 1.0}, (True, True)),
    "slides": ({"x_dot_0": 0.3, "belt_ddot": 1.0}, (True, False)),
    "slides back": ({"x_dot_0": -0.3, "table_ddot": 0.4}, (True, False)),
}


@pytest.mark.parametrize("situation", SITUATIONS)
def test_derivatives_are_those_of_the_mode(library, situation) -> None:
    """Against differences within the mode, of rates and forces that are linear or nearly so; and the adjoint ones."""
    values, expected = SITUATIONS[situation]
    instance = library(bodies.Sledge, "fmi3").running(MODEL_EXCHANGE, **values)
    assert modes(instance) == list(expected)
    names = (*INPUTS, *STATES)
    random = np.random.default_rng(3)
    direction = dict(zip(names, random.normal(size=len(names)), strict=True))
    base = {name: instance[name] for name in names}
    derivative = instance.directional(UNKNOWNS, direction)

    def moved(h: float) -> NDArray:
        instance.set({name: base[name] + h * direction[name] for name in names})
        return instance.get(*UNKNOWNS)

    h = 1e-6
    difference = (moved(h) - moved(-h)) / (2 * h)
    moved(0.0)
    # Values of order 10, whose rounding is divided by h; truncation h² is far below.
    np.testing.assert_allclose(derivative, difference, rtol=0, atol=1e-8)
    weights = random.normal(size=len(UNKNOWNS))
    adjoint = instance.adjoint(dict(zip(UNKNOWNS, weights, strict=True)), names)
    assert adjoint @ np.array(list(direction.values())) == pytest.approx(weights @ derivative, rel=1e-12)


def test_the_force_of_what_slides_follows_from_that_of_the_gap(library) -> None:
    """Of Coulomb's friction: its derivative by the acceleration of the table is -drag times the mass, or 0."""
    for situation, (values, _) in SITUATIONS.items():
        instance = library(bodies.Sledge, "fmi3").running(MODEL_EXCHANGE, **values)
        found = instance.directional(["gap_force", "slip_force"], {"table_ddot": 1.0})
        lifted = {"open": (0, 0), "sticks": (1, 0), "slides": (1, -0.3), "slides back": (1, 0.3)}[situation]
        assert found == pytest.approx(np.array(lifted), abs=1e-12), situation
