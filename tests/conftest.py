"""What tests of several folders share."""

from __future__ import annotations

import os
import platform
import re
import shutil
import signal
import sys
import tomllib
from collections.abc import Callable, Generator, Iterator
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeVar

import casadi as ca
import numpy as np
import pytest

from liaisons.fmu import build
from liaisons.mechanics import Equations, assemble

_SYMBOLIC = {
    *("kernel/expressions", "kernel/language", "kernel/mechanics", "kernel/test_units.py"),
    *("motion/analysis", "pages/formulas"),
}
_SKIPS = tomllib.loads((Path(__file__).parent / "skips.toml").read_text(encoding="utf-8"))["skip"]
_SLOW_SECONDS = 1200  # for a slow test; pyproject.toml has the time of the others
_QUICK, _CORE = 12, 1  # variants of a function that are not slow, and those of them in the core suite
_ALLOWANCE = 2.0  # seconds of processor time of a test in the core suite, with what it is the first to build
_BEGIN = pytest.StashKey[float]()

Report = TypeVar("Report", pytest.TestReport, pytest.CollectReport)


def pytest_configure(config: pytest.Config) -> None:
    """``pytest`` runs the core suite; who names files, a word (-k) or marks (-m) gets what they name."""
    config.addinivalue_line("markers", "core: the first quick variant of a function; set here, not by hand")
    config.addinivalue_line(
        "markers", "variants(quick=12, core=1): how many variants of a function are not slow, and core"
    )
    if config.args_source is config.ArgsSource.TESTPATHS and not config.option.markexpr and not config.option.keyword:
        config.option.markexpr = "core"


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Say which variants of a function are slow and which are core; ``symbolic`` is what builds nothing."""
    functions: dict[str, list[pytest.Item]] = {}
    for item in items:
        functions.setdefault(item.nodeid.partition("[")[0], []).append(item)
    for variants in functions.values():
        _mark_variants(variants)
    for item in items:
        builds = any(name.startswith("tmp_path") for name in getattr(item, "fixturenames", ()))
        slow = item.get_closest_marker("slow") is not None
        if "/".join(item.path.relative_to(Path(__file__).parent).parts[:2]) in _SYMBOLIC and not builds and not slow:
            item.add_marker("symbolic")
        if slow and item.get_closest_marker("timeout") is None:
            item.add_marker(pytest.mark.timeout(_SLOW_SECONDS))


def _mark_variants(variants: list[pytest.Item]) -> None:
    """Mark the variants of one function by its ``@pytest.mark.variants(quick=12, core=1)``, whose defaults these are.

    Of ``quick`` variants as many values of each parameter as possible stay among the quick ones (None: all stay), the
    others are slow; the first ``core`` of them, or the one with this id, are core.
    """
    limits: dict[str, Any] = {"quick": _QUICK, "core": _CORE}
    for marker in variants[0].iter_markers("variants"):
        limits |= marker.kwargs
    quick = [item for item in variants if item.get_closest_marker("slow") is None]
    core = limits["core"]
    if isinstance(core, str):
        quick.sort(key=lambda item: not item.nodeid.endswith(f"[{core}]"))
        core = 1
    kept = _spread(quick, len(quick) if limits["quick"] is None else limits["quick"])
    for item in quick:
        if item not in kept:
            item.add_marker("slow")
    for item in kept[:core]:
        item.add_marker("core")


def _spread(variants: list[pytest.Item], count: int) -> list[pytest.Item]:
    """At most so many variants, the first among them, with as many values of each parameter as possible."""
    if len(variants) <= count:
        return variants
    even = {id(variants[k * len(variants) // count]) for k in range(count)}
    # one value of a parameter is one object in all variants
    parameters = {id(item): getattr(getattr(item, "callspec", None), "params", {}) for item in variants}
    values = {key: {(name, id(value)) for name, value in given.items()} for key, given in parameters.items()}
    kept: list[pytest.Item] = []
    seen: set[tuple[str, int]] = set()
    for _ in range(count):
        left = [item for item in variants if item not in kept]
        best = max(left, key=lambda item: (len(values[id(item)] - seen), id(item) in even))
        kept.append(best)
        seen |= values[id(best)]
    return kept


def _processor_time() -> float:
    """Seconds of this process and of those that it has waited for."""
    return sum(os.times()[:4])


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    item.stash[_BEGIN] = _processor_time()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Which tests of the core suite take more than they may: ``@pytest.mark.variants(core=0)`` takes one out."""
    ended = [report for reports in terminalreporter.stats.values() for report in reports if hasattr(report, "when")]
    taken = {
        report.nodeid: dict(report.user_properties)["processor time"]
        for report in ended
        if report.when == "teardown" and "core" in report.keywords
    }
    if len(taken) > 1:
        total = f"core suite: {len(taken)} tests, {sum(taken.values()):.0f} s of processor time"
        terminalreporter.section(f"{total}; more than {_ALLOWANCE:g} s", "-")
        for name, seconds in sorted(taken.items(), key=lambda entry: -entry[1]):
            if seconds > _ALLOWANCE:
                terminalreporter.write_line(f"{seconds:6.1f} s  {name}")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Let neighbours run in one process, which has their FMUs; one that has ended takes from those that have not."""
    from xdist.scheduler import WorkStealingScheduling

    return WorkStealingScheduling(config, log)


def skip_allowed(reason: str) -> bool:
    """Whether skips.toml has a skip of this reason that is allowed on this machine."""
    on_ci = sys.platform == "linux" and platform.machine() == "x86_64"
    return any(
        re.search(skip["reason"], reason)
        and not any(map(shutil.which, skip.get("missing", ())))
        and not (on_ci and "elsewhere" in skip)
        for skip in _SKIPS
    )


def _checked(report: Report) -> Report:
    """A report in which a skip that is not allowed is a failure."""
    if report.skipped and not hasattr(report, "wasxfail") and isinstance(report.longrepr, tuple):
        reason = report.longrepr[2]
        if not skip_allowed(reason):
            report.outcome, report.longrepr = "failed", f"{report.nodeid}: tests/skips.toml does not allow: {reason}"
    return report


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = _checked((yield))
    if report.when == "teardown":
        report.user_properties.append(("processor time", _processor_time() - item.stash[_BEGIN]))
    return report


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_make_collect_report() -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    return _checked((yield))


@pytest.fixture(params=range(10))
def seed(request: pytest.FixtureRequest) -> int:
    """Of random states; what has this argument runs for ten of them."""
    return request.param


@pytest.fixture(params=["native", "python"])
def backend(request: pytest.FixtureRequest) -> Any:
    """Each of the back ends."""
    return request.param


@pytest.fixture(scope="session")
def shared_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the FMUs of the catalogue are built, once for all workers of a session."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "catalogue"
    folder.mkdir(exist_ok=True)
    return folder


@pytest.fixture(scope="session")
def fmu(shared_folder: Path) -> Callable[..., Path]:
    """The FMU of a component, built once: ``fmu(Pendulum, "python")``, ``fmu(Pendulum, fmi="3")``."""

    @cache
    def built(component: Any, backend: Literal["native", "python"] = "native", fmi: Literal["2", "3"] = "2") -> Path:
        return build(assemble(component), shared_folder, backend=backend, fmi=fmi)

    return built


@pytest.fixture(scope="session")
def number() -> Callable[[Equations, ca.SX, dict[str, float]], np.ndarray]:
    """The value of an expression in a mechanism's symbols, at a state on its motion."""

    def evaluate(equations: Equations, expression: ca.SX, state: dict[str, float]) -> np.ndarray:
        numbers, symbols = equations.numbers({}) | state, equations.symbols
        function = ca.Function("number", [*symbols.values()], [ca.densify(equations.in_motion(expression))])
        return np.squeeze(np.asarray(function(*(numbers[name] for name in symbols))))

    return evaluate


class Markup(NamedTuple):
    """Some HTML: its frames with their attributes, its tags, its texts."""

    frames: list[dict[str, str | None]]
    tags: set[str]
    texts: list[str]


@pytest.fixture
def parsed() -> Callable[[str], Markup]:
    """What a browser makes of HTML."""

    def parse(html: str) -> Markup:
        found = Markup([], set(), [])

        class Parser(HTMLParser):
            def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
                found.tags.add(tag)
                if tag == "iframe":
                    found.frames.append(dict(attrs))

            def handle_data(self, data: str) -> None:
                found.texts.append(data)

        Parser().feed(html)
        return found

    return parse


@pytest.fixture
def interruptible() -> Iterator[None]:
    """An interrupt acts as in a terminal, on the test and on what it starts; shells have background jobs ignore it."""
    usual = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, usual)
