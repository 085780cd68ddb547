"""Arguments of wrong types, in every public function: our errors, in one line, never an AttributeError."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from liaisons import (
    Claims,
    LiaisonsError,
    Result,
    System,
    build,
    compare,
    crossings,
    ensemble,
    flatten,
    fmu_path,
    frequencies,
    grid,
    max_error,
    operator,
    sample,
    scenario,
    show,
    simulate,
    slope,
    sweep,
    table,
    verdict,
    within,
)
from liaisons.models import Constant, Pendulum

WRONG: list[Any] = [None, 5, b"x", ["x", 1], {"a": None}, {1: 2.0}, object(), np.zeros((2, 2)), lambda: 0, "x y"]
SPAN: dict[str, Any] = {"stop_time": 0.02, "step_size": 0.01}
MEMBERS: dict[str, Any] = {"values": {"theta_0": [0.1, 0.2]}, "backend": "numpy", "estimate": False, **SPAN}
CASES: dict[str, Any] = {"cases": {"theta_0": [0.1]}, "keep": "theta", **SPAN}


class Things(NamedTuple):
    """What the functions are called on."""

    fmu: Path
    system: System
    result: Result


@pytest.fixture(scope="module")
def things(shared_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Things]:
    folder = tmp_path_factory.mktemp("wrong")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setenv("LIAISONS_FMUS", str(folder / "fmus"))
        path = build(Pendulum, shared_folder)
        system = System("one")
        system.add("swing", path)
        result = Result("one", np.arange(2.0), ("y",), np.ones((1, 2)), {"y": "m"})
        yield Things(path, system, result)


NONE, NUMBER, TEXT, ARRAY, FUNCTION = (type(None), int), int, str, np.ndarray, type(lambda: 0)
CALLS: dict[str, tuple[Callable[[Things, Any], object], Any]] = {
    # what is called with a wrong value, and the types of those above that are right
    "simulate": (lambda _, w: simulate(w), ()),
    "simulate stop_time": (lambda x, w: simulate(x.fmu, stop_time=w, step_size=0.01), NONE),
    "simulate step_size": (lambda x, w: simulate(x.fmu, stop_time=0.02, step_size=w), NONE),
    "simulate start_time": (lambda x, w: simulate(x.fmu, **SPAN, start_time=w), NONE),
    "simulate times": (lambda x, w: simulate(x.fmu, times=w), type(None)),
    "simulate tolerance": (lambda x, w: simulate(x.fmu, **SPAN, tolerance=w), NONE),
    "simulate record": (lambda x, w: simulate(x.fmu, **SPAN, record=w), type(None)),
    "simulate record=[]": (lambda x, w: simulate(x.fmu, **SPAN, record=[w]), ()),
    "simulate inputs": (lambda x, w: simulate(x.fmu, **SPAN, inputs=w), type(None)),
    "simulate inputs of a name": (lambda x, w: simulate(x.fmu, **SPAN, inputs={"length": w}), ()),
    "simulate theta_0": (lambda x, w: simulate(x.fmu, **SPAN, theta_0=w), NUMBER),
    "System": (lambda _, w: System(w), TEXT),
    "add name": (lambda x, w: System("new").add(w, x.fmu), TEXT),
    "add fmu": (lambda _, w: System("new").add("a", w), ()),
    "connect": (lambda x, w: x.system.connect(w, x.system.parts["swing"]["length"]), ()),
    "end": (lambda x, w: x.system.parts["swing"][w], ()),
    "System.simulate stop_time": (lambda x, w: x.system.simulate(w, 0.01), NUMBER),
    "System.simulate step_size": (lambda x, w: x.system.simulate(0.02, w), NUMBER),
    "System.simulate start_time": (lambda x, w: x.system.simulate(0.02, 0.01, start_time=w), NONE),
    "System.simulate times": (lambda x, w: x.system.simulate(times=w), ()),
    "System.simulate record": (lambda x, w: x.system.simulate(0.02, 0.01, record=w), type(None)),
    "System.simulate inputs": (lambda x, w: x.system.simulate(0.02, 0.01, inputs=w), type(None)),
    "System.simulate coupling": (lambda x, w: x.system.simulate(0.02, 0.01, coupling=w), type(None)),
    "System.simulate error_tolerance": (lambda x, w: x.system.simulate(0.02, 0.01, error_tolerance=w), NONE),
    "write_ssp": (lambda x, w: x.system.write_ssp(w), TEXT),
    "write_ssp form": (lambda x, w: x.system.write_ssp("x.ssp", form=w), ()),
    "write_ssp stop_time": (lambda x, w: x.system.write_ssp("x.ssp", stop_time=w), NONE),
    "from_ssp": (lambda _, w: System.from_ssp(w), ()),
    "flatten": (lambda _, w: flatten(w), ()),
    "flatten output": (lambda x, w: x.system.flatten(w, backend="python"), (str, type(None))),
    "build": (lambda _, w: build(w), ()),
    "build output": (lambda _, w: build(Constant, w, backend="python"), (str, type(None))),
    "build backend": (lambda _, w: build(Constant, backend=w), ()),
    "build platforms": (lambda _, w: build(Constant, platforms=w), ()),
    "build fmi": (lambda _, w: build(Constant, fmi=w), ()),
    "fmu_path": (lambda _, w: fmu_path(w), ()),
    "fmu_path backend": (lambda _, w: fmu_path("Constant", w), ()),
    "fmu_path n": (lambda _, w: fmu_path("PendulumChain", n=w), NUMBER),
    "grid": (lambda _, w: grid(w), ()),
    "grid values": (lambda _, w: grid({"a": w}), NUMBER),
    "sample count": (lambda _, w: sample(w, {"a": (0, 1)}, seed=1), NUMBER),
    "sample over": (lambda _, w: sample(2, w, seed=1), ()),
    "sample distribution": (lambda _, w: sample(2, {"a": w}, seed=1), ()),
    "sample seed": (lambda _, w: sample(2, {"a": (0, 1)}, seed=w), NUMBER),
    "show": (lambda _, w: show(w), ()),
    "show path": (lambda x, w: show(x.fmu, w), (str, type(None))),
    "show theta_0": (lambda x, w: show(x.fmu, "x.html", theta_0=w), NUMBER),
    "sweep": (lambda _, w: sweep(w, {"theta_0": [0.1]}, "theta"), ()),
    **{
        f"sweep {name}": (lambda x, w, name=name: sweep(x.fmu, **CASES | {name: w}), right)
        for name, right in {
            "cases": (),
            "keep": (),
            "stop_time": NONE,
            "step_size": NONE,
            "start_time": NONE,
            "tolerance": NONE,
            "coupling": type(None),
            "starts": type(None),
            "record": type(None),
            "journal": (str, type(None)),
            "workers": NONE,
            "client": (str, type(None)),
        }.items()
    },
    "ensemble": (lambda _, w: ensemble(w, **MEMBERS), ()),
    **{
        f"ensemble {name}": (lambda _, w, name=name: ensemble("Pendulum", **MEMBERS | {name: w}), right)
        for name, right in {
            "values": (),
            "stop_time": NUMBER,
            "step_size": NUMBER,
            "samples": NUMBER,
            "start_time": int,
            "method": (),
            "operators": type(None),
            "record": type(None),
            "threads": NONE,
            "backend": (),
        }.items()
    },
    "ensemble operator": (lambda _, w: ensemble("Pendulum", **MEMBERS, operators={"length": w}), ()),
    "compare": (lambda x, w: compare(x.result, w), ()),
    "compare first": (lambda x, w: compare(w, x.result), ()),
    "max_error": (lambda _, w: max_error(w, [1.0]), ()),
    "max_error reference": (lambda _, w: max_error([1.0], w), NUMBER),
    "slope": (lambda _, w: slope(w, [1.0, 2.0, 3.0]), ()),
    "slope floor": (lambda _, w: slope([1.0, 2.0, 3.0], [1.0, 2.0, 3.0], floor=w), ()),
    "verdict error": (lambda _, w: verdict("claim", error=w, tolerance=1.0), NUMBER),
    "verdict tolerance": (lambda _, w: verdict("claim", error=1.0, tolerance=w), NUMBER),
    "table": (lambda _, w: table(w), ()),
    "scenario": (lambda _, w: scenario(w), FUNCTION),
    "within": (lambda _, w: within(w, because="it is a number"), int),
    "claim": (lambda _, w: Claims()("claim", w, 1.0, within(1.0, because="it is a number")), (int, ARRAY)),
    "crossings": (lambda _, w: crossings(w, [1.0, 2.0], [1.0, 2.0]), ()),
    "frequencies": (lambda _, w: frequencies(w, 0.1), ARRAY),
    "operator": (lambda _, w: operator(w), ()),
    "operator value": (lambda x, w: simulate(x.fmu, **SPAN, length=operator("Sinusoid", offset=w)), int),
    "result": (lambda x, w: x.result[w], ()),
    "to_csv": (lambda x, w: x.result.to_csv(w), TEXT),
    "from_csv": (lambda _, w: Result.from_csv(w), ()),
    "to_parquet": (lambda x, w: x.result.to_parquet(w), TEXT),
    "from_parquet": (lambda _, w: Result.from_parquet(w), ()),
    "plot": (lambda x, w: x.result.plot(w, path="x.png"), ()),
    "plot path": (lambda x, w: x.result.plot(path=w), (str, type(None))),
}


@pytest.mark.parametrize("name", CALLS)
def test_wrong_types_are_our_errors_in_one_line(things: Things, name: str) -> None:
    call, right = CALLS[name]
    for value in WRONG:
        if isinstance(value, right):
            continue
        with pytest.raises(LiaisonsError) as caught:
            call(things, value)
        assert "\n" not in str(caught.value), name


def test_an_empty_system_is_an_error(tmp_path: Path) -> None:
    empty = System("nothing")
    for call in (lambda: empty.simulate(1.0, 0.1), lambda: empty.write_ssp(tmp_path / "a.ssp"), lambda: flatten(empty)):
        with pytest.raises(LiaisonsError, match=r"^nothing is empty; add\(\) an FMU first$"):
            call()
    with pytest.raises(LiaisonsError, match="nothing is empty"):
        sweep(empty, {"a.x": [1.0]}, "a.y", **SPAN)
    assert list(tmp_path.iterdir()) == []
