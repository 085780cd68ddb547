"""Motions and forces that others have published: the IVP Test Set's mechanisms, two co-simulation benchmarks.

    python benchmarks/published.py [--quick]

Andrews' squeezer and the car axis (F. Mazzia, C. Magherini, Test Set for Initial Value Problem Solvers, release 2.4,
II-12 and II-13) are bodies and joints; an error is the largest difference from the published numbers, relative to the
largest of them.  "Converged" are the test set's equations of the squeezer, extrapolated in extended precision with two
sizes of steps that agree to 15 digits.

The linear oscillator of two masses and the hydraulic manipulator are the co-simulation benchmarks of the Laboratorio
de Ingeniería Mecánica (F. González et al., Universidade da Coruña, github.com/fgonzalezLIM/cosim-benchmarks): 10 s in
communication steps of H, each coupling there is.  Errors of the oscillator are those of the displacements, relative to
the largest, and of the energy, relative to that at the start, against the matrix exponential; "Jacobi and Euler" is
the scheme of the benchmark's own program, in NumPy.  Those of the manipulator are against the published
reference, the trapezoidal rule in one program with h = 0.05 ms; its study of convergence, continued to h = 0, moves the
stroke at 10 s by 1.4e-6 m.  A system that is flattened is one FMU, a solver without communication.  Processor times.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import hydraulic_manipulator
import numpy as np
import two_masses
from _measure import HERE, Row, command
from numpy.typing import NDArray

from liaisons import LiaisonsError, operator, simulate
from liaisons.base.project import load_module
from liaisons.cosim import System
from liaisons.fmu import build
from liaisons.language.component import Component
from liaisons.mechanics import assemble
from liaisons.models import CarAxis
from liaisons.results import Result

COUPLINGS = ("jacobi", "gauss-seidel", "waveform", "implicit")
SQUEEZER_TOLERANCES, CAR_TOLERANCES = (1e-6, 1e-9, 1e-12), (1e-6, 1e-9, 1e-12)
OSCILLATOR_STEPS, MANIPULATOR_STEPS = (8e-3, 4e-3, 2e-3, 1e-3), (4e-2, 1e-2, 1e-3)
TIGHT, MANIPULATOR_TOLERANCE = 1e-11, 1e-9
# By extrapolation of the test set's equations, at 0.03 s.
CONVERGED = {
    "beta": 15.8107711951537024,
    "theta": -15.7563710584118336,
    "gamma": 0.0408222401196465,
    "phi": -0.5347301163420788,
    "delta": 0.5244099658799541,
    "omega": 0.5347301163420787,
    "epsilon": 1.0480807410419379,
}


class Timed(NamedTuple):
    """A run, and its processor time [ms]."""

    run: Result
    milliseconds: float


def measure(quick: bool, plots: Path) -> list[Row]:  # noqa: ARG001 - no diagram
    rounds = 1 if quick else 5
    with TemporaryDirectory() as name:
        folder = Path(name)
        rows = [*_two_masses(folder, rounds, quick=quick), *_car_axis(folder, rounds, quick=quick)]
        if not quick:
            rows += [*_squeezer(folder, rounds), *_manipulator(folder, rounds)]
    order = ["Andrews' squeezer", "Car axis", "Two masses", "Hydraulic manipulator"]
    return sorted(rows, key=lambda row: next(i for i, start in enumerate(order) if row.topic.startswith(start)))


def _built(component: type[Component], folder: Path) -> Path:
    return build(assemble(component), folder)


def _timed(run: Callable[[], Result], rounds: int) -> Timed:
    """The median of the rounds, after one to warm up."""
    result, seconds = run(), []
    for _ in range(rounds):
        begin = time.process_time()
        result = run()
        seconds.append(time.process_time() - begin)
    return Timed(result, 1e3 * statistics.median(seconds))


def _relative(values: Mapping[str, float], expected: Mapping[str, float]) -> float:
    """Largest difference, relative to the largest of what is expected."""
    largest = max(map(abs, expected.values()))
    return max(abs(values[name] - value) for name, value in expected.items()) / largest


# ---- IVP Test Set --------------------------------------------------------------------------------------------------


def _squeezer(folder: Path, rounds: int) -> Iterator[Row]:
    scenario = load_module(HERE.parent / "scenarios" / "andrews_squeezer.py")
    fmu = _built(scenario.Squeezer, folder)
    topic = "Andrews' squeezer of the IVP Test Set, 0.03 s"
    settings: dict[str, Any] = {"beta_force": scenario.TORQUE, "stop_time": 0.03, "step_size": 3e-4}
    for tolerance in SQUEEZER_TOLERANCES:
        run, spent = _timed(lambda: simulate(fmu, tolerance=tolerance, **settings), rounds)  # noqa: B023 - called at once
        angles = {name: run[name][-1] for name in CONVERGED}
        forces = scenario.pin_forces(run)
        finest = tolerance == SQUEEZER_TOLERANCES[-1]
        text = (
            f"{spent:.3g} ms; the reference took PSIDE 56.7 s of a Cray C90 at 1e-14" if finest else f"{spent:.3g} ms"
        )
        published, converged = ({pin: pair[i] for pin, pair in scenario.MULTIPLIERS.items()} for i in (0, 1))
        for what, error, bound in (
            ("angles, as published", _relative(angles, scenario.PUBLISHED), "<= 1e-10"),
            ("angles, converged", _relative(angles, CONVERGED), ""),
            ("multipliers, as published", _relative(forces, published), "<= 1e-8"),
            ("multipliers, converged", _relative(forces, converged), "<= 1e-8"),
        ):
            case = f"tolerance {tolerance:g}: {what}"
            yield Row(topic, case, error, "of the largest", asked=bound if finest else "", remark=text)


def _car_axis(folder: Path, rounds: int, *, quick: bool) -> Iterator[Row]:
    scenario = load_module(HERE.parent / "scenarios" / "car_axis.py")
    fmu, lift = (_built(component, folder) for component in (CarAxis, scenario.Bump))
    for tolerance in CAR_TOLERANCES[1:2] if quick else CAR_TOLERANCES:
        settings: dict[str, Any] = {"stop_time": 3.0, "step_size": 0.002, "tolerance": tolerance}
        run, spent = _timed(
            lambda: simulate(fmu, lift=operator(lift), input_reconstruction=2, **settings),  # noqa: B023 - called at once
            rounds,
        )
        error = _relative({name: run[name][-1] for name in scenario.PUBLISHED}, scenario.PUBLISHED)
        bound = "<= 1e-9" if tolerance == CAR_TOLERANCES[-1] else ""
        text = f"{spent:.3g} ms, communication steps of 2 ms"
        case = f"tolerance {tolerance:g}: places and velocities"
        yield Row("Car axis of the IVP Test Set, 3 s", case, error, "of the largest", asked=bound, remark=text)


# ---- co-simulation -------------------------------------------------------------------------------------------------


def _two_masses(folder: Path, rounds: int, *, quick: bool) -> Iterator[Row]:
    first, second = (str(_built(component, folder)) for component in two_masses.COMPONENTS.values())
    signals = [f"{mass}.{name}" for name in ("x", "x_dot") for mass in ("first", "second")]
    for text, damping in two_masses.DAMPING.items():
        topic = f"Two masses, {text}"
        system = two_masses.two_masses(first, second, damping)

        def row(case: str, z: NDArray, spent: float, topic: str = topic, damping: float = damping) -> Row:
            expected = two_masses.exact(z.shape[1] - 1, damping)
            error = np.abs(z - expected)[:2].max() / np.abs(expected[:2]).max()
            lost = np.abs(two_masses.energy(z) - two_masses.energy(expected)).max() / two_masses.energy(z[:, :1])[0]
            return Row(topic, case, float(error), "of the largest", remark=f"energy {lost:.1e}, {spent:.3g} ms")

        for step in OSCILLATOR_STEPS[-2:] if quick else OSCILLATOR_STEPS:
            count = round(two_masses.DURATION / step)
            for coupling in COUPLINGS:
                run, spent = _coupled(system, coupling, step, rounds)
                yield row(f"{coupling}, H = {step:g} s", np.array([run[name] for name in signals]), spent)
            begin = time.process_time()
            z = two_masses.by_jacobi_and_euler(count, damping)
            yield row(f"Jacobi and Euler, H = {step:g} s", z, 1e3 * (time.process_time() - begin))
        if not quick:
            one = system.flatten(components=two_masses.COMPONENTS)
            run, spent = _timed(lambda: simulate(one, stop_time=10.0, step_size=0.01, tolerance=TIGHT), rounds)  # noqa: B023
            yield row("flattened, one FMU", np.array([run[name] for name in signals]), spent)


def _manipulator(folder: Path, rounds: int) -> Iterator[Row]:
    arm, cylinder = (str(_built(it, folder)) for it in hydraulic_manipulator.COMPONENTS.values())
    system = hydraulic_manipulator.manipulator(arm, cylinder)
    topic = "Hydraulic manipulator, steps of the valve, stroke at 6.04 s"

    def row(case: str, timed: Timed) -> Row:
        run, spent = timed
        published = hydraulic_manipulator.PUBLISHED
        last, *pressures = (abs(run[name][-1] - value) for name, value in published.items())
        stroke = np.interp(6.04, run.time, run["arm.stroke"])  # a communication point
        text = f"at 10 s {last:.1e} m, pressures {max(pressures):.2g} Pa of 4.28 MPa, {spent:.3g} ms"
        return Row(topic, case, abs(stroke - hydraulic_manipulator.PUBLISHED_STROKE), "m", remark=text)

    for step in MANIPULATOR_STEPS:
        for coupling in COUPLINGS:
            case = f"{coupling}, H = {step:g} s"
            try:
                yield row(case, _coupled(system, coupling, step, rounds, MANIPULATOR_TOLERANCE))
            except LiaisonsError as error:
                reason = str(error).partition(": ")[2].partition(",")[0]
                yield Row(topic, case, float("nan"), "", remark=f"refused: {reason}")
    one, tolerance = system.flatten(components=hydraulic_manipulator.COMPONENTS), MANIPULATOR_TOLERANCE
    timed = _timed(lambda: simulate(one, stop_time=10.0, step_size=0.01, tolerance=tolerance), rounds)
    yield row("flattened, one FMU", timed)
    for text, stroke in hydraulic_manipulator.OTHERS.items():
        error = abs(stroke - hydraulic_manipulator.PUBLISHED_STROKE)
        yield Row(topic, f"Jacobi and Euler, {text}", error, "m", remark="published")


def _coupled(system: System, coupling: Any, step: float, rounds: int, tolerance: float = TIGHT) -> Timed:
    return _timed(lambda: system.simulate(10.0, step, tolerance=tolerance, coupling=coupling), rounds)


if __name__ == "__main__":
    command(measure)
