"""A planned motion: σ(t) in polynomials, its cost, the system of FMUs that performs it, and its verdicts."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NoReturn, final

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike
from scipy.interpolate import PPoly

from liaisons import Result, System, Verdict, simulate, tabulated
from liaisons.base.arguments import as_path, check_finite, check_integer, float_array, name_dictionary, name_list, shown
from liaisons.base.array_names import by_name
from liaisons.base.arrays import Floats
from liaisons.base.files import replacement_path
from liaisons.base.port_names import port_names
from liaisons.base.published import publishers
from liaisons.cosim import DefaultExperiment
from liaisons.errors import LiaisonsError, PlanError
from liaisons.library import Target
from liaisons_motion.goals import Goal
from liaisons_motion.planning.phases import optimal_control_problem
from liaisons_motion.planning.problems import Problem
from liaisons_motion.planning.transcription import (
    DEGREE,
    POWERS,
    TO_POWERS,
    Arc,
    Clock,
    CollocatedTrajectory,
    Solution,
    in_relative_units,
    interval_count,
)
from liaisons_motion.planning.verifying import MODE_DISTANCES, verdicts

_INTERPOLATION_ERROR = 1e-12
"""Error of the operators' quintics between knots, relative to the range of σ."""
_FORCE_ERROR = 1e-10
"""The same of forces, relative to their range, between which importers interpolate by cubics."""
_JUMP_LEAD = 1e-9
"""Distance of the last communication point before a jump from the jump, relative to the duration."""
_DURATION_ERROR = 1e-7
"""Relative violation of the bounds of a duration that IPOPT leaves."""
_FEWEST_STEPS = 4000
"""Fewest steps for masters that step all FMUs at once: the error, of third order, is then some 1e-10."""
_TOLERANCE = 1e-12
"""Tolerance of solvers in a replay: near rounding, so that the plan's own error remains."""


@final
@dataclass(frozen=True, eq=False)
class Plan:
    """A motion of active coordinates, planned by :func:`liaisons.plan`."""

    goal: Goal
    problem: Problem
    solution: Solution

    def __reduce__(self) -> NoReturn:
        """Refuse copies, which functions of a goal do not allow."""
        raise PlanError(f"{self!r} is neither copied nor pickled; save(path) writes a file that Plan.load reads")

    @property
    def cost(self) -> float:
        """The minimised cost."""
        return self.solution.cost

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        low, high = self.problem.duration
        return low if low == high else float(self.solution.trajectory.durations.sum())

    @property
    def jump_lead(self) -> float:
        """Distance of the communication point before a jump from the jump [s]."""
        return _JUMP_LEAD * self.duration

    @property
    def finished(self) -> bool:
        """Whether the search ended by itself; False after a time limit or Ctrl-C."""
        return self.solution.finished

    @cached_property
    def proved(self) -> bool:
        """Whether all verdicts of :meth:`verify` pass; evaluated at the first access."""
        return self.finished and all(verdict.passed for verdict in self.verify())

    @property
    def multipliers(self) -> dict[str, float]:
        """Derivatives of the cost by each value at the end, by name, and by the duration if it is given.

        Durations of phases have none.
        """
        multipliers = by_name(self.problem.end.labels, map(float, self.solution.end_multipliers))
        low, high = self.problem.duration
        if not all(phase.duration[0] < phase.duration[1] for phase in self.problem.phases):
            return multipliers
        return multipliers | ({"duration": float(np.mean(self.solution.hamiltonian))} if low == high else {})

    @property
    def switches(self) -> Floats:
        """Instants [s] at which controls may jump: ends of the arcs but the last."""
        return np.cumsum(self.solution.trajectory.durations)[:-1]

    def sigma(self, t: ArrayLike) -> dict[str, Floats]:
        """Values of σ, σ̇, σ̈ and of forces by the names of the FMU's variables; at a jump those after it.

        :param t: times [s], of any shape; beyond both ends the polynomials are extrapolated.
        :raises PlanError: if the times are no numbers.
        """
        t = float_array("t", t, PlanError)
        return {
            name: polynomial.derivative(n)(t)
            for move, polynomial in self._polynomials.items()
            for n, name in enumerate(port_names(move)[:3] if move in self.problem.moves else (move,))
        }

    def impulse(self, name: str, t: ArrayLike) -> Floats:
        """Integral of a force from the start to times [s], the part of the plan's end beyond it.

        :param name: of one of the controls.
        :raises PlanError: for another name.
        """
        if name not in self.problem.forces:
            raise PlanError(
                f"{self.problem.name}: impulse of {name!r}: the forces are {', '.join(self.problem.forces)}"
            )
        t = float_array("t", t, PlanError)
        return self._polynomials[name].antiderivative()(t)

    @cached_property
    def _polynomials(self) -> dict[str, PPoly]:
        """Polynomials of σ on the intervals of the mesh, by name: integrals of the controls; and those of forces."""
        trajectory, problem = self.solution.trajectory, self.problem
        h = np.diff(trajectory.breaks)
        first = by_name(problem.states, trajectory.knots[:, 0])
        polynomials = {}
        for i, name in enumerate((*problem.moves, *problem.forces)):
            nodes = trajectory.controls[i].reshape(-1, DEGREE)
            powers = (nodes @ TO_POWERS.T) / h[:, None] ** POWERS
            polynomial = PPoly(powers.T[::-1].copy(), trajectory.breaks)
            if name in problem.moves:
                begins = [first.get(name, problem.initial_sigma[i]), first.get(f"{name}_dot", 0.0)]
                for n in reversed(range(problem.control_order)):
                    polynomial = polynomial.antiderivative()
                    polynomial.c[-1] += begins[n]
            polynomials[name] = polynomial
        return polynomials

    # ---- FMUs -------------------------------------------------------------------------------------------------

    def system(self, *, interpolate: bool = True) -> System:
        """The mechanism connected with one operator FMU for each coordinate, with start values and step size.

        :param interpolate: for masters that step operators first: the mechanism interpolates their outputs, and follows
            their polynomials to the last digits.  False is for masters that step all FMUs at once, in at least 4000
            equal steps with a knot at the start of each: values and rates are those of the plan, accelerations those
            that lead to the next value, so that extrapolation has an error of third order.
        """
        if not isinstance(interpolate, bool):
            raise PlanError(f"{self.problem.name}: interpolate = {shown(interpolate)}: give True or False")
        system, end = System(f"planned_{self.problem.name}"), self.duration
        first = float(self._communication_points()[1])
        step = first if interpolate else _even_step(end, min(first / 10, end / _FEWEST_STEPS))
        knots = self._knots if interpolate else self._equidistant_knots(step)
        system.add(self.problem.name, self.goal.fmu, **self.fmu_starts, **_interpolants(knots))
        system.experiment = DefaultExperiment(0.0, end, step)
        return system

    def replay(self) -> Result:
        """Simulate the FMUs, with the knots as communication points."""
        values = {**self.fmu_starts, **_interpolants(self._knots)}
        return simulate(self.goal.fmu, times=self._communication_points(), tolerance=_TOLERANCE, **values)

    def verify(self, time_limit: float = 60.0) -> list[Verdict]:
        """Verdicts: replay by FMUs, bounds between nodes, extremality, second-order condition, finer mesh, multipliers.

        They prove a local minimum; a distant motion may cost less.

        :param time_limit: [s]; a claim for which no time is left fails.
        :returns: verdicts; ``liaisons.check.table`` prints them, and ``all(v.passed for v in ...)`` sums them up.
        """
        check_finite("time_limit", time_limit, PlanError)
        clock, solution = Clock(time_limit), in_relative_units(self.problem, self.solution)
        return verdicts(solution, self.replay(), clock)

    def plot(self, *names: str | Iterable[str], path: Path | str | None = None) -> Figure:
        """Draw signals of the replay: moved and free coordinates, unless names are given."""
        moves = self.problem.moves
        free = (name for name in self.problem.states if name not in moves and not name.endswith("_dot"))
        return self.replay().plot(*(names or [*moves, *free]), path=path)

    @property
    def fmu_starts(self) -> dict[str, Any]:
        """Start values of the mechanism's FMU at the beginning of the plan, by its parameters."""
        first = self.sigma(0.0)
        controls = np.array([first[name] for name in self.problem.controls])
        values = self.problem.start_values(self.solution.trajectory.knots[:, 0], controls)
        return self.goal.parameters | by_name(self.problem.start_names, np.array(values).ravel().tolist())

    @cached_property
    def _knots(self) -> dict[str, Floats]:
        """Times, σ, σ̇ and σ̈ at the knots of each operator, (4, knots), by moved coordinate.

        The times are the same for all, as many as the interpolation error needs.
        The quintic through both ends of an interval differs from a polynomial of degree six by at most c₆ (h/2)⁶.
        """
        breaks, polynomials = self.solution.trajectory.breaks, self._polynomials
        h = np.diff(breaks)
        parts, kinks = np.ones(h.size), np.zeros(h.size, dtype=bool)
        for name, polynomial in polynomials.items():
            lost = _INTERPOLATION_ERROR * max(np.ptp(polynomial(breaks)), np.finfo(float).tiny)
            if name in self.problem.forces:  # which importers interpolate by cubics
                lost *= _FORCE_ERROR / _INTERPOLATION_ERROR
                parts = np.maximum(parts, np.ceil((np.abs(polynomial.c[0]) * (h / 2) ** 4 / lost) ** (1 / 4)))
            elif len(polynomial.c) > 6:
                parts = np.maximum(parts, np.ceil((np.abs(polynomial.c[0]) * (h / 2) ** 6 / lost) ** (1 / 6)))
            ends, begins = (_value_and_derivatives(polynomial, local) for local in (h, 0 * h))
            kinks[1:] |= (np.abs(ends[:, :-1] - begins[:, 1:]) * h[1:] ** [[0], [1], [2]] > lost).any(axis=0)
        kinks[0] = True  # the first knot of an interval is the last of the one before it, unless there is a kink

        def column(polynomial: PPoly, k: int) -> Floats:
            """Times, σ, σ̇ and σ̈ at the knots of the k-th interval, (4, knots)."""
            local = np.linspace(0, h[k], int(parts[k]) + 1)
            return np.vstack([breaks[k] + local, _value_and_derivatives(polynomial, local, k)])[:, int(not kinks[k]) :]

        return {name: np.hstack([column(p, k) for k in range(h.size)]) for name, p in polynomials.items()}

    def _equidistant_knots(self, step: float) -> dict[str, Floats]:
        """The same at equal steps, where each acceleration is the one that leads to the next value.

        Extrapolation from a knot meets the next value, even if σ̈ jumps between them.
        """
        times = step * np.arange(round(self.duration / step) + 1)
        knots = {}
        for move, polynomial in self._polynomials.items():
            value, rate, acceleration = (polynomial.derivative(n)(times) for n in range(3))
            acceleration[:-1] = 2 * (np.diff(value) / step - rate[:-1]) / step
            knots[move] = np.vstack([times, value, rate, acceleration])
        return knots

    def _communication_points(self) -> Floats:
        """Times of the knots, and instants just before jumps or beside the ends of phases [s]."""
        times = next(iter(self._knots.values()))[0]
        jumps = times[:-1][np.diff(times) == 0]
        beside = [jumps - self.jump_lead]
        if self.problem.phases:
            beside = [self.switches + sign * x * self.duration for x in MODE_DISTANCES for sign in (-1, 1)]
        return np.unique(np.concatenate([times, *beside]).clip(times[0], times[-1]))

    # ---- files ------------------------------------------------------------------------------------------------

    def save(self, path: Path | str) -> None:
        """Write goal and motion as JSON; :meth:`load` reads it.

        :raises PlanError: if the goal has functions, or a class that is not in the catalogue: give text and file names.
        """
        path = as_path("path", path, PlanError)
        goal = asdict(self.goal)
        if isinstance(goal["component"], type):
            goal["component"] = goal["component"].__name__
            if not publishers(goal["component"]):
                raise PlanError(f"{path}: {goal['component']} is not in the catalogue; plan it by the name of its file")
        goal["component"] = str(goal["component"])
        for name in ("start", "end", "minimize"):
            if callable(goal[name]):
                raise PlanError(
                    f"{path}: {name} is a function, which no file holds; write it as text, 'pivot_x_ddot**2'"
                )
        solution = {k: v for k, v in vars(self.solution).items() if k not in {"problem", "trajectory"}}
        document = {"goal": goal, "track": vars(self.solution.trajectory), "solution": solution}
        text = json.dumps(document, default=_json_value, indent=1)
        with replacement_path(path) as part:
            part.write_text(text, encoding="utf-8")

    @classmethod
    def load(cls, path: Path | str, component: Target | None = None, *, trust: bool = False) -> Plan:
        """Read a plan from a file that :meth:`save` has written.

        :param component: the mechanism, instead of that in the file; needed if the catalogue does not have that.
        :param trust: run the Python file that the plan names; by default opening a plan runs no code.
        :raises PlanError: if the file is no plan.
        """
        path = as_path("path", path, PlanError)
        try:
            document = json.loads(path.read_text(encoding="utf-8"))
            goal = _read_goal(document["goal"], component, trust=trust)
            problem = optimal_control_problem(goal)
            solution = _read_solution(problem, document["track"], document["solution"])
        except LiaisonsError as error:
            raise PlanError(f"{path} is no saved plan: {error}") from None
        except OSError as error:
            raise PlanError(f"{path}: {error.strerror or error}") from None
        except (ValueError, KeyError, TypeError, AttributeError, IndexError, OverflowError, RecursionError) as error:
            raise PlanError(f"{path} is no saved plan: {type(error).__name__}: {shown(str(error))}") from None
        return cls(goal, problem, solution)

    def __repr__(self) -> str:
        word = "" if self.finished else ", not proved: it was stopped on the way"
        moves = ", ".join(self.goal.driven)
        return f"<Plan of {self.problem.name}: {moves} in {self.duration:.6g} s, cost {self.cost:.8g}{word}>"


def _interpolants(knots: Mapping[str, Floats]) -> dict[str, Any]:
    """Moved coordinate -> operator that interpolates between its knots."""
    return {name: tabulated(*columns) for name, columns in knots.items()}


def _even_step(end: float, longest: float) -> float:
    """A step [s] that divides the duration and is no longer than the longest, in whole nanoseconds if possible.

    Some masters count nanoseconds.
    """
    least = math.ceil(end / longest - 1e-6)
    steps = (end / n for n in range(least, 2 * least))
    return next((round(step, 9) for step in steps if abs(step - round(step, 9)) < 1e-12), end / least)


def _value_and_derivatives(polynomial: PPoly, local: Floats, k: int | slice = slice(None)) -> Floats:
    """Value, first and second derivative, (3, n), at times ``local`` after the starts of the intervals k."""
    return np.array([np.polyval(polynomial.derivative(order).c[:, k], local) for order in range(3)])


def _json_value(value: Any) -> Any:
    """An object of a plan as a list, a dictionary or a number, for JSON."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, Mapping):
        return dict(value)
    return {"intervals": value.intervals, "held": value.active_bounds} if isinstance(value, Arc) else float(value)


def _tuples(value: Any) -> Any:
    """The value of JSON with tuples instead of lists."""
    if isinstance(value, list):
        return tuple(map(_tuples, value))
    return {name: _tuples(item) for name, item in value.items()} if isinstance(value, dict) else value


# ---- reading ------------------------------------------------------------------------------------------------------


def _read_goal(document: Any, component: Target | None, *, trust: bool) -> Goal:
    """The goal in a document of JSON, with its component or with another one."""
    if component is None:
        component = document["component"]
        if not (trust or publishers(component)):
            raise PlanError(
                f"goal.component = {shown(component)} is not in the catalogue, and opening a plan runs no code: "
                "pass component=..., or trust=True if you know the file"
            )
    for name in ("bounds", "values"):
        name_dictionary(f"goal.{name}", document[name], PlanError)
    for name in ("moves", "closed"):
        name_list(f"goal.{name}", document[name], PlanError)
    arguments: dict[str, Any] = {name: _tuples(value) for name, value in document.items()}
    arguments["controls"] = arguments.get("controls") or None
    return Goal.checked(**arguments | {"component": component, "phases": arguments.get("phases") or None})


def _read_solution(problem: Problem, trajectory: Any, document: Any) -> Solution:
    """The solution of a problem from its two parts in a file, which are checked.

    :raises PlanError: for other shapes or values.
    """
    arcs = tuple(Arc(arc["intervals"], _tuples(arc["held"])) for arc in trajectory["arcs"])
    for number in (*(arc.intervals for arc in arcs), document["starts"], document["optima"]):
        check_integer("a number", number, PlanError)
    m, n, c, path = interval_count(arcs), len(problem.states), len(problem.controls), problem.path
    points, rows = m * DEGREE, len(path.labels)
    of_trajectory = {"durations": (len(arcs),), "knots": (n, m + 1), "inner": (n, points), "controls": (c, points)}
    multipliers = (len(problem.end.labels),)
    shapes = {"cost": (), "hamiltonian": (points,), "adjoints": (n, points), "end_multipliers": multipliers}
    columns, values = (
        dict[str, Any]((name, _finite_array(name, part[name], shape)) for name, shape in shapes.items())
        for part, shapes in ((trajectory, of_trajectory), (document, shapes))
    )
    if not arcs or not (columns["durations"] > 0).all():
        raise PlanError("it has to have arcs with durations > 0")
    (low, high), T = problem.duration, columns["durations"].sum()
    if not low * (1 - _DURATION_ERROR) <= T <= high * (1 + _DURATION_ERROR):
        raise PlanError(f"its arcs last {T:g} s, where the goal's duration is {low:g} s to {high:g} s")
    for i, bound in (active for arc in arcs for active in arc.active_bounds):
        if not 0 <= i < rows or bound not in (path.low[i], path.high[i]):
            raise PlanError(f"an arc holds row {i} at {bound:g}, which is no bound of the goal")
    return Solution(
        problem=problem,
        trajectory=CollocatedTrajectory(arcs, **columns),
        cost=float(values.pop("cost")),
        status=str(document["status"]),
        finished=document["finished"] in (1, True),
        starts=document["starts"],
        optima=document["optima"],
        **values,
    )


def _finite_array(name: str, value: Any, shape: tuple[int, ...]) -> Floats:
    """The value as an array of finite numbers of a shape.

    :raises PlanError: if it is none.
    """
    numbers = np.array(value, dtype=float)
    if numbers.shape != shape or not np.isfinite(numbers).all():
        raise PlanError(f"{name} has the shape {numbers.shape}; finite numbers of the shape {shape} are wanted")
    return numbers
