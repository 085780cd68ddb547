"""Which jumps of prescribed coordinates are the limit of fast motions: where Θ does not depend on x (M eq. 50, 52)."""

from __future__ import annotations

import numpy as np
import pytest
from on_paper import random_states

from liaisons.fmu.jumps import jump_flags
from liaisons.mechanics import assemble
from liaisons.models import CartesianPendulum, CircularHoop, Pendulum, PlanarCat, Satellite, SpatialCat, Swing

JUMPS, MIXES = 1, 2
ADAPTED = [Swing, Pendulum, PlanarCat, SpatialCat, Satellite, CircularHoop]


@pytest.mark.parametrize("component", ADAPTED)
def test_jumps_have_a_limit_where_the_effective_mass_is_the_same_everywhere(component) -> None:
    """∂Θ/∂x by differences of the derived Θ, which the derivation of the table does not use."""
    varies = np.zeros(2 * [len(component.actives)], dtype=bool)
    for n in random_states(component, 3):
        for q in component.coordinates:  # off the unit quaternions Θ means nothing
            here, there = n("effective_mass"), (n | {q.name: n[q.name] + 0.1})("effective_mass")
            varies |= np.abs(np.atleast_2d(there - here)) > 1e-9
    table = jump_flags(assemble(component))
    if not table:
        assert np.diag(varies).all()
        return
    np.testing.assert_array_equal((np.array(table) & MIXES) != 0, varies)


def test_only_jumps_that_have_a_limit_are_in_the_code() -> None:
    assert jump_flags(assemble(Pendulum)) == [
        [0, MIXES, MIXES],
        [MIXES, JUMPS | MIXES, MIXES],
        [MIXES, MIXES, JUMPS | MIXES],
    ]
    assert jump_flags(assemble(Swing)) == [[JUMPS, 0], [0, JUMPS]]
    assert jump_flags(assemble(CartesianPendulum)) == []  # kept by a constraint: it is projected
    assert jump_flags(assemble(CircularHoop)) == []  # off its centre a ring is flung out
