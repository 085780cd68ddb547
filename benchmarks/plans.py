"""Plans against closed forms and shooting: error of the least cost on two meshes, time to solve, replay, verdicts.

    python benchmarks/plans.py [--quick]

No reference shares a line with what it is compared with: closed forms, and extremals shot by Hamilton's equations from
equations written by hand, most of which the scenarios have.  Each problem is planned on N intervals and on 2 N as they
are, arcs between switches having three at least, then as ``plan`` does it if nothing is said, refined until the
Hamiltonian is constant to 1e-8: that one is timed, replayed through the FMUs and judged by ``verify``.  Times are
processor times, equations and derivatives included.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from _measure import HERE, Row, command
from scipy.optimize import minimize_scalar, root

from liaisons import Plan, fmu_path, hamiltonian_flow, plan
from liaisons.base.project import load_module

COST = "Relative error of the least cost, on N intervals and on 2 N"
SOLVE = "Time of a plan"
REPLAY = "Replayed through the FMUs: error of the end"
VERDICTS = "Verdicts of the plan that fail"
ALL = "All of them"
MESHES = (4, 6, 8, 12, 16, 24)


def scenario(name: str) -> Any:
    """Its functions."""
    return load_module(HERE.parent / "scenarios" / f"{name}.py")


CAT, CRANE, GEODESIC, HOOP, SPATIAL, SPHERE, SWING, TOP, FASTEST_SWING = map(
    scenario,
    (
        "planned_cat",
        "planned_crane",
        "satellite_geodesic",
        "planned_hoop",
        "planned_spatial_cat",
        "fastest_sphere",
        "planned_swing",
        "satellite_as_top",
        "fastest_swing",
    ),
)


@dataclass(frozen=True, slots=True)
class Problem:
    """What is planned, and the least cost as somebody else has it."""

    name: str
    planned: Callable[..., Plan]  # with options of plan: intervals, accuracy
    reference: Callable[[Plan], float]
    source: str
    intervals: int = 20


def measure(quick: bool, plots: Path) -> list[Row]:
    rows: list[Row] = []
    begin = time.process_time()
    problems = PROBLEMS[:2] if quick else PROBLEMS
    for problem in problems:
        motion, seconds = _timed(problem)
        reference, fmu = problem.reference(motion), fmu_path(motion.goal.component)
        built = fmu.stat().st_mtime
        for intervals in (problem.intervals, 2 * problem.intervals):
            cost = problem.planned(intervals=intervals, accuracy=None).cost
            remark = f"{problem.source}; cost {cost:.12g}"
            case = f"{problem.name}, {intervals} intervals"
            rows.append(Row(COST, case, abs(cost / reference - 1), "", asked="<= 1e-9", remark=remark))
        rows.append(Row(SOLVE, problem.name, seconds, "s", asked="<= 10", remark=f"{_count(motion)} intervals"))
        verdicts = motion.verify()
        replay = next(verdict.error for verdict in verdicts if verdict.claim.startswith("replayed"))
        rows.append(Row(REPLAY, problem.name, replay, "", asked="<= 1e-8"))
        failed = [verdict.claim for verdict in verdicts if not verdict.passed]
        remark = "; ".join([f"of {len(verdicts)}", *failed])
        rows.append(Row(VERDICTS, problem.name, len(failed), "", asked="<= 0", remark=remark))
        assert fmu.stat().st_mtime == built, "a second plan builds no FMU"
    rows.append(Row(ALL, "with verdicts and references", time.process_time() - begin, "s", asked="<= 180"))
    _draw_orders(problems[:4], plots / "plans.png")
    return sorted(rows, key=lambda row: (COST, SOLVE, REPLAY, VERDICTS, ALL).index(row.topic))


def _timed(problem: Problem) -> tuple[Plan, float]:
    begin = time.process_time()
    return problem.planned(), time.process_time() - begin


def _count(motion: Plan) -> int:
    return sum(arc.intervals for arc in motion.solution.trajectory.arcs)


def _draw_orders(problems: Sequence[Problem], path: Path) -> None:
    figure, ax = plt.subplots(figsize=(7, 4.5), layout="constrained")
    for problem in problems:
        motions = [problem.planned(intervals=n, accuracy=None) for n in MESHES]
        reference = problem.reference(motions[-1])
        ax.loglog(MESHES, [abs(motion.cost / reference - 1) + 1e-16 for motion in motions], ".-", label=problem.name)
    ax.loglog(MESHES, 1e-4 * (np.array(MESHES) / MESHES[0]) ** -10.0, "k:", label="order 10")
    ax.set(xlabel="intervals", ylabel="relative error of the least cost", ylim=(1e-15, None))
    ax.set_xticks(MESHES, [f"{n}" for n in MESHES])
    ax.minorticks_off()
    ax.legend(fontsize="small")
    figure.savefig(path, dpi=70)
    plt.close(figure)


# ---- references ----------------------------------------------------------------------------------------------------


def _least_of_top(motion: Plan) -> float:
    goal = np.append(np.cos(TOP.ANGLE / 2), np.sin(TOP.ANGLE / 2) * TOP.AXIS)
    guess = TOP.TOP * TOP.ANGLE * TOP.AXIS / TOP.DURATION
    shot: Any = root(lambda L: TOP.top(L, motion.duration)[1:4] - goal[1:], guess, tol=1e-14)
    return motion.duration * float(np.sum(shot.x**2 / TOP.TOP)) / 2


def _least_of_hoop(motion: Plan) -> float:
    prices = np.array([motion.multipliers[name] for name in HOOP.END])
    shot: Any = root(lambda p: HOOP.back(p, motion.duration)[:3] - [0, 0, HOOP.OMEGA], prices, tol=1e-14)
    return -float(HOOP.back(shot.x, motion.duration)[3])


def _crane(*z: Any) -> Any:
    """H of the crane (x, x', θ, θ', cost): the best acceleration is by/2 at a price of 1 for ∫ a² dt."""
    (_, v, theta, w, _), (p, p_v, p_theta, p_w, p_cost) = z[:5], z[5:]
    by = p_v - p_w * np.cos(theta) / CRANE.LENGTH
    return p * v + p_theta * w - p_w * CRANE.GRAVITY / CRANE.LENGTH * np.sin(theta) - by**2 / (4 * p_cost)


def _least_of_crane(motion: Plan) -> float:
    names = ("pivot_x", "pivot_x_dot", "theta", "theta_dot")
    end = [0.8, 0.0, 0.0, 0.0]

    def back(p: Any) -> Any:
        return hamiltonian_flow(lambda *z: -_crane(*z), [*end, 0, *p, -1], motion.duration)

    shot: Any = root(lambda p: back(p)[:4], [motion.multipliers[name] for name in names], tol=1e-14)
    return -float(back(shot.x)[4])


def _fastest_crane(motion: Plan) -> float:
    """Four arcs of ± A that end at rest; what they take is what is left to find."""
    edges = np.array([0.0, *motion.switches, motion.duration])
    signs = np.sign(motion.sigma((edges[1:] + edges[:-1]) / 2)["pivot_x_ddot"])

    def end(durations: Any) -> Any:
        z = np.zeros(8)
        for T, sign in zip(durations, signs, strict=True):
            z = hamiltonian_flow(lambda *z, a=sign * BOUND: _driven(a, *z), z, T)
        return z[:4] - [0.8, 0, 0, 0]

    shot: Any = root(end, np.diff(edges), tol=1e-14)
    return float(shot.x.sum())


def _driven(a: float, *z: Any) -> Any:
    """p · rates of (x, x', θ, θ')."""
    _, v, theta, w, p, p_v, p_theta, p_w = z
    swing = -(CRANE.GRAVITY * np.sin(theta) + a * np.cos(theta)) / CRANE.LENGTH
    return p * v + p_v * a + p_theta * w + p_w * swing


def _least_of_sphere(motion: Plan) -> float:
    edges = np.array([0.0, *motion.switches, motion.duration])
    arcs = motion.sigma((edges[1:] + edges[:-1]) / 2)
    torques = -np.sign([arcs[f"wheel_{k}_ddot"] for k in SPHERE.AXES]).T
    shot: Any = root(SPHERE.left, [*np.diff(edges), *np.zeros(6)], args=(torques,), tol=1e-13)
    return float(shot.x[: len(torques)].sum())


def _of_constant_bend(_: Plan) -> float:
    _, G, _ = SPATIAL.metric(SPATIAL.SpatialCat.bend_for(np.pi))
    return 4 * np.pi**2 * G / SPATIAL.FALL


def _fastest_half_swing(_: Plan) -> float:
    found: Any = minimize_scalar(
        FASTEST_SWING.duration, bounds=(0.1, 0.45), args=(0.55,), method="bounded", options={"xatol": 1e-11}
    )
    return float(found.fun)


# ---- problems ------------------------------------------------------------------------------------------------------

BOUND = 0.8  # of the crane's acceleration [m/s2]


def _geodesic(**mesh: Any) -> Plan:
    end: Any = {"attitude": (0, 0, 0, 1)}
    moments: Any = {"J_xx": GEODESIC.J, "J_yy": GEODESIC.J, "duration": GEODESIC.DURATION}
    return plan("Satellite", ["wheel_1", "wheel_2"], end=end, **moments, **mesh)


def _as_top(**mesh: Any) -> Plan:
    goal: Any = np.append(np.cos(TOP.ANGLE / 2), np.sin(TOP.ANGLE / 2) * TOP.AXIS)
    moments: Any = dict(zip(("J_xx", "J_yy", "J_zz"), TOP.J, strict=True), J_wheel=TOP.WHEEL)
    return plan("Satellite", end={"attitude": goal}, duration=TOP.DURATION, **moments, **mesh)


def _effort(**mesh: Any) -> Plan:
    sphere: Any = SPHERE.SPHERE
    return plan("Satellite", end=SPHERE.HALF_TURN, duration=2.0, minimize="effort", **mesh, **sphere)


def _hoop(**mesh: Any) -> Plan:
    start: Any = {"u": 0, "u_dot": 0, "beta_dot": HOOP.OMEGA}
    ellipse: Any = {"semi_axis_a": HOOP.LONG, "semi_axis_b": HOOP.SHORT}
    goal: Any = {"end": HOOP.END, "duration": HOOP.DURATION, "minimize": "beta_ddot**2"}
    return plan("EllipticHoop", start=start, **mesh, **goal, **ellipse)


def _cat(turn: float) -> Callable[..., Plan]:
    cat: Any = {"start": {"phi": 0}, "closed": True, "bounds": CAT.LIMBS, "arm_1": CAT.ARM, "arm_2": CAT.ARM}
    return lambda **mesh: plan("PlanarCat", end={"phi": turn}, duration=CAT.FALL, tries=3, **mesh, **cat)


def _spatial_cat(**mesh: Any) -> Plan:
    goal: Any = {"start": {"bend": None}, "end": {"q_w": 0, "azimuth": 2 * np.pi}, "closed": ["bend"]}
    return plan("SpatialCat", ["bend", "azimuth"], bounds={"bend": (0.1, 3)}, duration=SPATIAL.FALL, **goal, **mesh)


def _half_swing(**mesh: Any) -> Plan:
    goal: Any = {"start": {"theta": -0.5}, "end": {"p_theta": 0, "theta": 0.55}, "minimize": "time"}
    bounds = {"length": (FASTEST_SWING.SHORT, FASTEST_SWING.LONG)}
    return plan("Pendulum", ["length"], bounds=bounds, duration=(0.5, 3), **mesh, **goal)


def _fast_crane(**mesh: Any) -> Plan:
    bounds = {"pivot_x_ddot": (-BOUND, BOUND)}
    return CRANE.moved(0.8, duration=(0.5, 6), minimize="time", bounds=bounds, **mesh)


PROBLEMS = (
    Problem(
        "satellite, half a turn by two wheels",
        _geodesic,
        lambda _: 3 * np.pi**2 * (GEODESIC.J / GEODESIC.WHEEL) ** 2 * GEODESIC.THETA / (2 * GEODESIC.DURATION),
        "length √3 π",
    ),
    Problem("satellite, three wheels and moments of inertia", _as_top, _least_of_top, "a free top, shot"),
    Problem("sphere, least effort", _effort, lambda _: 12 * np.pi**2 / 2**3, "12 J'² θ²/T³"),
    Problem("hoop, over the top", _hoop, _least_of_hoop, "shot"),
    Problem("crane, least ∫ a²", lambda **mesh: CRANE.moved(0.8, duration=3.0, minimize="pivot_x_ddot**2", **mesh),
            _least_of_crane, "shot"),
    Problem("cat, one loop", _cat(CAT.TURN), CAT.shot, "Wong's equations, shot"),
    Problem("spatial cat, half a turn", _spatial_cat, _of_constant_bend, "4π² G/T of the constant bend"),
    Problem("swing, largest amplitude", lambda **mesh: SWING.swung("Pendulum", "length", **mesh),
            lambda _: (1 - SWING.RATIO) * (1 - np.cos(SWING.AMPLITUDE)), "(l_max/l_min)³"),
    Problem("swing, least time", _half_swing, _fastest_half_swing, "elliptic integrals"),
    Problem("crane, least time", _fast_crane, _fastest_crane, "four arcs, shot"),
    Problem("sphere, least time", SPHERE.fastest, _least_of_sphere, "Pontryagin's principle, shot", 12),
)  # fmt: skip


if __name__ == "__main__":
    command(measure)
