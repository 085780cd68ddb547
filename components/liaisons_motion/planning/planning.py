"""``plan``: from a goal to the motion of active coordinates that reaches it at least cost."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from liaisons.base.arguments import (
    as_path,
    check_finite,
    check_integer,
    merged_start_values,
    name_dictionary,
    shown,
    start_value_hints,
)
from liaisons.base.files import file_beside, read_toml_arguments
from liaisons.base.logs import deferred_interrupts, progress_bar
from liaisons.errors import PlanError
from liaisons.library import Target, component
from liaisons_motion.goals import Cost, Goal, Place
from liaisons_motion.planning.guesses import far_guesses, guesses
from liaisons_motion.planning.invariants import refuse_invariants
from liaisons_motion.planning.phases import optimal_control_problem
from liaisons_motion.planning.plans import Plan
from liaisons_motion.planning.problems import Problem
from liaisons_motion.planning.searching import SEARCH, SearchSettings, refuse_singularity, search
from liaisons_motion.planning.transcription import Arc, Clock, CollocatedTrajectory, Solution, in_relative_units, in_si

_VANISHING = 1e-5
"""Part of the duration below which a phase vanishes."""
_EXAMPLES = {"mechanism": '"PlanarCat"', "duration": "0.9"}


def plan(
    mechanism: Target,
    /,
    moves: str | Sequence[str] | None = None,
    *,
    controls: str | Sequence[str] | None = None,
    start: Place | None = None,
    end: Place | None = None,
    closed: bool | str | Sequence[str] = False,
    loops: int = 1,
    duration: float | tuple[float, float],
    minimize: Cost | None = None,
    bounds: Mapping[str, tuple[float | None, float | None]] | None = None,
    phases: Sequence[Mapping[str, Any]] | None = None,
    intervals: int = 20,
    accuracy: float | None = 1e-8,
    tries: int | None = None,
    guess: Plan | None = None,
    time_limit: float = 60.0,
    progress: bool = False,
    start_values: Mapping[str, float] | None = None,
    **keywords: float,
) -> Plan:
    """Find the motion of active coordinates that takes a mechanism from start to end at least cost.

    ::

        motion = plan(
            "PlanarCat", ["psi_1", "psi_2"], start={"phi": 0}, end={"phi": -1.047}, closed=True, duration=0.9,
            bounds={"psi_1": (-3, 3), "psi_2": (-3, 3)}, arm_1=0.25, arm_2=0.25,
        )

    Names are those of the FMU.  Values that start does not give are as declared, at rest; an orientation has its own
    name, as a quaternion.  ``start`` and ``end`` may also be a function of the mechanism that has to vanish (``lambda
    m: m.bob_x - 1``), or the same as text; ``minimize`` may be such a function, too.

    :param mechanism: name, file or class of a mechanism or chain.
    :param moves: active coordinates that the plan moves; unless given all, or none beside controls.  The others stay.
    :param controls: forces that the plan sets, ``"theta_force"``; they may jump.
    :param start: values of states (q, q_dot, p_q, σ, σ̇); (low, high) a range, None: free.
    :param end: values of anything that can be read.
    :param closed: True, or names: the moved coordinates return to their first values.
    :param loops: number of equal loops of a closed motion; end and duration are those of all loops, and one loop is
        returned.
    :param duration: [s]; (low, high): free.
    :param minimize: ``"motion"``: ∫ ½ σ̇ᵀΘσ̇ dt; ``"effort"``: ∫ λ² dt, of controls, too; ``"time"``; or an integrand.
        Unless given motion, or effort where only forces act.
    :param bounds: (low, high) of anything that can be read: coordinates, rates, accelerations, forces, power.
    :param phases: of a mechanism with contacts, in their order; in each, modes by contact: ``"closed"`` or ``"open"``
        for a unilateral liaison, ``"sticks"``, ``"forward"`` or ``"backward"`` for dry friction.  What a phase does not
        name keeps its mode; ``"open"`` named twice in a row is a bounce.  ``"duration"`` is that of a phase, as above;
        free unless given.
    :param intervals: of the first mesh.
    :param accuracy: the mesh is refined until the Hamiltonian is constant to this accuracy; None: it is not refined.
    :param tries: number of initial guesses, if there are several extremals; the best motion is kept, so more guesses
        never give a worse one.  Unless given, the search ends after 4 that agree, or after 8.
    :param guess: a plan of the same kind to start from.
    :param time_limit: [s]; then, or at Ctrl-C, the best motion so far is returned, with ``motion.finished`` False.
    :param progress: show a progress bar on stderr.
    :param start_values: parameters, and inputs that stay constant, by name.
    :param keywords: further ones; a keyword that is also a setting is the setting.
    :returns: the motion.  Do not rely on IPOPT's report alone: ``motion.verify()`` replays it through the FMUs.
    :raises PlanError: for an unknown name, with the nearest one; for an end that cannot be reached, with the reason.
    """
    with start_value_hints({parameter.name for parameter in getattr(component(mechanism), "parameters", ())}):
        goal = Goal.checked(
            mechanism,
            moves=moves,
            start={} if start is None else start,
            end={} if end is None else end,
            closed=closed,
            duration=duration,
            minimize=minimize,
            controls=controls,
            bounds=bounds,
            values=merged_start_values("plan", start_values, keywords, PlanError),
            phases=phases,
        )
    for name, number in {"intervals": intervals, "loops": loops, "tries": 1 if tries is None else tries}.items():
        check_integer(name, number, PlanError)
    if accuracy is not None:
        check_finite("accuracy", accuracy, PlanError)
    check_finite("time_limit", time_limit, PlanError)
    title = f"plan {', '.join(goal.driven)}" if progress else ""
    with progress_bar(title, "{:.0f} of {:g} s", 0, time_limit) as show, deferred_interrupts() as interrupts:
        clock = Clock(time_limit, show, interrupts)
        problem = optimal_control_problem(goal)
        if loops > 1:
            goal = _goal_of_one_loop(goal, problem, loops)
            problem = optimal_control_problem(goal)
        coarse, further = intervals if phases else min(SEARCH.coarse_intervals, intervals), ()
        if not phases:
            refuse_invariants(problem.relative_problem)
            further = far_guesses(problem.relative_problem, coarse)
        starts = guesses(problem.relative_problem, coarse)
        if guess is not None:
            starts, tries = [_trajectory_of_guess(problem, guess, intervals)], 1
        settings = SearchSettings(intervals, accuracy, tries)
        solution = search(problem.relative_problem, starts, clock, settings, further)
    _refuse_vanishing_phases(solution)
    if goal.minimize == "motion":
        refuse_singularity(solution)
    return Plan(goal, problem, in_si(problem, solution))


def plan_from_file(path: Path | str, *, progress: bool = False) -> Plan:
    """Run :func:`plan` with the arguments of a TOML file.

    ::

        mechanism = "PlanarCat"
        moves = ["psi_1", "psi_2"]
        closed = true
        duration = 0.9
        start = { phi = 0 }
        end = { phi = -0.1 }
        bounds = { psi_1 = [-3, 3], psi_2 = [-3, 3] }
        values = { arm_1 = 0.25, arm_2 = 0.25 }

    :param path: the file; that of a mechanism of one's own is looked for beside it.
    :param progress: show a progress bar on stderr.
    :raises PlanError: if it is no TOML, or has another key, or what it asks for cannot be planned.
    """
    path = as_path("path", path, PlanError)
    keys = {*inspect.signature(plan).parameters} - {"guess", "progress", "keywords"} | {"values"}
    arguments = read_toml_arguments(path, keys, _EXAMPLES, PlanError)
    mechanism, values = str(arguments.pop("mechanism")), arguments.pop("values", {})
    for key in name_dictionary(f"{path}: values", values, PlanError):
        if key in keys:
            raise PlanError(f"{path}: values: {key} is a key of its own, and no parameter")
    return plan(file_beside(path, mechanism), **arguments, **values, progress=progress)


def _refuse_vanishing_phases(solution: Solution) -> None:
    """Raise an error if a phase of free duration lasts no time."""
    problem, durations = solution.problem, solution.trajectory.durations
    for k, (phase, T) in enumerate(zip(problem.phases, durations, strict=False)):
        if phase.duration[0] < T <= _VANISHING * durations.sum():
            raise PlanError(
                f"{problem.name}: phases[{k}] vanishes: the best motion has none; leave it out, or give its duration"
            )


def _goal_of_one_loop(goal: Goal, problem: Problem, loops: int) -> Goal:
    """The goal of one of several equal loops, with its part of the change and of the duration.

    :raises PlanError: if there are none, or if what one of them gains is not what the next one gains.
    """
    label = f"{problem.name}: loops = {loops}"
    if problem.phases:
        raise PlanError(f"{label}: a motion with phases is planned as one; leave loops out")
    if not problem.is_loop:
        raise PlanError(f"{label}: only what is closed goes round: closed=True")
    if not isinstance(goal.end, Mapping) or not set(goal.end) <= set(problem.states):
        raise PlanError(f"{label}: give the end by names and values of states")
    functions = (problem.rates, problem.cost, problem.path.function)
    acts = {int(i) for function in functions for i in function.jac_sparsity(0, 0).get_col()}
    parts: dict[str, Any] = {}
    for name, value in goal.end.items():
        i = problem.states.index(name)
        if i in acts:
            raise PlanError(f"{label}: the motion depends on {name}, so that no loop is like the one before it")
        first = float(problem.initial_state[i])
        several: Any = value if isinstance(value, (tuple, list)) else [value]
        ends = [None if x is None else first + (x - first) / loops for x in several]
        parts[name] = tuple(ends) if isinstance(value, (tuple, list)) else ends[0]
    low, high = goal.duration
    return replace(goal, end=parts, duration=(low / loops, high / loops))


def _trajectory_of_guess(problem: Problem, guess: Plan, intervals: int) -> CollocatedTrajectory:
    """The motion of another plan, on one arc of equal intervals."""
    if not isinstance(guess, Plan) or guess.problem.states != problem.states:
        raise PlanError(f"{problem.name}: guess = {shown(guess)}: give a plan of the same coordinates and costs")
    trajectory = in_relative_units(problem, guess.solution).trajectory
    if len(problem.phases) != len(guess.problem.phases):
        raise PlanError(f"{problem.name}: guess has {len(guess.problem.phases)} phases; give a plan of the same phases")
    if problem.phases:
        return trajectory
    return trajectory.interpolated((Arc(intervals),), trajectory.durations.sum(keepdims=True))
