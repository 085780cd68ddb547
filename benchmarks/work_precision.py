"""Work against precision of the solver in a native FMU, beside DOP853 written by hand in C and CVODE's two methods.

    python benchmarks/work_precision.py [--quick]

Every solver integrates the same right-hand side, which is the FMU's own, compiled once; all are called from C, rounds
are interleaved, times are processor times.  Errors are those of the states at the end in units of their nominal sizes,
against a solution in extended precision.  First the time that an error of 1e-8 costs, then the time of one right-hand
side within the solver: by hand is the solver, or the right-hand side (``by_hand/rates.c``), too, which counts in the
loads that are 0 here, while the generated one is the shortest that these inputs allow.  Whether that DOP853 is a fair
yardstick is checked last: right-hand sides and errors beside those of SciPy's, at the same tolerance.
"""

from __future__ import annotations

import ctypes
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import casadi as ca
import matplotlib.pyplot as plt
import numpy as np
from _measure import Row, command
from fmpy import sharedLibraryExtension
from fmpy.sundials import libraries as sundials
from native_code import BY_HAND, compile_library, component_library, doubles, open_component
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.integrate._ivp import dop853_coefficients as published

from liaisons import models
from liaisons.language import Variable
from liaisons.mechanics import assemble
from liaisons.mechanics.model import Model

TOLERANCES = 10.0 ** -np.arange(4.0, 12.5, 0.5)
ERROR = 1e-8  # at which times are compared
REFERENCE_TOLERANCE = 1e-17  # of extended precision, which has 1e-19
ADAMS, BDF = 1, 2
DOP853, ALL_BY_HAND = "DOP853 by hand", "DOP853 and right-hand side by hand"
PRECISION = f"Time for an error of {ERROR:g}, called from C"
COST = "One right-hand side, within the solver"
FAIRNESS = f"The yardstick: right-hand sides of DOP853 by hand at a tolerance of {ERROR:g}"
TOPICS = (PRECISION, COST, FAIRNESS)


@dataclass(frozen=True, slots=True)
class Case:
    """A motion of a component of the catalogue."""

    component: str
    title: str
    duration: float
    values: Mapping[str, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        return f"{self.component}, {self.title}"


CASES = (
    Case("Pendulum", "libration", 50.0, {"theta_0": 2.0}),
    Case("Pendulum", "rotation", 50.0, {"theta_0": 0.0, "theta_dot_0": 8.0}),
    Case("Swing", "large swing", 50.0, {"theta_0": 1.5}),
    Case("CircularHoop", "turning", 50.0, {"xi_0": 2.5, "beta_dot": 2.0}),
    Case("KeplerOrbit", "e = 0.6", 100.0, {"y_dot_0": 1.6**0.5}),
    Case("DoublePendulum", "regular", 20.0, {"theta_1_0": 0.5, "theta_2_0": 0.7}),
    Case("ChargedParticle", "helix", 100.0, {"x_dot_0": 1.0, "z_dot_0": 0.1}),
    Case("SpatialCat", "tumbling", 10.0, {"bend": 0.5, "H_x_0": 0.1, "H_y_0": 0.05, "H_z_0": 0.2}),
)
BY_HAND_TOO = ("Pendulum", "KeplerOrbit", "CircularHoop", "ChargedParticle")  # right-hand sides in by_hand/rates.c


@dataclass(frozen=True, slots=True)
class Run:
    """What a solver does at one tolerance."""

    seconds: float
    evaluations: int
    end: NDArray


Solver = Callable[[float], Run]


@dataclass(frozen=True, slots=True)
class Problem:
    """A case, compiled: solvers by name, the right-hand side, and the states at the end in extended precision."""

    solvers: dict[str, Solver]
    rates: Callable[[float, NDArray], NDArray]
    start: NDArray
    sizes: NDArray
    reference: NDArray

    def error(self, end: NDArray) -> float:
        """The last two states are integrals along the motion, which the energy balance is for."""
        return float(np.max(np.abs(end - self.reference)[:-2] / self.sizes[:-2]))


def measure(quick: bool, plots: Path) -> list[Row]:
    _load_globally()
    cases, tolerances, count = (CASES[:2], TOLERANCES[::2], 2) if quick else (CASES, TOLERANCES, 9)
    rows: list[Row] = []
    figure, axes = plt.subplots(2, 4, figsize=(13, 6.5), layout="constrained", sharey=True)
    for case, ax in zip(cases, axes.flat, strict=False):
        with tempfile.TemporaryDirectory() as name:
            problem = _prepare(case, Path(name))
            rounds = [{s: [*map(run, tolerances)] for s, run in problem.solvers.items()} for _ in range(count)]
            rows.append(_fairness_row(case, problem))
        errors = {s: [problem.error(r.end) for r in runs] for s, runs in rounds[0].items()}
        times = {s: np.array([[run.seconds for run in r[s]] for r in rounds]) for s in problem.solvers}
        for solver in problem.solvers:
            ax.loglog(errors[solver], 1e6 * np.median(times[solver], axis=0), ".-", label=solver)
        ax.set(title=case.name, xlabel="error at the end")
        rows += _precision_rows(case, errors, times) + _cost_rows(case, rounds)
    for ax in axes[:, 0]:
        ax.set(ylabel="time [µs]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    figure.savefig(plots / "work_precision.png", dpi=55)
    plt.close(figure)
    return sorted(rows, key=lambda row: TOPICS.index(row.topic))


def _precision_rows(case: Case, errors: Mapping[str, list[float]], times: Mapping[str, NDArray]) -> list[Row]:
    at = {s: [1e6 * _time_at(errors[s], row) for row in times[s]] for s in times}
    return [
        Row.of(PRECISION, case.name, at["FMU"], "µs", yardstick=solver, beside=at[solver], asked="<= 1")
        for solver in (DOP853, "CVODE Adams", "CVODE BDF")
    ]


def _time_at(errors: list[float], times: NDArray) -> float:
    """Time for ERROR, by a line through the points that lie within three decades of it; logarithms of both."""
    near = [i for i, error in enumerate(errors) if ERROR / 1e3 < error < ERROR * 1e3]
    _, at_error = np.polyfit(np.log(np.array(errors)[near] / ERROR), np.log(times[near]), 1)
    return float(np.exp(at_error))


def _cost_rows(case: Case, rounds: list[dict[str, list[Run]]]) -> list[Row]:
    """Nanoseconds a right-hand side, all tolerances together."""

    def cost(runs: list[Run]) -> float:
        return 1e9 * sum(run.seconds for run in runs) / sum(run.evaluations for run in runs)

    costs = {s: [cost(r[s]) for r in rounds] for s in rounds[0]}
    return [
        Row.of(COST, case.name, costs["FMU"], "ns", yardstick=solver, beside=costs[solver], asked="<= 1.1")
        for solver in (DOP853, ALL_BY_HAND)
        if solver in costs
    ]


def _fairness_row(case: Case, problem: Problem) -> Row:
    """Right-hand sides of DOP853 by hand over those of SciPy's, which is the same pair with the same control."""
    run = problem.solvers[DOP853](ERROR)
    start, sizes = problem.start, problem.sizes

    def rates(t: float, y: NDArray) -> NDArray:
        return problem.rates(t, y * sizes) / sizes

    scipys = solve_ivp(rates, (0, case.duration), start / sizes, method="DOP853", rtol=ERROR, atol=ERROR)
    errors = problem.error(run.end), problem.error(scipys.y[:, -1] * sizes)
    remark = "errors {:.0e} and {:.0e}".format(*errors)
    ratio = run.evaluations / scipys.nfev
    return Row(FAIRNESS, case.name, run.evaluations, "", "SciPy's DOP853", ratio, remark=remark)


# ---- the solvers -----------------------------------------------------------------------------------------------


def _prepare(case: Case, folder: Path) -> Problem:
    model: Model = assemble(getattr(models, case.component)).flat()
    (folder / "stages.h").write_text(_stages())
    library = component_library(model, folder, "solvers.c", "rates.c")
    library.dop853.restype = library.cvode.restype = ctypes.c_double
    settable = (*model.parameters, *model.inputs)
    values = doubles([_value(case, variable) for variable in settable])
    n = len(model.states)
    start, sizes = doubles([0.0] * n), doubles([0.0] * n)
    library.begin(values, start, sizes)

    def solver(function: Callable[..., float], *more: object) -> Solver:
        def run(tolerance: float) -> Run:
            y, evaluations = doubles(start), ctypes.c_long()
            call = (n, ctypes.c_double(tolerance), sizes, ctypes.c_double(case.duration), y, *more[:1])
            seconds = function(*call, None, ctypes.byref(evaluations), *more[1:])
            return Run(seconds if seconds > 0 else np.nan, evaluations.value, np.array(y))

        return run

    def fmu(tolerance: float) -> Run:
        y = doubles(start)
        seconds = np.nan
        for counting in (True, False):
            instance = open_component(library, tolerance, counting=counting)
            seconds = library.component_advance(instance, ctypes.c_double(case.duration), ctypes.c_long(1))
            library.component_states(instance, y)
            library.component_close(instance)
        return Run(seconds if seconds > 0 else np.nan, library.component_evaluations(), np.array(y))

    solvers: dict[str, Solver] = {
        "FMU": fmu,
        DOP853: solver(library.dop853, library.rates),
        "CVODE Adams": solver(library.cvode, library.rates, ADAMS),
        "CVODE BDF": solver(library.cvode, library.rates, BDF),
    }
    if case.component in BY_HAND_TOO:
        library.begin_by_hand(values, len(model.parameters), len(model.inputs))
        solvers[ALL_BY_HAND] = solver(library.dop853, getattr(library, f"rates_of_{case.component}"))

    def rates(t: float, y: NDArray) -> NDArray:
        f = doubles([0.0] * n)
        library.rates(None, ctypes.c_double(t), doubles(y), f)
        return np.array(f)

    reference = _reference(model, case, folder, start, sizes)
    return Problem(solvers, rates, np.array(start), np.array(sizes), reference)


def _reference(model: Model, case: Case, folder: Path, start: ctypes.Array, sizes: ctypes.Array) -> NDArray:
    """The states at the end by DOP853 in extended precision, from code that CasADi prints for it."""
    t, y = ca.SX.sym("t"), ca.SX.sym("y", len(start))
    u, k = ([_value(case, variable) for variable in group] for group in (model.inputs, model.parameters))
    (rates,) = model.derivatives.call([t, y, ca.DM(u), ca.DM(k)])
    generator = ca.CodeGenerator("reference", {"casadi_real": "long double", "with_header": False})
    generator.add(ca.Function("right_hand_side", [t, y], [rates]))
    (folder / "reference.c").write_text(f"#include <tgmath.h>\n{generator.dump()}\n{_REFERENCE_RATES}")
    files = [folder / "reference.c", BY_HAND / "solvers.c"]
    library = compile_library(folder, "extended", files, "-DREFERENCE")
    end = (ctypes.c_longdouble * len(start))(*start)
    tolerance, duration = ctypes.c_double(REFERENCE_TOLERANCE), ctypes.c_double(case.duration)
    library.dop853(len(start), tolerance, sizes, duration, end, library.rates, None, ctypes.byref(ctypes.c_long()))
    return np.array([float(value) for value in end])


_REFERENCE_RATES = """
void rates(void *context, long double t, const long double y[], long double f[]) {
    const long double *in[] = {&t, y};
    long double *out[] = {f};
    (void)context;
    right_hand_side(in, out, 0, 0, 0);
}
"""


def _value(case: Case, variable: Variable) -> float:
    (start,) = variable.starts
    return case.values.get(variable.name, start)


def _stages() -> str:
    """DOP853 as C expressions, from the coefficients that SciPy has."""

    def weighted(weights: NDArray) -> str:
        return " + ".join(f"{float(w)!r} * k[{j}][i]" for j, w in enumerate(weights, start=1) if w)

    rows = {f"STAGE_{s}": published.A[s - 1, : s - 1] for s in range(2, 13)}
    rows |= {"ORDER_8": published.B, "ERROR_5": published.E5[:12], "ERROR_3": published.E3[:12]}
    nodes = ", ".join(repr(float(c)) for c in published.C[:12])
    return "".join(f"#define {name}(i) {weighted(row)}\n" for name, row in rows.items()) + (
        f"static const double NODES[] = {{{nodes}}};\n"
    )


def _load_globally() -> None:
    """CVODE as FMPy carries it, for the C code to be linked with."""
    for name in ("core", "nvecserial", "sunmatrixdense", "sunlinsoldense", "cvode"):
        path = sundials.library_dir / f"sundials_{name}{sharedLibraryExtension}"
        ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)


if __name__ == "__main__":
    command(measure)
