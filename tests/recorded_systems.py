"""Systems whose runs are recorded: impacts, stick and slip, samples, adaptive steps, isolated and foreign FMUs."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parent / "kernel/cosim"))

from making import exchange_only, wired
from test_impulses import MOVERS, OWN, TOPS

import conftest
import liaisons
from liaisons import Result, System, sampled
from liaisons.cosim import IncompleteError, Run
from liaisons.fmu import build
from liaisons.library import catalogue
from liaisons.mechanics import assemble

Record = dict[str, NDArray[Any]]
Make = Callable[[], tuple[System, dict[str, Any]]]
FOLDER = Path(mkdtemp())


@cache
def path(name: str) -> Path:
    """FMU of a component of the catalogue or of ``test_impulses``, or of another make: ``"little/..."``.

    Before the name of one of ours there may be its kind: ``"fmi3/..."``, ``"python/..."``, ``"exchange/..."``.
    """
    kind, _, plain = name.rpartition("/")
    folder = FOLDER / (kind or "fmi2")
    folder.mkdir(exist_ok=True)
    if kind == "little":
        return conftest.little_fmu(folder, plain)
    if kind == "exchange":
        return exchange_only(path(plain), folder)
    backend: Any = "python" if kind == "python" else "auto"
    fmi: Any = "3" if kind == "fmi3" else "2"
    return build(assemble(OWN[plain] if plain in OWN else catalogue()[plain]), folder, backend=backend, fmi=fmi)


def of(*links: str, settings: dict[str, Any] | None = None, **parts: str | tuple[str, dict[str, Any]]) -> Make:
    """A system of FMUs by name, with start values where there are any."""

    def make() -> tuple[System, dict[str, Any]]:
        pairs = {key: part if isinstance(part, tuple) else (part, {}) for key, part in parts.items()}
        system = wired(*links, **{key: (path(kind), starts) for key, (kind, starts) in pairs.items()})
        return system, {"stop_time": 1.0, "step_size": 0.02, **(settings or {})}

    return make


def pair(mover: str, top: str, seed: int, **settings: Any) -> Make:
    """A mover below what has contacts with it, with random start values."""
    random = np.random.default_rng(seed)
    (kind, port, starts), (above, own) = MOVERS[mover], TOPS[top]
    lower = starts(random)
    upper = {"mass": 0.7, "bounce": 0.6, **own(random), "height_0": float(random.uniform(0.4, 0.7))}
    more = {"stop_time": 0.6, "step_size": 0.01, **settings}
    return of(f"mover.{port} -> top.table", settings=more, mover=(kind, lower), top=(above, upper))


def dry(mass: dict[str, float], block: dict[str, float], **settings: Any) -> Make:
    """Dry friction on what another FMU moves."""
    kind = "DryOscillator" if "mu_static" in mass else "Oscillator"
    return of("mass.x -> block.belt", settings=settings, mass=(kind, mass), block=("DryOscillator", block))


def pendulums(upper: str = "Pendulum", lower: str = "Pendulum", **settings: Any) -> Make:
    return of("upper.bob -> lower.pivot", settings=settings, upper=(upper, {"theta_0": 0.4}), lower=(lower, {}))


def swing(**settings: Any) -> Make:
    motor = "Sinusoid", {"offset": 1.0, "amplitude": 0.1, "angular_frequency": 5.0}
    return of("motor.y -> swing.length", settings=settings, motor=motor, swing=("Pendulum", {"theta_0": 0.2}))


def controlled(coupling: Any = None, *, function: bool = False, delay: float = 0.0, **settings: Any) -> Make:
    """A sampled controller beside a pendulum, which carries another one where the coupling is implicit."""

    def make() -> tuple[System, dict[str, Any]]:
        system = System("controlled")
        plant = system.add("plant", path("Pendulum"), theta_0=0.4)
        if coupling == "implicit":
            system.connect(plant["bob"], system.add("lower", path("Pendulum"))["pivot"])
        if function:
            torque = sampled(
                lambda state, angle: (-4 * angle - state, state + 0.1 * angle), period=0.03, delay=delay, state=0.0,
                reads=["plant.theta"], writes=["plant.theta_force"],
            )  # fmt: skip
            system.add("controller", torque)
        else:
            pid = system.add("controller", path("Pid"), period=0.03, delay=delay, setpoint=0.1, gain=4.0)
            system.connect(plant["theta"], pid["reading"])
            system.connect(pid["output"], plant["theta_force"])
        return system, {"stop_time": 1.0, "step_size": 0.02, "coupling": coupling, **settings}

    return make


def driven(*, breaks: bool = True, coupling: Any = None, **settings: Any) -> Make:
    """Functions of time that break, announced or not."""

    def make() -> tuple[System, dict[str, Any]]:
        system, more = pendulums()() if coupling == "implicit" else of(upper="Pendulum")()
        jump = liaisons.Signal(lambda t: float(t > 0.33), breaks=[0.33]) if breaks else lambda t: float(t > 0.33)
        inputs = {"upper.theta_force": jump, "upper.length": _length}
        return system, {**more, "inputs": inputs, "coupling": coupling, **settings}

    return make


def _length(t: float) -> tuple[float, float, float]:
    s = abs(t - 0.61)
    return 1 + 0.05 * s**3, 0.15 * s * (t - 0.61), 0.3 * s


def isolated(make: Make) -> Make:
    def made() -> tuple[System, dict[str, Any]]:
        system, settings = make()
        return system.isolated_copy(), settings

    return made


_BLOCK = {"mass": 2.8511, "stiffness": 0.0, "mu_sliding": 0.0501, "mu_static": 0.06597, "x_0": 0.0383}
_SLIPS = {"mass": 1.6756, "stiffness": 20.87, "x_0": 0.0537, "x_dot_0": -0.2883, "damping": 1.6625}
_TURNS = {"mass": 3.0, "stiffness": 32.17, "x_0": 0.0949, "x_dot_0": 0.12526, "damping": 1.38725}
_TURNED = {
    "mass": 0.7145,
    "stiffness": 76.18,
    "mu_sliding": 0.1683,
    "mu_static": 0.2022,
    "x_0": 0.0976,
    "x_dot_0": 0.26,
}
_CART = "cart.q -> buffer.length"
_LATER: dict[str, Any] = {"times": [0.0, 0.1, 0.15, 0.4, 0.41, 0.7, 1.0], "stop_time": None, "step_size": None}
_ADAPTED: dict[str, Any] = {"step_size": None}
_BOUNDED: dict[str, Any] = {"step_size": None, "error_tolerance": 1e-5}

SYSTEMS: dict[str, Make] = {
    "impacts on a table": pair("table", "ball", 1),
    "impacts on a brake": pair("brake", "ball", 2),
    "impacts on a tower": pair("tower", "two balls", 3),
    "impacts on a lever": pair("lever", "ball", 4, coupling="implicit"),
    "impacts of a ball on a ball": pair("lower ball", "ball", 5),
    "impacts of a bar": pair("table", "bar", 6),
    "impacts under a roof": pair("table", "ball under a roof", 7),
    "impacts of a box that slides": pair("table", "sliding box", 8),
    "impacts of a box on a brake": pair("brake", "sliding box", 9),
    "impacts in long steps": pair("table", "ball", 10, step_size=0.06),
    "impacts at rest": pair("table", "ball", 1, stop_time=1.5, step_size=0.02),
    "impacts on an operator's table": of(
        "motor.y -> ball.table",
        ball=("BouncingBall", {"height_0": 0.3, "bounce": 0.5}),
        motor=("Sinusoid", {"amplitude": 0.0883, "angular_frequency": 10.0, "phase": math.pi / 2}),
    ),
    "impacts that go no further": of(
        "table.x -> ball.table", ball=("BouncingBall", {"height_0": 0.3}), table=("Oscillator", {"x_0": 0.0}),
        settings={"coupling": "gauss-seidel"},
    ),
    "impacts that an adaptive step meets": of(
        "motor.y -> ball.table", ball=("BouncingBall", {"bounce": 0.5}), settings=_ADAPTED,
        motor=("Sinusoid", {"amplitude": 0.1, "angular_frequency": 40.0}),
    ),
    "slides neither way": dry(_SLIPS, _BLOCK),
    "turns and does not stick": dry(_TURNS, _TURNED),
    "sticks with what moves it": dry({"stiffness": 80.0, "x_0": 0.1}, {"stiffness": 1e-3, "mu_static": 0.5}),
    "dry on dry": dry(
        {"mass": 0.2111, "stiffness": 0.0, "mu_sliding": 0.3067, "mu_static": 0.4056, "x_0": -0.0796},
        {"mass": 0.3623, "stiffness": 99.12, "mu_sliding": 0.4551, "mu_static": 0.8466, "x_0": -0.034, "x_dot_0": -0.4},
    ),
    "samples": controlled(),
    "samples that are late": controlled(delay=0.01),
    "samples of a function": controlled(function=True, delay=0.013),
    "samples in an implicit coupling": controlled("implicit"),
    "samples of a function in an implicit coupling": controlled("implicit", function=True),
    "samples in a waveform": controlled("waveform", delay=0.03),
    "samples by jacobi": controlled("jacobi", function=True),
    "samples in steps of the user": controlled(**_LATER),
    "adaptive steps": swing(**_ADAPTED),
    "adaptive steps of a bounded error": swing(**_BOUNDED),
    "adaptive implicit steps": pendulums(**_ADAPTED),
    "adaptive implicit steps of a bounded error": pendulums(**_BOUNDED),
    "adaptive steps to breaks": driven(**_ADAPTED),
    "adaptive steps to breaks nobody announced": driven(breaks=False, **_BOUNDED),
    "adaptive steps to samples": controlled("implicit", **_ADAPTED),
    "adaptive steps that are refused": of(
        "hasty.x -> mass.q_force", hasty=("little/hasty", {"longest": 0.001}), mass="little/cart", settings=_BOUNDED
    ),
    "breaks": driven(),
    "breaks that nobody announced": driven(breaks=False),
    "breaks in an implicit coupling": driven(coupling="implicit"),
    "breaks found in an implicit coupling": driven(breaks=False, coupling="implicit", **_LATER),
    "a waveform": pendulums(coupling="waveform"),
    "gauss-seidel": swing(coupling="gauss-seidel"),
    "jacobi": swing(coupling="jacobi"),
    "FMI 3 on FMI 2": pendulums("Pendulum", "fmi3/Pendulum"),
    "Python on native": pendulums("python/Pendulum", "Pendulum"),
    "isolated pendulums": isolated(pendulums()),
    "isolated swing of adaptive steps": isolated(swing(**_ADAPTED)),
    "model exchange": pendulums("exchange/Pendulum", "Pendulum"),
    "model exchange of breaks": of(
        "motor.y -> swing.length", motor=("Sinusoid", {"offset": 1.0, "amplitude": 0.1}), swing="exchange/Pendulum"
    ),
    "foreign cart and buffer": of(
        _CART,
        cart=("little/cart", {"q_dot_0": 0.4}), buffer="little/buffer", settings={"coupling": "waveform"},
    ),
    "foreign cart and buffer, adaptive": of(
        _CART,
        cart=("little/cart", {"q_dot_0": 0.4}), buffer="little/buffer", settings=_ADAPTED,
    ),
    "foreign wave": of("wave.y -> mass.x_force", wave="little/wave", mass="Oscillator"),
    "a foreign jump": of("jump.y -> mass.x_force", jump="little/jump", mass="Oscillator"),
    "ends early": of("finite.x -> probe.u", finite="little/finite", probe="little/probe"),
    "ends early, alone": of(finite=("little/finite", {"last": 0.37})),
    "fails": of(faulty=("little/faulty", {"time_of_failure": 0.5})),
    "refuses a step": of("hasty.x -> probe.u", hasty=("little/hasty", {"longest": 0.01}), probe="little/probe"),
}  # fmt: skip
"""Name -> system and settings of its simulation."""


def of_system(name: str) -> Record:
    """Numbers of a simulation, and of steps with branches where the settings let a caller step and go back."""
    system, settings = SYSTEMS[name]()
    record = _of_result(name, lambda: system.simulate(**settings))
    chooses = settings["step_size"] is None and "times" not in settings
    if not chooses and all(part.fmu.can_get_and_set_state for part in system.parts.values()):
        with system.start(**settings) as run:
            record |= _of_result(f"{name}, in steps", lambda: _branch(run))
    return record


def _branch(run: Run) -> Result:
    """Step, go back twice, and go on to the end."""
    for _ in range(3):
        run.step()
    saved = run.save()
    for _ in range(3):
        run.step()
    later, seen = run.save(), run.result
    run.restore(saved)
    for _ in range(2):
        run.step()
    np.testing.assert_array_equal(run.result.values[:, -1], seen.values[:, 5])
    run.restore(later)
    np.testing.assert_array_equal(run.result.values, seen.values)
    run.finish()
    return run.result


def _of_result(name: str, make: Callable[[], Result]) -> Record:
    refusal = ""
    try:
        result = make()
    except IncompleteError as error:
        refusal, result = str(error), error.result
    texts = [*result.warnings, refusal]
    errors = np.zeros(0) if result.coupling_error is None else result.coupling_error
    return {
        f"{name}: time": result.time, f"{name}: values": result.values, f"{name}: coupling error": errors,
        f"{name}: texts": np.asarray([str(text).replace(str(FOLDER), "") for text in texts]),
    }  # fmt: skip
