"""Arguments of wrong types, in every public function: our errors, in one line, never an AttributeError."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from typing import Any, NamedTuple

import numpy as np
import pytest

import liaisons
from liaisons import (
    LiaisonsError,
    Result,
    System,
    build,
    compare,
    crossings,
    ensemble,
    errors,
    flatten,
    fmu_path,
    frequencies,
    grid,
    hamiltonian_flow,
    hold,
    identify,
    max_error,
    observe,
    operator,
    plan,
    sample,
    show,
    simulate,
    start,
    sweep,
    verdict,
)
from liaisons.check import slope, table
from liaisons.cosim import Settings
from liaisons.models import Constant, Pendulum
from liaisons_tools.scenarios import Claims, scenario, within

WRONG: list[Any] = [None, 5, b"x", ["x", 1], {"a": None}, {1: 2.0}, object(), np.zeros((2, 2)), lambda: 0, "x y"]
SPAN: dict[str, Any] = {"stop_time": 0.02, "step_size": 0.01}
MEMBERS: dict[str, Any] = {"start_values": {"theta_0": [0.1, 0.2]}, "estimate": False, **SPAN}
UNKNOWN: dict[str, Any] = {"unknown": ["length"]}
MEASURED: dict[str, Any] = {"time": [0.0, 0.1, 0.2], "theta": [0.1, 0.09, 0.08]}
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


NOTHING = type(None)
NONE, NUMBER, TEXT, ARRAY, FUNCTION = (NOTHING, int), int, str, np.ndarray, type(lambda: 0)
PATH = (str, NOTHING)
Call = Callable[[Things, Any], object]


def keywords(label: str, call: Callable[..., object], **right: Any) -> dict[str, tuple[Call, Any]]:
    """Calls with one wrong keyword each."""
    return {f"{label} {name}": (lambda x, w, n=name: call(x, **{n: w}), types) for name, types in right.items()}


CALLS: dict[str, tuple[Call, Any]] = {
    # what is called with a wrong value, and the types of those above that are right
    "simulate": (lambda _, w: simulate(w), ()),
    **keywords(
        "simulate", lambda x, **w: simulate(x.fmu, **SPAN | w), stop_time=NONE, step_size=NONE, start_time=NONE,
        tolerance=NONE, record=NOTHING, inputs=NOTHING, theta_0=NUMBER, start_values=NOTHING,
    ),
    "simulate times": (lambda x, w: simulate(x.fmu, times=w), NOTHING),
    "simulate record=[]": (lambda x, w: simulate(x.fmu, **SPAN, record=[w]), ()),
    "simulate inputs of a name": (lambda x, w: simulate(x.fmu, **SPAN, inputs={"length": w}), ()),
    "System": (lambda _, w: System(w), TEXT),
    "add name": (lambda x, w: System("new").add(w, x.fmu), TEXT),
    "add fmu": (lambda _, w: System("new").add("a", w), ()),
    "connect": (lambda x, w: x.system.connect(w, x.system.parts["swing"]["length"]), ()),
    "end": (lambda x, w: x.system.parts["swing"][w], ()),
    **keywords(
        "System.simulate", lambda x, **w: x.system.simulate(**SPAN | w), stop_time=NUMBER, step_size=NONE,
        start_time=NONE, record=NOTHING, inputs=NOTHING, coupling=NOTHING, error_tolerance=NONE,
    ),
    "System.simulate times": (lambda x, w: x.system.simulate(times=w), ()),
    "write_ssp": (lambda x, w: x.system.write_ssp(w), TEXT),
    **keywords("write_ssp", lambda x, **w: x.system.write_ssp("x.ssp", **w), form=(), stop_time=NONE),
    "from_ssp": (lambda _, w: System.from_ssp(w), ()),
    "flatten": (lambda _, w: flatten(w), ()),
    "flatten output": (lambda x, w: x.system.flatten(w, backend="python"), PATH),
    "build": (lambda _, w: build(w), ()),
    "build output": (lambda _, w: build(Constant, w, backend="python"), PATH),
    **keywords("build", lambda _, **w: build(Constant, **w), backend=(), platforms=(), fmi=()),
    "fmu_path": (lambda _, w: fmu_path(w), ()),
    "fmu_path backend": (lambda _, w: fmu_path("Constant", w), ()),
    "fmu_path n": (lambda _, w: fmu_path("PendulumChain", n=w), NUMBER),
    "grid": (lambda _, w: grid(w), ()),
    "grid values": (lambda _, w: grid({"a": w}), NUMBER),
    **keywords(
        "sample", lambda _, **w: sample(**{"count": 2, "over": {"a": (0, 1)}, "seed": 1} | w), count=NUMBER, over=(),
        seed=NUMBER,
    ),
    "sample distribution": (lambda _, w: sample(2, {"a": w}, seed=1), ()),
    "show": (lambda _, w: show(w), ()),
    "show path": (lambda x, w: show(x.fmu, w), PATH),
    "show start_values": (lambda x, w: show(x.fmu, "x.html", start_values=w), NOTHING),
    "show theta_0": (lambda x, w: show(x.fmu, "x.html", theta_0=w), NUMBER),
    "sweep": (lambda _, w: sweep(w, {"theta_0": [0.1]}, "theta"), ()),
    **keywords(
        "sweep", lambda x, **w: sweep(x.fmu, **CASES | w), cases=(), keep=(), stop_time=NONE, step_size=NONE,
        start_time=NONE, tolerance=NONE, coupling=NOTHING, start_values=NOTHING, record=NOTHING, journal=PATH,
        workers=NONE, client=PATH,
    ),
    "ensemble": (lambda _, w: ensemble(w, **MEMBERS), ()),
    **keywords(
        "ensemble", lambda _, **w: ensemble("Pendulum", **MEMBERS | w), start_values=(), stop_time=NUMBER,
        step_size=NUMBER, samples=NUMBER, start_time=int, method=NONE, operators=NOTHING, record=NOTHING,
        threads=NONE,
    ),
    "ensemble operator": (lambda _, w: ensemble("Pendulum", **MEMBERS, operators={"length": w}), ()),
    "identify": (lambda _, w: identify(w, MEASURED, ["length"]), ()),
    "identify data": (lambda _, w: identify("Pendulum", w, ["length"]), ()),
    **keywords(
        "identify", lambda _, **w: identify("Pendulum", MEASURED, **UNKNOWN | w), unknown=(),
        noise=NONE, each=(), bounds=NOTHING, prior=NOTHING, loss=(), operators=NOTHING, measured=NOTHING,
        ignore=(str,), smoothing=NONE, start_time=NONE, segments=NONE, tolerance=NUMBER, start_values=NOTHING,
        length=NUMBER,
    ),
    "identify bound": (lambda _, w: identify("Pendulum", MEASURED, ["length"], bounds={"length": w}), ()),
    "identify prior": (lambda _, w: identify("Pendulum", MEASURED, ["length"], prior={"length": w}), ()),
    "compare": (lambda x, w: compare(x.result, w), ()),
    "compare first": (lambda x, w: compare(w, x.result), ()),
    "max_error": (lambda _, w: max_error(w, [1.0]), ()),
    "max_error reference": (lambda _, w: max_error([1.0], w), NUMBER),
    "slope": (lambda _, w: slope(w, [1.0, 2.0, 3.0]), ()),
    "verdict error": (lambda _, w: verdict("claim", error=w, tolerance=1.0), NUMBER),
    "verdict tolerance": (lambda _, w: verdict("claim", error=1.0, tolerance=w), NUMBER),
    "table": (lambda _, w: table(w), ()),
    "scenario": (lambda _, w: scenario(w), FUNCTION),
    "within": (lambda _, w: within(w, because="it is a number"), int),
    "claim": (lambda _, w: Claims()("claim", w, 1.0, within(1.0, because="it is a number")), (int, ARRAY)),
    "crossings": (lambda _, w: crossings(w, [1.0, 2.0], [1.0, 2.0]), ()),
    "frequencies": (lambda _, w: frequencies(w, 0.1), ARRAY),
    "hamiltonian_flow": (lambda _, w: hamiltonian_flow(lambda q, p: q * p, w, 1.0), ()),
    "hamiltonian_flow times": (lambda _, w: hamiltonian_flow(lambda q, p: q * p, [1.0, 0.0], w), NUMBER),
    "operator": (lambda _, w: operator(w), ()),
    "operator value": (lambda x, w: simulate(x.fmu, **SPAN, length=operator("Sinusoid", offset=w)), int),
    "result": (lambda x, w: x.result[w], ()),
    "to_csv": (lambda x, w: x.result.to_csv(w), TEXT),
    "from_csv": (lambda _, w: Result.from_csv(w), ()),
    "to_parquet": (lambda x, w: x.result.to_parquet(w), TEXT),
    "from_parquet": (lambda _, w: Result.from_parquet(w), ()),
    "plot": (lambda x, w: x.result.plot(w, path="x.png"), ()),
    "plot axes": (lambda x, w: x.result.plot("theta", axes=w), ()),
    "plot path": (lambda x, w: x.result.plot(path=w), PATH),
}  # fmt: skip


@pytest.mark.parametrize("name", CALLS)
def test_wrong_types_are_our_errors_in_one_line(things: Things, name: str) -> None:
    call, right = CALLS[name]
    for value in WRONG:
        if isinstance(value, right):
            continue
        with pytest.raises(LiaisonsError) as caught:
            call(things, value)
        assert "\n" not in str(caught.value), name


@pytest.fixture(scope="module")
def objects(things: Things) -> Iterator[dict[str, Any]]:
    """An object of each public class that has methods."""
    from liaisons_motion.gymnasium import Environment

    upright = {"theta": np.pi, "pivot_x": 0.0}
    task: dict[str, Any] = {"observe": ["theta"], "act": {"pivot_x_ddot": (-5, 5)}, "reward": "1", "step_size": 0.02}
    with start(things.fmu, step_size=0.1) as run:
        run.step()
        environment = Environment("Pendulum", **task)
        environment.reset()
        yield {
            "System": things.system,
            "Run": run,
            "Result": things.result,
            "Plan": plan("Oscillator", ["support"], start={"x": 0}, end={"x": 1.0}, duration=2.0),
            "Controller": hold("Pendulum", upright, "pivot_x", step_size=0.02),
            "Observer": observe("Pendulum", "theta", {"theta": 0.01}, {"theta_force": 0.1}, at={"theta": 0}),
            "Environment": environment,
        }
        environment.close()


NOT_TRIED = {
    "Run.start": "with_start_values() makes its argument",
    "Run.finish": "simulate() calls it",
    "Run.conclude_or_divide": "likewise",
    "System.flatten": "tried above; each try may build",
    "Result.animate": "draws for seconds",
    "Result.plot": "tried above",
    "Controller.survives": "simulates for seconds",
    "Controller.verify": "likewise",
    "Observer.random_runs": "likewise",
    "Observer.consistency": "takes what random_runs() returns",
    "Plan.animate": "draws for seconds",
    "Plan.verify": "simulates for seconds",
}


@pytest.mark.parametrize("kind", ["System", "Run", "Result", "Plan", "Controller", "Observer", "Environment"])
def test_methods_say_which_argument_is_wrong(objects: dict[str, Any], kind: str) -> None:
    """Each value in each argument of each method: it is taken, or refused by a sentence that names something."""
    subject, said = objects[kind], list[str]()
    for name, method in inspect.getmembers(type(subject), callable):
        public = (not name.startswith("_") or name == "__getitem__") and f"{kind}.{name}" not in NOT_TRIED
        if not public or not (method.__module__ or "").startswith("liaisons") or name == "close":
            continue
        call = getattr(subject, name)
        parameters = inspect.signature(call).parameters
        arguments = [p for p in parameters.values() if p.kind != p.VAR_KEYWORD]
        if "settings" in parameters:  # which are typed
            only, own = inspect.Parameter.KEYWORD_ONLY, Settings.__annotations__
            arguments += [inspect.Parameter(setting, only, default=None) for setting in own]
        needed = [
            p for p in arguments if p.default is p.empty and p.kind in {p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD}
        ]
        for argument in arguments:
            for value in WRONG:
                before = [value if p is argument else "theta" for p in needed]
                by_place = argument in needed or argument.kind in {argument.POSITIONAL_ONLY, argument.VAR_POSITIONAL}
                before += [value] * (by_place and argument not in needed)
                try:
                    call(*before, **({} if by_place else {argument.name: value}))
                except LiaisonsError as error:
                    said += [f"{name}({argument.name}={value!r}): two lines"] * ("\n" in str(error))
                except Exception as error:  # noqa: BLE001 - what is looked for
                    is_sentence = isinstance(error, (TypeError, ValueError)) and argument.name in str(error)
                    said += [f"{name}({argument.name}={value!r}): {error!r}"] * (not is_sentence)
                if kind == "Run":
                    subject._clock = None  # no waiting for a pace that was taken
    assert said == []


def test_an_empty_system_is_an_error(tmp_path: Path) -> None:
    empty = System("nothing")
    for call in (lambda: empty.simulate(1.0, 0.1), lambda: empty.write_ssp(tmp_path / "a.ssp"), lambda: flatten(empty)):
        with pytest.raises(LiaisonsError, match=r"^nothing is empty; add\(\) an FMU first$"):
            call()
    with pytest.raises(LiaisonsError, match="nothing is empty"):
        sweep(empty, {"a.x": [1.0]}, "a.y", **SPAN)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "name", ["simulate stop_time", "System.simulate coupling", "simulate theta_0", "sweep workers"]
)
def test_wrong_values_are_value_errors(things: Things, name: str) -> None:
    with pytest.raises(ValueError, match=name.rsplit(maxsplit=1)[-1]):
        CALLS[name][0](things, "x y")


def test_all_errors_are_in_one_module() -> None:
    defined = {name for name, value in vars(errors).items() if isinstance(value, type)}
    for module in walk_packages(liaisons.__path__, "liaisons."):
        if ".runtime" not in module.name and ".python_runtime" not in module.name:
            for name, value in vars(import_module(module.name)).items():
                is_error = isinstance(value, type) and issubclass(value, (LiaisonsError, KeyboardInterrupt))
                assert not is_error or name in {*defined, "KeyboardInterrupt"}, f"{module.name}.{name}"
