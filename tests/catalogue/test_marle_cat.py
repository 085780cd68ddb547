"""A cat from inertia, connection and effective mass: those of a SpatialCat make the same motion and the same forces."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from liaisons import ActiveCoordinate, build, operator, simulate
from liaisons.errors import ComponentError
from liaisons.mechanics import derive
from liaisons.models import SpatialCat, marle_cat
from liaisons_motion import analysis

SHAPE = ("bend", "azimuth", "twist")
EQUATIONS = derive(SpatialCat)
ATTITUDE = slice(3, 6)  # behind the centre of mass


def of_shape(expression: ca.SX) -> Any:
    """Function of the shape of a SpatialCat as by default."""
    m = EQUATIONS.mechanism
    values = [float(p.start) for p in m.parameters]
    function = ca.Function("f", [m.active.s], [ca.substitute(expression, m.parameter_column, ca.DM(values))])
    return lambda bend, azimuth, twist: function.call([ca.vertcat(bend, azimuth, twist)], True, False)[0]


inertia = of_shape(EQUATIONS.mass_matrix[ATTITUDE, ATTITUDE])
connection = of_shape(-analysis.kinetic_connection(EQUATIONS).expression[ATTITUDE, :])
mass = of_shape(EQUATIONS.effective_mass)
declared: Any = {name: ActiveCoordinate("rad", f"angle {name}", start=0.0) for name in SHAPE}
Cat = marle_cat(inertia, connection, mass, shape=declared, name="MadeCat")


def test_it_is_the_spatial_cat() -> None:
    random = np.random.default_rng(5)
    mine = derive(Cat)
    for _ in range(5):
        q = random.normal(size=4)
        state: dict[str, float] = dict(zip(("q_w", "q_x", "q_y", "q_z"), q / np.linalg.norm(q), strict=True))
        for name in (*SHAPE, "omega_x", "omega_y", "omega_z"):
            state |= {name: random.normal()}
        for name in SHAPE:
            state |= {f"{name}_dot": random.normal(), f"{name}_ddot": random.normal()}
        for quantity, rows in (("accelerations", ATTITUDE), ("momenta", ATTITUDE), ("operator_forces", slice(None))):
            expected = EQUATIONS.evaluate(quantity, **state)[rows]
            # a few hundred operations on numbers of up to 10
            np.testing.assert_allclose(mine.evaluate(quantity, **state), expected, rtol=1e-11, atol=1e-12)
        energy = EQUATIONS.evaluate("kinetic_energy", com_z_dot=0.0, **state)
        np.testing.assert_allclose(mine.evaluate("energy", **state), energy, rtol=1e-12)


@pytest.mark.variants(core=0)
def test_fmu_turns_as_the_spatial_cat(tmp_path: Path) -> None:
    limbs: Any = {
        "bend": operator("Sinusoid", offset=0.8, amplitude=0.3, angular_frequency=5.0),
        "azimuth": operator("Ramp", rate=3.0),
        "twist": operator("Sinusoid", amplitude=0.4, angular_frequency=7.0),
    }
    settings: Any = {"stop_time": 2.0, "step_size": 0.01, "tolerance": 1e-11, "H_x_0": 0.02, **limbs}
    runs = [simulate(fmu, **settings) for fmu in (build(Cat, tmp_path), "SpatialCat")]
    for name in ("q_w", "q_x", "q_y", "q_z", "omega_z", "bend_force", "twist_force"):
        np.testing.assert_allclose(runs[0][name], runs[1][name], rtol=0, atol=1e-9, err_msg=name)
    np.testing.assert_array_equal(runs[0]["H_x"], 0.02)
    assert abs(runs[0]["q_w"][-1]) < 0.99


def test_connection_and_mass_are_those_given() -> None:
    shape: Any = {"bend": 0.6, "azimuth": 0.3, "twist": -0.4}
    numbers = [np.array(f(*shape.values()), dtype=float) for f in (connection, mass)]
    np.testing.assert_allclose(analysis.kinetic_connection(Cat).evaluate(**shape), -numbers[0], rtol=0, atol=1e-14)
    np.testing.assert_allclose(analysis.effective_mass(Cat).evaluate(**shape), numbers[1], rtol=0, atol=1e-14)


def test_functions_that_make_no_cat_are_named() -> None:
    good: Any = (lambda s=1: (1 + s**2) * ca.SX.eye(3), lambda s: [s, 0, 1], lambda s: 1 + s**2)
    assert marle_cat(*good).actives[0].name == "s"
    with pytest.raises(ComponentError, match=r"connection returns shape \(2, 1\).* s it must be \(3, 1\)"):
        marle_cat(good[0], lambda s: [s, 0], good[2])
    with pytest.raises(ComponentError, match="mass must take the shape coordinates s"):
        marle_cat(good[0], good[1], lambda: 1)
    with pytest.raises(ComponentError, match=r"not positive definite"):
        marle_cat(lambda s=1: -s * ca.SX.eye(3), good[1], good[2])
