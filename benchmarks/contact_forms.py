"""Closed forms of contact, impact, stick and slip, and runs of FMUs by every interface to hold against them."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from ctypes import c_int32
from dataclasses import dataclass, field
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import fmpy
import numpy as np
from _measure import HERE
from numpy.typing import NDArray

from liaisons import System, operator
from liaisons.composition import composed_model
from liaisons.cosim import simulate
from liaisons.fmu import build
from liaisons.mechanics import Model, assemble
from liaisons.models import BallRow, BeadOnSphere, BouncingBall, DryOscillator, StringPendulum

sys.path[:0] = [str(HERE.parent / "tests" / "kernel" / folder) for folder in ("fmu", "cosim")]

from driver import Library  # noqa: E402 - it lies with the tests
from making import exchange_only  # noqa: E402
from wasm_driver import WasmLibrary  # noqa: E402

TOLERANCE = 1e-13  # at 1e-14 CVODE gives up
GRAVITY = 9.81
EXACT = "<= 1e-10"

Values = Mapping[str, NDArray]
Error = Callable[[NDArray, Values], Any]
"""Of a run, from times and values at its communication points: what should be 0."""


class Run(NamedTuple):
    """At the communication points; impacts so far, and events that the importer handled."""

    time: NDArray
    values: Values
    impacts: int
    events: int | None = None


@dataclass(frozen=True)
class Case:
    """A run, and closed forms that hold for it."""

    component: type[Any]
    start: Mapping[str, Any]
    size: float
    stop: float
    forms: Mapping[str, Error]
    read: tuple[str, ...]
    moved: Mapping[str, Any] = field(default_factory=dict)  # inputs, by operators that are a part of the same FMU

    def model(self, name: str) -> Model:
        if not self.moved:
            return assemble(self.component)
        system = System(name)
        system.add("it", self.component.__name__, **self.moved)
        return composed_model(system)

    def named(self, name: str) -> str:
        return f"it.{name}" if self.moved else name

    @property
    def times(self) -> NDArray:
        return self.size * np.arange(1, round(self.stop / self.size) + 1)


# ---- interfaces --------------------------------------------------------------------------------------------------


def stepped(library: Library, case: Case, *, events: bool = False) -> Run:
    """Co-simulation; with events they are handled where they are."""
    starts = {case.named(name): value for name, value in case.start.items()}
    instance = library.start(tolerance=TOLERANCE, options={"events": events, "early": events}, **starts)
    count, rows, time = 0, [], 0.0
    if events:
        instance.go_on()
    for end in case.times:
        while time < end:
            step = instance.advance(time, end - time)
            instance.expect(step.status)
            time = step.time if events else end
            if step.event:
                instance.do("EnterEventMode")
                instance.go_on()
                count += 1
        rows.append({name: np.squeeze(instance.get(case.named(name))) for name in case.read})
    names, numbers = counters(library), (c_int32 * library.count(*counters(library)))()
    instance.do("GetInt32", instance.refs(names), len(instance.refs(names)), numbers, len(numbers))
    values = {name: np.array([row[name] for row in rows]) for name in case.read}
    return Run(case.times, values, sum(numbers), count if events else None)


def counters(library: Library) -> list[str]:
    """Variables that count impacts."""
    names = {name.partition("[")[0] for name in library.references}
    return sorted(name for name in names if name.endswith("_impacts"))


def by_cvode(path: Path, case: Case) -> Run:
    """Model exchange in FMPy."""
    library, starts = Library(path), dict[str, Any]()
    for name, value in case.start.items():
        elements = library.elements(case.named(name))
        starts |= {elements[0]: value} if len(elements) == 1 else dict(zip(elements, value, strict=True))
    names = {name: library.elements(case.named(name)) for name in case.read}
    counted = [element for name in counters(library) for element in library.elements(name)]
    rows = fmpy.simulate_fmu(
        path,
        fmi_type="ModelExchange",
        stop_time=case.times[-1],
        output_interval=case.size,
        relative_tolerance=TOLERANCE,
        start_values=starts,
        output=[*chain(*names.values()), *counted],
    )
    events = int(np.sum(np.diff(rows["time"]) == 0))
    rows = rows[np.searchsorted(rows["time"], case.times * (1 + 1e-9), side="right") - 1]
    values = {name: np.squeeze(np.column_stack([rows[element] for element in each])) for name, each in names.items()}
    return Run(case.times, values, sum(int(np.sum(rows[name][-1])) for name in counted), events)


def simulated(path: Path, case: Case) -> Run:
    """By ``liaisons.simulate``."""
    counted, starts = counters(Library(path)), {case.named(name): value for name, value in case.start.items()}
    run = simulate(
        path,
        stop_time=case.times[-1],
        step_size=case.size,
        tolerance=TOLERANCE,
        record=[*map(case.named, case.read), *counted],
        start_values=starts,
    )
    values = {name: run[case.named(name)][1:] for name in case.read}
    return Run(run.time[1:], values, sum(int(np.sum(run[name][-1])) for name in counted))


def interfaces(model: Model, case: Case, folder: Path) -> Mapping[str, tuple[str, Callable[[], Run]]]:
    """What is asked of each, and a run by it."""
    two, three = build(model, folder, fmi="2"), build(model, folder / "three", fmi="3", platforms="wasm")
    library, component = Library(three), WasmLibrary(three)
    found = {
        "CS 2": (EXACT, partial(stepped, Library(two), case)),
        "CS 3": (EXACT, partial(stepped, library, case)),
        "CS 3, event mode": (EXACT, partial(stepped, library, case, events=True)),
        "WASM, CS 3": (EXACT, partial(stepped, component, case)),
        "WASM, CS 3, event mode": (EXACT, partial(stepped, component, case, events=True)),
    }
    for version, path in (("2", two), ("3", three)):
        other = folder / f"exchange{version}"
        other.mkdir()
        found[f"ME {version}, liaisons.simulate"] = "", partial(simulated, exchange_only(path, other), case)
        found[f"ME {version}, CVODE of FMPy"] = "", partial(by_cvode, path, case)
    return found


# ---- closed forms ------------------------------------------------------------------------------------------------


def motion(component: type[Any], start: Mapping[str, float], *names: str) -> Error:
    """Off the closed form at all times."""

    def error(t: NDArray, v: Values) -> Any:
        exact = component.exact(t, **start)
        return [v[name] - exact[name] for name in names]

    return error


def to_rest() -> Case:
    names = ("height", "height_dot", "impact_loss")
    forms = {name: motion(BouncingBall, {}, name) for name in names}
    forms["gap_rests_from"] = lambda _, v: v["gap_rests_from"][-1] - BouncingBall.rests_at()
    return Case(BouncingBall, {}, 0.037, 5.0, forms, (*names, "gap_rests_from"))


def shaken(ratio: float) -> Case:
    """From rest on a table A sin 7t, Γ = 49 A/g, until just after it may leave."""
    amplitude = ratio * GRAVITY / 49
    leaves = BouncingBall.leaves_at(amplitude=amplitude, angular_frequency=7.0)

    def error(t: NDArray, v: Values) -> Any:
        held = np.minimum(t, leaves)
        table, rate, since = amplitude * np.sin(7 * held), 7 * amplitude * np.cos(7 * held), t - held
        return [v["height"] - table - (rate - GRAVITY / 2 * since) * since, v["height_dot"] - rate + GRAVITY * since]

    form, stop = ("stays", 2.0) if ratio < 1 else ("leaves where sin ωt = 1/Γ", 0.25)
    start = {"height_0": 0.0, "height_dot_0": 7 * amplitude}
    moved = {"table": operator("Sinusoid", amplitude=amplitude, angular_frequency=7.0)}
    return Case(BouncingBall, start, 0.01, stop, {f"Γ = {ratio}, {form}": error}, ("height", "height_dot"), moved)


def in_step() -> Case:
    """Γ = 2.3, once a period of the table, halfway between impacts."""
    values = {"bounce": 0.2, "gravity": 1.0}
    phase, speed = BouncingBall.period_one(**values, amplitude=2.3, angular_frequency=1.0)
    top = 2.3 * np.sin(phase) + speed**2 / 2
    moved = {"table": operator("Sinusoid", amplitude=2.3, angular_frequency=1.0, phase=phase + np.pi)}

    def error(_: NDArray, v: Values) -> Any:
        return [v["height"][19::20] - top, v["height_dot"][19::20]]

    form = {"Γ = 2.3, 20 periods in step": error}
    start = {**values, "height_0": top}
    return Case(BouncingBall, start, np.pi / 10, 40 * np.pi, form, ("height", "height_dot"), moved)


def off_sphere() -> Case:
    """The velocity along x after it has left is √(g r) cos^(3/2) θ."""
    cosine = 2 / 3 * np.cos(0.1)
    forms = {
        "motion": motion(BeadOnSphere, {}, "x", "z", "x_dot", "z_dot"),
        "cos θ where it leaves": lambda _, v: np.cbrt(v["x_dot"][-1] ** 2 / GRAVITY) - cosine,
    }
    return Case(BeadOnSphere, {}, 0.037, 1.5, forms, ("x", "z", "x_dot", "z_dot"))


def slack() -> Case:
    """With a tug; the velocity along x while it is slack is √(g l) sin^(3/2) ψ, the height l sin ψ where it began."""
    start = {"x_0": 0.0, "z_0": -1.0, "x_dot_0": 4.6}

    def flies(t: NDArray) -> NDArray:
        exact = StringPendulum.exact(t, **start)
        return (exact["slack_force"] == 0) & (exact["impact_loss"] == 0)

    def height(t: NDArray, v: Values) -> Any:
        return np.cbrt(v["x_dot"][flies(t)] ** 2 / GRAVITY) - StringPendulum.slack_height(4.6)

    forms = {
        "height where it goes slack": height,
        "parabola": lambda t, v: [e[flies(t)] for e in motion(StringPendulum, start, "x", "z")(t, v)],
        "loss of the tug": motion(StringPendulum, start, "impact_loss"),
        "motion, tug included": motion(StringPendulum, start, "x", "z", "x_dot", "z_dot"),
    }
    return Case(StringPendulum, start, 0.037, 3.0, forms, ("x", "z", "x_dot", "z_dot", "impact_loss"))


def pulled() -> Case:
    """2 kg at rest without weight, 0.25 m inside; the string is drawn in at 0.5 m/s, e = 0.5."""
    start = {"x_0": 0.0, "z_0": -0.75, "gravity": 0.0, "bounce": 0.5, "mass": 2.0}
    moved = {"length": operator("Ramp", offset=1.0, rate=-0.5)}
    forms = {"work of an operator's tug": lambda _, v: [v["work"][-1] - 0.75, v["z_dot"][-1] - 0.75]}
    return Case(StringPendulum, start, 0.037, 0.8, forms, ("work", "z_dot"), moved)


def decays() -> Case:
    """A communication point at each turning point."""
    start = {"stiffness": np.pi**2, "mu_static": 0.05, "mu_sliding": 0.03}
    turns = DryOscillator.turning_points(**start)[1]
    forms = {
        "amplitudes of half swings": lambda _, v: v["x"][: len(turns) - 1] - turns[1:],
        "where it stops": lambda _, v: v["x"][-1] - turns[-1],
    }
    return Case(DryOscillator, start, 1.0, 20.0, forms, ("x",))


def sticks_and_slips() -> Case:
    """Sliding begins at (δ, v) from its centre; how long ago that was is the angle of (x, x'/ω) since then."""
    friction, belt, omega = {"mu_static": 0.25, "mu_sliding": 0.1}, 0.2, np.sqrt(10.0)
    start, period = {"x_0": 0.0, "x_dot_0": belt, **friction}, sum(DryOscillator.stick_slip(belt_dot=belt, **friction))
    centre, reach = (mu * GRAVITY / 10 for mu in (0.1, 0.15))

    def error(t: NDArray, v: Values) -> Any:
        slides = v["x_dot"] < belt - 0.01
        turned = np.angle((reach + 1j * belt / omega) / (v["x"] - centre + 1j * v["x_dot"] / omega)[slides])
        begins = t[slides] - turned % (2 * np.pi) / omega
        return (begins[-1] - begins[0]) / np.round((begins[-1] - begins[0]) / period) - period

    forms = {"stick-slip, motion": motion(DryOscillator, {**start, "belt_dot": belt}, "x"), "stick-slip, period": error}
    return Case(DryOscillator, start, 0.037, 20.0, forms, ("x", "x_dot"), {"belt": operator("Ramp", rate=belt)})


def row(form: str, bounce: float) -> Case:
    """Of 2, 1 and 3 kg."""
    values = {"mass": [1.0, 2.0, 3.0], "bounce": bounce}
    exact = BallRow.moreau(**values) if form == "Moreau" else BallRow.sequence(**values)[-1]
    apart = {"x_0": [0.0, 1.0, 1.1 + 1e-6]} if form == "sequence" else {}
    forms: dict[str, Error] = {form: lambda _, v: v["x_dot"][-1] - exact}
    return Case(BallRow, {**values, **apart}, 0.037, 3.0, forms, ("x_dot",))


def cases() -> list[Case]:
    tables = shaken(0.999), shaken(1.01), in_step()
    rows = row("Moreau", bounce=0.6), row("sequence", bounce=1.0)
    return [to_rest(), *tables, off_sphere(), slack(), pulled(), decays(), sticks_and_slips(), *rows]
