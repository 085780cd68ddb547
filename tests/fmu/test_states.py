"""Saved states: complete, pointer-free, checked; a roll-back is exact to the last bit."""

from __future__ import annotations

import ctypes as c
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from driver import ERROR, MODEL_EXCHANGE, OK, Instance, reals
from handmade import breathing

NAMES = ("length", "length_dot", "length_ddot")
OUTPUTS = ("theta", "p_theta", "work", "dissipated", "energy", "energy_balance", "length_force")


def run(instance: Instance, begin: int, end: int, *, size: float = 0.1) -> list[bytes]:
    """Steps with a breathing length and a changing torque; all outputs, as bytes, after each of them."""
    rows = []
    for i in range(begin, end):
        values = dict(zip(NAMES, breathing((i + 1) * size), strict=True)) | {"theta_force": 0.1 * i}
        assert instance.set(values) == OK
        assert instance.step(i * size, size) == OK
        rows.append(instance.get(*OUTPUTS).tobytes())
    return rows


@pytest.fixture(params=[0, 1, 2], ids=["hold", "extrapolate", "interpolate"])
def instance(request, pendulum_library) -> Instance:
    return pendulum_library.start(tolerance=1e-9, theta_0=1.0, friction=0.1, input_reconstruction=request.param)


def test_roll_back_is_exact_to_the_last_bit(instance) -> None:
    run(instance, 0, 7)
    state = instance.save()
    once = run(instance, 7, 20)
    assert instance.set(length=3.0, length_dot=-1.0, friction=0.7) == OK  # another past, which has to be forgotten
    assert instance.step(2.0, 0.37) == OK
    for _ in range(2):
        assert instance.call("SetFMUstate", state) == OK
        assert run(instance, 7, 20) == once
    assert instance.call("FreeFMUstate", c.byref(state)) == OK


def test_state_holds_what_was_set_but_not_used_yet(instance, pendulum_library) -> None:
    """Inputs and derivatives of inputs that wait for the next step."""
    run(instance, 0, 3)
    pending = (c.c_double * 2)(0.5, -2.0)
    assert instance.set(theta_force=0.3, length=1.1) == OK
    references = instance.refs(["theta_force"] * 2)
    assert instance.call("SetRealInputDerivatives", references, 2, (c.c_int * 2)(1, 2), pending) == OK
    content = instance.serialize()
    assert instance.step(0.3, 0.2) == OK
    other = pendulum_library.instantiate()
    assert other.deserialize(content) == OK
    assert other.step(0.3, 0.2) == OK
    assert other.get(*OUTPUTS).tobytes() == instance.get(*OUTPUTS).tobytes()


def test_state_holds_the_step_that_the_solver_would_try_next(pendulum_library) -> None:
    """Else the first step after a restoration is found anew, and the result differs in the last digits."""
    instance = pendulum_library.start(tolerance=1e-6, theta_0=2.0)
    assert instance.step(0.0, 3.0) == OK
    content = instance.serialize()
    assert instance.step(3.0, 5.0) == OK
    other = pendulum_library.instantiate()
    assert other.deserialize(content) == OK
    assert other.step(3.0, 5.0) == OK
    assert other["theta"] == instance["theta"]


_FRESH = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from driver import Library, OK
from test_states import run
instance = Library(Path(sys.argv[2])).instantiate()
assert instance.deserialize(sys.stdin.buffer.read()) == OK
sys.stdout.buffer.write(b"".join(run(instance, 5, 15)))
"""


def test_state_lives_on_in_a_fresh_process(instance, pendulum_fmu) -> None:
    run(instance, 0, 5)
    content = instance.serialize()
    expected = run(instance, 5, 15)
    arguments = [sys.executable, "-c", _FRESH, str(Path(__file__).parent), str(pendulum_fmu)]
    fresh = subprocess.run(arguments, input=content, capture_output=True, check=True)
    assert fresh.stdout == b"".join(expected)


def test_states_of_any_phase(pendulum_library) -> None:
    instance = pendulum_library.instantiate()
    assert instance.set(theta_0=0.7) == OK
    early = instance.serialize()
    assert instance.setup() == OK
    assert instance.call("EnterInitializationMode") == OK
    assert instance.set(theta_dot_0=0.3) == OK
    initializing = instance.serialize()
    assert instance.call("ExitInitializationMode") == OK
    assert instance.step(0.0, 0.5) == OK
    expected = instance["theta"]
    for content, before in ((early, True), (initializing, False)):
        assert instance.deserialize(content) == OK
        if before:
            assert instance.setup() == OK
            assert instance.call("EnterInitializationMode") == OK
            assert instance.set(theta_dot_0=0.3) == OK
        assert instance.call("ExitInitializationMode") == OK
        assert instance.step(0.0, 0.5) == OK
        assert instance["theta"] == expected


def test_memory_of_a_saved_state_is_used_again(pendulum_library) -> None:
    instance = pendulum_library.start()
    state = instance.save()
    address = state.value
    assert instance.step(0.0, 0.1) == OK
    assert instance.call("GetFMUstate", c.byref(state)) == OK
    assert state.value == address
    expected = instance["theta"]
    assert instance.step(0.1, 0.1) == OK
    assert instance.call("SetFMUstate", state) == OK
    assert instance["theta"] == expected
    assert instance.call("FreeFMUstate", c.byref(state)) == OK


def _patched(content: bytes, offset: int, replacement: bytes) -> bytes:
    return content[:offset] + replacement + content[offset + len(replacement) :]


def test_foreign_and_damaged_states_are_refused(pendulum_library, fall_library) -> None:
    """Header: 8 bytes of magic, byte order, version (4 each), size, checksum (8 each), guid (40)."""
    instance = pendulum_library.start(theta_0=0.7)
    content = instance.serialize()
    order = struct.unpack_from("=I", content, 8)[0]
    size = len(content)
    cases = {
        content[:10]: "the saved state has 10 bytes: it is cut off",
        content[:-8]: f"the saved state has {size - 8} bytes instead of {size}: it is cut off or damaged",
        content + b"12345678": f"the saved state has {size + 8} bytes instead of {size}: it is cut off or damaged",
        _patched(content, 0, b"nonsense"): "these bytes are no saved state of such an FMU",
        _patched(content, 8, order.to_bytes(4, "big")): "the saved state comes from a machine with another byte order",
        _patched(content, 12, struct.pack("=I", 99)): "the saved state has version 99, this FMU reads version 2",
        _patched(content, size - 20, b"####"): "the saved state is damaged: its checksum is wrong",
        fall_library.start().serialize(): f"belongs to another FMU, with guid {fall_library.description.guid}",
    }
    before = instance.get(*OUTPUTS)
    for damaged, message in cases.items():
        instance.messages.clear()
        assert instance.deserialize(damaged) == ERROR
        assert len(instance.messages) == 1
        assert instance.messages[0].endswith(message)
    np.testing.assert_array_equal(instance.get(*OUTPUTS), before)
    exchange = pendulum_library.start(MODEL_EXCHANGE)
    assert exchange.deserialize(content) == ERROR
    assert exchange.messages == ["the saved state belongs to an instance for co-simulation"]


def test_serialization_into_too_little_memory_is_refused(pendulum_library) -> None:
    instance = pendulum_library.start()
    state = instance.save()
    assert instance.call("SerializeFMUstate", state, c.create_string_buffer(8), 8) == ERROR
    assert instance.messages[0].startswith("fmi2SerializeFMUstate: 8 bytes are too few")
    assert instance.call("FreeFMUstate", c.byref(state)) == OK


def test_model_exchange_state(pendulum_library) -> None:
    instance = pendulum_library.start(MODEL_EXCHANGE, theta_0=0.5)
    instance.new_discrete_states()
    assert instance.call("EnterContinuousTimeMode") == OK
    assert instance.call("SetTime", 1.5) == OK
    assert instance.call("SetContinuousStates", reals([0.3, 0.4, 0.5, 0.0]), 4) == OK
    content, expected = instance.serialize(), instance.get(*OUTPUTS)
    other = pendulum_library.instantiate(MODEL_EXCHANGE)
    assert other.deserialize(content) == OK
    np.testing.assert_array_equal(other.get(*OUTPUTS), expected)
    np.testing.assert_array_equal(other.vector("GetContinuousStates", 4), [0.3, 0.4, 0.5, 0.0])
