"""IFToMM multibody benchmarks A01 to A05: time for the error that is allowed, beside Exudyn and what was published.

    python benchmarks/iftomm.py [--quick]

A01 is a pendulum let go horizontally, 2000 s in 4000 output steps; A02 a row of N parallelograms (40 as specified) that
turns through its singular configurations, 20 s in 400 output steps; A03 Andrews' squeezer, 0.05 s in 100; A04 Bricard's
mechanism, with one condition too many, 10 s in 200; A05 a stiff flyball governor, 10 s in 100.  The specifications
(M. González, 2005, lim.ii.udc.es/mbsbenchmark) allow an error of 1e-3 at high precision.  The error here is the root
mean square over all output steps and coordinates (A01: place of the bob; A02: place and velocity of B_0; A03: place of
F; A04: place of P_3; A05: height s of the slider) of (value - exact) / max(|exact|, threshold), with a threshold of
1e-3 of the largest value.  Exact are Jacobi's elliptic functions for A01 and A02, else our joints at a tolerance of
1e-13; "Converged values" says how far those are from values of another origin.

"Joints" are bodies and joints as anyone declares them (iftomm_linkages.py); the other descriptions have coordinates
that suit the mechanism.  Our times are those of co-simulation FMUs called from C, one call an output step; of the
tolerances 1e-2, 3e-3, 1e-3 ... the first is taken that stays within the allowed error.  Exudyn (optional) gets the same
mechanisms as rigid bodies and joints in redundant coordinates with its implicit solvers and fixed steps, and those that
are trees also as such with its adaptive explicit ones, which take no constraints; its step or tolerance is refined
until the error is allowed or a run takes too long.  Of its solvers for such a mechanism, in the ways to solve linear
systems that it offers, the one is taken whose time and error in a trial promise most.  "Right-hand sides alone" is the
equations of motion, called as often as the solver calls them: below that no solver of this order comes.  Processor
times.
"""

from __future__ import annotations

import ctypes
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from _measure import Row, command, interleaved
from iftomm_exudyn import Attempt, peers
from iftomm_linkages import BricardMechanism, FlyballGovernor, JointedPendulum, Squeezer, jointed_four_bars
from native_code import component_library, doubles, open_component
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from liaisons.mechanics import assemble
from liaisons.mechanics.model import Model
from liaisons.models import CartesianPendulum, Pendulum
from liaisons_catalogue.parallelograms import four_bars

ALLOWED, THRESHOLD = 1e-3, 1e-3
TOLERANCES = [round(m * 10.0**-e, e + 1) for e in range(2, 9) for m in (1.0, 0.3)]
FINEST, FINER = 1e-13, 10  # tolerance and output steps of a reference without a closed form
WINDOWS, JOINTED = (2, 10, 40), 10  # most windows that are built by joints: their C has 0.25 MB each
ASKED = {("A01", "FMU, one angle"): "<= 6", ("A02, N = 40", "FMU, constraints"): "<= 20"}  # ms
# RehabEngGroup/MBSbenchmarksInOpenSim, 10 s of motion, of A03 0.05 s [ms].
PUBLISHED = {"A01": 637.0, "A02, N = 2": 455.0, "A03": 384.0, "A04": 258.0, "A05": 233.0}
# Angles of the squeezer at 0.05 s by extrapolation of the IVP Test Set's equations in extended precision.
SQUEEZER_CONVERGED = {
    "beta": 33.825867766954507,
    "theta": -33.583431517463855,
    "gamma": 0.1133950738126020,
    "phi": -0.4078528656018797,
    "delta": 0.5260604449169956,
    "epsilon": 1.0569024294349636,
    "omega": 0.4078528656018794,
}


@dataclass(frozen=True)
class Description:
    """How we describe the mechanism."""

    name: str
    model: Model
    start: dict[str, float]
    found: Callable[[NDArray, NDArray], NDArray]  # coordinates of the benchmark from states and their rates
    stiff: bool = False  # by the stiff solver


@dataclass(frozen=True)
class Case:
    """A benchmark: output times, and what is to be found there."""

    name: str
    duration: float
    steps: int
    ours: Sequence[Description]
    exact: Callable[[NDArray], NDArray] | None = None  # (coordinates, times); None: by ours[0]
    windows: int = 0
    size: float = 1.0  # of the coordinates

    def error(self, found: NDArray, times: NDArray | None = None) -> float:
        assert self.exact is not None
        expected = self.exact(np.linspace(0.0, self.duration, self.steps + 1) if times is None else times)
        relative = (found - expected) / np.maximum(np.abs(expected), THRESHOLD * self.size)
        return float(np.sqrt(np.mean(relative**2)))


def cases(windows: Sequence[int], *, quick: bool) -> list[Case]:
    """A01 to A05, A02 for each number of windows; quickly those that compile soon."""
    pendulum = Case(
        "A01",
        2000.0,
        4000,
        [
            Description("one angle", assemble(Pendulum), {"theta_0": np.pi / 2}, lambda y, _: _place(y[0])),
            Description(
                "constraints",
                assemble(CartesianPendulum),
                {"x_0": 1.0, "z_0": 1.0},
                lambda y, _: y[[0, 2]] - [[0.0], [1.0]],
            ),
            Description("joints", assemble(JointedPendulum), {}, lambda y, _: _place(y[0] + np.pi / 2)),
        ],
        lambda t: _place(Pendulum.exact(t, theta_0=np.pi / 2)["theta"]),
    )
    governor = assemble(FlyballGovernor)
    height = [
        Description(f"joints{text}", governor, {}, lambda y, _: y[[1]], stiff)
        for text, stiff in (("", False), (", stiff solver", True))
    ]
    squeezer = Description("joints", assemble(Squeezer), {"beta_force": 0.033}, lambda y, _: 0.007 * _turned(y[0]))
    bricard = Description("joints", assemble(BricardMechanism), {}, lambda y, _: _corner(y[0], y[1]))
    further = [] if quick else [Case("A03", 0.05, 100, [squeezer], size=0.007), Case("A04", 10.0, 200, [bricard])]
    return [pendulum, *map(_parallelograms, windows), *further, Case("A05", 10.0, 100, height)]


def _place(theta: NDArray) -> NDArray:
    return np.array([np.sin(theta), -np.cos(theta)])


def _turned(theta: NDArray) -> NDArray:
    return np.array([np.cos(theta), np.sin(theta)])


def _corner(first: NDArray, second: NDArray) -> NDArray:
    """Place of P_3 from two hinges."""
    reach = 1 + np.sin(second)
    return np.array([reach * np.cos(first), -np.cos(second), -reach * np.sin(first)])


def _parallelograms(windows: int) -> Case:
    component = four_bars(windows)

    def top(theta: NDArray, theta_dot: NDArray) -> NDArray:
        x, z = _turned(theta)
        return np.array([x, z, -z * theta_dot, x * theta_dot])

    ours = [
        Description(name, assemble(kind), {}, lambda y, y_dot: top(y[0], y_dot[0]))
        for name, kind in (
            ("constraints", component),
            *([("joints", jointed_four_bars(windows))] if windows <= JOINTED else []),
        )
    ]
    return Case(f"A02, N = {windows}", 20.0, 400, ours, lambda t: top(**component.exact(t)), windows)


def measure(quick: bool, plots: Path) -> list[Row]:  # noqa: ARG001 - no diagram
    rounds, windows, limit = (2, WINDOWS[:1], 0.5) if quick else (3, WINDOWS, 2.0)
    rows, converged = [], []
    for case in cases(windows, quick=quick):
        with tempfile.TemporaryDirectory() as name:
            components = [Compiled(kind, Path(name) / str(i)) for i, kind in enumerate(case.ours)]
            if case.exact is None:
                converged.append(_converged(case, components[0]))
                case = replace(case, exact=converged[-1].exact)  # noqa: PLW2901 - from here on it has one
            ours = [attempt for it in components for attempt in it.attempts(case)]
            others = list(peers(case, ALLOWED, limit))
            rows += _rows(case.name, ours, others, rounds)
    return rows + [row for case in converged for row in _agreement(case)]


def _rows(case: str, ours: Sequence[Attempt], others: Sequence[Attempt], rounds: int) -> list[Row]:
    attempts = [*ours, *others]
    times = interleaved({it.solver: lambda it=it: 1e3 * it.time() for it in attempts}, rounds)
    rows = []
    for it in attempts:
        yardstick = ours[0].solver if it in others else ""
        excess = "" if it.error <= ALLOWED else ", more than allowed"
        rows.append(
            Row.of(
                case,
                it.solver,
                times[it.solver],
                "ms",
                yardstick=yardstick,
                beside=times.get(yardstick),
                asked=ASKED.get((case, it.solver), ""),
                remark=f"{it.setting}, error {it.error:.1e}{excess}",
            )
        )
    if case in PUBLISHED:
        remark = f"published, {'0.05' if case == 'A03' else '10'} s of motion, Intel i5-4570 at 3.2 GHz"
        rows.append(Row(case, "OpenSim 3.2", PUBLISHED[case], "ms", remark=remark))
    if not others:
        rows.append(Row(case, "Exudyn", float("nan"), "", remark="not installed: pip install exudyn"))
    return rows


@dataclass(frozen=True)
class Converged:
    """A motion at the finest tolerance."""

    name: str
    exact: Callable[[NDArray], NDArray]
    end: dict[str, float]  # last values of coordinates by name


def _converged(case: Case, component: Compiled) -> Converged:
    steps = case.steps * FINER
    states, rates = component.states(FINEST, case.duration, steps)
    spline = CubicSpline(np.linspace(0.0, case.duration, steps + 1), component.kind.found(states, rates), axis=1)
    names = (state.name for state in component.model.states)
    return Converged(case.name, spline, dict(zip(names, states[:, -1].tolist(), strict=True)))


def _agreement(converged: Converged) -> list[Row]:
    """How far a converged motion is from values of another origin."""
    topic = "Converged values"
    if converged.name == "A03":
        error = max(abs(converged.end[name] - value) for name, value in SQUEEZER_CONVERGED.items())
        text = "the IVP Test Set's equations, extrapolated in extended precision"
        return [Row(topic, "A03, angles at 0.05 s", error, "rad", remark=text)]
    if converged.name == "A05":
        times = np.linspace(0.0, 10.0, 101)
        error = float(np.abs(converged.exact(times)[0] - _governor_by_hand(times)).max())
        return [Row(topic, "A05, height", error, "m", remark="two equations by hand, SciPy's Radau at 1e-9")]
    return []


def _governor_by_hand(times: NDArray) -> NDArray:
    """Height of the slider of A05 from the angle of both arms, its own equation, and the angular momentum."""
    rod, ball, slider, gravity, stiffness, damping = 0.3, 5.0, 3.0, 9.81, 8e5, 4e4
    arm, centre = rod + ball, (0.5 * rod + ball) / (rod + ball)
    along, across = rod * 0.0002 / 12, rod * 1.0001 / 12 + rod * ball / arm * 0.25
    fixed = rod * 0.0002 / 12 + slider * 0.02 / 12

    def inertia(angle: float) -> tuple[float, float]:
        """About the axis of the shaft, and its derivative by the angle."""
        c, s = np.cos(angle), np.sin(angle)
        reach = 0.05 + centre * c
        value = fixed + 2 * (arm * reach**2 + along * s**2 + across * c**2)
        return value, 4 * (-arm * reach * centre * s + (along - across) * s * c)

    momentum = inertia(np.pi / 6)[0] * 2 * np.pi

    def rates(_t: float, y: NDArray) -> list[float]:
        angle, height, angle_dot, height_dot = y
        c, s = np.cos(angle), np.sin(angle)
        drop = 1 - 0.5 * s - height
        length = np.hypot(0.5 * c, drop)
        by_angle, by_height = (-0.25 * s * c - 0.5 * c * drop) / length, -drop / length
        force = stiffness * (length - 0.5) + damping * (by_angle * angle_dot + by_height * height_dot)
        about, slope = inertia(angle)
        turning = slope * (momentum / about) ** 2 / 4 + arm * gravity * centre * c - force * by_angle
        return [
            angle_dot,
            height_dot,
            turning / (arm * centre**2 + across),
            -gravity - 2 * force * by_height / slider,
        ]

    start = [np.pi / 6, 0.5, 0, 0]
    return solve_ivp(rates, (0, times[-1]), start, method="Radau", t_eval=times, rtol=1e-9, atol=1e-10).y[1]


class Compiled:
    """A description as C."""

    def __init__(self, kind: Description, folder: Path) -> None:
        folder.mkdir()
        self.kind, self.model = kind, kind.model.flat()
        self._library = component_library(self.model, folder)
        variables = (*self.model.parameters, *self.model.inputs)
        self._values = doubles(kind.start.get(v.name, v.starts[0]) for v in variables)

    def states(self, tolerance: float, duration: float, steps: int, symplectic_steps: int = 0) -> tuple[NDArray, ...]:
        """States and their rates at the output steps, (count, steps + 1) each."""
        count = len(self.model.states)
        instance, step = self._opened(tolerance, symplectic_steps), ctypes.c_double(duration / steps)
        y, y_dot = doubles([0.0] * count), doubles([0.0] * count)
        found = []
        for i in range(steps + 1):
            if i:
                self._library.component_advance(instance, step, ctypes.c_long(1))
            self._library.component_states(instance, y)
            self._library.rates(None, ctypes.c_double(0.0), y, y_dot)
            found.append((list(y), list(y_dot)))
        self._library.component_close(instance)
        states, rates = np.array(found).transpose(1, 2, 0)
        return states, rates

    def attempts(self, case: Case) -> Iterator[Attempt]:
        """The solver that controls its error, and the symplectic one where there is nothing to project onto."""
        solver = f"FMU, {self.kind.name}"
        found = self._best(case, solver, ((tolerance, 0, f"tolerance {tolerance:g}") for tolerance in TOLERANCES))
        yield found
        if self.kind.stiff:
            return
        yield self._alone(case, solver, float(found.setting.removeprefix("tolerance ")), found.error)
        if self.model.project is None and case.name == "A01":
            settings = ((TOLERANCES[0], n, f"step {case.duration / case.steps / n:.3g} s") for n in range(1, 101))
            yield self._best(case, f"{solver}, symplectic", settings)

    def _best(self, case: Case, solver: str, settings: Iterable[tuple[float, int, str]]) -> Attempt:
        """The first setting that is good enough."""
        for tolerance, steps, text in settings:
            error = case.error(self.kind.found(*self.states(tolerance, case.duration, case.steps, steps)))
            if error <= ALLOWED:
                return Attempt(solver, text, error, partial(self._seconds, case, tolerance, steps))
        raise SystemExit(f"{case.name}, {solver}: no setting gives an error of {ALLOWED:g}")

    def _alone(self, case: Case, solver: str, tolerance: float, error: float) -> Attempt:
        self._seconds(case, tolerance, 0, counting=True)
        count = self._library.component_evaluations()
        return Attempt(f"{solver}, right-hand sides alone", f"{count} of them", error, partial(self._rates, count))

    def _opened(self, tolerance: float, symplectic_steps: int, *, counting: bool = False) -> ctypes.c_void_p:
        count = len(self.model.states)
        self._library.begin(self._values, *(doubles([0.0] * count) for _ in range(2)))
        return open_component(
            self._library, tolerance, symplectic_steps=symplectic_steps, stiff=self.kind.stiff, counting=counting
        )

    def _seconds(self, case: Case, tolerance: float, symplectic_steps: int, *, counting: bool = False) -> float:
        instance = self._opened(tolerance, symplectic_steps, counting=counting)
        step = ctypes.c_double(case.duration / case.steps)
        spent = self._library.component_advance(instance, step, ctypes.c_long(case.steps))
        self._library.component_close(instance)
        return spent

    def _rates(self, count: int) -> float:
        self._library.begin(self._values, *(y := [doubles([0.0] * len(self.model.states)) for _ in range(2)]))
        return self._library.component_rates(*y, ctypes.c_long(count))


if __name__ == "__main__":
    command(measure)
