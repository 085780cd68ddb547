"""``liaisons list`` and ``liaisons build``."""

from __future__ import annotations

import argparse
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from liaisons.cli._command import command
from liaisons.cli._terminal import fitting_table
from liaisons.library import catalogue, claim, model
from liaisons.library import components as find
from liaisons.processes import die_with_parent
from liaisons.project import declared_components, fmus_directory, from_here

if TYPE_CHECKING:
    from liaisons.cli._command import Commands
    from liaisons.fmu.layout import Fmi
    from liaisons.language import Component

S = TypeVar("S")
T = TypeVar("T")


def register(commands: Commands) -> None:
    """Add the commands."""
    listing = command(
        commands,
        "list",
        _list,
        "show the components: free and active coordinates, and what each one is",
        "liaisons list\nliaisons list my_component.py",
    )
    listing.add_argument("targets", nargs="*", metavar="FILE.py", help="show those of these files instead")
    build = command(
        commands,
        "build",
        _build,
        "build FMUs",
        "liaisons build\n"
        "liaisons build Pendulum Sinusoid --backend python\n"
        "liaisons build Pendulum --fmi both\n"
        "liaisons build OscillatorChain --size n=1000\n"
        "liaisons build my_component.py --output /tmp/fmus --platforms all",
    )
    build.add_argument(
        "targets",
        nargs="*",
        metavar="NAME|FILE.py",
        help="what to build (default: what fmus/fmus.toml declares; without one, the whole catalogue)",
    )
    build.add_argument(
        "--backend",
        choices=("auto", "native", "python"),
        default="auto",
        help="native: generated C; python: pythonfmu; auto (default): native where a C compiler is found",
    )
    build.add_argument(
        "--platforms",
        choices=("host", "all"),
        default="host",
        help="binaries inside a native FMU: for this machine (default), or for Linux, Windows and macOS",
    )
    build.add_argument(
        "--fmi",
        choices=("2", "3", "both"),
        default="2",
        help="version: FMI 2.0 (default), FMI 3.0, which goes to fmi3/ and is native, or both",
    )
    build.add_argument(
        "--size", type=_size, metavar="n=NUMBER", help="how many links a chain has (default: as it declares)"
    )
    build.add_argument("--output", type=Path, metavar="DIR", help="where they go (default: fmus/)")


def _list(arguments: argparse.Namespace) -> int:
    targets = arguments.targets or catalogue()
    print(fitting_table([_row(component) for target in targets for component in find(target)], narrow={"free": 13}))
    return 0


def _build(arguments: argparse.Namespace) -> int:
    # All are found before the first is built: a misspelt name must not cost a compilation.
    named = [(target, component) for target in _targets(arguments.targets) for component in find(target)]
    output = arguments.output or fmus_directory()
    for _, component in named:
        claim(component, output)
    names = [(target, component.__name__) for target, component in named]
    for paths in _on_all_cores(partial(_build_one, arguments, output), names):
        for path in paths:
            print(from_here(path), flush=True)
    return 0


def _build_one(arguments: argparse.Namespace, output: Path, name: tuple[str, str]) -> list[Path]:
    from liaisons.fmu import build

    target, class_name = name
    (component,) = (component for component in find(target) if component.__name__ == class_name)
    sized = model(component, **dict([arguments.size] if arguments.size else []))
    versions: tuple[Fmi, ...] = ("2", "3") if arguments.fmi == "both" else (arguments.fmi,)
    how = {"backend": arguments.backend, "platforms": arguments.platforms}
    return [build(sized, output, fmi=fmi, **how) for fmi in versions]


def _on_all_cores(function: Callable[[S], T], tasks: list[S]) -> Iterator[T]:
    """What the function makes of each task, in their order; what it raises is raised when its turn comes."""
    count = min(os.cpu_count() or 1, len(tasks) // 2)  # a process takes as long to begin as an FMU to be built
    if count < 2:
        yield from map(function, tasks)
        return
    with ProcessPoolExecutor(count, multiprocessing.get_context("spawn"), _begin, (os.getpid(),)) as pool:
        try:
            yield from pool.map(function, tasks)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in multiprocessing.active_children():
                process.terminate()
            raise


def _begin(parent: int) -> None:
    die_with_parent(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends them


def _targets(named: list[str]) -> list[str]:
    """What to build: what is named, else what the project declares, else the whole catalogue."""
    declared = None if named else declared_components()
    return named or (list(catalogue()) if declared is None else declared)


def _size(text: str) -> tuple[str, object]:
    name, separator, number = text.partition("=")
    if not separator:
        raise argparse.ArgumentTypeError(f"{text!r}: write name=number, for example n=100")
    return name, int(number) if number.isdigit() else number


def _row(component: type[Component]) -> dict[str, str]:
    from liaisons.language import Chain, Mechanism

    moving = component if issubclass(component, (Mechanism, Chain)) else None
    ending = "[n]" if issubclass(component, Chain) else ""
    free = [f"{c.name}{ending}" for c in moving.coordinates] if moving else []
    free += [turn.name for turn in component.orientations] if issubclass(component, Mechanism) else []
    return {
        "name": component.__name__,
        "free": ", ".join(free) or "-",
        "active": ", ".join(c.name for c in moving.actives) or "-" if moving else "-",
        "what it is": component.summary(),
    }
