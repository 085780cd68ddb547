"""Time for an error of stiff motions: the stiff solver of the native FMU beside CVODE and SciPy's implicit methods.

    python benchmarks/stiff.py [--quick]

Problems of the IVP Test Set, against the digits that it publishes.  The stiff solver takes its Jacobian from the FMU's
derivatives, CVODE and SciPy from differences.  CVODE (BDF) integrates the same FMU by Model Exchange; SciPy's
right-hand sides are written by hand in NumPy.  An error is the largest one, relative to the largest published number.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path

import fmpy
import matplotlib.pyplot as plt
import numpy as np
from _measure import Row, command, interleaved
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from stiff_problems import HIRES_END, HIRES_PUBLISHED, VAN_DER_POL_END, VAN_DER_POL_PUBLISHED, Hires, VanDerPol

from liaisons.cosim import System
from liaisons.fmu import build
from liaisons.mechanics import assemble

TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10)
OURS = "FMU, stiff solver"


def _van_der_pol(_t: float, y: NDArray) -> NDArray:
    return np.array([y[1], ((1 - y[0] ** 2) * y[1] - y[0]) * 1e6])


def _hires(_t: float, y: NDArray) -> NDArray:
    bound = 280 * y[5] * y[7]
    return np.array(
        [
            -1.71 * y[0] + 0.43 * y[1] + 8.32 * y[2] + 0.0007,
            1.71 * y[0] - 8.75 * y[1],
            -10.03 * y[2] + 0.43 * y[3] + 0.035 * y[4],
            8.32 * y[1] + 1.71 * y[2] - 1.12 * y[3],
            -1.745 * y[4] + 0.43 * y[5] + 0.43 * y[6],
            -bound + 0.69 * y[3] + 1.71 * y[4] - 0.43 * y[5] + 0.69 * y[6],
            bound - 1.81 * y[6],
            -bound + 1.81 * y[6],
        ]
    )


def measure(quick: bool, plots: Path) -> list[Row]:
    rounds, tolerances = (1, TOLERANCES[1:3]) if quick else (5, TOLERANCES)
    problems = {
        "Van der Pol, ε = 1e-6": (VanDerPol, VAN_DER_POL_END, VAN_DER_POL_PUBLISHED, _van_der_pol, [2.0, 0.0]),
        "HIRES": (Hires, HIRES_END, HIRES_PUBLISHED, _hires, [1.0, *[0.0] * 6, 0.0057]),
    }
    rows = []
    _, axes = plt.subplots(1, len(problems), figsize=(10, 4.5), layout="constrained")
    with tempfile.TemporaryDirectory() as folder:
        for ax, (title, (component, end, published, rates, start)) in zip(axes, problems.items(), strict=True):
            fmu = build(assemble(component), Path(folder))
            extracted = str(fmpy.extract(fmu, Path(folder) / component.__name__))
            lines: dict[str, list[tuple[float, float]]] = {}
            for tolerance in tolerances:
                # A hundred communication points; CVODE, as FMPy sets it up, makes 500 steps between two and gives up.
                runs = {
                    OURS: _by_fmu(fmu, end, tolerance, published),
                    "FMPy, CVODE on the FMU": _by_cvode(extracted, end, tolerance, published),
                    "SciPy, Radau": _by_scipy(rates, start, end, tolerance, published, "Radau"),
                    "SciPy, BDF": _by_scipy(rates, start, end, tolerance, published, "BDF"),
                }
                pairs = interleaved(runs, rounds)
                ours = [seconds for seconds, _ in pairs[OURS]]
                for name, found in pairs.items():
                    seconds, error = [1e3 * s for s, _ in found], found[0][1]
                    beside = [1e3 * s for s in ours]
                    remark = "gives up" if math.isnan(error) else f"error {error:.1e}"
                    case = f"{name}, tolerance {tolerance:g}"
                    rows.append(Row.of(title, case, seconds, "ms", beside=beside, remark=remark))
                    lines.setdefault(name, []).append((float(np.median(seconds)), error))
            for name, points in lines.items():
                ax.loglog(*zip(*points, strict=True), "o-", label=name)
            ax.set(title=title, xlabel="processor time [ms]", ylabel="relative error")
    axes[0].legend()
    plt.savefig(plots / "stiff.png", dpi=100)
    plt.close()
    return rows


def _by_fmu(
    fmu: Path, end: float, tolerance: float, published: Mapping[str, float]
) -> Callable[[], tuple[float, float]]:
    """Seconds of a run, and its error."""
    system = System("stiff")
    system.add("problem", fmu, stiff_solver=1)
    record = [f"problem.{name}" for name in published]

    def run() -> tuple[float, float]:
        begin = time.process_time()
        result = system.simulate(stop_time=end, step_size=end / 100, tolerance=tolerance, record=record)
        return time.process_time() - begin, _error([result[name][-1] for name in record], published)

    return run


def _by_cvode(
    folder: str, end: float, tolerance: float, published: Mapping[str, float]
) -> Callable[[], tuple[float, float]]:
    def run() -> tuple[float, float]:
        begin = time.process_time()
        try:
            found = fmpy.simulate_fmu(
                folder,
                validate=False,
                fmi_type="ModelExchange",
                solver="CVode",
                stop_time=end,
                output_interval=end / 100,
                relative_tolerance=tolerance,
                output=[*published],
            )
        except RuntimeError:  # more than 500 steps between two points
            return time.process_time() - begin, math.nan
        return time.process_time() - begin, _error([found[name][-1] for name in published], published)

    return run


def _by_scipy(  # noqa: PLR0917 - a row of the table above
    rates: Callable, start: list[float], end: float, tolerance: float, published: Mapping[str, float], method: str
) -> Callable[[], tuple[float, float]]:
    def run() -> tuple[float, float]:
        begin = time.process_time()
        solution = solve_ivp(rates, (0, end), start, method=method, rtol=tolerance, atol=tolerance)  # type: ignore[call-overload]
        return time.process_time() - begin, _error(solution.y[:, -1], published)

    return run


def _error(values: NDArray | list[float], published: Mapping[str, float]) -> float:
    expected = np.array([*published.values()])
    return float(np.abs(np.asarray(values) - expected).max() / np.abs(expected).max())


if __name__ == "__main__":
    command(measure)
