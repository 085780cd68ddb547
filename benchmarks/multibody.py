"""Linkages: right-hand sides beside Pinocchio's, the C of an arm, and what the number of bodies costs.

    python benchmarks/multibody.py [--quick] [--output FOLDER]

Time of ``pin.aba`` is that of a call from Python less that of a call with a model of no joints, which takes as many
arrays; ours is called from C, and has the power at all ports in it.  The row of bodies begins with a free one, so that
each body costs the same; a third of its joints is prescribed.  All times are processor times; slopes are fits to
log-log points.
"""

from __future__ import annotations

import ctypes
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields
from functools import partial
from importlib import import_module
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
from _measure import HERE, Row, command, interleaved
from native_code import BY_HAND, doubles

from liaisons import Body, Free, Linkage, Revolute, ground
from liaisons.base.compiler import FLAGS
from liaisons.fmu.code import source_files
from liaisons.mechanics import Model, assemble

ROBOTS = HERE.parent / "tests" / "kernel" / "language" / "robots"
SIZES, QUICK = (2, 4, 8, 15, 30, 60), (2, 8)
GUID = "{00000000-0000-0000-0000-000000000000}"
ROD: dict[str, Any] = {"mass": 2.0, "inertia": (0.02, 0.03, 0.025), "centre": (0, 0, 0.15)}


@dataclass(frozen=True, slots=True)
class Cost:
    """Of one row of bodies: processor times [s], bytes of generated C."""

    derive: float
    generate: float
    code: float
    compile: float
    rates: float


def measure(quick: bool, plots: Path) -> list[Row]:  # noqa: ARG001 - no diagram
    rounds, calls = (3, 2000) if quick else (41, 20_000)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        rows = _beside_pinocchio(Path(name), rounds, calls)
        rows += _arm_with_prescribed_axes(Path(name) / "arm")
        rows += _growth(Path(name) / "row", QUICK if quick else SIZES, rounds)
    return rows


def row_of_bodies(count: int, prescribed: Iterable[int] = (), *, free: bool = False) -> type[Linkage]:
    """Bodies on hinges at right angles to each other, the first one on the ground or free."""
    bodies, listed = [Body(**ROD) for _ in range(count)], set(prescribed)
    members: dict[str, Any] = {"__doc__": "Bodies in a row."} | {f"body_{i}": body for i, body in enumerate(bodies)}
    for i, (parent, child) in enumerate(zip([ground, *bodies], bodies, strict=False)):
        place: dict[str, Any] = {"at": (0, 0, 0.3), "rotation": ((-1) ** i * pi / 2, 0, 0)} if i else {}
        joint = Free(parent, child) if free and not i else Revolute(parent, child, prescribed=i in listed, **place)
        members[f"joint_{i}"] = joint
    return type("Row", (Linkage,), members)


# ---- right-hand sides ------------------------------------------------------------------------------------------------


def _beside_pinocchio(folder: Path, rounds: int, calls: int) -> list[Row]:
    try:
        pin: Any = import_module("pinocchio")
    except ImportError:
        print("multibody without Pinocchio, which is not installed: pip install pin", file=sys.stderr)
        return []
    subjects = {"seven joints": (row_of_bodies(7), _seven_joints(pin))}
    for name in ("ur5", "panda", "a1_leg"):
        file = ROBOTS / f"{name}.urdf"
        subjects[name] = Linkage.from_urdf(file), pin.buildModelFromUrdf(str(file))
    found = []
    for name, (linkage, theirs) in subjects.items():
        ours = _right_hand_side(assemble(linkage), folder / name)[0]
        runs = {
            "ours": partial(ours, calls),
            "pin": partial(_aba, pin, theirs, calls),
            "": partial(_aba, pin, pin.Model(), calls),
        }
        times = interleaved(runs, rounds)
        alone = [whole - call for whole, call in zip(times["pin"], times[""], strict=True)]
        asked = "<= 0.5" if name == "seven joints" else ""
        topic, unit = "Right-hand side", "µs"
        found.append(Row.of(topic, f"{name}: pin.aba", [1e6 * t for t in alone], unit))
        microseconds = [[1e6 * t for t in column] for column in (times["ours"], alone)]
        found.append(
            Row.of(topic, name, microseconds[0], unit, beside=microseconds[1], yardstick="pin.aba", asked=asked)
        )
    return found


def _seven_joints(pin: Any) -> Any:
    """Pinocchio's model of seven bodies in a row."""
    model, last = pin.Model(), 0
    for i in range(7):
        turn = pin.rpy.rpyToMatrix((-1) ** i * pi / 2 if i else 0.0, 0.0, 0.0)
        last = model.addJoint(
            last, pin.JointModelRZ(), pin.SE3(turn, np.array([0, 0, 0.3 if i else 0.0])), f"joint_{i}"
        )
        inertia = pin.Inertia(ROD["mass"], np.array(ROD["centre"]), np.diag(ROD["inertia"]))
        model.appendBodyToJoint(last, inertia, pin.SE3.Identity())
    return model


def _aba(pin: Any, model: Any, calls: int) -> float:
    """Seconds a call."""
    data, q, v, tau = model.createData(), pin.neutral(model), np.full(model.nv, 0.1), np.zeros(model.nv)
    aba, begin = pin.aba, time.process_time()
    for _ in range(calls):
        aba(model, data, q, v, tau)
    return (time.process_time() - begin) / calls


def _right_hand_side(model: Model, folder: Path) -> tuple[Callable[[int], float], float, float, int]:
    """Function of a number of calls to the seconds of one; seconds to generate and to compile the C, and its bytes."""
    folder.mkdir(parents=True)
    begin = time.process_time()
    code = source_files(model, GUID)
    generated = time.process_time() - begin
    for file, text in code.items():
        (folder / file).write_bytes(text)
    flags = [flag for flag in FLAGS if flag not in ("-fvisibility=hidden", "-shared")]
    flags += ["-D_GNU_SOURCE", "-I.", f"-I{BY_HAND}"]
    begin = _compilers()
    subprocess.run(["cc", *flags, "-c", "model.c"], cwd=folder, check=True)
    compiled = _compilers() - begin
    others = [path.name for path in folder.glob("*.c") if not path.name.startswith("fmi") and path.name != "model.c"]
    others += ["model.o", str(BY_HAND / "component.c")]
    subprocess.run(["cc", *flags, "-shared", *others, "-o", "component.so", "-lm"], cwd=folder, check=True)
    library = ctypes.CDLL(str(folder / "component.so"))
    library.component_rates.restype = ctypes.c_double
    # No input is 0: the shorter functions without them are not measured.
    starts = doubles(
        [x for v in model.parameters for x in v.starts] + [x or 0.1 for v in model.inputs for x in v.starts]
    )
    y, f = (doubles([0.0] * model.start.numel_out(0)) for _ in range(2))

    def rates(calls: int) -> float:
        library.begin(starts, y, f)
        return library.component_rates(y, f, ctypes.c_long(calls)) / calls

    return rates, generated, compiled, len(code["model.c"])


def _compilers() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


# ---- size and growth -------------------------------------------------------------------------------------------------


def _arm_with_prescribed_axes(folder: Path) -> list[Row]:
    """Seven joints, the second and the fifth prescribed, from declaration to machine code."""
    begin = time.process_time()
    model = assemble(row_of_bodies(7, (1, 4)))
    derived = time.process_time() - begin
    _, generated, compiled, size = _right_hand_side(model, folder)
    topic, arm = "Seven joints, two prescribed", "derive, generate, compile"
    third = len(source_files(model, GUID, "3")["model.c"])
    return [
        Row(topic, "C of all functions, FMI 2", size / 1000, "kB", asked="<= 600"),
        Row(topic, "C of all functions, FMI 3", third / 1000, "kB", asked="<= 600"),
        Row(topic, arm, derived + generated + compiled, "s", asked="<= 8"),
    ]


def _growth(folder: Path, sizes: Iterable[int], rounds: int) -> list[Row]:
    costs = {n: _cost(folder / str(n), n, rounds) for n in sizes}
    units, found = {"code": ("kB", 1e-3), "rates": ("µs", 1e6)}, []
    for field in fields(Cost):
        unit, scale = units.get(field.name, ("s", 1.0))
        values = [getattr(cost, field.name) for cost in costs.values()]
        for n, value in zip(costs, values, strict=True):
            found.append(Row("Bodies in a row", f"{field.name}, n = {n}", scale * value, unit))
        slope = float(np.polyfit(np.log(list(costs)), np.log(values), 1)[0])
        found.append(Row("Growth with the number of bodies, log-log slope", field.name, slope, "", asked="<= 1.1"))
    return found


def _cost(folder: Path, n: int, rounds: int) -> Cost:
    linkage = row_of_bodies(n, range(1, n, 3), free=True)
    begin = time.process_time()
    model = assemble(linkage)
    derived = time.process_time() - begin
    rates, generated, compiled, size = _right_hand_side(model, folder)
    return Cost(derived, generated, size, compiled, min(rates(1 + 20_000 // n) for _ in range(rounds)))


if __name__ == "__main__":
    command(measure)
