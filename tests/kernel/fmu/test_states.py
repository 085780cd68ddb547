"""Saved states: complete, pointer-free, checked; a roll-back is exact to the last bit."""

from __future__ import annotations

import ctypes as c
import re
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from driver import CO_SIMULATION, ERROR, MODEL_EXCHANGE, OK, Instance, Library, reals
from handmade import GRAVITY, breathing_inputs

from liaisons import models
from liaisons.language import Component

OUTPUTS = ("theta", "p_theta", "work", "dissipated", "energy", "energy_balance", "length_force")


def run(instance: Instance, begin: int, end: int, *, size: float = 0.1) -> list[bytes]:
    """Steps with a breathing length and a changing torque; all outputs, as bytes, after each of them."""
    rows = []
    for i in range(begin, end):
        instance.set(breathing_inputs((i + 1) * size), theta_force=0.1 * i)
        instance.step(i * size, size)
        rows.append(instance.get(*OUTPUTS).tobytes())
    return rows


MODES = ["hold", "extrapolate", "interpolate", "symplectic"]


@pytest.fixture(params=MODES)
def instance(request, every_pendulum) -> Instance:
    mode = {"input_reconstruction": MODES.index(request.param)}
    if request.param == "symplectic":  # which guesses the next step from the last ones: they belong to the state
        if every_pendulum.python:
            pytest.skip("there is no symplectic solver in Python")
        mode = {"symplectic_steps": 3}
    return every_pendulum.start(tolerance=1e-9, theta_0=1.0, friction=0.1, **mode)


def test_roll_back_is_exact_to_the_last_bit(instance) -> None:
    run(instance, 0, 7)
    state, there = instance.save(), instance.get(*OUTPUTS)
    once = run(instance, 7, 20)
    instance.set(length=3.0, length_dot=-1.0, friction=0.7)  # another past, which has to be forgotten
    instance.step(2.0, 0.37)
    for _ in range(2):
        instance.restore(state)
        np.testing.assert_array_equal(instance.get(*OUTPUTS), there)
        assert run(instance, 7, 20) == once
    instance.drop(state)


def test_state_holds_what_was_set_but_not_used_yet(instance) -> None:
    """Inputs and derivatives of inputs that wait for the next step."""
    run(instance, 0, 3)
    pending = (c.c_double * 2)(0.5, -2.0)
    instance.set(theta_force=0.3, length=1.1)
    if instance.library.fmi == "2" and not instance.library.python:
        references = instance.refs(["theta_force"] * 2)
        instance.do("SetRealInputDerivatives", references, 2, (c.c_int * 2)(1, 2), pending)
    content = instance.serialize()
    instance.step(0.3, 0.2)
    other = instance.library.restored(content)  # which is not initialized
    assert other.serialize() == content
    other.step(0.3, 0.2)
    assert other.get(*OUTPUTS).tobytes() == instance.get(*OUTPUTS).tobytes()


def test_state_holds_the_step_that_the_solver_would_try_next(every_pendulum) -> None:
    """Else the first step after a restoration is found anew, and the result differs in the last digits."""
    instance = every_pendulum.start(tolerance=1e-6, theta_0=2.0)
    instance.step(0.0, 3.0)
    content = instance.serialize()
    instance.step(3.0, 5.0)
    other = every_pendulum.restored(content)
    other.step(3.0, 5.0)
    assert other["theta"] == instance["theta"]


_FRESH = """
import sys
from importlib import import_module
from pathlib import Path
folder, module, library, fmu = sys.argv[1:]
sys.path.insert(0, folder)
from test_states import run
instance = getattr(import_module(module), library)(Path(fmu)).instantiate()
instance.deserialize(sys.stdin.buffer.read())
sys.stdout.buffer.write(b"".join(run(instance, 5, 15)))
"""


@pytest.mark.parametrize("instance", ["interpolate", "symplectic"], indirect=True)  # which have most to remember
def test_state_lives_on_in_a_fresh_process(instance) -> None:
    run(instance, 0, 5)
    content = instance.serialize()
    expected = run(instance, 5, 15)
    library = type(instance.library)
    arguments = [Path(__file__).parent, library.__module__, library.__name__, instance.library.path]
    fresh = subprocess.run([sys.executable, "-c", _FRESH, *arguments], input=content, capture_output=True, check=True)
    assert fresh.stdout == b"".join(expected)


def test_states_of_any_phase(every_pendulum) -> None:
    instance = every_pendulum.instantiate()
    instance.set(theta_0=0.7)
    early = instance.serialize()
    instance.initialize()
    instance.set(theta_dot_0=0.3)
    initializing = instance.serialize()
    instance.exit_initialization()
    instance.step(0.0, 0.5)
    expected = instance["theta"]
    for content, before in ((early, True), (initializing, False)):
        instance.deserialize(content)
        if before:
            instance.initialize()
            instance.set(theta_dot_0=0.3)
        instance.exit_initialization()
        instance.step(0.0, 0.5)
        assert instance["theta"] == expected


def test_memory_of_a_saved_state_is_used_again(native_pendulum) -> None:
    instance = native_pendulum.start()
    state = instance.save()
    address = state.value
    instance.step(0.0, 0.1)
    instance.do("GetFMUState", c.byref(state))
    assert state.value == address
    expected = instance["theta"]
    instance.step(0.1, 0.1)
    instance.restore(state)
    assert instance["theta"] == expected
    instance.drop(state)


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
        _patched(content, 12, struct.pack("=I", 99)): "the saved state has another version than 2",
        _patched(content, size - 20, b"####"): "the saved state is damaged: its checksum is wrong",
        _patched(content, 24, bytes(8)): "the saved state is damaged: its checksum is wrong",
        fall_library.start().serialize(): "the saved state belongs to another FMU",
    }
    before = instance.get(*OUTPUTS)
    for damaged, message in cases.items():
        instance.messages.clear()
        instance.deserialize(damaged, ERROR)
        assert len(instance.messages) == 1
        assert instance.messages[0].endswith(message)
    np.testing.assert_array_equal(instance.get(*OUTPUTS), before)
    message = "the saved state belongs to an instance for co-simulation"
    pendulum_library.start(MODEL_EXCHANGE).deserialize(content, ERROR, message)


# ---- forged states: the checksum can be computed anew ----------------------------------------------------------------

_MASK = 2**64 - 1
# Where the scalars of instance.h are: header of 72 bytes, then four reals and ten integers.
_REALS = {name: 72 + 8 * i for i, name in enumerate(("time", "tolerance", "step", "limit"))}
_INTEGERS = (
    *("phase", "use", "reconstruction", "unstarted"),
    *("jumped", "expanded", "symplectic_steps", "known", "stiff_solver", "stiffness_reported"),
)
_PLACES = _REALS | {name: 104 + 4 * i for i, name in enumerate(_INTEGERS)}
_VECTORS = 144  # where the first of them begins


def _sealed(content: bytes) -> bytes:
    """With the checksum that such content has: FNV-1a over words of 8 bytes, from the guid on."""
    total = 14695981039346656037
    for (word,) in struct.iter_unpack("=Q", content[32:]):
        total = (total ^ word) * 1099511628211 & _MASK
        total ^= total >> 32
    return _patched(content, 24, struct.pack("=Q", total | 1))


def _forged(content: bytes, name: str, value: float) -> bytes:
    return _sealed(_patched(content, _PLACES[name], struct.pack("=d" if name in _REALS else "=i", value)))


def _swing(library: Library, *, symplectic: int = 0) -> Instance:
    """After some steps, with a derivative of an input that waits for the next one."""
    instance = library.start(theta_0=0.7, symplectic_steps=symplectic)
    run(instance, 0, 3)
    if library.fmi == "2":
        reference = instance.refs(["theta_force"])
        instance.do("SetRealInputDerivatives", reference, 1, (c.c_int * 1)(1), reals([0.5]))
    return instance


def _refused(instance, content: bytes) -> str:
    """Neither the instance nor its log shows anything of what was refused; the message."""
    before = instance.get(*OUTPUTS)
    instance.messages.clear()
    instance.deserialize(content, ERROR)
    assert instance.get(*OUTPUTS).tobytes() == before.tobytes()
    (message,) = instance.messages
    return message


def test_the_checksum_of_the_tests_is_that_of_the_fmu(pendulum_library) -> None:
    content = _swing(pendulum_library).serialize()
    assert _sealed(content) == content


_FLAGS = ("unstarted", "jumped", "expanded", "known", "stiff_solver", "stiffness_reported")
_IMPOSSIBLE = [
    *[("time", value) for value in (np.nan, np.inf, -np.inf)],
    *[("tolerance", value) for value in (0.0, -1e-8, 1.0, 1e-300, np.nan, np.inf)],
    *[("step", value) for value in (-0.1, np.nan, np.inf)],
    *[("limit", value) for value in (np.nan, -np.inf, 1.0)],  # the pendulum has no events
    # 8 is event mode, which an instance for co-simulation without events does not have
    *[("phase", value) for value in (0, 1, 3, 8, 16, 64, 256, -1, 2**31 - 1)],
    *[("use", value) for value in (-1, 3, 2**30)],
    *[("reconstruction", value) for value in (-1, 3, 2**31 - 1)],
    *[("symplectic_steps", value) for value in (-1, 100001, 2**31 - 1)],
    *[(flag, value) for flag in _FLAGS for value in (-1, 2, 2**31 - 1)],
    ("unstarted", 1),  # after initialization
]


def test_scalars_that_no_instance_can_have_are_refused(pendulum_library) -> None:
    instance = _swing(pendulum_library)
    content = instance.serialize()
    for name, value in _IMPOSSIBLE:
        message = _refused(instance, _forged(content, name, value))
        assert re.fullmatch(r"the saved state is damaged: [a-z_ ]+ is out of range", message), (name, value)


@pytest.mark.parametrize("steps", [1, 2])
def test_a_state_has_one_solver(pendulum_library, steps) -> None:
    """The stiff one, or so many symplectic steps."""
    instance = _swing(pendulum_library)
    content = _forged(instance.serialize(), "stiff_solver", 1)
    instance.deserialize(content)
    forged = _forged(content, "symplectic_steps", steps)
    assert _refused(instance, forged) == "the saved state is damaged: stiff_solver is out of range"


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("symplectic", [0, 2])
def test_every_number_of_the_vectors_is_finite(pendulum_library, value, symplectic) -> None:
    instance = _swing(pendulum_library, symplectic=symplectic)
    content = instance.serialize()
    for offset in range(_VECTORS, len(content), 8):
        message = _refused(instance, _sealed(_patched(content, offset, struct.pack("=d", value))))
        assert message.endswith("is out of range"), offset
        assert not re.search("nan|inf", message)


def test_parameters_of_a_state_are_in_their_domains(pendulum_library) -> None:
    instance = _swing(pendulum_library)
    content = instance.serialize()
    mass = content.index(struct.pack("=d", 1.0) + struct.pack("=d", GRAVITY), _VECTORS)
    forged = _sealed(_patched(content, mass, struct.pack("=d", -2.5)))
    assert _refused(instance, forged) == "the saved state is damaged: mass is out of range"
    early = pendulum_library.instantiate()
    early.set(mass=-2.5)  # is refused when initialization ends, so it can be saved before
    other = pendulum_library.instantiate()
    other.deserialize(early.serialize())
    assert other["mass"] == -2.5


def test_the_next_event_of_a_state_is_one_of_the_component(kick_library) -> None:
    """Until then functions of time are taken from its left: at another time they would stand still."""
    instance = kick_library.running(MODEL_EXCHANGE)
    content = instance.serialize()
    (event,) = struct.unpack_from("=d", content, _PLACES["limit"])
    assert event == instance["t_1"]
    other = kick_library.restored(content, MODEL_EXCHANGE)
    other.deserialize(_forged(content, "limit", np.inf))  # it is past
    message = "the saved state is damaged: the next event is out of range"
    for value in (event + 1, -1e300, 0.0):
        other.deserialize(_forged(content, "limit", value), ERROR, message)


def _rewritten(content: bytes, random: np.random.Generator) -> bytes:
    """With up to three words that are swapped, drawn, turned over in a bit, or of another size; sealed."""
    words = np.frombuffer(content[72:], dtype=np.uint64).copy()
    for _ in range(random.integers(1, 4)):
        i, j = random.integers(words.size, size=2)
        change = random.integers(4)
        if change == 0:
            words[[i, j]] = words[[j, i]]
        elif change == 1:
            words[i] = random.integers(2**64, dtype=np.uint64)
        elif change == 2:
            words[i] ^= np.uint64(1) << np.uint64(random.integers(64))
        else:
            words[i] = np.float64(10.0 ** random.uniform(-300, 300)).view(np.uint64)
    return _sealed(content[:72] + words.tobytes())


def test_a_forged_state_is_refused_or_behaves(pendulum_library) -> None:
    """Whatever was accepted ends, and no number that is not finite comes with OK."""
    random = np.random.default_rng(1)
    content = _swing(pendulum_library).serialize()
    accepted = 0
    for _ in range(100):
        forged, other = _rewritten(content, random), pendulum_library.instantiate()
        if other.deserialize(forged, None):
            continue
        accepted += 1
        (t,) = struct.unpack_from("=d", forged, _PLACES["time"])
        for _ in range(3):
            if other.step(t, 0.1, None):
                break
            t += 0.1
            status, values = other.read(*OUTPUTS)
            assert status != OK or np.isfinite(values).all()
    assert accepted > 10


def test_serialization_into_too_little_memory_is_refused(pendulum_library) -> None:
    instance = pendulum_library.start()
    state = instance.save()
    assert instance.call("SerializeFMUState", state, c.create_string_buffer(8), 8) == ERROR
    assert instance.messages[0].startswith(f"{instance.library.full('SerializeFMUState')}: 8 bytes are too few")
    instance.drop(state)


# ---- of any component, in the middle of an event ---------------------------------------------------------------------

INTERFACES: dict[str, tuple[str, str, dict[str, bool]]] = {
    "FMI 2 Model Exchange": ("fmi2", MODEL_EXCHANGE, {}),
    "FMI 3 Model Exchange": ("fmi3", MODEL_EXCHANGE, {}),
    "event mode": ("fmi3", CO_SIMULATION, {"events": True, "early": True}),
}
SUBJECTS: dict[str, tuple[type[Component], dict[str, Any]]] = {
    "plain mechanism": (models.Pendulum, {"theta_0": 1.0, "friction": 0.1}),
    "jumps of σ̇": (models.DoublePendulum, {}),
    "constraints": (models.CartesianPendulum, {}),
    "non-holonomic": (models.IsokineticOscillator, {}),
    "orientation": (models.Satellite, {}),
    "arrays": (models.OscillatorChain, {}),
    "chain": (models.PendulumChain, {}),
    "unilateral": (models.BouncingBall, {"height_0": 1e-3, "bounce": 0.5}),
    "unilateral, leaves": (models.BeadOnSphere, {"x_0": 0.75, "z_0": (1 - 0.75**2) ** 0.5}),
    "unilateral, several": (models.BallRow, {"x_0": [0.0, 0.115, 0.215]}),
    "dry friction": (models.DryOscillator, {"x_0": 0.0991, "x_dot_0": 0.02, "belt_dot": 0.02}),
    "internal states": (models.NoseHooverOscillator, {}),
    "prescribed only": (models.Ramp, {"start_time": 0.025}),
    "operator with states": (models.SwingPump, {}),
    "regulator": (models.Regulator, {"gain_1": [2.0] * 50, "gain_2": [0.3] * 50}),
    "planned motion": (models.PlannedMotion, {"instant": [0.0, 0.025, 0.025, 0.05, *[0.0] * 96]}),
}


def act(instance: Instance, name: str, cycle: int) -> bytes:
    """One call of an importer, in the cycle of this number; all that can be read after it."""
    description, states = instance.library.description, instance.library.states
    said = b""
    if name == "set":  # jumps of rates, forces and readings; positions that an operator prescribes do not jump
        inputs = [v.name for v in description.modelVariables if v.causality == "input"]
        for i, moved in enumerate(n for n in inputs if f"{n}_dot" not in inputs and "_ddot" not in n):
            instance.set({moved: instance.get(moved) + 0.01 * (1 + (cycle + i) % 3)})
    elif name == "update":
        said = repr(instance.update()).encode()
    elif name == "advance":
        said = repr(instance.advance(instance["time"], 0.01)).encode()
    elif name == "integrate":  # by Euler's rule
        y = instance.vector("GetContinuousStates", states)
        y += 0.01 * instance.vector("GetContinuousStateDerivatives", states)
        instance.do("SetTime", 0.01 * (cycle + 1))
        instance.do("SetContinuousStates", reals(y), states)
    else:
        instance.do(name)
    return said + instance.get(*(v.name for v in description.modelVariables if v.type in {"Real", "Float64"})).tobytes()


def calls(kind: str) -> list[tuple[str, int]]:
    """Those of eight steps with an event after each, at which inputs jump twice."""
    moves = ("integrate", "EnterContinuousTimeMode") if kind == MODEL_EXCHANGE else ("advance", "EnterStepMode")
    cycle = ["EnterEventMode", "set", "update", "set", "update", moves[1], moves[0]]
    return [(name, k) for k in range(8) for name in cycle[0 if k else 2 :]]


@pytest.mark.parametrize("interface", INTERFACES)
@pytest.mark.parametrize("subject", SUBJECTS)
def test_state_of_any_moment_goes_on_in_a_fresh_instance(library, subject: str, interface: str) -> None:
    """Before, between and after updates of discrete states, and after an early return; to the last bit."""
    (component, start), (target, kind, options) = SUBJECTS[subject], INTERFACES[interface]
    built: Library = library(component, target)
    instance, script = built.start(kind, options=options, **start), calls(kind)
    saved, said = [instance.serialize()], list[bytes]()
    for call in script:
        said.append(act(instance, *call))
        saved.append(instance.serialize())
    assert len(set(said)) > 8
    for k, content in enumerate(saved[:-1]):
        other = built.restored(content, kind, **options)
        assert other.serialize() == content
        assert act(other, *script[k]) == said[k], script[k]
        assert other.serialize() == saved[k + 1], script[k]
