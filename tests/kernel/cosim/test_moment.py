"""A moment is the whole state of a run: each of its members comes back, and changes from step to step somewhere."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from making import FmuPaths, wired

from liaisons import Signal, System
from liaisons.cosim import Call
from liaisons.cosim.compiled import library as compiled
from liaisons.cosim.coupling.bus import Bus
from liaisons.cosim.running.loop import Loop

Made = tuple[System, dict[str, Any]]


def _driven(component: FmuPaths) -> Made:
    """A function that breaks where it says, and one that does not say it, into two pendulums."""
    system = wired("upper.bob -> lower.pivot", upper=component("Pendulum"), lower=component("Pendulum"))
    inputs = {
        "upper.theta_force": Signal(lambda t: float(t > 0.23), breaks=[0.23]),
        "upper.length": lambda t: (1 + 0.1 * abs(t - 0.31), 0.1 * np.sign(t - 0.31), 0.0),
    }
    return system, {"inputs": inputs}


def _impacts(component: FmuPaths) -> Made:
    ball = component("BouncingBall"), {"height_0": 0.05, "bounce": 0.5}
    return wired("table.x -> ball.table", ball=ball, table=(component("Oscillator"), {"x_0": 0.0})), {}


def _same(one: Any, other: Any) -> bool:
    """Whether two saved states are the same to the bit."""
    if isinstance(one, np.ndarray):
        return one.tobytes() == other.tobytes()
    if isinstance(one, list | tuple):
        return len(one) == len(other) and all(map(_same, one, other))
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(_same(one[key], other[key]) for key in one)
    return one is other or bool(one == other) or bool(one != one and other != other)  # noqa: PLR0124 - not a number


@pytest.mark.core
@pytest.mark.parametrize(
    ("make", "name", "changing"),
    [
        (_driven, "lower.theta_force", {"Loop", "Coupled", "Drive", "Memory", "Timeline", "Progress", "RunVariables"}),
        (_impacts, "table.x_force", {"Loop", "Coupled", "Progress", "RunVariables", "ImpactSteps"}),
    ],
)
def test_each_member_comes_back(
    component: FmuPaths, make: Callable[[FmuPaths], Made], name: str, changing: set[str]
) -> None:
    system, settings = make(component)
    with system.start(1.0, 0.05, **settings) as run:
        for k in range(3):
            run.step({name: 0.1 * k})
        first = run.save()
        for k in range(6):
            run.step({name: 0.3 + 0.1 * k})
        later = run.save()
        run.restore(first)
        again = run.save()
        owners = [type(owner).__name__ for owner in run._kernel.moments.owners]
        seen = {}
        for turn in range(2):
            run.restore(first)
            for k in range(6):
                run.step({name: 0.3 + 0.1 * k})
            seen[turn] = run.result.values
    assert _same(again.values, first.values)
    assert _same(seen[0], seen[1])
    assert [own for own, a, b in zip(owners, first.memories, again.memories, strict=True) if not _same(a, b)] == []
    changed = {own for own, a, b in zip(owners, first.memories, later.memories, strict=True) if not _same(a, b)}
    assert not _same(first.values, later.values)
    assert changing <= changed


@pytest.mark.core
def test_what_a_rejected_step_has_seen_is_forgotten(component: FmuPaths) -> None:
    """The worst error of the estimate is that of the steps that are kept."""
    system, _ = _driven(component)
    with system.start(1.0, error_tolerance=1e-5, tolerance=1e-8) as run:
        first = run.save()
        estimate: Any = run._observers.estimate
        run.finish()
        assert estimate.worst is not None
        run.restore(first)
        assert estimate.worst is None


@pytest.mark.core
def test_progress_comes_back(component: FmuPaths) -> None:
    """Why there is no next point, and errors between points, which only a run to its end knows."""
    with _driven(component)[0].start(0.4, 0.1) as run:
        first, progress = run.save(), run._kernel.progress
        progress.errors.append(1.0)
        progress.end = "an FMU has ended"
        run.restore(first)
        assert progress.errors == []
        run.step()
    assert run.time == pytest.approx(0.1)


def _counting_loop() -> Loop:
    """A loop on a bus of one value, which a step increases by one."""
    bus = Bus(["clock"], {}, [("clock", "ticks")], [], {})

    def tick() -> None:
        bus.values[0] += 1

    return Loop([Call(tick)], [], bus, capacity=2)


def _points(loop: Loop) -> list[tuple[float | None, ...]]:
    """Columns of the recorded points; None for what is not a number."""
    columns = loop.rows[:, 0], loop.times, loop.result_times, loop.after_break
    return [tuple(None if np.isnan(value) else value for value in c[: loop.done].tolist()) for c in columns]


@pytest.mark.core
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("language", ["C", "Python"])
def test_saved_points_are_those_of_a_list(language: str, seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Points that saved states share come back whatever has taken their places: the reference copies all of them."""
    if language == "Python":
        monkeypatch.setattr(compiled, "step_library", lambda **_: None)
    loop, random = _counting_loop(), np.random.default_rng(seed)
    saved: list[tuple[Any, list[tuple[float | None, ...]]]] = []

    loop.add(0.0, np.zeros(1), result_time=0.0)
    for _ in range(300):
        before = _points(loop)
        match random.choice(["advance", "add", "break", "truncate", "join", "save", "restore"]):
            case "advance":
                steps = int(random.integers(1, 5))
                loop.advance((loop.end + np.arange(1, steps + 1)).tolist(), in_result=bool(random.integers(2)))
                assert np.diff(loop.rows[loop.done - steps : loop.done, 0]).tolist() == [1.0] * (steps - 1)
                assert [column[:-steps] for column in _points(loop)] == before
            case "add":
                loop.add(loop.end + 0.5, random.random(1), after_break=bool(random.integers(2)))
                assert [column[:-1] for column in _points(loop)] == before
            case "break":
                loop.begin_piece(1e-3)
                assert loop.begins_piece
            case "truncate":
                kept = int(random.integers(1, loop.done + 1))
                loop.truncate(kept)
                assert _points(loop) == [column[:kept] for column in before]
            case "join" if loop.done > 3:
                loop.join(2, in_result=True)
                assert (loop.done, loop.end, loop.time) == (len(before[0]) - 1, before[1][-1], before[1][-1])
            case "save":
                saved.append((loop.save(), before))
            case "restore" if saved:
                state, kept_points = saved[int(random.integers(len(saved)))]
                loop.restore(state)
                assert _points(loop) == kept_points
        assert not loop.after_break[loop.done :].any()
    assert len(saved) > 20
