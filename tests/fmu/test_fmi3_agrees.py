"""FMI 2.0 and FMI 3.0 from one core: the same calls give the same bits, in both interfaces and all input modes."""

from __future__ import annotations

from dataclasses import dataclass

import driver
import driver3
import numpy as np
import pytest
from driver import OK, Library, reals
from driver3 import Library3
from handmade import pendulum, ring
from numpy.typing import NDArray

from liaisons.fmu import build
from liaisons.fmu.layout import first_reference, places
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
    """The same component by both versions, addressed by numbers and by variables."""

    model: Model
    two: Library
    three: Library3

    def elements(self, names: list[str]) -> list[int]:
        where, first = places(self.model), first_reference(self.model)
        return [first + place for name in names for place in where[name]]


@pytest.fixture(scope="module", params=MODELS)
def pair(request, folder) -> Pair:
    model = MODELS[request.param]()
    two, three = (build(model, folder, backend="native", fmi=fmi) for fmi in ("2", "3"))
    return Pair(model, Library(two), Library3(three))


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


def set_both(pair: Pair, two: driver.Instance, three: driver3.Instance3, values: dict[str, NDArray]) -> None:
    if values:
        flat = np.concatenate(list(values.values())).tolist()
        references = (driver.c.c_uint * len(flat))(*pair.elements(list(values)))
        assert two.call("SetReal", references, len(flat), reals(flat)) == OK
        assert three.set(values) == OK


def get_both(pair: Pair, two: driver.Instance, three: driver3.Instance3) -> tuple[bytes, bytes]:
    names = [variable.name for variable in pair.model.outputs]
    found = reals([0.0] * len(pair.elements(names)))
    assert two.call("GetReal", (driver.c.c_uint * len(found))(*pair.elements(names)), len(found), found) == OK
    return bytes(found), three.get(*names).tobytes()


def started(pair: Pair, kinds: tuple[int, str], mode: int) -> tuple[driver.Instance, driver3.Instance3]:
    two, three = pair.two.instantiate(kinds[0]), pair.three.instantiate(kinds[1])
    assert (two.setup(1e-9), three.initialize(1e-9)) == (OK, OK)
    assert two.call("EnterInitializationMode") == OK
    if pair.model.inputs:
        assert (two.set_integer("input_reconstruction", mode), three.set_mode(mode)) == (OK, OK)
    set_both(pair, two, three, inputs_at(pair.model, 0.0))
    bits = get_both(pair, two, three)
    assert bits[0] == bits[1]
    assert (two.call("ExitInitializationMode"), three.call("ExitInitializationMode")) == (OK, OK)
    return two, three


@pytest.mark.parametrize("mode", [0, 1, 2], ids=["hold", "extrapolate", "interpolate"])
def test_co_simulation(pair, mode) -> None:
    two, three = started(pair, (driver.CO_SIMULATION, driver3.CO_SIMULATION), mode)
    before = bits = get_both(pair, two, three)
    for i in range(20):
        set_both(pair, two, three, inputs_at(pair.model, (i + (mode == 2)) * STEP))
        assert two.step(i * STEP, STEP) == OK
        assert three.step(i * STEP, STEP) == (OK, False, False, pytest.approx((i + 1) * STEP, rel=1e-12))
        bits = get_both(pair, two, three)
        assert bits[0] == bits[1]
    assert bits != before  # it has moved


def test_model_exchange(pair) -> None:
    """Explicit Euler steps, with an event in their midst."""
    two, three = started(pair, (driver.MODEL_EXCHANGE, driver3.MODEL_EXCHANGE), 1)
    n = pair.model.start.numel_out(0)
    for event in range(2):
        two_info, three_info = two.new_discrete_states(), three.update()
        assert bool(two_info.valuesOfContinuousStatesChanged) == three_info.states_changed
        assert (two_info.nextEventTime if two_info.nextEventTimeDefined else None) == three_info.next_time
        assert (two.call("EnterContinuousTimeMode"), three.call("EnterContinuousTimeMode")) == (OK, OK)
        y = two.vector("GetContinuousStates", n)
        for i in range(10 * event, 10 * event + 10):
            assert (two.call("SetTime", i * 0.01), three.call("SetTime", i * 0.01)) == (OK, OK)
            set_both(pair, two, three, inputs_at(pair.model, i * 0.01))
            assert two.call("SetContinuousStates", reals(y), n) == OK
            assert three.call("SetContinuousStates", reals(y), n) == OK
            rates = two.vector("GetDerivatives", n)
            assert three.vector("GetContinuousStateDerivatives", n).tobytes() == rates.tobytes()
            y = y + 0.01 * rates
            bits = get_both(pair, two, three)
            assert bits[0] == bits[1]
        assert (two.call("EnterEventMode"), three.call("EnterEventMode")) == (OK, OK)
        set_both(pair, two, three, inputs_at(pair.model, 5.0))  # a jump
    nominals = (instance.vector("GetNominalsOfContinuousStates", n).tobytes() for instance in (two, three))
    assert len(set(nominals)) == 1
