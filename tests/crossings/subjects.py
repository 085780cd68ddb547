"""A subject of each kind, and how it moves: by a closed form, or by SciPy on equations written down by hand."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache, partial
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from equations import equations
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from liaisons import (
    ActiveCoordinate,
    Ball,
    Coordinate,
    Gravity,
    Mechanism,
    Parameter,
    Shapes,
    Size,
    System,
    constraint,
    hold,
    operator,
    point,
    unilateral,
)
from liaisons.language import Component
from liaisons.models import (
    BouncingBall,
    CartesianPendulum,
    DryOscillator,
    FurutaPendulum,
    IsokineticOscillator,
    NoseHooverOscillator,
    Oscillator,
    OscillatorChain,
    Pendulum,
    Pid,
    Regulator,
    Satellite,
    Sinusoid,
    SwingPump,
)

COSIM = Path(__file__).parents[1] / "kernel/cosim"

Signals = dict[str, NDArray]
Exact = Callable[..., Signals]

STEP, STOP, SAMPLE = 0.05, 2.0, 0.01
T = np.linspace(0.0, STOP, 41)


class Row(Mechanism):
    """Beads, each bound by a spring to its place."""

    n = Size(3, "number of beads")
    mass = Parameter((1.0, 2.0, 3.0), "kg", "masses", above=0, size="n")
    stiffness = Parameter(4.0, "N/m", "stiffness of the springs", above=0)
    x = Coordinate("m", "displacements", start=(0.3, 0.2, 0.1), size="n")

    def kinetic_energy(self) -> ca.SX:
        return ca.dot(self.mass, self.dot(self.x) ** 2) / 2

    def potential_energy(self) -> ca.SX:
        return self.stiffness / 2 * ca.sumsqr(self.x)

    def picture(self) -> Shapes:
        return [Ball({"x": x}) for x in ca.vertsplit(self.x)]


class Hoist(Mechanism):
    """Load on an arm of variable reach; operators prescribe both, nothing is free."""

    mass = Parameter(2.0, "kg", "mass of the load", above=0)
    gravity = Gravity()
    angle = ActiveCoordinate("rad", "angle of the arm above the horizontal")
    reach = ActiveCoordinate("m", "length of the arm", start=1.0, above=0)

    @point("m", "the load")
    def load(self) -> dict[str, ca.SX]:
        return {"x": self.reach * ca.cos(self.angle), "z": self.reach * ca.sin(self.angle)}

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * self.speed_squared(self.load)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.load["z"]


class Buffered(OscillatorChain):
    """Three masses in a row, of which the last runs into a buffer."""

    n = Size(3, "number of masses")
    bounce = Parameter(0.5, "1", "coefficient of restitution", minimum=0, maximum=1)
    room = Parameter(0.4, "m", "way of the last mass to the buffer")
    u = Coordinate("m", "displacements from the places at rest", start_rate=0.5)

    @unilateral("m", "distance of the last mass from the buffer", restitution="bounce", last=True)
    def gap(self) -> ca.SX:
        return self.room - self.u


class Rods(Mechanism):
    """Two rods from a fixed pin to a knee, where a bell swings, and on to an end that an operator pulls along x.

    The bell hangs on a spring across the plane, so that something moves where nothing is pulled.
    """

    mass = Parameter(1.0, "kg", "mass of the knee", above=0)
    gravity = Gravity()
    rod = Parameter(1.0, "m", "length of each rod", above=0)
    x = Coordinate("m", "position of the knee", start=0.5)
    z = Coordinate("m", "height of the knee", start=-np.sqrt(0.75))
    u = Coordinate("m", "displacement of the bell", start=0.1)
    stiffness = Parameter(4.0, "N/m", "stiffness of the bell's spring")
    pull = ActiveCoordinate("m", "position of the end", start=1.0)

    @constraint("m2", "length of the first rod")
    def inner(self) -> ca.SX:
        return self.x**2 + self.z**2 - self.rod**2

    @constraint("m2", "length of the second rod")
    def outer(self) -> ca.SX:
        return (self.x - self.pull) ** 2 + self.z**2 - self.rod**2

    @point("m", "the knee")
    def knee(self) -> dict[str, ca.SX]:
        return {"x": self.x, "z": self.z}

    def kinetic_energy(self) -> ca.SX:
        return self.mass / 2 * (self.speed_squared(self.knee) + self.dot(self.u) ** 2)

    def potential_energy(self) -> ca.SX:
        return self.mass * self.gravity * self.z + self.stiffness / 2 * self.u**2


class Ramp(NamedTuple):
    """Input that moves at a constant rate from an instant on."""

    offset: float = 0.0
    rate: float = 0.0
    begin: float = 0.0

    def __call__(self, t: float) -> tuple[float, float, float]:
        return self.offset + self.rate * max(t - self.begin, 0.0), self.rate * (t >= self.begin), 0.0


@dataclass(frozen=True)
class Subject:
    """What is simulated.

    :param component: its class; None: :attr:`put_together` makes a system, or the file of an FMU.
    :param exact: signals at times, as a function of start values.
    :param by: start value of which the signals are a function that can be differentiated, and its value.
    :param ramps: operators of its active coordinates.
    :param starts: further start values.
    :param bound: of errors, relative to the size of a signal or to 1.
    :param dead_point: instant from which on a ramp cannot be followed.
    """

    component: type[Component] | None
    exact: Exact
    by: tuple[str, float]
    ramps: Mapping[str, Ramp] = field(default_factory=dict)
    starts: Mapping[str, Any] = field(default_factory=dict)
    put_together: Callable[[Path], System | Path] | None = None
    bound: float = 1e-8  # a hundred tolerances
    dead_point: float = np.inf

    @property
    def start_values(self) -> dict[str, Any]:
        return {**self.starts, self.by[0]: self.by[1]}

    @property
    def operators(self) -> dict[str, Any]:
        return {
            name: operator("Ramp", offset=ramp.offset, rate=ramp.rate, start_time=ramp.begin)
            for name, ramp in self.ramps.items()
        }

    def signals(self, t: NDArray = T, **values: float) -> Signals:
        return self.exact(t, **(self.start_values | values))


def integrated(rates: Callable[[float, NDArray], Any], start: Any, t: NDArray) -> NDArray:
    """SciPy's solution of equations written down by hand, shape (states, times)."""
    return solve_ivp(rates, (0.0, t[-1]), start, "DOP853", t, rtol=1e-13, atol=1e-14).y


def moved_oscillator(t: NDArray, *, x_0: float, ramp: Ramp) -> Signals:
    """On a support that starts at once with a constant rate; ω = 1."""
    since = np.maximum(t - ramp.begin, 0.0)
    x = x_0 * np.cos(t) + ramp.rate * (since - np.sin(since))
    return {"x": x, "x_dot": -x_0 * np.sin(t) + ramp.rate * (1 - np.cos(since))}


def lengthened(t: NDArray, *, x_0: float, gravity: float, ramp: Ramp, **_: float) -> Signals:
    """Pendulum below (0, 0, 1) of length l(t): l θ'' + 2 l' θ' + g sin θ = 0, at first along the rod."""

    def rates(t: float, y: NDArray) -> list[float]:
        length, rate, _ = ramp(t)
        return [y[1], -(2 * rate * y[1] + gravity * np.sin(y[0])) / length]

    theta, length = integrated(rates, [np.arcsin(x_0), 0.0], t)[0], np.array([ramp(s)[0] for s in t])
    return {"x": length * np.sin(theta), "z": 1 - length * np.cos(theta)}


def stretched(t: NDArray, *, mass: float, pull: Ramp, **_: float) -> Signals:
    """The knee of two rods of 1 m halves the way to their end, which is out of reach beyond 2 m."""
    x = np.minimum(pull.offset + pull.rate * t, 2.0) / 2
    return {"x": x, "z": -np.sqrt(1 - x**2), "u": 0.1 * np.cos(np.sqrt(4 / mass) * t)}


def thermostat(t: NDArray, *, q_0: float) -> Signals:
    def rates(_: float, y: NDArray) -> list[float]:
        return [y[1], -y[0] - y[2] * y[1], y[1] ** 2 - 1]

    q, q_dot, xi = integrated(rates, [q_0, 0.0, 0.0], t)
    return {"q": q, "q_dot": q_dot, "xi": xi}


def hoisted(t: NDArray, *, mass: float, angle: Ramp, reach: Ramp) -> Signals:
    """Newton's law along the arm and across it, without accelerations of angle and reach."""
    phi, r = angle.offset + angle.rate * t, reach.offset + reach.rate * t
    along = mass * (9.81 * np.sin(phi) - r * angle.rate**2)
    moment = mass * r * (2 * reach.rate * angle.rate + 9.81 * np.cos(phi))
    return {"reach_force": along, "angle_force": moment, "angle_power": moment * angle.rate}


def filtered(t: NDArray, *, low: float) -> Signals:
    """Three filters of rate 30 1/s in a row, from 1 to 0."""
    u = 30.0 * t
    decay = (1.05 - low) * np.exp(-u)
    y_ddot = 30.0**2 * decay * (u**2 / 2 - u)
    return {"y": low + decay * (1 + u + u**2 / 2), "y_dot": -30.0 * decay * u**2 / 2, "y_ddot": y_ddot}


def regulated(t: NDArray, *, period: float, **_: Any) -> Signals:
    """No gains: x''' = (w - x'')/period with w = 1 from rest."""
    decay = np.exp(-t / period)
    return {"y": t**2 / 2 - period * (t - period * (1 - decay)), "y_ddot": 1 - decay}


def late(t: NDArray, *, gain: float, setpoint: float, reading: float, delay: float, **_: float) -> Signals:
    """One sample, at 0, of a proportional controller."""
    return {"output": gain * (setpoint - reading) * (t >= delay)}


def thrown(t: NDArray, *, q_dot_0: float, **_: float) -> Signals:
    return {"q": q_dot_0 * t + t**2 / 2, "q_dot": q_dot_0 + t}


def pushed(t: NDArray, *, u: float) -> Signals:
    """x'' = u - x from x = 1 at rest."""
    return {"x0": u + (1 - u) * np.cos(t), "y": (u - 1) * np.sin(t)}


def foreign_co_simulation(folder: Path) -> Path:
    """A mass under constant force, from another maker: it can go back, and gives no derivatives."""
    spec = spec_from_file_location("little_fmus", COSIM / "conftest.py")
    assert spec is not None
    assert spec.loader is not None
    little = module_from_spec(spec)
    sys.modules[spec.name] = little  # its dataclasses ask for it
    spec.loader.exec_module(little)
    return little._build(folder, "Cart", little.CART)


def foreign_model_exchange(folder: Path) -> Path:
    """An oscillator from another maker, equations only."""
    rates = "f[0] = x[1]; f[1] = u - x[0];"
    return equations(folder, 2, start="x[0] = 1;", rates=rates, output="y = x[1];")


def shaken_mass(_: Path) -> System:
    """An oscillator on a support that moves as a sine."""
    system = System("shaken mass")
    shaker = system.add("shaker", Sinusoid, amplitude=0.2, angular_frequency=1.7)
    mass = system.add("mass", Oscillator)
    system.connect(shaker["y"], mass["support"])
    return system


def pulled_masses(_: Path) -> System:
    """An oscillator that is the support of another one, and feels its force."""
    system = System("pulled masses")
    first, second = system.add("first", Oscillator), system.add("second", Oscillator)
    system.connect(first["x"], second["support"])
    return system


def struck_table(_: Path) -> System:
    """A ball that falls on a table on a spring: two FMUs that share an impulse."""
    system = System("struck table")
    ball, table = system.add("ball", BouncingBall, mass=0.1), system.add("table", Oscillator)
    system.connect(table["x"], ball["table"])
    return system


@cache
def held_pendulum(_: Path) -> System:
    """A pendulum held upright by its pivot, sampled five times a communication step."""
    return hold(Pendulum, {"theta": np.pi, "pivot_x": 0.0}, "pivot_x", step_size=SAMPLE).system()


def held(t: NDArray, **starts: float) -> Signals:
    """From sample to sample H x_dddot = w - x_ddot, w the offset less the gains of θ, p_θ, x, x_dot, x_ddot there."""
    values = held_pendulum(Path()).parts["Pendulum_pivot_x"].starts
    names = ("offset", *(f"gain_{i}" for i in range(1, 6)))
    offset, *gains = (float(np.ravel(values.get(name, 0.0))[0]) for name in names)
    y, rows = np.array([starts["Pendulum.theta_0"], 0.0, 0.0, 0.0, 0.0]), []
    for _ in range(round(t[-1] / SAMPLE) + 1):
        rows.append(y[[0, 2]])
        momentum = y[1] + np.cos(y[0]) * y[3]
        wanted = offset - np.dot(gains, [y[0], momentum, *y[2:]])

        def rates(_: float, y: NDArray, wanted: float = wanted) -> list[float]:
            return [y[1], -9.81 * np.sin(y[0]) - np.cos(y[0]) * y[4], y[3], y[4], (wanted - y[4]) / SAMPLE]

        y = integrated(rates, y, np.array([0.0, SAMPLE]))[:, -1]
    chosen = np.transpose(rows)[:, np.round(t / SAMPLE).astype(int)]
    return dict(zip(("Pendulum.theta", "Pendulum.pivot_x"), chosen, strict=True))


def shaken(t: NDArray, **starts: float) -> Signals:
    exact = Oscillator.exact(t, x_0=starts["mass.x_0"], amplitude=0.2, angular_frequency=1.7)
    return {"mass.x": exact["x"]}


def pulled(t: NDArray, **starts: float) -> Signals:
    """x'' = -K x from rest, by the eigenvectors of K."""
    squares, modes = np.linalg.eigh([[2.0, -1.0], [-1.0, 1.0]])
    x = (modes * (modes.T @ [starts["first.x_0"], 0.0])) @ np.cos(np.outer(np.sqrt(squares), t))
    return {"second.x": x[1], "first.x": x[0]}


def struck(t: NDArray, **starts: float) -> Signals:
    """Parabolas and cosines between impacts, whose instants are roots; momentum is kept, by Newton's rule."""
    e, masses, g = starts["ball.bounce"], np.array([starts.get("ball.mass", 0.1), 1.0]), 9.81
    begin, y = 0.0, np.array([starts["ball.height_0"], 0.0, 0.0, 0.0])
    rows = np.empty((2, t.size))

    def at(s: NDArray | float) -> NDArray:
        ball = [y[0] + y[1] * s - g * s**2 / 2, y[1] - g * s]
        return np.array([*ball, y[2] * np.cos(s) + y[3] * np.sin(s), y[3] * np.cos(s) - y[2] * np.sin(s)])

    while True:
        s = np.linspace(1e-6, t[-1] - begin + 1e-6, 20001)
        below = np.flatnonzero(at(s)[0] < at(s)[2])
        hit = np.inf
        if below.size:
            low, high = s[below[0] - 1], s[below[0]]
            hit = float(brentq(lambda s: at(s)[0] - at(s)[2], low, high, xtol=1e-15))  # pyright: ignore[reportArgumentType]
        inside = (t >= begin) & (t <= begin + hit)
        rows[:, inside] = at(t[inside] - begin)[[0, 2]]
        if begin + hit >= t[-1]:
            return {"ball.height": rows[0], "table.x": rows[1]}
        y = at(hit)
        impulse = (1 + e) * (y[1] - y[3]) / np.sum(1 / masses)
        y[[1, 3]] += np.array([-1.0, 1.0]) * impulse / masses
        begin += hit


def chained(t: NDArray, **starts: Any) -> Signals:
    exact = OscillatorChain.exact(t, n=10, u_0=np.r_[starts["u_0[1]"], np.zeros(9)])
    return {"u[1]": exact["u"][:, 0], "u[5]": exact["u"][:, 4]}


def buffered(t: NDArray, *, bounce: float, rate: float = 0.5, room: float = 0.4) -> Signals:
    """All at one rate up to the impact, which sends the last mass back."""
    hits = room / rate
    before = np.outer(np.minimum(t, hits), np.full(3, rate))
    rates = np.array([rate, rate, -bounce * rate])
    after = OscillatorChain.exact(np.maximum(t - hits, 0.0), n=3, u_0=np.full(3, room), u_dot_0=rates)["u"]
    u = np.where(t[:, None] < hits, before, after)
    return {"u[3]": u[:, 2], "u[1]": u[:, 0], "gap": room - u[:, 2]}


RAMP, PULL = Ramp(0.0, 0.3, 0.5), Ramp(1.0, 0.1)
BEYOND = Ramp(1.0, 0.9)  # out of reach at t = 10/9
ANGLE, REACH = Ramp(0.2, 0.4), Ramp(1.0, 0.3)
TOP = {"omega_y_0": 0.3, "omega_z_0": 1.0}
HELD = 2e-4  # a correction that decays by e in a sample, interpolated by polynomials of degree five
LEAN = 0.3  # x of a bob at the distance 1 from its pivot

SUBJECTS: dict[str, Subject] = {
    "plain": Subject(Pendulum, Pendulum.exact, ("theta_0", 1.0)),
    "jumps": Subject(Oscillator, partial(moved_oscillator, ramp=RAMP), ("x_0", 0.4), {"support": RAMP}),
    "constraints": Subject(
        CartesianPendulum, partial(lengthened, ramp=PULL), ("gravity", 9.0), {"rod": PULL},
        {"x_0": LEAN, "z_0": 1 - np.sqrt(1 - LEAN**2), "x_dot_0": 0.1 * LEAN, "z_dot_0": -0.1 * np.sqrt(1 - LEAN**2)},
    ),
    "dead_point": Subject(
        Rods, partial(stretched, pull=BEYOND), ("mass", 3.0), {"pull": BEYOND},
        {"x_dot_0": 0.45, "z_dot_0": 0.45 / np.sqrt(3)}, dead_point=10 / 9,
    ),
    "non_holonomic": Subject(IsokineticOscillator, IsokineticOscillator.exact, ("x_0", 1.1)),
    "orientation": Subject(Satellite, Satellite.exact, ("omega_x_0", 0.2), starts=TOP),
    "linkage": Subject(FurutaPendulum, FurutaPendulum.exact, ("swing_0", 1.1)),
    "arrays": Subject(
        Row, lambda t, **k: {"x[1]": k["x_0[1]"] * np.cos(2 * t), "x[3]": 0.1 * np.cos(2 * t / np.sqrt(3))},
        ("x_0[1]", 0.4),
    ),
    "chain": Subject(OscillatorChain, chained, ("u_0[1]", 0.8)),
    "chain_contacts": Subject(Buffered, buffered, ("bounce", 0.6)),
    "friction": Subject(Oscillator, Oscillator.exact, ("x_0", 0.7), starts={"damping": 0.4}),
    "unilateral": Subject(BouncingBall, BouncingBall.exact, ("height_0", 1.0)),
    "dry_friction": Subject(DryOscillator, DryOscillator.exact, ("x_0", 0.9)),
    "internal_states": Subject(NoseHooverOscillator, thermostat, ("q_0", 1.2)),
    "prescribed_only": Subject(
        Hoist, partial(hoisted, angle=ANGLE, reach=REACH), ("mass", 3.0), {"angle": ANGLE, "reach": REACH}
    ),
    "operator": Subject(SwingPump, filtered, ("low", 0.9)),
    "regulator": Subject(Regulator, regulated, ("period", 4.0), starts={"offset": np.ones(50)}),
    "sampled": Subject(
        Pid, late, ("gain", 2.0),
        starts={"period": 10.0, "delay": 0.725, "setpoint": 1.0, "reading": 0.3, "derivative_time": 0.0},
    ),
    "foreign_co_simulation": Subject(
        None, thrown, ("q_dot_0", 0.7), starts={"q_force": 1.0}, put_together=foreign_co_simulation
    ),
    "foreign_model_exchange": Subject(None, pushed, ("u", 0.3), put_together=foreign_model_exchange),
    "system": Subject(None, shaken, ("mass.x_0", 0.1), put_together=shaken_mass),
    "two_way": Subject(  # its port is interpolated at steps of 50 ms, without being solved between them
        None, pulled, ("first.x_0", 0.4), starts={"second.x_0": 0.0}, put_together=pulled_masses, bound=2e-8
    ),
    "collision": Subject(
        None, struck, ("ball.bounce", 0.9), starts={"ball.height_0": 1.0, "table.x_0": 0.0}, put_together=struck_table
    ),
    "held": Subject(None, held, ("Pendulum.theta_0", np.pi + 0.1), put_together=held_pendulum, bound=HELD),
    "flattened": Subject(
        None, shaken, ("mass.x_0", 0.1), put_together=lambda folder: shaken_mass(folder).flatten(folder)
    ),
}  # fmt: skip
