"""Motions through knots: those of the parameters, and a table of any length in the resources, which replaces them."""

from __future__ import annotations

import re
import struct
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from driver import CO_SIMULATION, MODEL_EXCHANGE, Instance, Library
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import BPoly

from liaisons import System, tabulated
from liaisons.errors import SimulationError
from liaisons.fmu.code import model_code
from liaisons.interface import MOST_KNOTS
from liaisons.mechanics import assemble
from liaisons.models import ForceRegulator, PlannedMotion, Sinusoid
from liaisons_exchange import ssp

NAMES = ("instant", "value", "rate", "acceleration")
TRIPLE = ("y", "y_dot", "y_ddot")


def knots(count: int, *, jumps: bool = True) -> NDArray:
    """Random ones, (4, count), every seventh a jump."""
    random = np.random.default_rng(count)
    steps = random.uniform(0.1, 1.0, count)
    steps[7::7] *= not jumps
    return np.vstack([np.cumsum(steps), random.normal(size=(3, count))])


def exact(t: float, table: NDArray) -> list[float]:
    """Bernstein's polynomial through the two knots around t, of SciPy."""
    ends = table[0]
    forward = np.flatnonzero(np.diff(ends) > 0)
    k = forward[max(np.searchsorted(ends[forward], t, side="right") - 1, 0)]
    piece = BPoly.from_derivatives(ends[k : k + 2], table[1:, k : k + 2].T)
    return [float(piece(t, order)) for order in range(3)]


@pytest.fixture(params=["fmi2", "fmi3"])
def planned(library: Callable[..., Library], request: pytest.FixtureRequest) -> Library:
    return library(PlannedMotion, request.param)


def with_table(planned: Library, folder: Path, table: NDArray, kind: str = CO_SIMULATION, **options: bool) -> Instance:
    bits = " ".join(struct.pack(">d", number).hex() for number in table.ravel())
    (folder / "starts.txt").write_text(f"t 0 {table.size} {bits} table\n")
    return planned.instantiate(kind, token=f"{planned.token}-0123456789abcdef", resources=folder, **options)


def columns(planned: Library, table: NDArray) -> dict[str, NDArray]:
    padded = np.pad(table, ((0, 0), (0, MOST_KNOTS - table.shape[1])), mode="edge")
    if planned.fmi == "3":
        return dict(zip(NAMES, padded, strict=True))
    return {f"{name}[{i}]": x for name, row in zip(NAMES, padded, strict=True) for i, x in enumerate(row, start=1)}


@pytest.mark.parametrize("count", [30, MOST_KNOTS, 333])
def test_values_between_knots_and_beyond(planned: Library, tmp_path: Path, count: int) -> None:
    table = knots(count)
    instance = with_table(planned, tmp_path, table) if count > MOST_KNOTS else planned.instantiate()
    if count <= MOST_KNOTS:
        instance.set(columns(planned, table))
    instance.initialize()
    instance.exit_initialization()
    times = np.sort(np.append(np.random.default_rng(1).uniform(0, table[0, -1] + 0.5, 100), table[0]))
    now = 0.0
    for t in times:
        if t > now:
            instance.step(now, t - now)
        now = t
        found = instance.get(*TRIPLE)
        # two orders of evaluation: roundings of terms of size 100/h²
        np.testing.assert_allclose(found, exact(t, table), rtol=0, atol=1e-10, err_msg=f"t = {t}")
        assert instance.output_derivatives("y") == pytest.approx(found[1], abs=1e-9)


def test_knots_are_time_events(planned: Library, tmp_path: Path) -> None:
    table = knots(150)
    instance = with_table(planned, tmp_path, table, MODEL_EXCHANGE)
    instance.initialize()
    instance.exit_initialization()
    expected = np.unique(table[0])
    seen = [instance.go_on().next_time]
    while seen[-1] is not None:
        instance.do("SetTime", seen[-1])
        instance.do("EnterEventMode")
        seen.append(instance.go_on().next_time)
    np.testing.assert_array_equal(seen[:-1], expected)


@pytest.mark.parametrize("from_file", [False, True])
def test_steps_end_early_at_every_knot(library: Callable[..., Library], from_file: bool, tmp_path: Path) -> None:
    planned, table = library(PlannedMotion, "fmi3"), knots(20)
    options: dict[str, Any] = {"events": True, "early": True}
    instance = with_table(planned, tmp_path, table, **options) if from_file else planned.instantiate(**options)
    instance.initialize()
    if not from_file:
        instance.set(columns(planned, table))
    instance.exit_initialization()
    assert instance.go_on().next_time == table[0, 0]
    seen, now = [], 0.0
    while now < table[0, -1] + 1:
        step = instance.advance(now, 20.0 - now)
        now = step.time
        if step.event:
            seen.append(now)
            instance.do("EnterEventMode")
            instance.go_on()
    np.testing.assert_array_equal(seen, np.unique(table[0]))


def test_the_next_event_is_announced(planned: Library, tmp_path: Path) -> None:
    instants = np.sort(np.append(np.linspace(0.0, 10.0, 501), 1.0))  # one of them twice
    instance = with_table(planned, tmp_path, np.vstack([instants, np.sin(instants), np.cos(instants), -instants]))
    instance.initialize()
    instance.exit_initialization()
    seen = [instance["next_event_time"]]
    for t, size in ((0.0, 1.0), (1.0, 1.0), (2.0, 7.0), (9.0, 1.0)):
        instance.step(t, size)
        seen.append(instance["next_event_time"])
    assert seen == [*instants[[1, 52, 102, 452]], sys.float_info.max]


def test_derivatives_by_knots_are_differences_and_forth_and_back_agree(planned: Library) -> None:
    table = knots(20, jumps=False)
    instance = planned.instantiate()
    given = columns(planned, table)
    instance.set(given)
    instance.initialize(start=float(table[0, 9] + 0.03))
    direction = columns(planned, np.random.default_rng(2).normal(size=table.shape))
    derivative, h = instance.directional(TRIPLE, direction), 1e-6
    ends = []
    for way in (h, -h):
        instance.set({name: given[name] + way * direction[name] for name in given})
        ends.append(instance.get(*TRIPLE))
    np.testing.assert_allclose(derivative, (ends[0] - ends[1]) / (2 * h), rtol=1e-6, atol=1e-4)
    if planned.fmi == "3":
        instance.set(given)
        weights: dict[str, ArrayLike] = dict(zip(TRIPLE, (0.3, -0.2, 0.1), strict=True))
        back = instance.adjoint(weights, list(given))
        flat = np.concatenate([np.ravel(column) for column in direction.values()])
        assert back @ flat == pytest.approx(instance.directional(TRIPLE, direction) @ [0.3, -0.2, 0.1], rel=1e-12)


WRONG = {
    "odd": (np.ones(7), "a table of 7 numbers: PlannedMotion takes 4 columns of 2 rows at least"),
    "short": (np.ones((4, 1)), "a table of 4 numbers: PlannedMotion takes 4 columns of 2 rows at least"),
    "back": (np.array([[0, 1, 0.5], *np.ones((3, 3))]), "row 3 of the table: 0.5 after 1: its first column"),
    "infinite": (np.array([[0, 1], [0, np.nan], [0, 0], [0, 0]]), "row 2 of the table: nan: finite numbers only"),
}


def test_adjoint_derivatives_of_a_table_with_zeros_in_its_rows() -> None:
    """A sampled force depends on few columns of its rows, of which FMI 3.0 has all derivatives."""
    code = model_code(assemble(ForceRegulator), "{0}", "3")
    assert "calculate_reverse" in code
    cleared = set(re.findall(r"j\+\+\) results\[(\d+)\]\[j\] = 0;", code))  # then written where they are not 0
    assert any(re.search(rf"results\[{result}\]\[\d+ \+ \d+\] = ", code) for result in cleared)


@pytest.mark.parametrize("case", WRONG)
def test_a_bad_table_is_refused_in_one_line(planned: Library, tmp_path: Path, case: str) -> None:
    table, words = WRONG[case]
    instance = with_table(planned, tmp_path, table)
    assert not instance.pointer
    (message,) = instance.messages
    assert message.startswith(words)


def test_the_file_of_start_values_is_closed(planned: Library, tmp_path: Path) -> None:
    """Looked up where Linux lists the open files of a process."""
    assert with_table(planned, tmp_path, knots(10)).pointer
    assert tmp_path / "starts.txt" not in [path.resolve() for path in Path("/proc/self/fd").glob("*")]


def test_other_components_take_no_table(library: Callable[..., Library], tmp_path: Path) -> None:
    instance = with_table(library(Sinusoid), tmp_path, knots(10))
    assert not instance.pointer
    (message,) = instance.messages
    assert message.startswith("a table of 40 numbers: Sinusoid takes 0 columns")


def test_an_fmu_in_python_takes_no_table(fmu: Callable[..., Path]) -> None:
    with pytest.raises(SimulationError, match=r"PlannedMotion\.fmu: 120 knots need a native FMU"):
        ssp.fmu_with_table(fmu(PlannedMotion, backend="python"), knots(120))


def test_a_table_goes_through_an_archive_and_into_no_flat_system(tmp_path: Path) -> None:
    """Two of them in one archive are two FMUs, and a start value beside a table leaves it."""
    t = np.linspace(0, 2, 151)
    system = System("tables")
    moves: Any = {"length": tabulated(t, 1 + 0.1 * np.sin(t)), "pivot_x": tabulated(t, np.cos(t))}
    system.add("swing", "Pendulum", **moves)
    system.write_ssp(tmp_path / "tables.ssp", stop_time=2.0, step_size=0.1)
    again = System.from_ssp(tmp_path / "tables.ssp")
    result = again.simulate(2.0, 0.1)
    # the spline's own error, 0.1 (t/h)⁶
    np.testing.assert_allclose(result["swing.length"], 1 + 0.1 * np.sin(result.time), rtol=0, atol=1e-11)
    np.testing.assert_allclose(result["swing.pivot_x"], np.cos(result.time), rtol=0, atol=1e-13)
    with pytest.raises(SimulationError, match="has its motion in a file"):
        again.flatten()
