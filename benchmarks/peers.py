"""The same pendulum by every way to make an FMU of it: time of a communication step, and error.

    python benchmarks/peers.py [--quick]

Task: 10 s from 2 rad at rest in 1000 communication steps, by FMPy's own calls, in processor time.  Ratios are to
hand-written C in the same rounds; errors are the largest of θ at the communication points against the elliptic
functions.  C by hand has all that the generated pendulum has, and plain Python an angle and a momentum: Runge-Kutta's
classical method at fixed steps, three and one a communication step.  Ours keep a tolerance of 1e-8.  CasADi's
integrators have their default tolerances, which is how one writes it at first.  CasADi's own export is for model
exchange alone: CVODE, as FMPy carries it, integrates it from one communication point to the next, and ours beside it.
FMPy's call of an FMI 3.0 step is dearer than that of FMI 2.0 by itself: see ``step_cost.py``.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, chdir, contextmanager
from ctypes import c_double
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import fmpy
import matplotlib.pyplot as plt
import numpy as np
import pythonfmu
import pythonfmu3
from _measure import HERE, Row, command, interleaved
from fmpy.simulation import Input, apply_start_values, instantiate_fmu
from fmpy.sundials import CVodeSolver
from step_cost import compile_by_hand, instantiate

from liaisons.fmu import build
from liaisons.mechanics import assemble
from liaisons.models import Pendulum

STEP = 0.01  # [s]
STEPS = 1000
AMPLITUDE = 2.0  # [rad]
CVODE_TOLERANCE = 1e-8
BY_HAND = "C by hand (FMI 2)"
THETA = 13  # its place in by_hand/pendulum.c


@dataclass(frozen=True, slots=True)
class Opened:
    """An initialized instance."""

    step: Callable[[float, float], object]
    theta: Callable[[], float]


@dataclass(frozen=True, slots=True)
class Peer:
    """A way to make the pendulum; every time that it is opened it starts anew."""

    open: Callable[[], AbstractContextManager[Opened]]
    share: float = 1.0  # of the steps that are timed


def measure(quick: bool, plots: Path) -> list[Row]:
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        peers = _peers(Path(name))
        errors = {title: _error(peer) for title, peer in peers.items()}
        times = interleaved(
            {title: lambda peer=peer: _seconds_a_step(peer) for title, peer in peers.items()}, 2 if quick else 9
        )
    rows = [
        Row.of(
            "10 s of a pendulum in 1000 communication steps, through FMPy",
            title,
            [1e6 * t for t in values],
            "µs a step",
            yardstick="" if title == BY_HAND else BY_HAND,
            beside=None if title == BY_HAND else [1e6 * t for t in times[BY_HAND]],
            remark=f"error {errors[title]:.0e} rad",
            better="less" if title.startswith("liaisons") else "",
        )
        for title, values in times.items()
    ]
    _plot(rows, errors, plots / "peers.png")
    return rows


def _plot(rows: list[Row], errors: Mapping[str, float], path: Path) -> None:
    _, ax = plt.subplots(figsize=(9, 4.5), layout="constrained")
    for row, marker in zip(rows, "osD^vPXp*hd", strict=True):
        ax.loglog(row.figure, errors[row.case], marker, label=row.case)
    ax.set(xlabel="communication step through FMPy [µs]", ylabel="largest error of θ in 10 s [rad]")
    ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    plt.savefig(path, dpi=100)
    plt.close()


def _seconds_a_step(peer: Peer) -> float:
    n = int(STEPS * peer.share)
    with peer.open() as opened:
        step = opened.step
        begin = time.thread_time()
        for i in range(n):
            step(i * STEP, STEP)
        return (time.thread_time() - begin) / n


def _error(peer: Peer) -> float:
    theta = []
    with peer.open() as opened:
        for i in range(STEPS):
            opened.step(i * STEP, STEP)
            theta.append(opened.theta())
    exact = Pendulum.exact(STEP * np.arange(1, STEPS + 1), theta_0=AMPLITUDE)["theta"]
    return float(np.max(np.abs(exact - theta)))


# ---- the peers ---------------------------------------------------------------------------------------------------


def _peers(folder: Path) -> dict[str, Peer]:
    hand_written = folder / "by_hand"
    compile_by_hand("pendulum", hand_written)
    native2, native3 = (build(assemble(Pendulum), folder / v, backend="native", fmi=v) for v in ("2", "3"))
    python = build(assemble(Pendulum), folder / "python", backend="python")
    plain, plain3, naive = (
        builder.build_FMU(HERE / "by_hand" / f"{script}.py", dest=folder / script)
        for builder, script in (
            (pythonfmu.FmuBuilder, "plain_python_pendulum"),
            (pythonfmu3.FmuBuilder, "plain_python_pendulum3"),
            (pythonfmu.FmuBuilder, "casadi_pendulum"),
        )
    )
    ours, theirs = {"theta_0": AMPLITUDE}, {"theta": AMPLITUDE}
    exported = _exported_by_casadi(folder / "exported")
    return {
        BY_HAND: Peer(lambda: _opened_by_hand(hand_written)),
        "liaisons, native FMI 2": _co_simulation(native2, ours),
        "liaisons, native FMI 3": _co_simulation(native3, ours),
        "liaisons, Python back end": _co_simulation(python, ours),
        "pythonfmu, plain Python": _co_simulation(plain, theirs),
        "pythonfmu3, plain Python": _co_simulation(plain3, theirs),
        "pythonfmu, CasADi's rk": _co_simulation(naive, {**theirs, "plugin": "rk"}),
        "pythonfmu, CasADi's cvodes": _co_simulation(naive, {**theirs, "plugin": "cvodes"}),
        "pythonfmu, CasADi's cvodes made anew each step": _co_simulation(naive, {**theirs, "rebuilt": True}, share=0.2),
        f"CasADi's FMI 3 export, CVODE {CVODE_TOLERANCE:g}": _model_exchange(exported),
        f"liaisons, FMI 3 model exchange, CVODE {CVODE_TOLERANCE:g}": _model_exchange(native3),
    }


@contextmanager
def _opened_by_hand(folder: Path) -> Iterator[Opened]:
    slave = instantiate(folder, "pendulum", "by hand")
    slave.setReal([THETA], [AMPLITUDE])
    yield Opened(slave.doStep, lambda: slave.getReal([THETA])[0])
    slave.freeInstance()


def _co_simulation(path: Path, starts: Mapping[str, object], share: float = 1.0) -> Peer:
    description, folder = _unpacked(path)
    (reference,) = (v.valueReference for v in description.modelVariables if v.name == "theta")

    @contextmanager
    def opened() -> Iterator[Opened]:
        slave: Any = instantiate_fmu(folder, description, fmi_type="CoSimulation")
        three = description.fmiVersion.startswith("3")
        if not three:
            slave.setupExperiment(startTime=0.0)
        apply_start_values(slave, description, dict(starts))
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        get = slave.getFloat64 if three else slave.getReal
        yield Opened(slave.doStep, lambda: get([reference])[0])
        slave.terminate()
        slave.freeInstance()

    return Peer(opened, share)


def _model_exchange(path: Path) -> Peer:
    description, folder = _unpacked(path)
    n = description.numberOfContinuousStates

    @contextmanager
    def opened() -> Iterator[Opened]:
        fmu: Any = instantiate_fmu(folder, description, fmi_type="ModelExchange")
        fmu.enterInitializationMode(startTime=0.0)
        fmu.exitInitializationMode()
        fmu.enterContinuousTimeMode()
        states = (c_double * n)(AMPLITUDE)  # θ is the first one of both
        fmu.setContinuousStates(states, n)
        solver = CVodeSolver(
            nx=n,
            nz=0,
            get_x=fmu.getContinuousStates,
            set_x=fmu.setContinuousStates,
            get_dx=fmu.getContinuousStateDerivatives,
            get_z=fmu.getEventIndicators,
            get_nominals=fmu.getNominalsOfContinuousStates,
            set_time=fmu.setTime,
            input=Input(fmu, description, None),
            startTime=0.0,
            relativeTolerance=CVODE_TOLERANCE,
        )

        def theta() -> float:
            fmu.getContinuousStates(states, n)
            return states[0]

        yield Opened(lambda t, h: solver.step(t, t + h), theta)
        fmu.terminate()
        fmu.freeInstance()

    return Peer(opened)


def _unpacked(path: Path) -> tuple[Any, str]:
    return fmpy.read_model_description(path, validate=False), str(fmpy.extract(path, path.with_suffix("")))


def _exported_by_casadi(folder: Path) -> Path:
    """``DaeBuilder.export_fmu`` and what belongs to it; it writes into the current directory."""
    folder.mkdir()
    dae = ca.DaeBuilder("casadi_export")
    dae.add("time", "independent")
    theta, p_theta = dae.add("theta"), dae.add("p_theta")
    dae.eq(dae.der(theta), p_theta)
    dae.eq(dae.der(p_theta), -9.81 * ca.sin(theta))
    headers = os.fspath(Path(fmpy.__file__).parent / "c-code")
    with chdir(folder):
        files = dae.export_fmu({"no_warning": True})
        files = dae.compile_fmu(files, {"include_dirs": [headers], "compiler_options": {"flags": ["-O2"]}})
        return folder / dae.pack_fmu(files)


if __name__ == "__main__":
    command(measure)
