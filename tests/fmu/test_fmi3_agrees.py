"""FMI 2.0 and FMI 3.0 from one core: the same calls give the same bits, in both interfaces and all input modes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from driver import CO_SIMULATION, OK, Library
from handmade import pendulum, ring
from numpy.typing import NDArray

from liaisons.fmu import build
from liaisons.mechanics import assemble
from liaisons.mechanics.model import Model
from liaisons.models import CartesianPendulum, CircularHoop, OscillatorChain, PendulumChain, Ramp

MODELS = {
    "pendulum": pendulum,
    "hoop": lambda: assemble(CircularHoop),  # an active coordinate, points
    "rod": lambda: assemble(CartesianPendulum),  # constraints: projection after each step of the solver
    "ramp": lambda: assemble(Ramp),  # no states, no inputs, an event
    "ring": lambda: ring(3),  # arrays
    "masses": lambda: assemble(OscillatorChain, 9),  # loops, links at the ends written out
    "chain": lambda: assemble(PendulumChain, 4),  # loops that carry something; active coordinates
}
STEP = 0.1


@dataclass(frozen=True)
class Pair:
    """The same component by both versions, addressed by numbers and by variables; or an instance of each."""

    model: Model
    two: Any
    three: Any

    def alike(self, do: Callable[[Any], Any]) -> Any:
        """What both do: it is the same."""
        two, three = do(self.two), do(self.three)
        assert two == three
        return two

    def outputs(self) -> bytes:
        return self.alike(lambda it: it.get(*(variable.name for variable in self.model.outputs)).tobytes())

    def set(self, values: dict[str, NDArray]) -> None:
        self.alike(lambda it: it.set(values))


@pytest.fixture(scope="module", params=MODELS)
def pair(request, folder) -> Pair:
    model = MODELS[request.param]()
    return Pair(model, *(Library(build(model, folder, backend="native", fmi=fmi)) for fmi in ("2", "3")))


def inputs_at(model: Model, t: float) -> dict[str, NDArray]:
    """Something smooth away from the start values, with right rates and accelerations of what is prescribed."""
    starts = {variable.name: np.array(variable.starts) for variable in model.inputs}
    waves = {name: np.sin(t * (1 + np.arange(start.size))) for name, start in starts.items()}
    values: dict[str, NDArray] = {name: starts[name] + 0.05 * wave for name, wave in waves.items()}
    for a in model.active:
        w = 1 + np.arange(starts[a.value].size)
        values[a.value] = starts[a.value] + 0.05 * (1 - np.cos(w * t))
        values[a.rate], values[a.acceleration] = 0.05 * w * np.sin(w * t), 0.05 * w**2 * np.cos(w * t)
    return values


def started(pair: Pair, kind: str, mode: int) -> Pair:
    both = Pair(pair.model, pair.two.instantiate(kind), pair.three.instantiate(kind))
    both.alike(lambda it: it.initialize(1e-9))
    if pair.model.inputs:
        both.alike(lambda it: it.set_integer("input_reconstruction", mode))
    both.set(inputs_at(pair.model, 0.0))
    both.outputs()
    both.alike(lambda it: it.exit_initialization())
    return both


def test_co_simulation(pair, mode) -> None:
    both = started(pair, CO_SIMULATION, mode)
    before = after = both.outputs()
    for i in range(20):
        both.set(inputs_at(pair.model, (i + (mode == 2)) * STEP))
        step = both.alike(lambda it, i=i: it.advance(i * STEP, STEP))
        assert step == (OK, False, False, pytest.approx((i + 1) * STEP, rel=1e-12))
        after = both.outputs()
    assert after != before  # it has moved
